// SPDX-License-Identifier: MIT
#include "boards/host/usbip/server.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "wire/pc/user_error.hpp"

namespace boards::usb {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint16_t version = 0x0111, devlist = 0x0005, import = 0x0003, request = 0x8000;
constexpr std::uint32_t status_ok = 0, status_unknown = 1, status_busy = 2, status_error = 3;
constexpr std::uint32_t cmd_submit = 1, cmd_unlink = 2, ret_submit = 3, ret_unlink = 4;
constexpr std::size_t operation_bytes = 8, bus_id_bytes = 32, path_bytes = 256, command_bytes = 48;
constexpr std::uint32_t bus_number = 1, device_number = 2, full_speed = 2;

// Bounds of ours: what a client may ask for before it is cut off.
constexpr std::uint32_t longest_transfer = 1 << 20;
constexpr std::size_t most_transfers = 256, most_clients = 4, longest_queue = 8 << 20;

std::uint32_t get(const Bytes& b, std::size_t at) {
  return static_cast<std::uint32_t>(b[at]) << 24 | static_cast<std::uint32_t>(b[at + 1]) << 16 |
         static_cast<std::uint32_t>(b[at + 2]) << 8 | b[at + 3];
}
void put16(Bytes& b, std::uint32_t v) {
  b.push_back(static_cast<std::uint8_t>(v >> 8));
  b.push_back(static_cast<std::uint8_t>(v));
}
void put32(Bytes& b, std::uint32_t v) {
  put16(b, v >> 16);
  put16(b, v & 0xFFFF);
}
void put_text(Bytes& b, const std::string& text, std::size_t room) {
  for (std::size_t i = 0; i < room; ++i) b.push_back(static_cast<std::uint8_t>(i < text.size() ? text[i] : 0));
}

double wall_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

}  // namespace

Server::Server(Device& device, std::uint16_t port) : device_(device), transfers_(device) {
  listener_ = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int on = 1;
  setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  sockaddr_in where{};
  where.sin_family = AF_INET;
  where.sin_port = htons(port);
  where.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (bind(listener_, reinterpret_cast<sockaddr*>(&where), sizeof where) != 0 || listen(listener_, 4) != 0) {
    const std::string why = errno == EADDRINUSE ? "is taken by another program" : std::strerror(errno);
    close(listener_);
    throw wire::pc::UserError(wire::pc::Exit::busy, fmt::format("Port {} {}: choose another with --port.", port, why));
  }
  device_.plug(true);
  const bool alive = transfers_.enumerate();
  device_.plug(false);
  transfers_.forget();
  if (alive) return;
  close(listener_);
  throw wire::pc::UserError(wire::pc::Exit::no_board,
                            "The board does not answer on its USB side: is its flash image older than this program?");
}

Server::~Server() {
  for (const Client& c : clients_) close(c.socket);
  close(listener_);
}

std::uint16_t Server::port() const {
  sockaddr_in where{};
  socklen_t bytes = sizeof where;
  getsockname(listener_, reinterpret_cast<sockaddr*>(&where), &bytes);
  return ntohs(where.sin_port);
}

void Server::serve(const std::function<bool()>& stop) {
  constexpr double slice_s = 2e-3, too_late_s = 20e-3;
  double offset_s = transfers_.time_s() - wall_s();  // of the device's clock against this PC's
  std::vector<Transfer> finished;
  while (!stop()) {
    const double slice_ends_s = wall_s() + slice_s;
    bool due = true;
    while (finished.empty() && wall_s() < slice_ends_s && (due = transfers_.time_s() - offset_s < wall_s()))
      transfers_.turn(finished);
    for (const Transfer& t : finished) deliver(t);
    finished.clear();
    part_if_device_left();
    // A device that is slower than this PC's clock falls behind for good and does not race to catch up.
    offset_s = std::min(offset_s, transfers_.time_s() - wall_s() + too_late_s);
    look_at_sockets(due ? 0 : 1);
  }
}

void Server::look_at_sockets(int patience_ms) {
  std::vector<pollfd> watched{{listener_, POLLIN, 0}};
  for (const Client& c : clients_)
    watched.push_back({c.socket, static_cast<short>(POLLIN | (c.out.empty() ? 0 : POLLOUT)), 0});
  if (poll(watched.data(), watched.size(), patience_ms) <= 0) return;
  std::size_t k = 1;
  for (auto c = clients_.begin(); c != clients_.end();) {
    const auto events = watched[k++].revents;
    if ((events & (POLLIN | POLLHUP | POLLERR) && !read_from(*c)) || !flush(*c)) {
      leave(*c);
      c = clients_.erase(c);
    } else {
      ++c;
    }
  }
  if (watched[0].revents & POLLIN) accept_one();
}

void Server::accept_one() {
  const int socket = accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (socket < 0) return;
  if (clients_.size() >= most_clients) {
    close(socket);
    return;
  }
  const int on = 1;
  setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  clients_.push_back({socket});
}

void Server::leave(Client& client) {
  if (client.has_device) {
    device_.plug(false);
    transfers_.forget();
  }
  close(client.socket);
}

void Server::part_if_device_left() {
  const auto holder = std::find_if(clients_.begin(), clients_.end(), [](const Client& c) { return c.has_device; });
  if (holder == clients_.end() || device_.attached()) return;
  leave(*holder);
  clients_.erase(holder);
}

bool Server::read_from(Client& client) {
  std::uint8_t part[16384];
  const ssize_t got = recv(client.socket, part, sizeof part, 0);
  if (got == 0 || (got < 0 && errno != EAGAIN)) return false;
  if (got > 0) client.in.insert(client.in.end(), part, part + got);
  for (;;) {
    const int used = handle(client);
    if (used < 0) return false;
    if (used == 0) return true;
    client.in.erase(client.in.begin(), client.in.begin() + used);
  }
}

bool Server::flush(Client& client) {
  if (client.out.empty()) return true;
  const ssize_t sent = send(client.socket, client.out.data(), client.out.size(), MSG_NOSIGNAL);
  if (sent < 0) return errno == EAGAIN && client.out.size() <= longest_queue;
  client.out.erase(client.out.begin(), client.out.begin() + sent);
  return client.out.size() <= longest_queue;
}

int Server::handle(Client& client) { return client.has_device ? handle_command(client) : handle_operation(client); }

// ---- before the device is had ---------------------------------------------------------------------------------------

void Server::describe(Bytes& out) const {
  const Bytes &d = transfers_.device_descriptor(), &c = transfers_.configuration_descriptor();
  put_text(out, "/sys/devices/platform/hotcore/usb1/1-1", path_bytes);
  put_text(out, bus_id, bus_id_bytes);
  for (const std::uint32_t v : {bus_number, device_number, full_speed}) put32(out, v);
  for (const std::size_t at : {8u, 10u, 12u}) put16(out, static_cast<std::uint32_t>(d[at] | d[at + 1] << 8));
  for (const std::size_t at : {4u, 5u, 6u}) out.push_back(d[at]);  // class, subclass, protocol
  out.push_back(0);                                                // not configured
  out.push_back(d[17]);
  out.push_back(c[4]);
}

int Server::handle_operation(Client& client) {
  const Bytes& in = client.in;
  if (in.size() < operation_bytes) return 0;
  const std::uint32_t head = get(in, 0);
  if (head >> 16 != version) return -1;
  if ((head & 0xFFFF) == (request | devlist)) {
    put16(client.out, version);
    put16(client.out, devlist);
    put32(client.out, status_ok);
    put32(client.out, 1);
    describe(client.out);
    const Bytes& c = transfers_.configuration_descriptor();
    int interfaces = c[4];
    for (std::size_t at = 0; at + 8 < c.size() && c[at] >= 2 && interfaces > 0; at += c[at]) {
      if (c[at + 1] != 4 || c[at + 3] != 0) continue;  // an interface, not an alternate setting
      client.out.insert(client.out.end(), {c[at + 5], c[at + 6], c[at + 7], 0});
      --interfaces;
    }
    for (; interfaces > 0; --interfaces) put32(client.out, 0);
    return static_cast<int>(operation_bytes);
  }
  if ((head & 0xFFFF) != (request | import)) return -1;
  if (in.size() < operation_bytes + bus_id_bytes) return 0;
  char wanted[bus_id_bytes + 1] = {};
  std::memcpy(wanted, in.data() + operation_bytes, bus_id_bytes);
  import_device(client, std::string(wanted) == bus_id);
  return static_cast<int>(operation_bytes + bus_id_bytes);
}

void Server::import_device(Client& client, bool known) {
  std::uint32_t status = known ? status_ok : status_unknown;
  if (known && std::any_of(clients_.begin(), clients_.end(), [](const Client& c) { return c.has_device; })) {
    status = status_busy;
  } else if (known) {
    device_.plug(true);
    client.has_device = transfers_.enumerate();
    if (!client.has_device) {
      device_.plug(false);
      status = status_error;
    }
  }
  put16(client.out, version);
  put16(client.out, import);
  put32(client.out, status);
  if (status != status_ok) return;
  describe(client.out);
}

// ---- with the device ------------------------------------------------------------------------------------------------

int Server::handle_command(Client& client) {
  const Bytes& in = client.in;
  if (in.size() < command_bytes) return 0;
  const std::uint32_t command = get(in, 0), sequence = get(in, 4), direction = get(in, 12), endpoint = get(in, 16);
  if (command == cmd_unlink) {
    const std::uint32_t which = get(in, 20);
    const bool caught = transfers_.cancel(which);
    client.waiting.erase(which);
    for (const std::uint32_t v :
         {ret_unlink, sequence, 0u, 0u, 0u, caught ? static_cast<std::uint32_t>(-ECONNRESET) : 0u})
      put32(client.out, v);
    client.out.resize(client.out.size() + command_bytes - 24);
    return static_cast<int>(command_bytes);
  }
  const std::uint32_t length = get(in, 24), packets = get(in, 32);
  if (command != cmd_submit || direction > 1 || endpoint > 15 || length > longest_transfer) return -1;
  if (packets != 0 && packets != 0xFFFFFFFF) return -1;  // isochronous: no such endpoint here
  if (client.waiting.size() >= most_transfers || client.waiting.contains(sequence)) return -1;
  const std::size_t data = direction == 0 ? length : 0;
  if (in.size() < command_bytes + data) return 0;
  Transfer t;
  t.id = sequence;
  t.endpoint = static_cast<int>(endpoint);
  t.in = direction == 1;
  t.wanted = t.in ? length : 0;
  t.bytes.assign(in.begin() + command_bytes, in.begin() + static_cast<std::ptrdiff_t>(command_bytes + data));
  std::copy_n(in.begin() + 40, 8, t.setup.begin());
  client.waiting.insert(sequence);
  // A control transfer says twice how long it is and which way it goes.
  const std::size_t stated = static_cast<std::size_t>(t.setup[6] | t.setup[7] << 8);
  if (endpoint == 0 && (stated != length || (stated && t.in != ((t.setup[0] & 0x80) != 0)))) {
    t.outcome = Outcome::stalled;
    t.bytes.clear();
    deliver(t);
  } else {
    transfers_.submit(std::move(t));
  }
  return static_cast<int>(command_bytes + data);
}

void Server::deliver(const Transfer& t) {
  for (Client& client : clients_) {
    if (!client.waiting.erase(t.id)) continue;
    const int status = t.outcome == Outcome::done      ? 0
                       : t.outcome == Outcome::stalled ? -EPIPE
                       : t.outcome == Outcome::gone    ? -EPROTO
                                                       : -EOVERFLOW;
    const auto moved = static_cast<std::uint32_t>(t.outcome == Outcome::done || t.in ? t.bytes.size() : 0);
    for (const std::uint32_t v : {ret_submit, t.id, 0u, 0u, 0u, static_cast<std::uint32_t>(status), moved})
      put32(client.out, v);
    client.out.resize(client.out.size() + command_bytes - 28);
    if (t.in) client.out.insert(client.out.end(), t.bytes.begin(), t.bytes.end());
    flush(client);
  }
}

namespace {
volatile std::sig_atomic_t interrupted = 0, power_cut = 0;
}

int serve_until_interrupted(Device& device, std::uint16_t port, bool json) {
  Server server(device, port);
  // Before it says that it serves: who reads that may interrupt at once.
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { interrupted = 1; });
  std::signal(SIGHUP, [](int) { power_cut = 1; });
  const std::string attach =
      fmt::format("modprobe vhci-hcd && usbip --tcp-port {} attach -r 127.0.0.1 -b {}", server.port(), bus_id);
  if (json) {
    const nlohmann::ordered_json served = {{"serial", server.serial()},
                                           {"bus_id", bus_id},
                                           {"host", "127.0.0.1"},
                                           {"port", server.port()},
                                           {"attach", attach}};
    fmt::print("{}\n", served.dump());
  } else {
    fmt::print(
        "Board {} is served on 127.0.0.1:{} (USB/IP). To attach it to this PC (package usbip, as root):\n"
        "  {}\nCtrl-C pulls the cable and ends.\n",
        server.serial(), server.port(), attach);
  }
  std::fflush(stdout);
  server.serve([&] {
    if (power_cut != 0) device.power_cycle();
    power_cut = 0;
    return interrupted != 0;
  });
  return 0;
}

}  // namespace boards::usb
