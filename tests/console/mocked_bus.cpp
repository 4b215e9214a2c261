// SPDX-License-Identifier: MIT
// A USB bus that the kernel never had: real libusb in an unmodified program, below it umockdev instead of usbfs, below
// that virtual boards whose own USB stack answers every transfer.
//
//   umockdev-wrapper mocked_bus [--boards N] [--busy] [--unplug-after FRAMES] [--unplug-after-in PACKETS]
//                               [--stall-out] [--stall-in PACKETS] PROGRAM ARGUMENTS...
//
// --stall-out: once, in the middle of the first frame that takes two packets.
//
// Ends with the program's exit code. Enumeration by a kernel is not shown here: sysfs is filled with the descriptors
// that the board's stack gave.
#include <linux/ioctl.h>
//
#include <linux/usbdevice_fs.h>  // does not include what it needs
#include <sys/wait.h>
#include <umockdev-1.0/umockdev.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "boards/host/virtual/virtual_board.hpp"
#include "wire/pc/motor_file.hpp"

namespace {

using boards::host::Handshake;
using boards::host::VirtualBoard;
using Bytes = std::vector<std::uint8_t>;

constexpr std::uint8_t address = 1;

struct Faults {
  bool busy = false;
  int unplug_after = -1;     // OUT transfers
  int unplug_after_in = -1;  // IN packets
  bool stall_out = false;
  int stall_in = -1;  // before this IN packet
};

class MockedBoard {
 public:
  MockedBoard(const boards::host::VirtualBoardOptions& options, const Faults& faults)
      : board_(options), faults_(faults) {
    board_.advance(10000);  // half a second: the current sensors' offsets are learnt
    board_.bus().plug();
    board_.bus().reset();
    Bytes nothing;
    control(0, {0x00, 5, address, 0, 0, 0, 0, 0}, nothing);
    control(address, {0x00, 9, 1, 0, 0, 0, 0, 0}, nothing);
    last_ = Clock::now();
  }

  /// Device and configuration descriptor, as sysfs has them.
  std::string descriptors() {
    Bytes all, part(18);
    control(address, {0x80, 6, 0, 1, 0, 0, 18, 0}, part);
    all = part;
    part.assign(255, 0);
    control(address, {0x80, 6, 0, 2, 0, 0, 255, 0}, part);
    all.insert(all.end(), part.begin(), part.end());
    std::string hex;
    for (const std::uint8_t byte : all) {
      char digits[3];
      std::snprintf(digits, sizeof digits, "%02X", byte);
      hex += digits;
    }
    return hex;
  }

  /// One ioctl of the program on the board's node. Runs in umockdev's thread, which alone touches the board from here
  /// on.
  bool ioctl(UMockdevIoctlClient* client) {
    const auto request = umockdev_ioctl_client_get_request(client);
    UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
    const auto done = [&](int result, int error) {
      umockdev_ioctl_client_complete(client, result, error);
      return true;
    };
    switch (request) {
      case USBDEVFS_GET_CAPABILITIES: {
        std::uint32_t can = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
                            USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
        auto* data = umockdev_ioctl_data_resolve(argument, 0, sizeof can, nullptr);
        umockdev_ioctl_data_update(data, 0, reinterpret_cast<std::uint8_t*>(&can), sizeof can);
        return done(0, 0);
      }
      case USBDEVFS_GETDRIVER:
        return done(-1, ENODATA);
      case USBDEVFS_CLAIMINTERFACE:
        return faults_.busy ? done(-1, EBUSY) : done(0, 0);
      case USBDEVFS_RELEASEINTERFACE:
      case USBDEVFS_SETCONFIGURATION:
        return done(0, 0);
      case USBDEVFS_CLEAR_HALT: {
        auto* data = umockdev_ioctl_data_resolve(argument, 0, sizeof(unsigned), nullptr);
        return halt(data->data[0], false) ? done(0, 0) : done(-1, EPIPE);
      }
      case USBDEVFS_SUBMITURB:
        return gone_ ? done(-1, ENODEV) : submit(argument) ? done(0, 0) : done(-1, EFAULT);
      case USBDEVFS_DISCARDURB: {
        gulong which = argument->client_addr;
        if (argument->data != nullptr) std::memcpy(&which, argument->data, sizeof which);
        return discard(which) ? done(0, 0) : done(-1, EINVAL);
      }
      case USBDEVFS_REAPURB:
      case USBDEVFS_REAPURBNDELAY: {
        live();
        if (finished_.empty()) return gone_ ? done(-1, ENODEV) : done(-1, EAGAIN);
        auto* place = umockdev_ioctl_data_resolve(argument, 0, sizeof(void*), nullptr);
        umockdev_ioctl_data_set_ptr(place, 0, finished_.front().data);
        finished_.pop_front();
        return done(0, 0);
      }
      default:
        std::fprintf(stderr, "mocked_bus: unknown ioctl %lx\n", static_cast<unsigned long>(request));
        return done(-1, ENOTTY);
    }
  }

 private:
  using Clock = std::chrono::steady_clock;
  struct Urb {
    UMockdevIoctlData *data, *buffer;
    usbdevfs_urb* raw() const { return reinterpret_cast<usbdevfs_urb*>(data->data); }
  };

  void finish(const Urb& urb, int status, int bytes) {
    urb.raw()->status = status;
    urb.raw()->actual_length = bytes;
    finished_.push_back(urb);
  }

  /// A control transfer; `data` is what goes out, or as long as what may come in. Returns bytes or -EPIPE.
  int control(std::uint8_t at, const std::array<std::uint8_t, 8>& setup, Bytes& data) {
    auto& bus = board_.bus();
    decltype(board_.bus().setup(0, nullptr)) ack = Handshake::ack;
    if (bus.setup(at, setup.data()) != ack) return -EPIPE;
    std::remove_reference_t<decltype(bus)>::Packet packet;
    if ((setup[0] & 0x80) != 0) {
      std::size_t came = 0;
      do {
        if (bus.in(at, 0x80, packet) != ack) return -EPIPE;
        const std::size_t n = std::min(packet.bytes, data.size() - came);
        std::copy_n(packet.data.begin(), n, data.begin() + static_cast<std::ptrdiff_t>(came));
        came += n;
      } while (packet.bytes == hal::usb_packet_bytes && came < data.size());
      bus.out(at, 0x00, true, {});
      data.resize(came);
      return static_cast<int>(came);
    }
    if (!data.empty() && bus.out(at, 0x00, true, data) != ack) return -EPIPE;
    return bus.in(at, 0x80, packet) == ack ? static_cast<int>(data.size()) : -EPIPE;
  }

  bool submit(UMockdevIoctlData* argument) {
    auto* data = umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_urb), nullptr);
    if (data == nullptr) return false;
    const auto* raw = reinterpret_cast<usbdevfs_urb*>(data->data);
    auto* buffer = umockdev_ioctl_data_resolve(data, offsetof(usbdevfs_urb, buffer),
                                               static_cast<gsize>(raw->buffer_length), nullptr);
    if (buffer == nullptr) return false;
    g_object_ref(data);
    const Urb urb{data, buffer};
    if (raw->type == USBDEVFS_URB_TYPE_CONTROL) {
      std::array<std::uint8_t, 8> setup{};
      std::copy_n(buffer->data, 8, setup.begin());
      const bool in = (setup[0] & 0x80) != 0;
      Bytes bytes(static_cast<std::size_t>(raw->buffer_length - 8));
      if (!in) std::copy_n(buffer->data + 8, bytes.size(), bytes.begin());
      const int result = control(address, setup, bytes);
      if (in && result > 0) umockdev_ioctl_data_update(buffer, 8, bytes.data(), result);
      finish(urb, std::min(result, 0), std::max(result, 0));
    } else {
      waiting_[raw->endpoint].push_back({urb, 0});
      pump();
    }
    return true;
  }

  bool discard(gulong which) {
    for (auto& [endpoint, queue] : waiting_) {
      const auto at =
          std::find_if(queue.begin(), queue.end(), [&](const auto& w) { return w.urb.data->client_addr == which; });
      if (at == queue.end()) continue;
      finish(at->urb, -ENOENT, at->bytes);
      queue.erase(at);
      return true;
    }
    return false;
  }

  /// The board has lived as long as the world.
  void live() {
    const auto now = Clock::now();
    const double due_s = std::min(0.02, std::chrono::duration<double>(now - last_).count());
    last_ = now;
    for (int i = 0; i < static_cast<int>(due_s / board_.period_s()) + 1 && !gone_; ++i) {
      pump();
      board_.advance(1);
    }
  }

  /// SET_FEATURE or CLEAR_FEATURE, ENDPOINT_HALT: the board's own stack stalls. A kernel leaves the pipe alone until
  /// CLEAR_HALT.
  bool halt(std::uint8_t endpoint, bool on) {
    Bytes nothing;
    if (control(address, {0x02, static_cast<std::uint8_t>(on ? 3 : 1), 0, 0, endpoint, 0, 0, 0}, nothing) < 0)
      return false;
    if (!on) halted_[endpoint] = false;
    return true;
  }

  void stalled(std::uint8_t endpoint) {
    auto& queue = waiting_[endpoint];
    finish(queue.front().urb, -EPIPE, queue.front().bytes);
    queue.pop_front();
    halted_[endpoint] = true;
  }

  /// At most a packet each way, as the bus would carry them.
  void pump() {
    auto& out = waiting_[wire::link_out_endpoint];
    if (!out.empty() && !halted_[wire::link_out_endpoint]) {
      Waiting& w = out.front();
      if (faults_.stall_out && w.bytes > 0) faults_.stall_out = !halt(wire::link_out_endpoint, true);
      const int n = std::min<int>(hal::usb_packet_bytes, w.urb.raw()->buffer_length - w.bytes);
      const std::span packet(w.urb.buffer->data + w.bytes, static_cast<std::size_t>(n));
      const Handshake said =
          board_.bus().out(address, wire::link_out_endpoint, board_.bus().toggle(wire::link_out_endpoint), packet);
      if (said == Handshake::stall) {
        stalled(wire::link_out_endpoint);
      } else if (said == Handshake::ack) {
        w.bytes += n;
        if (w.bytes == w.urb.raw()->buffer_length) {
          finish(w.urb, 0, w.bytes);
          out.pop_front();
          if (faults_.unplug_after >= 0 && ++sent_ > faults_.unplug_after) unplug();
        }
      }
    }
    auto& in = waiting_[wire::link_in_endpoint];
    if (in.empty() || gone_ || halted_[wire::link_in_endpoint]) return;
    std::remove_reference_t<decltype(board_.bus())>::Packet packet;
    if (came_ == faults_.stall_in) halt(wire::link_in_endpoint, true), faults_.stall_in = -1;
    const Handshake said = board_.bus().in(address, wire::link_in_endpoint, packet);
    if (said == Handshake::stall) return stalled(wire::link_in_endpoint);
    if (said != Handshake::ack) return;
    if (faults_.unplug_after_in >= 0 && came_ >= faults_.unplug_after_in) return unplug();
    ++came_;
    Waiting& w = in.front();
    if (packet.bytes > 0)
      umockdev_ioctl_data_update(w.urb.buffer, static_cast<gsize>(w.bytes), packet.data.data(),
                                 static_cast<gint>(packet.bytes));
    w.bytes += static_cast<int>(packet.bytes);
    if (packet.bytes == hal::usb_packet_bytes && w.bytes < w.urb.raw()->buffer_length) return;
    finish(w.urb, 0, w.bytes);
    in.pop_front();
  }

  void unplug() {
    gone_ = true;
    board_.bus().unplug();
    for (auto& [endpoint, queue] : waiting_) {
      for (const Waiting& w : queue) finish(w.urb, -ENODEV, 0);
      queue.clear();
    }
  }

  struct Waiting {
    Urb urb;
    int bytes;
  };

  VirtualBoard board_;
  Faults faults_;
  std::map<unsigned, std::deque<Waiting>> waiting_;
  std::deque<Urb> finished_;
  Clock::time_point last_;
  std::map<unsigned, bool> halted_;
  int sent_ = 0, came_ = 0;
  bool gone_ = false;
};

gboolean on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer board) {
  return static_cast<MockedBoard*>(board)->ioctl(client) ? TRUE : FALSE;
}

}  // namespace

int main(int argc, char** argv) {
  Faults faults;
  int boards = 1, at = 1;
  for (; at < argc && argv[at][0] == '-'; ++at) {
    const std::string option = argv[at];
    if (option == "--busy") faults.busy = true;
    if (option == "--boards" && at + 1 < argc) boards = std::atoi(argv[++at]);
    if (option == "--unplug-after" && at + 1 < argc) faults.unplug_after = std::atoi(argv[++at]);
    if (option == "--unplug-after-in" && at + 1 < argc) faults.unplug_after_in = std::atoi(argv[++at]);
    if (option == "--stall-out") faults.stall_out = true;
    if (option == "--stall-in" && at + 1 < argc) faults.stall_in = std::atoi(argv[++at]);
  }
  if (at >= argc) return 2;

  UMockdevTestbed* testbed = umockdev_testbed_new();
  std::vector<std::unique_ptr<MockedBoard>> all;
  for (int i = 0; i < boards; ++i) {
    boards::host::VirtualBoardOptions options;
    options.motor = wire::pc::read_motor("ec-16-40w", HOTCORE_SOURCE_DIR "/boards/motors").motor;
    options.serial = "SIM" + std::to_string(i);
    all.push_back(std::make_unique<MockedBoard>(options, faults));
    UMockdevIoctlBase* handler = umockdev_ioctl_base_new();
    g_signal_connect(handler, "handle-ioctl", G_CALLBACK(on_ioctl), all.back().get());
    const std::string number = std::to_string(i + 2), three = std::string(3 - number.size(), '0') + number;
    const std::string node = "bus/usb/001/" + three;
    GError* error = nullptr;
    const std::string device =
        "P: /devices/usb1/1-" + std::to_string(i + 1) + "\nN: " + node +
        "\nE: SUBSYSTEM=usb\nE: DRIVER=usb\nE: BUSNUM=001\nE: DEVNUM=" + three + "\nE: DEVNAME=/dev/" + node +
        "\nE: DEVTYPE=usb_device\nA: busnum=1\\n\nA: devnum=" + number +
        "\\n\nA: bConfigurationValue=1\\n\nA: speed=12\\n\nH: descriptors=" + all.back()->descriptors() + "\n\n";
    if (!umockdev_testbed_attach_ioctl(testbed, ("/dev/" + node).c_str(), handler, &error) ||
        !umockdev_testbed_add_from_string(testbed, device.c_str(), &error)) {
      std::fprintf(stderr, "mocked_bus: %s\n", error->message);
      return 99;
    }
  }
  const pid_t child = fork();
  if (child == 0) {
    execvp(argv[at], argv + at);
    _exit(127);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 98;
}
