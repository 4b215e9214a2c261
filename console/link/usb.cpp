// SPDX-License-Identifier: MIT
#include "console/link/usb.hpp"

#include <fmt/format.h>
#include <libusb-1.0/libusb.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <optional>

#include "console/link/ring.hpp"
#include "wire/protocol.hpp"

namespace console::link {
namespace {

using wire::pc::Exit;
using wire::pc::UserError;

constexpr std::size_t transfers_each_way = 8;
constexpr int transfer_bytes = 512;  // whole packets of 64 B, and no frame is longer
constexpr std::size_t ring_bytes = 1 << 16;

/// The vendor interface of a board and its two bulk endpoints.
struct Endpoints {
  int interface;
  std::uint8_t in, out;
};

std::optional<Endpoints> endpoints_of(libusb_device* device) {
  libusb_config_descriptor* config = nullptr;
  if (libusb_get_active_config_descriptor(device, &config) != 0) return {};
  std::optional<Endpoints> found;
  for (int i = 0; i < config->bNumInterfaces && !found; ++i) {
    if (config->interface[i].num_altsetting < 1) continue;
    const libusb_interface_descriptor& interface = config->interface[i].altsetting[0];
    if (interface.bInterfaceClass != LIBUSB_CLASS_VENDOR_SPEC) continue;
    Endpoints ends{interface.bInterfaceNumber, 0, 0};
    for (int e = 0; e < interface.bNumEndpoints; ++e) {
      const libusb_endpoint_descriptor& end = interface.endpoint[e];
      if ((end.bmAttributes & 3) != LIBUSB_TRANSFER_TYPE_BULK) continue;
      ((end.bEndpointAddress & LIBUSB_ENDPOINT_IN) != 0 ? ends.in : ends.out) = end.bEndpointAddress;
    }
    if (ends.in != 0 && ends.out != 0) found = ends;
  }
  libusb_free_config_descriptor(config);
  return found;
}

std::string place_of(libusb_device* device) {
  std::array<std::uint8_t, 7> ports{};  // the deepest chain that USB allows
  const int depth = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string place = fmt::format("bus {}", libusb_get_bus_number(device));
  for (int i = 0; i < depth; ++i)
    place += fmt::format("{}{}", i == 0 ? " port " : ".", ports[static_cast<std::size_t>(i)]);
  return place;
}

/// A string descriptor; what is not printable ASCII becomes '?', since it goes to a terminal.
std::string text_of(libusb_device_handle* handle, std::uint8_t index) {
  std::array<unsigned char, 256> bytes{};
  const int n =
      index == 0 ? 0 : libusb_get_string_descriptor_ascii(handle, index, bytes.data(), static_cast<int>(bytes.size()));
  std::string text(reinterpret_cast<const char*>(bytes.data()), static_cast<std::size_t>(std::clamp(n, 0, 255)));
  for (char& c : text) c = c >= ' ' && c <= '~' ? c : '?';
  return text;
}

void explain(Found& found, int error) {
  switch (error) {
    case LIBUSB_ERROR_ACCESS:
      found.trouble = Exit::no_permission;
      found.sentence = fmt::format(
          "{}: no permission to open the board; run 'hotcore udev' and install the rule that it prints, then plug the "
          "board in again.",
          found.place);
      return;
    case LIBUSB_ERROR_BUSY:
      found.trouble = Exit::busy;
      found.sentence = fmt::format("{}: another program holds the board; end it (Ctrl-C disarms) and try again.",
                                   found.serial.empty() ? found.place : found.serial);
      return;
    default:
      found.trouble = Exit::gone;
      found.sentence =
          fmt::format("{}: the board cannot be opened ({}); plug it in again.", found.place, libusb_error_name(error));
  }
}

/// A board on the bus: what a person is told, and what libusb needs. Holds one reference on the device.
struct Seen {
  Found found;
  libusb_device* device;
};

/// Every board with our ids. Opens each for a moment to read its strings; those of other makers are left out.
std::vector<Seen> look(libusb_context* context) {
  libusb_device** devices = nullptr;
  const ssize_t count = libusb_get_device_list(context, &devices);
  std::vector<Seen> boards;
  for (ssize_t i = 0; i < count; ++i) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(devices[i], &descriptor) != 0) continue;
    if (descriptor.idVendor != wire::usb_vendor_id || descriptor.idProduct != wire::usb_product_id) continue;
    Seen seen{{"", "", place_of(devices[i])}, devices[i]};
    libusb_device_handle* handle = nullptr;
    if (const int error = libusb_open(devices[i], &handle); error != 0) {
      explain(seen.found, error);
    } else {
      const std::string maker = text_of(handle, descriptor.iManufacturer);
      seen.found.product = text_of(handle, descriptor.iProduct);
      seen.found.serial = text_of(handle, descriptor.iSerialNumber);
      libusb_close(handle);
      if (maker != manufacturer) continue;
    }
    libusb_ref_device(devices[i]);
    boards.push_back(std::move(seen));
  }
  if (count >= 0) libusb_free_device_list(devices, 1);
  std::sort(boards.begin(), boards.end(), [](const Seen& a, const Seen& b) { return a.found.serial < b.found.serial; });
  return boards;
}

class UsbTransport final : public Transport {
 public:
  UsbTransport(libusb_context* context, libusb_device_handle* handle, const Endpoints& ends)
      : context_(context), handle_(handle), interface_(ends.interface) {
    prepare(in_, ends.in, &arrived);
    prepare(out_, ends.out, &sent);
    listen();
  }

  ~UsbTransport() override {
    closing_ = true;
    cancel(in_);
    cancel(out_);
    // Cancelled transfers come back within a frame; a kernel that keeps one for 2 s keeps its memory as well.
    for (int i = 0; i < 200 && (busy(in_) || busy(out_)); ++i) wait(10);
    const bool all_back = !busy(in_) && !busy(out_);
    for (Pipe* pipe : {&in_, &out_}) {
      for (Slot& slot : pipe->slots) {
        if (!slot.busy) libusb_free_transfer(slot.transfer);
      }
    }
    if (!gone_) libusb_release_interface(handle_, interface_);
    if (all_back) libusb_close(handle_);
  }

  bool write(std::span<const std::uint8_t> bytes) override {
    for (Slot& slot : out_.slots) {
      if (slot.busy || gone_ || out_.halted || bytes.size() > slot.bytes.size()) continue;
      std::memcpy(slot.bytes.data(), bytes.data(), bytes.size());
      slot.transfer->length = static_cast<int>(bytes.size());
      submit(slot);
      return !gone_;
    }
    return false;
  }

  std::size_t read(std::span<std::uint8_t> room) override {
    const std::size_t n = ring_.take(room);
    listen();
    return n;
  }

  void wait(int milliseconds) override {
    timeval time{milliseconds / 1000, milliseconds % 1000 * 1000};
    libusb_handle_events_timeout_completed(context_, &time, nullptr);
    lift(in_);
    lift(out_);
  }

  double now_s() const override {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  }

  bool gone() const override { return gone_; }
  int restarts() const override { return stalls_; }

 private:
  struct Slot {
    libusb_transfer* transfer = nullptr;
    bool busy = false;
    UsbTransport* owner = nullptr;
    std::array<std::uint8_t, transfer_bytes> bytes;
  };

  struct Pipe {
    std::uint8_t endpoint = 0;
    bool halted = false;  // and not yet lifted
    std::array<Slot, transfers_each_way> slots;
  };

  static bool busy(const Pipe& pipe) {
    return std::any_of(pipe.slots.begin(), pipe.slots.end(), [](const Slot& slot) { return slot.busy; });
  }

  static void cancel(Pipe& pipe) {
    for (Slot& slot : pipe.slots) {
      if (slot.busy) libusb_cancel_transfer(slot.transfer);
    }
  }

  void prepare(Pipe& pipe, std::uint8_t endpoint, libusb_transfer_cb_fn done) {
    pipe.endpoint = endpoint;
    for (Slot& slot : pipe.slots) {
      slot.transfer = libusb_alloc_transfer(0);
      if (slot.transfer == nullptr) throw std::bad_alloc();
      slot.owner = this;
      libusb_fill_bulk_transfer(slot.transfer, handle_, endpoint, slot.bytes.data(), transfer_bytes, done, &slot, 0);
    }
  }

  void submit(Slot& slot) {
    slot.busy = libusb_submit_transfer(slot.transfer) == 0;
    gone_ = gone_ || !slot.busy;
  }

  /// Asks for more, as much as the ring can take: a reader who sleeps slows the board down and loses nothing.
  void listen() {
    std::size_t promised = ring_.size();
    for (const Slot& slot : in_.slots) promised += slot.busy ? transfer_bytes : 0;
    for (Slot& slot : in_.slots) {
      if (slot.busy || gone_ || closing_ || in_.halted || promised + transfer_bytes > ring_bytes) continue;
      submit(slot);
      promised += transfer_bytes;
    }
  }

  /// A transfer came back. A stall is the board's way to refuse: all that is under way there is taken back.
  void settle(Pipe& pipe, Slot& slot) {
    slot.busy = false;
    const auto status = slot.transfer->status;
    if (status == LIBUSB_TRANSFER_STALL) {
      pipe.halted = true;
      cancel(pipe);
    } else if (status != LIBUSB_TRANSFER_COMPLETED && status != LIBUSB_TRANSFER_CANCELLED) {
      gone_ = true;
    }
  }

  /// Once nothing is under way there any more (libusb_clear_halt asks for that), and outside of callbacks. A delimiter
  /// ends the frame that has arrived in part, there or here.
  void lift(Pipe& pipe) {
    if (!pipe.halted || closing_ || gone_ || busy(pipe)) return;
    pipe.halted = false;
    gone_ = ++stalls_ > most_stalls || libusb_clear_halt(handle_, pipe.endpoint) != 0;
    constexpr std::uint8_t delimiter[] = {0};
    if (&pipe == &out_)
      write(delimiter);
    else if (ring_.room() > 0)
      ring_.put(delimiter);
    listen();
  }

  static void LIBUSB_CALL arrived(libusb_transfer* transfer) {
    Slot& slot = *static_cast<Slot*>(transfer->user_data);
    UsbTransport& self = *slot.owner;
    self.settle(self.in_, slot);
    const auto n = static_cast<std::size_t>(std::clamp(transfer->actual_length, 0, transfer_bytes));
    self.ring_.put(std::span(slot.bytes).first(n));
    self.listen();
  }

  static void LIBUSB_CALL sent(libusb_transfer* transfer) {
    Slot& slot = *static_cast<Slot*>(transfer->user_data);
    slot.owner->settle(slot.owner->out_, slot);
  }

  static constexpr int most_stalls = 100;  // a board that stalls more often in one session is broken

  libusb_context* context_;
  libusb_device_handle* handle_;
  int interface_;
  int stalls_ = 0;
  bool gone_ = false, closing_ = false;
  Pipe in_, out_;
  Ring<ring_bytes> ring_;
};

std::unique_ptr<Transport> open_seen(libusb_context* context, Seen& seen) {
  libusb_device_handle* handle = nullptr;
  int error = libusb_open(seen.device, &handle);
  if (error == 0) {
    if (const auto ends = endpoints_of(seen.device)) {
      error = libusb_claim_interface(handle, ends->interface);
      if (error == 0) return std::make_unique<UsbTransport>(context, handle, *ends);
    } else {
      error = LIBUSB_ERROR_NOT_FOUND;
    }
    libusb_close(handle);
  }
  explain(seen.found, error);
  throw UserError(seen.found.trouble, seen.found.sentence);
}

/// The one board that is meant. Throws UserError when it is none or more than one.
Seen& choose(std::vector<Seen>& boards, const std::string& prefix) {
  std::vector<Seen*> fitting;
  std::vector<std::string> serials;
  for (Seen& seen : boards) {
    serials.push_back(seen.found.serial.empty() ? seen.found.place : seen.found.serial);
    const bool readable = seen.found.trouble == Exit::answered;
    if (!readable ? prefix.empty() : seen.found.serial.rfind(prefix, 0) == 0) fitting.push_back(&seen);
  }
  if (boards.empty()) {
    throw UserError(Exit::no_board, "No board is plugged in; check the cable and the board's power, or try --sim.");
  }
  if (fitting.empty()) {
    for (const Seen& seen : boards) {  // the one that is meant may be the one that cannot be read
      if (seen.found.trouble != Exit::answered) throw UserError(seen.found.trouble, seen.found.sentence);
    }
    throw UserError(Exit::no_board, fmt::format("No board's serial begins with '{}'; there are: {}.", prefix,
                                                fmt::join(serials, ", ")));
  }
  // Another board's serial may begin with the whole of the one that is meant.
  const auto meant = [&](const Seen* seen) { return !prefix.empty() && seen->found.serial == prefix; };
  if (std::count_if(fitting.begin(), fitting.end(), meant) == 1)
    fitting = {*std::find_if(fitting.begin(), fitting.end(), meant)};
  if (fitting.size() > 1) {
    std::vector<std::string> names;
    for (const Seen* seen : fitting)
      names.push_back(seen->found.serial.empty() ? seen->found.place : seen->found.serial);
    throw UserError(Exit::no_board,
                    prefix.empty() ? fmt::format("{} boards are plugged in ({}); choose one with --serial.",
                                                 names.size(), fmt::join(names, ", "))
                                   : fmt::format("{} boards have a serial that begins with '{}' ({}); give more of it.",
                                                 names.size(), prefix, fmt::join(names, ", ")));
  }
  if (fitting.front()->found.trouble != Exit::answered)
    throw UserError(fitting.front()->found.trouble, fitting.front()->found.sentence);
  return *fitting.front();
}

}  // namespace

Usb::Usb() {
  if (const int error = libusb_init(&context_); error != 0) {
    throw UserError(Exit::no_permission, fmt::format("USB cannot be used here ({}); plug a board in, or try --sim.",
                                                     libusb_error_name(error)));
  }
}

Usb::~Usb() { libusb_exit(context_); }

std::vector<Found> Usb::list() {
  std::vector<Found> all;
  for (Seen& seen : look(context_)) {
    all.push_back(seen.found);
    libusb_unref_device(seen.device);
  }
  return all;
}

std::unique_ptr<Transport> Usb::open(const std::string& prefix) {
  std::vector<Seen> boards = look(context_);
  struct Release {
    std::vector<Seen>& boards;
    ~Release() {
      for (Seen& seen : boards) libusb_unref_device(seen.device);
    }
  } release{boards};
  return open_seen(context_, choose(boards, prefix));
}

std::string udev_rule() {
  return fmt::format(
      "# hotcore boards: the user who sits at the machine, and the group plugdev, may open them.\n"
      "SUBSYSTEM==\"usb\", ATTR{{idVendor}}==\"{:04x}\", ATTR{{idProduct}}==\"{:04x}\", ATTR{{manufacturer}}==\"{}\", "
      "MODE=\"0660\", GROUP=\"plugdev\", TAG+=\"uaccess\"\n",
      wire::usb_vendor_id, wire::usb_product_id, manufacturer);
}

}  // namespace console::link
