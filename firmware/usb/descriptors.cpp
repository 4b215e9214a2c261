// SPDX-License-Identifier: MIT
#include "firmware/usb/descriptors.hpp"

namespace firmware::usb {

namespace {

enum : std::uint8_t { no_text, text_manufacturer, text_product, text_serial, text_link, text_port };

constexpr std::uint8_t low(std::size_t x) { return static_cast<std::uint8_t>(x); }
constexpr std::uint8_t high(std::size_t x) { return static_cast<std::uint8_t>(x >> 8); }

// 9.6.1. Class EFh/02h/01h: functions are told apart by interface association (IAD ECN).
// clang-format off
constexpr std::uint8_t device[] = {
    18, 1, 0x01, 0x02,  // USB 2.01: there is a BOS
    0xEF, 0x02, 0x01, low(hal::usb_packet_bytes),
    low(wire::usb_vendor_id), high(wire::usb_vendor_id), low(wire::usb_product_id), high(wire::usb_product_id),
    0x00, 0x01,  // release of the device 1.00
    text_manufacturer, text_product, text_serial, 1};
// clang-format on
static_assert(sizeof device == 18);

constexpr std::size_t configuration_bytes = 9 + (9 + 7 + 7) + 8 + (9 + 5 + 5 + 4 + 5 + 7) + (9 + 7 + 7);
constexpr std::uint8_t configuration[] = {
    // 9.6.3: self-powered, takes nothing from the bus, does not wake the host.
    9, 2, low(configuration_bytes), high(configuration_bytes), interface_count, 1, no_text, 0xC0, 0,
    // Frames: 9.6.5 interface of a vendor's class, 9.6.6 two bulk endpoints.
    9, 4, wire::link_interface, 0, 2, 0xFF, 0x00, 0x00, text_link,       //
    7, 5, wire::link_out_endpoint, 2, low(hal::usb_packet_bytes), 0, 0,  //
    7, 5, wire::link_in_endpoint, 2, low(hal::usb_packet_bytes), 0, 0,
    // Interfaces 1 and 2 are one function (IAD ECN): CDC, abstract control model.
    8, 11, text_control_interface, 2, 0x02, 0x02, 0x00, text_port,                               //
    9, 4, text_control_interface, 0, 1, 0x02, 0x02, 0x00, text_port, 5, 0x24, 0x00, 0x20, 0x01,  // CDC 1.20
    5, 0x24, 0x01, 0x00, text_data_interface,                      // PSTN 5.3.1: no call management
    4, 0x24, 0x02, 0x02,                                           // PSTN 5.3.2: line coding and line state
    5, 0x24, 0x06, text_control_interface, text_data_interface,    // CDC 5.2.3.2: union
    7, 5, notify_endpoint, 3, low(hal::usb_notify_bytes), 0, 16,   // polled every 16 ms; never sends
    9, 4, text_data_interface, 0, 2, 0x0A, 0x00, 0x00, no_text,    //
    7, 5, text_out_endpoint, 2, low(hal::usb_packet_bytes), 0, 0,  //
    7, 5, text_in_endpoint, 2, low(hal::usb_packet_bytes), 0, 0};
static_assert(sizeof configuration == configuration_bytes);

constexpr std::uint8_t windows_8_1[] = {0x00, 0x00, 0x03, 0x06};  // the oldest that knows MS OS 2.0, MS table 3

/// MS OS 2.0: header, subset of the configuration, subset of the function, WINUSB, the property that names the GUID by
/// which programs find the interface.
struct MsSet {
  static constexpr char name[] = "DeviceInterfaceGUIDs";
  static constexpr std::size_t name_bytes = 2 * sizeof name;                                // UTF-16 with its NUL
  static constexpr std::size_t value_bytes = 2 * (sizeof wire::device_interface_guid + 1);  // REG_MULTI_SZ: two NULs
  static constexpr std::size_t property_bytes = 10 + name_bytes + value_bytes, id_bytes = 20;
  static constexpr std::size_t function_bytes = 8 + id_bytes + property_bytes;
  static constexpr std::size_t bytes = 10 + 8 + function_bytes;

  std::uint8_t raw[bytes]{};
  std::size_t at = 0;

  constexpr void put(std::uint8_t byte) { raw[at++] = byte; }
  constexpr void put16(std::size_t x) { put(low(x)), put(high(x)); }
  constexpr void head(std::size_t length, std::uint8_t type) { put16(length), put16(type); }
  constexpr void text(const char* ascii, std::size_t characters) {
    for (std::size_t i = 0; i < characters; ++i) put16(static_cast<std::uint8_t>(ascii[i]));
  }

  constexpr MsSet() {
    head(10, 0x00);  // table 10
    for (const std::uint8_t b : windows_8_1) put(b);
    put16(bytes);
    head(8, 0x01);  // table 11: configuration by index, not by value
    put(0), put(0), put16(8 + function_bytes);
    head(8, 0x02);  // table 12
    put(wire::link_interface), put(0), put16(function_bytes);
    head(id_bytes, 0x03);  // table 13
    for (const char* c = "WINUSB"; *c != 0; ++c) put(static_cast<std::uint8_t>(*c));
    at += 2 + 8;                 // NUL to the end, no sub-compatible id
    head(property_bytes, 0x04);  // table 14
    put16(7);                    // REG_MULTI_SZ, table 15
    put16(name_bytes), text(name, sizeof name);
    put16(value_bytes), text(wire::device_interface_guid, sizeof wire::device_interface_guid), put16(0);
  }
};
constexpr MsSet ms_set;
static_assert(ms_set.at == MsSet::bytes && MsSet::bytes <= 0xFFFF);

// USB 3.2 9.6.2 and 9.6.2.4 (platform capability); MS table 4.
// clang-format off
constexpr std::uint8_t bos[] = {
    5, 15, 33, 0, 1,
    28, 16, 5, 0,
    0xDF, 0x60, 0xDD, 0xD8, 0x89, 0x45, 0xC7, 0x4C, 0x9C, 0xD2, 0x65, 0x9D, 0x9E, 0x64, 0x8A, 0x9F,
    // above: {D8DD60DF-4589-4CC7-9CD2-659D9E648A9F}
    windows_8_1[0], windows_8_1[1], windows_8_1[2], windows_8_1[3], low(MsSet::bytes), high(MsSet::bytes),
    ms_vendor_code, 0};
// clang-format on
static_assert(sizeof bos == 33);

template <std::size_t count>
constexpr Bytes all_of(const std::uint8_t (&table)[count]) {
  return {table, static_cast<std::uint16_t>(count)};
}

const char* text_of(std::uint8_t index, const Identity& identity) {
  switch (index) {
    case text_manufacturer:
      return "hotcore";
    case text_product:
      return identity.board;
    case text_serial:
      return identity.serial;
    case text_link:
      return "hotcore link";
    case text_port:
      return "hotcore text";
    default:
      return nullptr;
  }
}

}  // namespace

Bytes device_descriptor() { return all_of(device); }
Bytes configuration_descriptor() { return all_of(configuration); }
Bytes bos_descriptor() { return all_of(bos); }
Bytes ms_os_20_set() { return all_of(ms_set.raw); }

std::uint16_t string_descriptor(std::uint8_t index, const Identity& identity, std::uint8_t (&out)[max_string_bytes]) {
  std::uint8_t at = 2;
  if (index == 0) {
    out[at++] = low(language);
    out[at++] = high(language);
  } else {
    const char* text = text_of(index, identity);
    if (text == nullptr) return 0;
    while (*text != 0 && at + 1u < max_string_bytes) {
      out[at++] = static_cast<std::uint8_t>(*text++);
      out[at++] = 0;
    }
  }
  out[0] = at;
  out[1] = static_cast<std::uint8_t>(Descriptor::string);
  return at;
}

}  // namespace firmware::usb
