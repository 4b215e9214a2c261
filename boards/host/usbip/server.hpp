// SPDX-License-Identifier: MIT
// USB/IP 1.1.1 (Linux, Documentation/usb/usbip_protocol.rst) on loopback: the kernel of this PC, or of a guest,
// attaches to the device as if it hung on a cable. One device (bus id 1-1), one client that has it; a closed connection
// is a pulled cable, and a device that leaves the bus closes it. Every length that comes from the socket is checked
// before it is used; who breaks the protocol is cut off.
#pragma once

#include <cstdint>
#include <functional>
#include <list>
#include <set>

#include "boards/host/usbip/transfers.hpp"

namespace boards::usb {

inline constexpr std::uint16_t usbip_port = 3240;  // assigned by IANA
inline constexpr const char* bus_id = "1-1";

class Server {
 public:
  /// Port 0: any that is free. Looks at the device once. Throws wire::pc::UserError: the port is taken, or the device
  /// does not answer.
  Server(Device& device, std::uint16_t port);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// In real time, or as fast as the device can if that is slower, until `stop` says so (asked every few ms).
  void serve(const std::function<bool()>& stop);
  std::uint16_t port() const;
  const std::string& serial() const { return transfers_.serial(); }

 private:
  struct Client {
    int socket;
    bool has_device = false;
    std::vector<std::uint8_t> in{}, out{};
    std::set<std::uint32_t> waiting{};  // transfers under way
  };
  void look_at_sockets(int patience_ms);
  void accept_one();
  bool read_from(Client& client);  // false: cut off
  /// Bytes used up, 0: more are needed, -1: cut off.
  int handle(Client& client);
  int handle_operation(Client& client);
  int handle_command(Client& client);
  void import_device(Client& client, bool known);
  void describe(std::vector<std::uint8_t>& out) const;
  void deliver(const Transfer& transfer);
  bool flush(Client& client);
  void leave(Client& client);
  void part_if_device_left();

  Device& device_;
  Transfers transfers_;
  int listener_ = -1;
  std::list<Client> clients_;
};

/// What a program around a server does: says how to attach (`json`: in one line of it), serves until Ctrl-C, returns
/// its exit code. A SIGHUP cuts the device's power for a moment.
int serve_until_interrupted(Device& device, std::uint16_t port, bool json);

}  // namespace boards::usb
