// SPDX-License-Identifier: MIT
// A hostile device at the other end of the cable: whatever it sends, the PC neither crashes nor believes it.
//
// Deterministic. HOTCORE_FUZZ_CASES says how many frames; a tenth of it are profiles, a hundredth whole commands.
#include <gtest/gtest.h>

#include <cctype>
#include <cstdlib>

#include "console/commands.hpp"
#include "console/profile.hpp"
#include "tests/console/fake_board.hpp"

namespace {

using wire::Kind;

std::uint64_t cases() {
  const char* count = std::getenv("HOTCORE_FUZZ_CASES");
  return count != nullptr ? std::strtoull(count, nullptr, 10) : 200'000;
}

/// splitmix64: small, good enough, the same everywhere. Public domain by its author, S. Vigna.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : state_(seed) {}
  std::uint64_t roll() {
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(roll() % n); }
  std::uint8_t byte() { return static_cast<std::uint8_t>(roll()); }

 private:
  std::uint64_t state_;
};

constexpr Kind kinds[] = {
    Kind::hello,          Kind::describe_parameter, Kind::describe_signal, Kind::get,       Kind::stage,
    Kind::state,          Kind::setpoint,           Kind::fault,           Kind::calibrate, Kind::ask,
    Kind::capture_status, Kind::capture_read,       Kind::telemetry};

/// Answers as an honest board gives them, to be broken.
std::vector<std::vector<std::uint8_t>> honest_answers() {
  std::vector<std::vector<std::uint8_t>> answers(std::size(kinds));
  const auto board = std::make_shared<FakeBoard>();
  board->twist = [&](Kind kind, std::vector<std::uint8_t>& payload) {
    for (std::size_t k = 0; k < std::size(kinds); ++k) {
      if (kinds[k] == kind) answers[k] = payload;
    }
  };
  console::Session session(std::make_unique<FakeTransport>(board));
  const auto targets = session.parameters().all();
  (void)session.get(targets);
  session.set({{targets.front(), 1.0f}});
  (void)session.exchange({});
  (void)session.state();
  (void)session.fault(0);
  (void)session.calibrate(0);
  const wire::Segment segment{1.0f, 1.0f};
  (void)session.ask(0, std::span(&segment, 1), true);
  session.capture({{}, wire::Edge::now, 0, 0, 5, 5, 1}, session.signals().all());
  (void)session.capture_status();
  std::vector<float> values;
  std::uint32_t period = 0;
  (void)session.capture_read(0, static_cast<int>(session.signals().all().size()), values, period);
  session.subscribe(session.signals().all(), 20, [](const console::link::RowsView&) {});
  session.wait_until(session.now_s() + 0.01);
  return answers;
}

bool printable(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c <= '~'; });
}

/// What a caller may rely on, of any frame at all. Returns how many parsers took it.
int judge(const wire::Frame& frame) {
  namespace link = console::link;
  int taken = 0;
  for (const Kind kind : kinds) taken += link::answer_in(frame, kind).has_value();
  EXPECT_LE(taken, 1);
  if (const auto hello = link::hello_in(frame)) {
    for (const std::string text : {hello->board, hello->firmware, hello->serial}) EXPECT_TRUE(printable(text));
    if (hello->protocol == wire::protocol_version) {
      EXPECT_TRUE(hello->pwm_Hz > 0 && hello->axes <= wire::axis_count && hello->max_payload <= wire::max_payload);
    }
    ++taken;
  }
  for (const auto& description : {link::parameter_in(frame), link::signal_in(frame)}) {
    if (!description) continue;
    EXPECT_FALSE(description->name.empty());
    EXPECT_TRUE(printable(description->name + description->unit + description->doc));
    EXPECT_LE(description->min, description->max);
    EXPECT_EQ(description->name.find_first_of(" =\"#.*,"), std::string::npos);
    ++taken;
  }
  float values[wire::max_payload / sizeof(float)];
  for (const std::size_t count : {std::size_t{0}, std::size_t{7}, std::size(values)})
    taken += link::values_in(frame, std::span(values, count));
  taken += link::state_in(frame).has_value();
  taken += link::message_in<wire::FaultEvidence>(frame, Kind::fault).has_value();
  taken += link::message_in<wire::Outlook>(frame, Kind::ask).has_value();
  taken += link::message_in<wire::CaptureStatus>(frame, Kind::capture_status).has_value();
  for (const std::uint8_t kind : {static_cast<std::uint8_t>(Kind::telemetry), wire::reply_to(Kind::capture_read)}) {
    for (const int signals : {0, 3, 12}) {
      const auto rows = link::rows_in(frame, kind, signals);
      if (!rows) continue;
      const std::size_t bytes = sizeof(float) * rows->head.rows * rows->head.signals;
      EXPECT_LE(rows->values + bytes, frame.payload + frame.bytes);
      double sum = 0;  // touches every value: the sanitizers' build sees a read beyond the frame
      for (std::size_t r = 0; r < rows->head.rows; ++r) {
        for (std::size_t s = 0; s < rows->head.signals; ++s) sum += static_cast<double>(rows->value(r, s));
      }
      EXPECT_TRUE(rows->head.rows == 0 || rows->head.signals == signals) << sum;
      ++taken;
    }
  }
  return taken;
}

/// Breaks a payload a little: bits, length, a whole word.
void mutate(Dice& dice, std::vector<std::uint8_t>& payload) {
  for (std::size_t n = dice.below(4); n > 0; --n) {
    switch (dice.below(5)) {
      case 0:
        payload.resize(dice.below(wire::max_payload + 1));
        break;
      case 1:
        if (!payload.empty()) payload.resize(dice.below(payload.size() + 1));
        break;
      case 2:
        if (payload.size() >= 4) {  // NaN, infinity, or the largest of everything, at a word of the head
          const std::uint32_t words[] = {0x7FC0'0000u, 0x7F80'0000u, 0xFFFF'FFFFu, 0x8000'0000u, 0};
          const std::uint32_t word = words[dice.below(std::size(words))];
          std::memcpy(payload.data() + 4 * dice.below(std::min<std::size_t>(payload.size(), 64) / 4), &word, 4);
        }
        break;
      default:
        if (!payload.empty()) payload[dice.below(std::min<std::size_t>(payload.size(), 100))] = dice.byte();
    }
  }
}

TEST(HostileDevice, NoFrameIsBelievedBeyondItsBytes) {
  const auto honest = honest_answers();
  for (const auto& answer : honest) ASSERT_FALSE(answer.empty());
  Dice dice(1);
  wire::FrameReader reader;
  std::uint64_t whole = 0, taken = 0;
  std::vector<std::uint8_t> payload, stream(wire::max_encoded);
  for (std::uint64_t i = 0; i < cases(); ++i) {
    if (dice.below(8) == 0) {  // noise on the wire
      stream.resize(dice.below(wire::max_encoded + 40));
      for (std::uint8_t& byte : stream) byte = dice.below(6) == 0 ? 0 : dice.byte();
    } else {
      const std::size_t k = dice.below(std::size(kinds));
      payload = honest[k];
      mutate(dice, payload);
      const std::uint8_t kind = dice.below(20) == 0           ? dice.byte()
                                : kinds[k] == Kind::telemetry ? static_cast<std::uint8_t>(kinds[k])
                                                              : wire::reply_to(kinds[k]);
      stream.resize(wire::max_encoded);
      stream.resize(wire::encode({kind, dice.byte(), static_cast<std::uint16_t>(payload.size()), payload.data()},
                                 stream.data(), stream.size()));
      if (dice.below(16) == 0) stream[dice.below(stream.size())] = dice.byte();  // one byte torn
    }
    for (const std::uint8_t byte : stream) {
      if (!reader.take(byte)) continue;
      ++whole;
      taken += judge(reader.frame()) > 1;
    }
    if (HasFailure()) FAIL() << "case " << i;
  }
  // The fuzz must get past the doors that it shakes.
  EXPECT_GT(whole, cases() / 2);
  EXPECT_GT(taken, cases() / 10);
  std::printf("  %llu cases, %llu whole frames, %llu believed, %u torn\n", static_cast<unsigned long long>(cases()),
              static_cast<unsigned long long>(whole), static_cast<unsigned long long>(taken), reader.bad());
}

TEST(HostileText, AProfileIsReadOrRefused) {
  Dice dice(3);
  const std::string letters = "0123456789 .,-+eEAmsinf\t";
  int read = 0;
  for (std::uint64_t i = 0; i < cases() / 10; ++i) {
    const char* const pieces[] = {"20A 0.3s", "+6 5s", "\t-250 mA  2min"};
    std::string text;
    for (std::size_t n = dice.below(7); n > 0; --n)
      text += std::string(text.empty() ? "" : ", ") + pieces[dice.below(3)];
    for (std::size_t n = dice.below(6); n > 0; --n)
      text.insert(dice.below(text.size() + 1), 1, letters[dice.below(letters.size())]);
    try {
      for (const console::Piece& piece : console::profile_in(text, 4))
        ASSERT_TRUE(std::isfinite(piece.level) && piece.seconds > 0) << text;
      ++read;
    } catch (const wire::pc::UserError& error) {
      ASSERT_EQ(error.exit_code(), 2);
    }
  }
  EXPECT_GT(read, 0);
}

/// Whole commands against a board whose every answer may be broken: each ends with one of the documented codes.
TEST(HostileDevice, EveryCommandEndsInASentence) {
  const std::string folder = testing::TempDir();
  const std::string lines[] = {"get",
                               "get current_limit_A --json",
                               "set axis0.current_limit_A=5 pole_pairs=3 --save",
                               "diff",
                               "backup " + folder + "hostile.toml",
                               "run \"5A 0.03s\"",
                               "fault --clear",
                               "ask \"20A 0.3s\"",
                               "calibrate",
                               "signals",
                               "watch --seconds 0.2",
                               "watch iq_A --seconds 0.3",
                               "log --out " + folder + "hostile.csv --seconds 0.2",
                               "capture axis0.iq_A --pre 5 --post 30 --out " + folder + "hostile_capture.csv"};
  std::map<int, int> codes;
  Dice dice(2);
  for (std::uint64_t i = 0; i < cases() / 100; ++i) {
    const auto board = std::make_shared<FakeBoard>();
    const std::size_t rarely = 1 + dice.below(40);
    board->twist = [&](Kind, std::vector<std::uint8_t>& payload) {
      if (dice.below(rarely) == 0) mutate(dice, payload);
    };
    board->before = [&](Kind) { return dice.below(500) != 0 || !(board->unplugged = dice.below(2) == 0); };
    console::Console console([&](const console::Options&) { return std::make_unique<FakeTransport>(board); });
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const std::string& line = lines[dice.below(std::size(lines))];
    const int code = console::run_line(console, [&](CLI::App& app) { app.parse("--sim " + line); });
    const std::string out = testing::internal::GetCapturedStdout(), err = testing::internal::GetCapturedStderr();
    ++codes[code];
    ASSERT_TRUE(code == 0 || code == 2 || (code >= 7 && code <= 9)) << line << " -> " << code << ": " << err;
    const bool told = err.size() > 20 && err.substr(err.size() - 2) == ".\n";
    ASSERT_TRUE(code == 0 || told) << line << " -> " << code << ": " << err;
    ASSERT_EQ(out.find('\033'), std::string::npos);
  }
  for (const auto& [code, count] : codes) std::printf("  exit code %d: %d\n", code, count);
  EXPECT_GT(codes[0], 0);
  EXPECT_GT(codes[8] + codes[9], 0);
}

}  // namespace
