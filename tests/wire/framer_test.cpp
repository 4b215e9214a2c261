// SPDX-License-Identifier: MIT
#include "wire/framer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "wire/protocol.hpp"

namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes encoded(std::uint8_t kind, std::uint8_t sequence, const Bytes& payload) {
  Bytes out(wire::max_encoded);
  out.resize(wire::encode({kind, sequence, static_cast<std::uint16_t>(payload.size()), payload.data()}, out.data(),
                          out.size()));
  return out;
}

Bytes noise(std::mt19937& random, std::size_t bytes, int zeros_in_eight) {
  Bytes out(bytes);
  for (std::uint8_t& b : out)
    b = static_cast<int>(random() % 8) < zeros_in_eight ? 0 : static_cast<std::uint8_t>(random());
  return out;
}

/// All frames a reader finds.
std::vector<Bytes> frames(wire::FrameReader& reader, const Bytes& stream) {
  std::vector<Bytes> found;
  for (const std::uint8_t byte : stream) {
    if (reader.take(byte)) found.emplace_back(reader.frame().payload, reader.frame().payload + reader.frame().bytes);
  }
  return found;
}

TEST(Crc, IsTheOneOfTheStandardCheckValue) {
  // Check value of CRC-32/ISO-HDLC in Greg Cook's catalogue of parametrised CRC algorithms: 0xCBF43926.
  const std::string digits = "123456789";
  EXPECT_EQ(~wire::crc32(reinterpret_cast<const std::uint8_t*>(digits.data()), digits.size()), 0xCBF43926u);
}

TEST(Framer, EncodesAsCobsSays) {
  // kind 0, sequence 1, length 2, payload 11 00, CRC by Python's zlib; stuffed by hand.
  EXPECT_EQ(encoded(0, 1, {0x11, 0x00}),
            (Bytes{0x01, 0x03, 0x01, 0x02, 0x02, 0x11, 0x05, 0x88, 0x63, 0x72, 0x75, 0x00}));
}

TEST(Framer, ReturnsEveryLengthAsItWas) {
  std::mt19937 random(1);
  for (std::size_t bytes = 0; bytes <= wire::max_payload; ++bytes) {
    for (const int zeros : {0, 1, 8}) {
      const Bytes payload = noise(random, bytes, zeros);
      const Bytes stream = encoded(0x13, 7, payload);
      ASSERT_FALSE(stream.empty());
      ASSERT_LE(stream.size(), wire::encoded_bytes(bytes));
      wire::FrameReader reader;
      const std::vector<Bytes> found = frames(reader, stream);
      ASSERT_EQ(found.size(), 1u) << bytes;
      EXPECT_EQ(found[0], payload);
      EXPECT_EQ(reader.frame().kind, 0x13);
      EXPECT_EQ(reader.frame().sequence, 7);
      EXPECT_EQ(reader.bad(), 0u);
    }
  }
}

TEST(Framer, RefusesWhatDoesNotFit) {
  const Bytes payload(wire::max_payload + 1);
  EXPECT_TRUE(encoded(1, 1, payload).empty());
  std::uint8_t little[10];
  EXPECT_EQ(wire::encode({1, 1, 3, payload.data()}, little, sizeof little), 0u);
}

TEST(Framer, IsInStepAgainAtTheNextFrameWhateverCameBefore) {
  std::mt19937 random(2);
  for (int i = 0; i < 2000; ++i) {
    Bytes stream = noise(random, random() % 700, static_cast<int>(random() % 3));
    stream.push_back(0);
    const Bytes good = encoded(2, 3, {1, 0, 2});
    stream.insert(stream.end(), good.begin(), good.end());
    wire::FrameReader reader;
    const std::vector<Bytes> found = frames(reader, stream);
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found.back(), (Bytes{1, 0, 2}));
  }
}

TEST(Framer, FindsEveryTornOrDamagedFrame) {
  std::mt19937 random(3);
  for (int i = 0; i < 20000; ++i) {
    Bytes stream = encoded(4, 5, noise(random, random() % 60, 1));
    const std::size_t at = random() % (stream.size() - 1);
    switch (random() % 3) {
      case 0:
        stream[at] = static_cast<std::uint8_t>(stream[at] ^ (1u << random() % 8));
        break;
      case 1:
        stream.erase(stream.begin() + static_cast<long>(at));
        break;
      default:
        stream.insert(stream.begin() + static_cast<long>(at), static_cast<std::uint8_t>(random() % 255 + 1));
    }
    wire::FrameReader reader;
    EXPECT_TRUE(frames(reader, stream).empty());
    EXPECT_GE(reader.bad(), 1u);
  }
}

TEST(Framer, IgnoresDelimitersBetweenFrames) {
  wire::FrameReader reader;
  EXPECT_TRUE(frames(reader, Bytes(100, 0)).empty());
  EXPECT_EQ(reader.bad(), 0u);
}

}  // namespace
