// SPDX-License-Identifier: MIT
// The device as hosts meet it: descriptors against byte tables of the specifications, the sequences of Linux and
// Windows, and requests that must be refused.
#include <gtest/gtest.h>
#include <linux/usb/cdc.h>
#include <linux/usb/ch9.h>

#include <random>

#include "tests/usb/host.hpp"

namespace {

using namespace usb_host;

constexpr std::uint8_t get_descriptor = 6;
constexpr std::uint16_t device_type = 0x0100, configuration_type = 0x0200, string_type = 0x0300, qualifier = 0x0600,
                        bos_type = 0x0F00;

struct Enumeration : testing::Test {
  VirtualBoard board{options()};
  std::uint8_t address = 0;

  void SetUp() override {
    board.bus().plug();
    board.bus().reset();
  }
  void TearDown() override { EXPECT_EQ(board.violation(), nullptr) << board.violation(); }

  Transfer ask(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index, std::uint16_t length,
               const Bytes& data = {}) {
    return control(board.bus(), address, {type, request, value, index, length}, data);
  }
  Transfer descriptor(std::uint16_t value, std::uint16_t length, std::uint16_t index = 0) {
    return ask(0x80, get_descriptor, value, index, length);
  }
  void move_to(std::uint8_t to) {
    ASSERT_TRUE(ask(0x00, 5, to, 0, 0));
    address = to;
  }
  void configure() {
    move_to(3);
    ASSERT_TRUE(ask(0x00, 9, 1, 0, 0));
  }
};

// USB 2.0 table 9-8, field by field; class triple of the IAD ECN; bcdUSB 2.01 announces a BOS (USB 3.2, 9.6.2).
TEST_F(Enumeration, DeviceDescriptorIsTheTableOfTheSpecification) {
  EXPECT_EQ(descriptor(device_type, 18),
            (Bytes{18, 1, 0x01, 0x02, 0xEF, 0x02, 0x01, 64, 0x09, 0x12, 0x01, 0x00, 0x00, 0x01, 1, 2, 3, 1}));
}

// USB 2.0 tables 9-10, 9-12, 9-13; IAD ECN table 9-Z; CDC 1.2 tables 15, 16; PSTN 1.2 tables 3, 4. Subtypes 0 header, 1
// call management, 2 ACM, 6 union.
TEST_F(Enumeration, ConfigurationDescriptorIsTheTableOfTheSpecification) {
  const Bytes expected{9, 2,    98,   0,    3,    1,    0,    0xC0, 0,                       //
                       9, 4,    0,    0,    2,    0xFF, 0,    0,    4,                       // vendor
                       7, 5,    0x01, 2,    64,   0,    0,    7,    5, 0x81, 2, 64,   0, 0,  //
                       8, 0x0B, 1,    2,    2,    2,    0,    5,                             // association
                       9, 4,    1,    0,    1,    2,    2,    0,    5,                       // communication class
                       5, 0x24, 0,    0x20, 0x01, 5,    0x24, 1,    0, 2,    4, 0x24, 2, 2, 5, 0x24, 6, 1, 2,  //
                       7, 5,    0x82, 3,    8,    0,    16,                                                    //
                       9, 4,    2,    0,    2,    0x0A, 0,    0,    0,  // data class
                       7, 5,    0x03, 2,    64,   0,    0,    7,    5, 0x83, 2, 64,   0, 0};
  ASSERT_EQ(expected.size(), 98u);
  EXPECT_EQ(descriptor(configuration_type, 255), expected);
  EXPECT_EQ(descriptor(configuration_type, 9), Bytes(expected.begin(), expected.begin() + 9));
}

/// The same bytes once more, by the names that Linux's public headers (linux/usb/ch9.h, cdc.h) give them: written by
/// others after the same specifications, and what a Linux host reads them with.
TEST_F(Enumeration, TheDescriptorsMeanTheSameToTheHeadersOfLinux) {
  const auto read = [](const Bytes& bytes, std::size_t& at, auto& into) {
    ASSERT_LE(at + sizeof into, bytes.size());
    std::memcpy(&into, bytes.data() + at, sizeof into);
    at += bytes[at];
  };
  std::size_t at = 0;
  usb_device_descriptor device{};
  read(*descriptor(device_type, 18), at, device);
  EXPECT_EQ(device.bLength, USB_DT_DEVICE_SIZE);
  EXPECT_EQ(device.bDescriptorType, USB_DT_DEVICE);
  EXPECT_EQ(device.bcdUSB, 0x0201);
  EXPECT_EQ(device.bDeviceClass, USB_CLASS_MISC);
  EXPECT_EQ(device.bMaxPacketSize0, 64);
  EXPECT_EQ(device.idVendor, wire::usb_vendor_id);
  EXPECT_EQ(device.idProduct, wire::usb_product_id);
  EXPECT_EQ(device.bNumConfigurations, 1);

  const Bytes all = *descriptor(configuration_type, 255);
  at = 0;
  usb_config_descriptor configuration{};
  std::memcpy(&configuration, all.data(), USB_DT_CONFIG_SIZE);
  at += all[0];
  EXPECT_EQ(configuration.bLength, USB_DT_CONFIG_SIZE);
  EXPECT_EQ(configuration.bDescriptorType, USB_DT_CONFIG);
  EXPECT_EQ(configuration.wTotalLength, all.size());
  EXPECT_EQ(configuration.bNumInterfaces, 3);
  EXPECT_EQ(configuration.bmAttributes, USB_CONFIG_ATT_ONE | USB_CONFIG_ATT_SELFPOWER);

  const auto interface = [&](int number, int endpoints, int type) {
    usb_interface_descriptor i{};
    read(all, at, i);
    EXPECT_EQ(i.bLength, USB_DT_INTERFACE_SIZE);
    EXPECT_EQ(i.bDescriptorType, USB_DT_INTERFACE);
    EXPECT_EQ(i.bInterfaceNumber, number);
    EXPECT_EQ(i.bAlternateSetting, 0);
    EXPECT_EQ(i.bNumEndpoints, endpoints);
    EXPECT_EQ(i.bInterfaceClass, type);
  };
  const auto endpoint = [&](int number, int kind, int bytes) {
    usb_endpoint_descriptor e{};
    ASSERT_LE(at + USB_DT_ENDPOINT_SIZE, all.size());
    std::memcpy(&e, all.data() + at, USB_DT_ENDPOINT_SIZE);
    at += all[at];
    EXPECT_EQ(e.bLength, USB_DT_ENDPOINT_SIZE);
    EXPECT_EQ(e.bDescriptorType, USB_DT_ENDPOINT);
    EXPECT_EQ(e.bEndpointAddress, number);
    EXPECT_EQ(e.bmAttributes & USB_ENDPOINT_XFERTYPE_MASK, kind);
    EXPECT_EQ(e.wMaxPacketSize, bytes);
  };
  interface(0, 2, USB_CLASS_VENDOR_SPEC);
  endpoint(0x01, USB_ENDPOINT_XFER_BULK, 64);
  endpoint(0x81, USB_ENDPOINT_XFER_BULK, 64);
  usb_interface_assoc_descriptor association{};
  read(all, at, association);
  EXPECT_EQ(association.bDescriptorType, USB_DT_INTERFACE_ASSOCIATION);
  EXPECT_EQ(association.bFirstInterface, 1);
  EXPECT_EQ(association.bInterfaceCount, 2);
  EXPECT_EQ(association.bFunctionClass, USB_CLASS_COMM);
  EXPECT_EQ(association.bFunctionSubClass, USB_CDC_SUBCLASS_ACM);
  interface(1, 1, USB_CLASS_COMM);
  usb_cdc_header_desc header{};
  read(all, at, header);
  EXPECT_EQ(header.bDescriptorSubType, USB_CDC_HEADER_TYPE);
  EXPECT_EQ(header.bcdCDC, 0x0120);
  usb_cdc_call_mgmt_descriptor calls{};
  read(all, at, calls);
  EXPECT_EQ(calls.bDescriptorSubType, USB_CDC_CALL_MANAGEMENT_TYPE);
  EXPECT_EQ(calls.bDataInterface, 2);
  usb_cdc_acm_descriptor acm{};
  read(all, at, acm);
  EXPECT_EQ(acm.bDescriptorSubType, USB_CDC_ACM_TYPE);
  EXPECT_EQ(acm.bmCapabilities, USB_CDC_CAP_LINE);
  usb_cdc_union_desc both{};
  read(all, at, both);
  EXPECT_EQ(both.bDescriptorSubType, USB_CDC_UNION_TYPE);
  EXPECT_EQ(both.bMasterInterface0, 1);
  EXPECT_EQ(both.bSlaveInterface0, 2);
  endpoint(0x82, USB_ENDPOINT_XFER_INT, 8);
  interface(2, 2, USB_CLASS_CDC_DATA);
  endpoint(0x03, USB_ENDPOINT_XFER_BULK, 64);
  endpoint(0x83, USB_ENDPOINT_XFER_BULK, 64);
  EXPECT_EQ(at, all.size());

  const Bytes bos = *descriptor(bos_type, 255);
  at = 0;
  usb_bos_descriptor store{};
  read(bos, at, store);
  EXPECT_EQ(store.bDescriptorType, USB_DT_BOS);
  EXPECT_EQ(store.wTotalLength, bos.size());
  EXPECT_EQ(store.bNumDeviceCaps, 1);
  usb_dev_cap_header platform{};
  read(bos, at, platform);
  EXPECT_EQ(platform.bDescriptorType, USB_DT_DEVICE_CAPABILITY);
  EXPECT_EQ(platform.bDevCapabilityType, 5) << "platform: named only by later headers than 6.1";
  EXPECT_EQ(at, bos.size());
}

// Microsoft OS 2.0 Descriptors Specification (July 2018), tables 4 and 5; 0x06030000 is Windows 8.1. But for length and
// vendor code the same bytes as in Zephyr's sample of a CMSIS-DAP and in a capture from a Blue Pill with WebUSB.
TEST_F(Enumeration, BosNamesTheMicrosoftSet) {
  EXPECT_EQ(descriptor(bos_type, 255),
            (Bytes{5,    0x0F, 33,   0,    1,                                                                       //
                   28,   0x10, 5,    0,    0xDF, 0x60, 0xDD, 0xD8, 0x89, 0x45, 0xC7, 0x4C, 0x9C, 0xD2, 0x65, 0x9D,  //
                   0x9E, 0x64, 0x8A, 0x9F, 0x00, 0x00, 0x03, 0x06, 0xB2, 0x00, 0x20, 0x00}));
}

// The same, tables 9 to 15; type 7 is REG_MULTI_SZ. Types, lengths and order of fields as in two public transcripts of
// them, Zephyr's msos_desc.h and libusbK's libusbk.h. A name of 42 and one GUID of 80 bytes, as in Zephyr's sample.
TEST_F(Enumeration, MicrosoftSetIsTheTableOfTheSpecification) {
  Bytes expected{0x0A, 0, 0, 0, 0x00, 0x00, 0x03, 0x06, 0xB2, 0,                                  //
                 0x08, 0, 1, 0, 0,    0,    0xA8, 0,                                              //
                 0x08, 0, 2, 0, 0,    0,    0xA0, 0,                                              //
                 0x14, 0, 3, 0, 'W',  'I',  'N',  'U',  'S',  'B', 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,  //
                 0x84, 0, 4, 0, 7,    0,    0x2A, 0};
  const auto utf16 = [&](const char* text) {
    for (; *text != 0; ++text) expected.push_back(static_cast<std::uint8_t>(*text)), expected.push_back(0);
    expected.push_back(0), expected.push_back(0);
  };
  utf16("DeviceInterfaceGUIDs");
  expected.push_back(0x50), expected.push_back(0);
  utf16("{6F1D2B60-9E0B-4E43-9D5C-4B2C5D0A7E31}");
  expected.push_back(0), expected.push_back(0);
  ASSERT_EQ(expected.size(), 178u);
  EXPECT_EQ(ask(0xC0, 0x20, 0, 7, 178), expected);
  EXPECT_EQ(ask(0xC0, 0x20, 0, 7, 0xFFFF), expected);
  EXPECT_FALSE(ask(0xC0, 0x20, 0, 8, 178));
  EXPECT_FALSE(ask(0xC0, 0x21, 0, 7, 178));
}

TEST_F(Enumeration, StringsAreTextsInUtf16) {
  EXPECT_EQ(descriptor(string_type, 255), (Bytes{4, 3, 0x09, 0x04}));
  EXPECT_EQ(descriptor(string_type | 3, 255, 0x0409), (Bytes{10, 3, 'S', 0, 'I', 0, 'M', 0, '0', 0}));
  for (const int text : {0x0301, 0x0302, 0x0304, 0x0305})
    EXPECT_TRUE(descriptor(static_cast<std::uint16_t>(text), 255, 0x0409)) << text;
  EXPECT_FALSE(descriptor(string_type | 6, 255, 0x0409));
  EXPECT_FALSE(descriptor(string_type | 0xEE, 18)) << "MS OS 1.0 is not offered";
  EXPECT_FALSE(descriptor(string_type | 3, 255, 0x0407)) << "no German";
}

/// As drivers/usb/core/hub.c and config.c of Linux 6.1 ask a new full-speed device.
TEST_F(Enumeration, GoesAsLinuxDoesIt) {
  ASSERT_TRUE(descriptor(device_type, 64));
  EXPECT_EQ(descriptor(device_type, 64)->size(), 18u);
  board.bus().reset();
  move_to(7);
  ASSERT_TRUE(descriptor(device_type, 18));
  EXPECT_EQ(descriptor(bos_type, 5), (Bytes{5, 15, 33, 0, 1}));
  EXPECT_EQ(descriptor(bos_type, 33)->size(), 33u);
  EXPECT_FALSE(descriptor(qualifier, 10)) << "full speed only: refused, USB 2.0 9.6.2";
  const Transfer head = descriptor(configuration_type, 9);
  ASSERT_TRUE(head);
  const std::uint16_t all = static_cast<std::uint16_t>((*head)[2] | (*head)[3] << 8);
  EXPECT_EQ(descriptor(configuration_type, all)->size(), all);
  for (const int text : {0x0302, 0x0301, 0x0303})
    EXPECT_TRUE(descriptor(static_cast<std::uint16_t>(text), 255, 0x0409));
  ASSERT_TRUE(ask(0x00, 9, 1, 0, 0));
  EXPECT_TRUE(board.bus().present());
  EXPECT_EQ(ask(0x80, 8, 0, 0, 1), Bytes{1});
  // cdc-acm: line coding, line state.
  EXPECT_TRUE(ask(0x21, 0x20, 0, 1, 7, {0x80, 0x25, 0, 0, 0, 0, 8}));
  EXPECT_EQ(ask(0xA1, 0x21, 0, 1, 7), (Bytes{0x80, 0x25, 0, 0, 0, 0, 8}));
  EXPECT_TRUE(ask(0x21, 0x22, 3, 1, 0));
}

/// As Windows 10 asks: 64 bytes at address 0 cut short by a reset, whole configuration, BOS, MS OS 2.0 set.
TEST_F(Enumeration, GoesAsWindowsDoesIt) {
  const Request first{0x80, get_descriptor, device_type, 0, 64};
  ASSERT_EQ(board.bus().setup(0, first.raw().data()), Handshake::ack);
  board.bus().reset();
  move_to(1);
  EXPECT_EQ(descriptor(device_type, 18)->size(), 18u);
  EXPECT_EQ(descriptor(configuration_type, 255)->size(), 98u);
  EXPECT_EQ(descriptor(bos_type, 5)->size(), 5u);
  EXPECT_EQ(descriptor(bos_type, 33)->size(), 33u);
  EXPECT_EQ(ask(0xC0, 0x20, 0, 7, 0xB2)->size(), 0xB2u);
  EXPECT_TRUE(descriptor(string_type, 255));
  EXPECT_TRUE(descriptor(string_type | 2, 255, 0x0409));
  EXPECT_FALSE(descriptor(qualifier, 10));
  EXPECT_EQ(ask(0x80, 0, 0, 0, 2), (Bytes{1, 0}));
  EXPECT_TRUE(ask(0x00, 9, 1, 0, 0));
}

TEST_F(Enumeration, AnAnswerThatFillsItsPacketsEndsWithAnEmptyOne) {
  // 128 bytes of the MS set are asked with room for 128: no empty packet; the configuration is 98 = 64 + 34.
  EXPECT_EQ(ask(0xC0, 0x20, 0, 7, 128)->size(), 128u);
  EXPECT_EQ(ask(0xC0, 0x20, 0, 7, 64)->size(), 64u);
  // No descriptor of this device is a multiple of 64; that such a one would end rightly is shown on the state machine.
  const firmware::usb::Identity identity{"b", "f", "0123456789012345678901234567890"};  // string of 64 bytes
  firmware::usb::Control c(identity);
  const Request r{0x80, get_descriptor, string_type | 3, 0x0409, 255};
  ASSERT_EQ(c.setup(r.raw().data()), firmware::usb::Order::answer);
  firmware::usb::Bytes packet{};
  ASSERT_TRUE(c.next_packet(packet));
  EXPECT_EQ(packet.count, 64);
  ASSERT_TRUE(c.next_packet(packet));
  EXPECT_EQ(packet.count, 0);
  EXPECT_FALSE(c.next_packet(packet));
}

TEST_F(Enumeration, RefusesWhatIsNotOnTheWhitelist) {
  configure();
  const Request bad[] = {
      {0x00, 5, 128, 0, 0},      // address out of range
      {0x00, 5, 4, 0, 0},        // address while configured
      {0x00, 5, 4, 1, 0},        // index
      {0x00, 9, 2, 0, 0},        // no such configuration
      {0x00, 9, 1, 0, 1},        // length
      {0x80, 8, 0, 0, 2},        // length
      {0x80, 0, 0, 0, 3},        // length
      {0x80, 0, 1, 0, 2},        // value
      {0x81, 0, 0, 3, 2},        // interface
      {0x82, 0, 0, 0x84, 2},     // endpoint
      {0x82, 0, 0, 0x0181, 2},   // endpoint with a high byte
      {0x02, 3, 0, 0x00, 0},     // endpoint 0 never halts
      {0x02, 3, 1, 0x81, 0},     // feature
      {0x02, 1, 0, 0x04, 0},     // endpoint
      {0x00, 3, 1, 0, 0},        // remote wake-up is not offered
      {0x00, 3, 2, 0x0100, 0},   // test mode is for high speed
      {0x81, 10, 0, 3, 1},       // interface
      {0x01, 11, 1, 0, 0},       // alternate setting
      {0x01, 11, 0, 3, 0},       // interface
      {0x02, 3, 0, 0x0181, 0},   // endpoint with a high byte
      {0x21, 0x20, 0, 1, 8},     // length
      {0x21, 0x20, 0, 2, 7},     // interface
      {0x21, 0x22, 4, 1, 0},     // value
      {0x21, 0x23, 0, 1, 0},     // break
      {0x40, 0x20, 0, 7, 0},     // direction
      {0x80, 6, 0x0101, 0, 18},  // index of a device descriptor
      {0x80, 6, 0x0100, 1, 18},  // language of one
      {0x80, 7, 0x0100, 0, 18},  // SET_DESCRIPTOR
      {0xFF, 0xFF, 0xFFFF, 0xFFFF, 0xFFFF},
  };
  for (const Request& r : bad) {
    EXPECT_FALSE(control(board.bus(), address, r))
        << std::hex << int{r.type} << ' ' << int{r.request} << ' ' << r.value << ' ' << r.index << ' ' << r.length;
    EXPECT_TRUE(descriptor(device_type, 18)) << "the next SETUP ends the stall";
  }
  EXPECT_FALSE(ask(0x21, 0x20, 0, 1, 7, {1, 2, 3})) << "a data stage shorter than announced";
  EXPECT_TRUE(descriptor(device_type, 18));
}

TEST_F(Enumeration, NothingButEndpointZeroWorksBeforeConfiguration) {
  EXPECT_FALSE(ask(0x00, 9, 1, 0, 0)) << "no configuration at address 0";
  move_to(3);
  EXPECT_FALSE(ask(0x21, 0x22, 1, 1, 0));
  EXPECT_FALSE(ask(0x82, 0, 0, 0x81, 2));
  EXPECT_FALSE(ask(0x81, 0, 0, 0, 2));
  EXPECT_FALSE(ask(0x01, 11, 0, 0, 0));
  EXPECT_EQ(ask(0x80, 8, 0, 0, 1), Bytes{0});
  EXPECT_EQ(board.bus().out(address, 0x01, false, Bytes{1}), Handshake::none);
}

TEST_F(Enumeration, HaltAndItsEndSetTheToggleBack) {
  configure();
  Program program(board);
  const Bytes half = Program::framed(wire::Kind::state, 1, {});
  ASSERT_EQ(board.bus().out(address, 0x01, false, half), Handshake::ack);
  EXPECT_TRUE(board.bus().toggle(0x01));
  ASSERT_TRUE(ask(0x02, 3, 0, 0x01, 0));
  EXPECT_EQ(board.bus().out(address, 0x01, true, half), Handshake::stall);
  EXPECT_EQ(ask(0x82, 0, 0, 0x01, 2), (Bytes{1, 0}));
  ASSERT_TRUE(ask(0x02, 1, 0, 0x01, 0));
  EXPECT_EQ(ask(0x82, 0, 0, 0x01, 2), (Bytes{0, 0}));
  EXPECT_FALSE(board.bus().toggle(0x01));
  EXPECT_EQ(board.bus().out(address, 0x01, false, half), Handshake::ack) << "armed again";

  ASSERT_TRUE(ask(0x02, 3, 0, 0x81, 0));
  boards::host::UsbBus<VirtualBoard::Device>::Packet packet;
  EXPECT_EQ(board.bus().in(address, 0x81, packet), Handshake::stall);
  ASSERT_TRUE(ask(0x02, 1, 0, 0x81, 0));
  EXPECT_EQ(board.bus().in(address, 0x81, packet), Handshake::ack) << "the answer that waited is sent";
  EXPECT_FALSE(packet.data1);
  ASSERT_TRUE(ask(0x01, 11, 0, 0, 0)) << "SET_INTERFACE";
  EXPECT_FALSE(board.bus().toggle(0x81));
}

/// USB 2.0 9.4.5: SET_INTERFACE ends a halt as well, even one of the setting that it had.
TEST_F(Enumeration, SetInterfaceEndsTheHaltsOfItsEndpointsAndOfNoOther) {
  configure();
  for (const std::uint8_t endpoint : {std::uint8_t{0x01}, std::uint8_t{0x81}, std::uint8_t{0x03}, std::uint8_t{0x83}})
    ASSERT_TRUE(ask(0x02, 3, 0, endpoint, 0));
  ASSERT_TRUE(ask(0x01, 11, 0, 0, 0));
  EXPECT_EQ(ask(0x82, 0, 0, 0x01, 2), (Bytes{0, 0}));
  EXPECT_EQ(ask(0x82, 0, 0, 0x81, 2), (Bytes{0, 0}));
  EXPECT_EQ(ask(0x82, 0, 0, 0x03, 2), (Bytes{1, 0}));
  EXPECT_EQ(board.bus().out(address, 0x03, false, Bytes{0}), Handshake::stall);
  const Bytes request = Program::framed(wire::Kind::state, 1, {});
  EXPECT_EQ(board.bus().out(address, 0x01, false, request), Handshake::ack);
  boards::host::UsbBus<VirtualBoard::Device>::Packet packet;
  EXPECT_EQ(board.bus().in(address, 0x81, packet), Handshake::ack) << "and is answered";
  ASSERT_TRUE(ask(0x01, 11, 0, 2, 0));
  EXPECT_EQ(board.bus().out(address, 0x03, false, Bytes{'\n'}), Handshake::ack);
}

TEST_F(Enumeration, BothPortsAreSetBackOnTheirOwn) {
  configure();
  for (const std::uint8_t endpoint : {std::uint8_t{1}, std::uint8_t{3}}) {
    const std::uint16_t interface = endpoint == 0x01 ? 0 : 2;
    ASSERT_EQ(board.bus().out(address, endpoint, false, Bytes{0}), Handshake::ack);
    ASSERT_TRUE(ask(0x01, 11, 0, interface, 0));
    EXPECT_FALSE(board.bus().toggle(endpoint));
    EXPECT_EQ(board.bus().out(address, endpoint, false, Bytes{0}), Handshake::ack);
  }
  EXPECT_TRUE(ask(0x01, 11, 0, 1, 0)) << "the text port's control interface has nothing to set back";
  EXPECT_TRUE(board.bus().toggle(0x01));
}

TEST_F(Enumeration, EndpointZeroNeverHaltsAndNothingIsAskedOfItInVain) {
  configure();
  EXPECT_TRUE(ask(0x02, 1, 0, 0x00, 0)) << "to end a halt that is none is no error";
  EXPECT_TRUE(ask(0x02, 1, 0, 0x80, 0));
  EXPECT_FALSE(ask(0x02, 3, 0, 0x80, 0));
  EXPECT_EQ(ask(0x80, 6, 0x0100, 0, 0), Bytes{}) << "a descriptor of no bytes: 9.3.5, no data stage";
  EXPECT_TRUE(ask(0x80, 6, 0x0100, 0, 0).has_value());
}

TEST_F(Enumeration, ABusResetEndsEverything) {
  configure();
  ASSERT_TRUE(ask(0x02, 3, 0, 0x81, 0));
  board.bus().reset();
  address = 0;
  EXPECT_EQ(board.bus().out(3, 0x01, false, Bytes{1}), Handshake::none);
  configure();
  EXPECT_EQ(ask(0x82, 0, 0, 0x81, 2), (Bytes{0, 0}));
}

TEST_F(Enumeration, ASuspendedDeviceGoesOnWhereItWas) {
  configure();
  board.bus().suspend();
  board.advance(400);
  board.bus().resume();
  EXPECT_EQ(ask(0x80, 8, 0, 0, 1), Bytes{1});
  Program program(board);
}

}  // namespace
