// SPDX-License-Identifier: MIT
// What comes from outside, at random from fixed seeds: bus events, byte streams, commands, flash. HOTCORE_FUZZ_CASES
// sets the cases of each (10000000 in CI). Half of the input is noise, half is something good that was damaged.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>

#include "boards/dual_48v_20a.hpp"
#include "tests/usb/host.hpp"

namespace {

using namespace usb_host;

long cases() {
  const char* const set = std::getenv("HOTCORE_FUZZ_CASES");
  return set != nullptr ? std::atol(set) : 100000;
}

/// Fast and repeatable anywhere: splitmix64 (Steele, Lea, Flood 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t operator()() {
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }
  unsigned below(unsigned n) { return static_cast<unsigned>((*this)() % n); }
  std::uint8_t byte() { return static_cast<std::uint8_t>((*this)()); }

 private:
  std::uint64_t state_;
};

/// A stream that takes and gives whatever it likes.
struct Echo {
  Random random{11};
  std::size_t taken = 0;
  void restart() { taken = 0; }
  bool wants() { return random.below(4) != 0; }
  void take(const std::uint8_t* data, std::size_t bytes) {
    for (std::size_t i = 0; i < bytes; ++i) taken += data[i];
  }
  std::size_t give(std::uint8_t* out, std::size_t room) {
    const std::size_t bytes = random.below(3) == 0 ? 0 : random.below(static_cast<unsigned>(room) + 1);
    for (std::size_t i = 0; i < bytes; ++i) out[i] = 0xA5;
    return bytes;
  }
};

/// Requests that a host sends, to be damaged.
constexpr Request known[] = {
    {0x80, 6, 0x0100, 0, 64}, {0x80, 6, 0x0200, 0, 255}, {0x80, 6, 0x0F00, 0, 64}, {0x80, 6, 0x0303, 0x0409, 255},
    {0x00, 5, 9, 0, 0},       {0x00, 9, 1, 0, 0},        {0x00, 9, 0, 0, 0},       {0x80, 8, 0, 0, 1},
    {0x80, 0, 0, 0, 2},       {0x82, 0, 0, 0x81, 2},     {0x02, 1, 0, 0x81, 0},    {0x02, 3, 0, 0x81, 0},
    {0x02, 3, 0, 0x03, 0},    {0x01, 11, 0, 2, 0},       {0x81, 10, 0, 1, 1},      {0x21, 0x20, 0, 1, 7},
    {0xA1, 0x21, 0, 1, 7},    {0x21, 0x22, 1, 1, 0},     {0xC0, 0x20, 0, 7, 500},
};

TEST(Fuzz, NoOrderOfBusEventsBreaksTheDevice) {
  const firmware::usb::Identity identity{"fuzz", "0", "0123456789"};
  boards::host::UsbController port;
  Echo link, text;
  using Device = firmware::usb::Device<boards::host::UsbController, Echo, Echo>;
  Device device(port, identity, link, text);
  boards::host::UsbBus<Device> bus(port, device);
  port.connect(true);
  bus.plug();
  bus.reset();
  Random random(1);
  unsigned asked = 0, came = 0;  // bytes of the present control transfer
  std::uint8_t address = 0, next_address = 0;
  bool data1 = true, addressed = false;
  long configured = 0, answered = 0;
  boards::host::UsbBus<Device>::Packet packet;
  for (long n = cases(); n > 0; --n) {
    switch (random.below(16)) {
      case 0:
      case 1:
      case 2:
      case 3: {
        auto raw = known[random.below(std::size(known))].raw();
        if (random.below(2) == 0) raw[random.below(8)] = random.byte();
        if (random.below(8) == 0) {
          for (std::uint8_t& b : raw) b = random.byte();
        }
        ASSERT_EQ(bus.setup(address, raw.data()), Handshake::ack);
        asked = (raw[0] & 0x80) != 0 ? static_cast<unsigned>(raw[6] | raw[7] << 8) : 0;
        came = 0;
        data1 = true;
        addressed = raw[0] == 0 && raw[1] == 5;
        if (addressed) next_address = raw[2];
        break;
      }
      case 4:
      case 5:
      case 6:
      case 7:
      case 8:
        if (bus.in(address, 0x80, packet) == Handshake::ack) {
          came += static_cast<unsigned>(packet.bytes);
          ASSERT_LE(came, asked);
          answered += came > 0;
          if (addressed && packet.bytes == 0) address = next_address;
          addressed = false;
        }
        break;
      case 9: {
        const Bytes data(random.below(8) == 0 ? random.below(65) : random.below(2) * 7, random.byte());
        (void)bus.out(address, 0x00, data1, data);
        break;
      }
      case 10:
      case 11: {
        const Bytes data(random.below(65), random.byte());
        const std::uint8_t endpoint = random.below(2) == 0 ? 0x01 : 0x03;
        (void)bus.out(address, endpoint, random.below(8) == 0 ? random.below(2) == 0 : bus.toggle(endpoint), data);
        break;
      }
      case 12:
      case 13:
        (void)bus.in(address, random.below(2) == 0 ? 0x81 : 0x83, packet);
        break;
      case 14:
        bus.frame();
        break;
      default:
        switch (random.below(32)) {
          case 0:
            bus.reset();
            address = 0;
            addressed = false;
            asked = came = 0;
            break;
          case 1:
            bus.suspend();
            break;
          case 2:
            bus.resume();
            break;
          case 3:
            bus.unplug();
            bus.plug();
            break;
          default:
            bus.frame();
        }
    }
    ASSERT_EQ(port.violation(), nullptr) << port.violation();
    configured += device.configured();
  }
  EXPECT_GT(configured, cases() / 100) << "the walk must reach the inside";
  EXPECT_GT(answered, cases() / 100);
}

Bytes frame_of(Random& random, std::uint8_t kind, std::size_t bytes) {
  Bytes payload(bytes);
  for (std::uint8_t& b : payload) b = random.below(4) == 0 ? 0 : random.byte();
  return Program::framed(static_cast<wire::Kind>(kind), random.byte(), payload);
}

TEST(Fuzz, NoByteStreamBreaksTheFramer) {
  Random random(2);
  wire::FrameReader reader;
  long good = 0, whole = 0;
  for (long n = cases(); n > 0; --n) {
    const bool noise = random.below(2) == 0;
    Bytes stream;
    if (noise) {
      stream.resize(random.below(24));
      for (std::uint8_t& b : stream) b = random.below(8) == 0 ? 0 : random.byte();
      if (random.below(64) == 0) stream.resize(600, 7);
    } else {
      stream = frame_of(random, random.byte(), random.below(64) == 0 ? random.below(481) : random.below(16));
      if (random.below(2) == 0)
        stream[random.below(static_cast<unsigned>(stream.size()))] = random.byte();
      else
        ++whole;
    }
    for (const std::uint8_t byte : stream) {
      if (!reader.take(byte)) continue;
      ++good;
      ASSERT_LE(reader.frame().bytes, wire::max_payload);
      ASSERT_NE(reader.frame().payload, nullptr);
    }
  }
  // An undamaged frame is lost only if the noise before it did not end: with a quarter of the cases at least half stay.
  EXPECT_GT(good, whole / 4);
  EXPECT_GT(reader.bad(), 0u);
}

TEST(Fuzz, NoCommandBreaksTheDecoder) {
  Random random(3);
  VirtualBoard board(options());
  board.advance(3000);
  const firmware::usb::Identity identity{"fuzz", "0", "1"};
  auto recorder = std::make_unique<firmware::Recorder>();
  firmware::Commands commands(board.driver(), *recorder, board.parameters(), identity);
  constexpr std::size_t lengths[] = {0, 1, 2, 4, 8, 12, 16, 18, 20, 24, 40, 60, 132, 480};
  std::uint8_t payload[wire::max_payload];
  long done = 0;
  std::uint32_t period = 4000;
  for (long n = cases(); n > 0; --n) {
    const std::size_t bytes = random.below(16) == 0 ? random.below(wire::max_payload + 1)
                                                    : lengths[random.below(random.below(8) != 0 ? 13 : 14)];
    const bool small = random.below(2) == 0;
    for (std::size_t i = 0; i < bytes; ++i)
      payload[i] = small ? static_cast<std::uint8_t>(random.below(4)) : random.byte();
    constexpr std::uint8_t kinds[] = {0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x10, 0x11,
                                      0x12, 0x13, 0x14, 0x15, 0x16, 0x17, 0x20, 0x21, 0x22, 0x23};
    const std::uint8_t kind = random.below(8) == 0 ? random.byte() : kinds[random.below(std::size(kinds))];
    firmware::Reply reply;
    const wire::Frame request{kind, random.byte(), static_cast<std::uint16_t>(bytes), payload};
    if (firmware::Commands::well_formed(request, reply)) {
      ASSERT_EQ(reply.count(), 0);
      if (firmware::Commands::is_errand(kind)) continue;
      commands.answer(request, random.below(8) != 0, reply);
    }
    ASSERT_GE(reply.count(), sizeof(wire::Answer));
    ASSERT_LE(reply.count(), wire::max_payload);
    done += reply.bytes()[0] == 0;
    if (random.below(4) != 0) continue;
    recorder->tick(++period);
    firmware::Reply rows;
    (void)commands.telemetry(rows);
    for (int i = 0; i < 2; ++i) {
      const hal::Duty duty = board.driver().axis(i).tick({{0, 0, 0}, 48.0f, 1.0f, period, true});
      for (const float ratio : {duty.ratio.a, duty.ratio.b, duty.ratio.c}) ASSERT_TRUE(ratio >= 0.0f && ratio <= 1.0f);
    }
  }
  EXPECT_GT(done, cases() / 50) << "some of them must be obeyed";
}

/// Two areas of one slot.
struct SmallStore {
  std::array<std::array<std::uint8_t, firmware::ParameterStore::slot_bytes>, hal::store_areas> areas;
  std::span<const std::uint8_t> area(int index) const { return areas[static_cast<std::size_t>(index)]; }
  bool program(int index, std::size_t byte, std::span<const std::uint32_t> words) {
    std::memcpy(areas[static_cast<std::size_t>(index)].data() + byte, words.data(), words.size_bytes());
    return true;
  }
  bool erase(int index) {
    areas[static_cast<std::size_t>(index)].fill(0xFF);
    return true;
  }
};

TEST(Fuzz, NoFlashContentsBreakTheParameterLoader) {
  Random random(4);
  VirtualBoard board(options());
  SmallStore good{};
  for (auto& a : good.areas) a.fill(0xFF);
  firmware::Driver driver({boards::dual_48V_20A,
                           {firmware::setup_from(board.parameters().in_force().axes[0]),
                            firmware::setup_from(board.parameters().in_force().axes[1])}});
  firmware::ParameterStore fresh(boards::dual_48V_20A);
  ASSERT_EQ(static_cast<wire::Status>(fresh.start(good).status), wire::Status::nothing_saved);
  for (int i = 0; i < firmware::parameter_count; ++i) {
    for (std::uint8_t axis = 0; axis < 2; ++axis)
      ASSERT_EQ(fresh
                    .stage({{firmware::parameter_info(i)->id, axis},
                            firmware::parameter_value(board.parameters().in_force().axes[axis], i)})
                    .status,
                0);
  }
  ASSERT_EQ(fresh.commit(driver).status, 0);
  for (int i = 0; i < 2; ++i) (void)driver.axis(i).tick({});
  ASSERT_EQ(fresh.save(driver, good).status, 0);

  long accepted = 0;
  SmallStore damaged = good;
  for (long n = cases(); n > 0; --n) {
    auto& slot = damaged.areas[0];
    const auto& whole = good.areas[0];
    firmware::RecordHeader header{};
    std::memcpy(&header, whole.data(), sizeof header);
    const std::size_t record = sizeof header + header.bytes;
    std::memcpy(slot.data(), whole.data(), record);
    for (unsigned k = random.below(4); k > 0; --k) {
      const std::size_t at = sizeof header + 4 * random.below(static_cast<unsigned>(header.bytes / 4));
      float value = 0;
      std::memcpy(&value, slot.data() + at, 4);
      value *= random.below(2) == 0 ? 1.0f + 1e-3f * static_cast<float>(random.below(100)) : -1.0f;
      if (random.below(2) == 0)
        std::memcpy(slot.data() + at, &value, 4);
      else
        slot[at + random.below(4)] = random.byte();
    }
    std::memcpy(&header, slot.data(), sizeof header);
    if (random.below(8) == 0) header.bytes = static_cast<std::uint32_t>(random.below(300)) * (1 + random.below(4));
    if (random.below(8) != 0 && header.bytes <= slot.size() - sizeof header)
      header.crc = firmware::record_crc(header, slot.data() + sizeof header);
    std::memcpy(slot.data(), &header, sizeof header);
    firmware::ParameterStore loader(boards::dual_48V_20A);
    const wire::Answer answer = loader.start(damaged);
    if (answer.status != 0) continue;
    ++accepted;
    ASSERT_EQ(firmware::check(loader.in_force(), boards::dual_48V_20A).status, 0);
  }
  EXPECT_GT(accepted, cases() / 50);
  EXPECT_LT(accepted, cases());
}

}  // namespace
