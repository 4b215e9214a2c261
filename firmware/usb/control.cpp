// SPDX-License-Identifier: MIT
#include "firmware/usb/control.hpp"

#include <algorithm>
#include <cstring>
#include <iterator>

namespace firmware::usb {

namespace {

// bmRequestType, 9.3.1.
enum : std::uint8_t {
  to_device = 0x00,
  to_interface = 0x01,
  to_endpoint = 0x02,
  from_device = 0x80,
  from_interface = 0x81,
  from_endpoint = 0x82,
  class_to_interface = 0x21,
  class_from_interface = 0xA1,
  vendor_from_device = 0xC0,
};

enum : std::uint8_t {
  // 9.4, table 9-4
  get_status = 0,
  clear_feature = 1,
  set_feature = 3,
  set_address = 5,
  get_descriptor = 6,
  get_configuration = 8,
  set_configuration = 9,
  get_interface = 10,
  set_interface = 11,
  // PSTN 1.2, table 13
  set_line_coding = 0x20,
  get_line_coding = 0x21,
  set_control_line_state = 0x22,
};

constexpr std::uint16_t any = 0xFFFF, endpoint_halt = 0, self_powered = 1;

/// Everything that is ever obeyed. wIndex `any` and wValue `any`: looked at by whoever handles it.
struct Rule {
  std::uint8_t type, request;
  std::uint16_t value, index, length;
};
constexpr Rule whitelist[] = {
    {from_device, get_descriptor, any, any, any},
    {to_device, set_address, any, 0, 0},
    {to_device, set_configuration, any, 0, 0},
    {from_device, get_configuration, 0, 0, 1},
    {from_device, get_status, 0, 0, 2},
    {from_interface, get_status, 0, any, 2},
    {from_endpoint, get_status, 0, any, 2},
    {to_endpoint, clear_feature, endpoint_halt, any, 0},
    {to_endpoint, set_feature, endpoint_halt, any, 0},
    {from_interface, get_interface, 0, any, 1},
    {to_interface, set_interface, 0, any, 0},
    {class_to_interface, set_line_coding, 0, text_control_interface, sizeof(LineCoding)},
    {class_from_interface, get_line_coding, 0, text_control_interface, sizeof(LineCoding)},
    {class_to_interface, set_control_line_state, any, text_control_interface, 0},
    {vendor_from_device, ms_vendor_code, 0, ms_set_index, any},
};

bool allowed(const Setup& s) {
  const auto fits = [](std::uint16_t rule, std::uint16_t x) { return rule == any || rule == x; };
  return std::any_of(std::begin(whitelist), std::end(whitelist), [&](const Rule& r) {
    return r.type == s.type && r.request == s.request && fits(r.value, s.value) && fits(r.index, s.index) &&
           fits(r.length, s.length);
  });
}

}  // namespace

void Control::reset() {
  address_ = 0;
  configured_ = receiving_ = short_end_ = false;
  halted_ = 0;
  left_ = {nullptr, 0};
}

Order Control::setup(const std::uint8_t* raw) {
  left_ = {nullptr, 0};
  receiving_ = short_end_ = false;
  const Setup s = Setup::from(raw);
  if (!allowed(s)) return Order::refuse;
  if (s.type == vendor_from_device) return answer(ms_os_20_set(), s);
  const bool of_class = s.type == class_to_interface || s.type == class_from_interface;
  if (!of_class) return standard(s);
  if (!configured_) return Order::refuse;
  switch (s.request) {
    case set_line_coding:
      receiving_ = true;
      return Order::receive;
    case get_line_coding:
      return answer({line_.raw, sizeof line_.raw}, s);
    default:
      return s.value > 3 ? Order::refuse : Order::acknowledge;  // PSTN table 18: two bits, and there is no line
  }
}

Order Control::standard(const Setup& s) {
  switch (s.request) {
    case get_descriptor:
      return descriptor(s);
    case set_address:
      if (s.value > 127 || configured_) return Order::refuse;
      argument_ = address_ = static_cast<std::uint8_t>(s.value);
      return Order::address;
    case set_configuration:
      if (s.value > 1 || address_ == 0) return Order::refuse;
      configured_ = s.value == 1;
      halted_ = 0;
      argument_ = static_cast<std::uint8_t>(s.value);
      return Order::configure;
    case get_configuration:
      return address_ == 0 ? Order::refuse : answer_word(configured_ ? 1 : 0, 1, s);
    case get_status:
      if (address_ == 0) return Order::refuse;
      if (s.type == from_device) return answer_word(self_powered, 2, s);
      if (s.type == from_interface)
        return configured_ && s.index < interface_count ? answer_word(0, 2, s) : Order::refuse;
      if (s.index > 0xFF || !reaches(static_cast<std::uint8_t>(s.index))) return Order::refuse;
      return answer_word(halted(static_cast<std::uint8_t>(s.index)) ? 1 : 0, 2, s);
    case clear_feature:
      return feature(s, Order::unhalt);
    case set_feature:
      return feature(s, Order::halt);
    case get_interface:
      return configured_ && s.index < interface_count ? answer_word(0, 1, s) : Order::refuse;
    default:  // set_interface: there is but one alternate setting
      if (!configured_ || s.index >= interface_count) return Order::refuse;
      argument_ = static_cast<std::uint8_t>(s.index);
      halted_ &= static_cast<std::uint16_t>(~halts_of(argument_));  // USB 2.0 9.4.5
      return Order::restart;
  }
}

/// Of one interface's endpoints.
std::uint16_t Control::halts_of(std::uint8_t interface) {
  if (interface == wire::link_interface) return halt_bit(wire::link_out_endpoint) | halt_bit(wire::link_in_endpoint);
  if (interface == text_control_interface) return halt_bit(notify_endpoint);
  return halt_bit(text_out_endpoint) | halt_bit(text_in_endpoint);
}

Order Control::descriptor(const Setup& s) {
  const auto index = static_cast<std::uint8_t>(s.value);
  const auto type = static_cast<Descriptor>(s.value >> 8);
  if (type == Descriptor::string) {
    if (s.index != (index == 0 ? 0 : language)) return Order::refuse;
    return answer({scratch_, string_descriptor(index, *identity_, scratch_)}, s);
  }
  if (index != 0 || s.index != 0) return Order::refuse;
  switch (type) {
    case Descriptor::device:
      return answer(device_descriptor(), s);
    case Descriptor::configuration:
      return answer(configuration_descriptor(), s);
    case Descriptor::bos:
      return answer(bos_descriptor(), s);
    default:
      return Order::refuse;  // also the device qualifier: full speed only, 9.6.2
  }
}

/// The clamp: whatever the host asks, never more than there is.
Order Control::answer(Bytes all, const Setup& s) {
  if (all.count == 0) return Order::refuse;
  left_ = {all.data, std::min(all.count, s.length)};
  short_end_ = left_.count < s.length && left_.count % hal::usb_packet_bytes == 0;
  return s.length == 0 ? Order::acknowledge : Order::answer;  // 9.3.5: no data stage
}

Order Control::answer_word(std::uint16_t word, std::uint16_t bytes, const Setup& s) {
  scratch_[0] = static_cast<std::uint8_t>(word);
  scratch_[1] = static_cast<std::uint8_t>(word >> 8);
  return answer({scratch_, bytes}, s);
}

Order Control::feature(const Setup& s, Order order) {
  if (s.index > 0xFF) return Order::refuse;
  const auto endpoint = static_cast<std::uint8_t>(s.index);
  if (address_ == 0 || !reaches(endpoint)) return Order::refuse;
  if ((endpoint & 0x7F) == 0) return order == Order::unhalt ? Order::acknowledge : Order::refuse;  // never halts
  if (order == Order::halt)
    halted_ |= halt_bit(endpoint);
  else
    halted_ &= static_cast<std::uint16_t>(~halt_bit(endpoint));
  argument_ = endpoint;
  return order;
}

bool Control::reaches(std::uint8_t endpoint) const {
  if ((endpoint & 0x7F) == 0) return true;
  constexpr std::uint8_t all[] = {wire::link_out_endpoint, wire::link_in_endpoint, notify_endpoint, text_out_endpoint,
                                  text_in_endpoint};
  return configured_ && std::find(std::begin(all), std::end(all), endpoint) != std::end(all);
}

bool Control::next_packet(Bytes& packet) {
  if (left_.count == 0 && !short_end_) return false;
  packet = {left_.data, std::min(left_.count, hal::usb_packet_bytes)};
  if (left_.count == 0) short_end_ = false;
  left_ = {left_.data + packet.count, static_cast<std::uint16_t>(left_.count - packet.count)};
  return true;
}

Order Control::received(const std::uint8_t* data, std::size_t bytes) {
  if (!receiving_) {  // the status of an answer, perhaps before all of it was read: there is no more to send
    left_ = {nullptr, 0};
    short_end_ = false;
    return bytes == 0 ? Order::answer : Order::refuse;
  }
  receiving_ = false;
  if (bytes != sizeof line_.raw) return Order::refuse;
  std::memcpy(line_.raw, data, sizeof line_.raw);
  return Order::acknowledge;
}

}  // namespace firmware::usb
