// SPDX-License-Identifier: MIT
// In the guest: imports bus id 1-1 of a USB/IP server and hands the connection to vhci-hcd, as `usbip attach` does, but
// as one static program. attach HOST PORT
#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

bool receive(int socket, std::uint8_t* to, std::size_t bytes) {
  while (bytes > 0) {
    const ssize_t got = recv(socket, to, bytes, 0);
    if (got <= 0) return false;
    to += got;
    bytes -= static_cast<std::size_t>(got);
  }
  return true;
}

std::uint32_t big(const std::uint8_t* b) {
  return static_cast<std::uint32_t>(b[0]) << 24 | static_cast<std::uint32_t>(b[1]) << 16 |
         static_cast<std::uint32_t>(b[2]) << 8 | b[3];
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 3) return 2;
  const int server = socket(AF_INET, SOCK_STREAM, 0), on = 1;
  sockaddr_in where{};
  where.sin_family = AF_INET;
  where.sin_port = htons(static_cast<std::uint16_t>(std::atoi(arguments[2])));
  inet_pton(AF_INET, arguments[1], &where.sin_addr);
  if (connect(server, reinterpret_cast<sockaddr*>(&where), sizeof where) != 0) return std::perror("attach: connect"), 1;
  setsockopt(server, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  std::uint8_t request[40] = {0x01, 0x11, 0x80, 0x03};  // version 1.1.1, OP_REQ_IMPORT
  std::memcpy(request + 8, "1-1", 3);
  std::uint8_t head[8], device[312];
  if (send(server, request, sizeof request, 0) != sizeof request || !receive(server, head, sizeof head))
    return std::fputs("attach: the server hung up\n", stderr), 1;
  if (big(head) != 0x01110003 || big(head + 4) != 0)
    return std::fprintf(stderr, "attach: refused with status %u\n", big(head + 4)), 1;
  if (!receive(server, device, sizeof device)) return std::fputs("attach: torn answer\n", stderr), 1;
  const std::uint32_t bus = big(device + 288), number = big(device + 292), speed = big(device + 296);
  char line[64];
  const int bytes = std::snprintf(line, sizeof line, "0 %d %u %u", server, bus << 16 | number, speed);
  const int vhci = open("/sys/devices/platform/vhci_hcd.0/attach", O_WRONLY);
  if (vhci < 0 || write(vhci, line, static_cast<std::size_t>(bytes)) != bytes) return std::perror("attach: vhci"), 1;
}
