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

constexpr char too_many[] = "this command has fewer words; try: help\r\n";

/// -12.34; false for anything else. Digits behind the point that change no float are passed over: they would make
/// infinity over infinity of a number.
bool number(const char* text, float& value) {
  constexpr float whole_enough = 1e9f, unit_enough = 1e30f;
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
    if (point && (whole >= whole_enough || unit >= unit_enough)) continue;
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
  held_.take(data, bytes);
  digest();
}

/// What came and was not looked at yet, up to a line that takes time.
void TextPort::digest() {
  while (!held_.empty() && !waits_) {
    const char c = static_cast<char>(held_.next());
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
  wire::Answer answer;
  if (waits_ && link_.finished(answer)) {
    waits_ = false;
    say(answer);
  }
  digest();
  const std::size_t bytes = std::min(room, count_ - said_);
  std::memcpy(out, answer_ + said_, bytes);
  said_ += bytes;
  if (said_ == count_) said_ = count_ = 0;
  return bytes;
}

void TextPort::obey(char* line) {
  const char* const verb = next_word(line);
  const auto is = [verb](const char* word) { return std::strcmp(verb, word) == 0; };
  const auto more = [&line] { return *next_word(line) != 0; };
  if (is("help")) return help();
  if (is("state")) return state();
  if (is("get")) {
    const char* const name = next_word(line);
    const char* const axis = next_word(line);
    return more() ? say(too_many) : get(name, axis);
  }
  if (is("set")) {
    const char* const name = next_word(line);
    const char* const value = next_word(line);
    const char* const axis = next_word(line);
    return more() ? say(too_many) : set(name, value, axis);
  }
  if (is("save")) return more() ? say(too_many) : save();
  int i = 0;
  const bool commands_axis = is("arm") || is("disarm") || is("clear") || is("mode") || is("iq") || is("torque");
  if (!commands_axis) return say("unknown command; try: help\r\n");
  if (!axis_number(next_word(line), i)) return say("name axis 0 or 1\r\n");
  Axis& axis = commands_.driver().axis(i);
  if (is("disarm")) {
    axis.disarm();
    return more() ? say("this axis alone, one a line\r\n") : say(wire::Status::done);
  }
  const bool has_word = is("mode") || is("iq") || is("torque");
  const char* const word = has_word ? next_word(line) : "";
  if (more()) return say(too_many);
  if (is("arm")) return say(link_.parameters_free() ? axis.arm() : wire::Status::busy);
  if (is("clear")) return say(axis.clear());
  if (is("mode")) {
    for (const wire::ControlMode mode : {wire::ControlMode::current, wire::ControlMode::torque})
      if (std::strcmp(word, wire::text_of(mode)) == 0) return say(axis.choose(mode));
    return say("give current or torque, such as: mode 0 torque\r\n");
  }
  float wish = 0.0f;
  if (is("torque")) {
    if (!number(word, wish)) return say("give newton metres, such as: torque 0 0.02\r\n");
    return say(axis.set_torque(0.0f, wish));
  }
  if (!number(word, wish)) return say("give amperes, such as: iq 0 1.5\r\n");
  say(axis.set_current({0.0f, wish}));
}

void TextPort::help() {
  say("state            both axes\r\n"
      "arm 0            ready for setpoints; disarm 0, clear 0 (after a fault)\r\n"
      "iq 0 1.5         amperes; fades unless it is sent again within the time-out\r\n"
      "mode 0 torque    then: torque 0 0.02, newton metres; or: mode 0 current\r\n"
      "get pole_pairs   a parameter of both axes; get pole_pairs 0: of one\r\n"
      "set ramp 0.3     both axes off; set ramp 0.3 0: of one; save: over a reset\r\n"
      "Everything else: the program hotcore.\r\n");
}

/// -1, and said so: there is none.
int TextPort::parameter_named(const char* name) {
  for (int i = 0; i < parameter_count; ++i)
    if (std::strcmp(parameter_info(i)->name, name) == 0) return i;
  say("no such parameter; names and ranges: hotcore get\r\n");
  return -1;
}

/// Both unless one is named; false, and said so: neither.
bool TextPort::axes_in(const char* axis, int& first, int& last) {
  first = 0, last = axis_count - 1;
  if (*axis == 0) return true;
  if (axis_number(axis, first)) return last = first, true;
  say("name axis 0 or 1\r\n");
  return false;
}

void TextPort::get(const char* name, const char* axis) {
  int first = 0, last = 0;
  if (!axes_in(axis, first, last)) return;
  const int index = parameter_named(name);
  if (index < 0) return;
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

/// As the link does it: staged, then checked as a whole and put in force by the main context. What another program has
/// staged and not committed is not touched.
void TextPort::set(const char* name, const char* value, const char* axis) {
  int first = 0, last = 0;
  float number_given = 0.0f;
  const int index = parameter_named(name);
  if (index < 0) return;
  if (!number(value, number_given)) return say("give a number, such as: set ramp 0.3\r\n");
  if (!axes_in(axis, first, last)) return;
  ParameterStore& parameters = commands_.parameters();
  if (!link_.parameters_free() || parameters.uncommitted()) return say(wire::Status::busy);
  const wire::ParameterInfo& p = *parameter_info(index);
  for (int i = first; i <= last; ++i) {
    const wire::Answer found = parameters.stage({{p.id, static_cast<std::uint8_t>(i)}, number_given});
    if (found.status == 0) continue;
    say("it may be ");
    say_exactly(p.min);
    say(" to ");
    say_exactly(p.max);
    say(" ");
    say(wire::text_of(p.unit));
    return say("\r\n");
  }
  waits_ = link_.begin(wire::Kind::commit);
  if (waits_) return;
  (void)parameters.load(wire::LoadFrom::in_force);
  say(wire::Status::busy);
}

void TextPort::save() {
  waits_ = link_.begin(wire::Kind::save);
  if (!waits_) say(wire::Status::busy);
}

void TextPort::state() {
  const wire::State now = commands_.state();
  for (int i = 0; i < axis_count; ++i) {
    const wire::AxisReport& a = now.axis[i];
    say(i == 0 ? "axis 0: " : "axis 1: ");
    say(text_of(static_cast<Mode>(a.mode)));
    if (a.control != wire::ControlMode::current) say(", "), say(wire::text_of(a.control)), say(" mode");
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

/// With the parameter that it names.
void TextPort::say(const wire::Answer& answer) {
  for (int i = 0; answer.id != 0 && i < parameter_count; ++i) {
    if (parameter_info(i)->id != answer.id) continue;
    say(parameter_info(i)->name);
    say(answer.axis == 0 ? " of axis 0: " : " of axis 1: ");
  }
  say(static_cast<wire::Status>(answer.status));
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
