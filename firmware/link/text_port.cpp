// SPDX-License-Identifier: MIT
#include "firmware/link/text_port.hpp"

#include <algorithm>
#include <cstring>

#include "firmware/mode.hpp"

namespace firmware {

namespace {

/// The next word of a line, NUL-terminated in place; empty at the end.
char* next_word(char*& at) {
  while (*at == ' ') ++at;
  char* const word = at;
  while (*at != 0 && *at != ' ') ++at;
  if (*at == ' ') *at++ = 0;
  return word;
}

/// -12.34; false for anything else.
bool number(const char* text, float& value) {
  const bool negative = *text == '-';
  if (negative) ++text;
  float whole = 0.0f, unit = 1.0f;
  bool point = false, digits = false;
  for (; *text != 0; ++text) {
    if (*text == '.' && !point) {
      point = true;
      continue;
    }
    if (*text < '0' || *text > '9') return false;
    digits = true;
    whole = whole * 10.0f + static_cast<float>(*text - '0');
    if (point) unit *= 10.0f;
  }
  value = (negative ? -whole : whole) / unit;
  return digits;
}

bool axis_number(const char* text, int& axis) {
  axis = text[0] - '0';
  return axis >= 0 && axis < axis_count && text[1] == 0;
}

}  // namespace

void TextPort::take(const std::uint8_t* data, std::size_t bytes) {
  for (std::size_t i = 0; i < bytes; ++i) {
    const char c = static_cast<char>(data[i]);
    if (c == '\r' || c == '\n') {
      line_[line_count_] = 0;
      if (too_long_)
        say("this line is too long; try: help\r\n");
      else if (line_count_ > 0)
        obey(line_);
      line_count_ = 0;
      too_long_ = false;
    } else if (line_count_ + 1 < sizeof line_) {
      line_[line_count_++] = c;
    } else {
      too_long_ = true;
    }
  }
}

std::size_t TextPort::give(std::uint8_t* out, std::size_t room) {
  const std::size_t bytes = std::min(room, count_ - said_);
  std::memcpy(out, answer_ + said_, bytes);
  said_ += bytes;
  if (said_ == count_) said_ = count_ = 0;
  return bytes;
}

void TextPort::obey(char* line) {
  const char* const verb = next_word(line);
  const auto is = [verb](const char* word) { return std::strcmp(verb, word) == 0; };
  if (is("help")) return help();
  if (is("state")) return state();
  if (is("get")) {
    const char* const name = next_word(line);
    return get(name, next_word(line));
  }
  int i = 0;
  const bool commands_axis = is("arm") || is("disarm") || is("clear") || is("iq");
  if (!commands_axis) return say("unknown command; try: help\r\n");
  if (!axis_number(next_word(line), i)) return say("name axis 0 or 1\r\n");
  Axis& axis = commands_.driver().axis(i);
  if (is("arm")) return say(link_.parameters_free() ? axis.arm() : wire::Status::busy);
  if (is("clear")) return say(axis.clear());
  if (is("disarm")) {
    axis.disarm();
    return say(wire::Status::done);
  }
  float iq_A = 0.0f;
  if (!number(next_word(line), iq_A)) return say("give amperes, such as: iq 0 1.5\r\n");
  say(axis.set_current({0.0f, iq_A}));
}

void TextPort::help() {
  say("state            both axes\r\n"
      "arm 0            ready for setpoints; disarm 0, clear 0 (after a fault)\r\n"
      "iq 0 1.5         amperes; fades unless it is sent again within the time-out\r\n"
      "get pole_pairs   a parameter of both axes; get pole_pairs 0: of one\r\n"
      "Everything else: the program hotcore.\r\n");
}

void TextPort::get(const char* name, const char* axis) {
  int first = 0, last = axis_count - 1;
  if (*axis != 0) {
    if (!axis_number(axis, first)) return say("name axis 0 or 1\r\n");
    last = first;
  }
  int index = 0;
  while (index < parameter_count && std::strcmp(parameter_info(index)->name, name) != 0) ++index;
  if (index == parameter_count) return say("no such parameter; names and ranges: hotcore get\r\n");
  const wire::ParameterInfo& p = *parameter_info(index);
  for (int i = first; i <= last; ++i) {
    float value = 0.0f;
    (void)commands_.parameters().get({p.id, static_cast<std::uint8_t>(i)}, value);
    say(i == 0 ? "axis 0: " : "axis 1: ");
    say_exactly(value);
    say(" ");
    say(wire::text_of(p.unit));
    say("\r\n");
  }
}

void TextPort::state() {
  const wire::State now = commands_.state();
  for (int i = 0; i < axis_count; ++i) {
    const wire::AxisReport& a = now.axis[i];
    say(i == 0 ? "axis 0: " : "axis 1: ");
    say(text_of(static_cast<Mode>(a.mode)));
    say(", iq ");
    say(a.iq_A);
    say(" A, ");
    say(a.speed_rad_per_s);
    say(" rad/s, core ");
    say(a.core_degC);
    say(" degC, allowed ");
    say(a.allowance_A);
    say(" A");
    if (a.limit != 0) say(", limit: "), say(wire::text_of(static_cast<wire::Limit>(a.limit)).happened);
    if (a.fault != 0) say(", fault: "), say(wire::text_of(static_cast<wire::Fault>(a.fault)).happened);
    say("\r\n");
  }
}

/// What has no room is cut off.
void TextPort::say(const char* text) {
  while (*text != 0 && count_ < sizeof answer_) answer_[count_++] = *text++;
}

void TextPort::say(wire::Status status) {
  if (status == wire::Status::done) return say("ok\r\n");
  const wire::CodeText text = wire::text_of(status);
  say(text.happened);
  say("; ");
  say(text.advice);
  say("\r\n");
}

/// Two decimals, up to a million.
void TextPort::say(float value) {
  constexpr float most = 1e6f;
  if (!(value > -most && value < most)) return say("?");
  if (value < 0.0f) say("-");
  auto hundredths = static_cast<std::uint32_t>((value < 0.0f ? -value : value) * 100.0f + 0.5f);
  char digits[12];
  std::size_t at = sizeof digits;
  digits[--at] = 0;
  for (int i = 0; i < 3 || hundredths > 0; ++i) {
    if (i == 2) digits[--at] = '.';
    digits[--at] = static_cast<char>('0' + hundredths % 10);
    hundredths /= 10;
  }
  say(digits + at);
}

/// Six digits that count and no exponent, up to a million.
void TextPort::say_exactly(float value) {
  if (value != value) return say("not set");
  if (value < 0.0f) say("-");
  float scaled = value < 0.0f ? -value : value;
  if (!(scaled < 1e6f)) return say("a million or more");
  int decimals = 0;
  for (; scaled < 1e5f && decimals < 12; ++decimals) scaled *= 10.0f;
  auto rest = static_cast<std::uint32_t>(scaled + 0.5f);
  for (; decimals > 0 && rest % 10 == 0; --decimals) rest /= 10;
  char digits[16];
  std::size_t at = sizeof digits;
  digits[--at] = 0;
  for (int i = 0; i <= decimals || rest > 0; ++i) {
    if (i == decimals && decimals > 0) digits[--at] = '.';
    digits[--at] = static_cast<char>('0' + rest % 10);
    rest /= 10;
  }
  say(digits + at);
}

}  // namespace firmware
