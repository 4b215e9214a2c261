// SPDX-License-Identifier: MIT
#include "console/profile.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include "wire/pc/user_error.hpp"

namespace console {
namespace {

struct Unit {
  const char* name;
  float factor;
};
constexpr Unit ampere_units[] = {{"A", 1.0f}, {"mA", 1e-3f}, {"", 1.0f}};
constexpr Unit torque_units[] = {{"Nm", 1.0f}, {"mNm", 1e-3f}};
constexpr Unit second_units[] = {{"s", 1.0f}, {"ms", 1e-3f}, {"min", 60.0f}, {"", 1.0f}};

/// Takes a number and its unit off the front of `text`. False: there is none, and nothing is taken.
template <std::size_t n>
bool quantity(std::string_view& all, const Unit (&units)[n], float& value) {
  std::string_view text = all;
  const auto skip = [&] {
    while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  };
  skip();
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || !std::isfinite(value)) return false;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  skip();
  std::size_t letters = 0;
  while (letters < text.size() && std::isalpha(static_cast<unsigned char>(text[letters])) != 0) ++letters;
  for (const Unit& unit : units) {
    if (text.substr(0, letters) != unit.name) continue;
    value *= unit.factor;
    text.remove_prefix(letters);
    all = text;
    return true;
  }
  return false;
}

}  // namespace

const char* unit_of(wire::ControlMode mode) { return mode == wire::ControlMode::torque ? "N m" : "A"; }

std::vector<Piece> profile_in(const std::string& text, std::size_t most) {
  using wire::pc::Exit, wire::pc::UserError;
  std::vector<Piece> pieces;
  std::string commas = text;
  std::replace(commas.begin(), commas.end(), ';', ',');
  std::stringstream stream(commas);
  for (std::string part; std::getline(stream, part, ',');) {
    Piece piece{};
    std::string_view rest = part;
    bool read = quantity(rest, ampere_units, piece.level);
    if (!read) {
      read = quantity(rest, torque_units, piece.level);
      piece.mode = wire::ControlMode::torque;
    }
    read = read && quantity(rest, second_units, piece.seconds);
    if (!read || rest.find_first_not_of(" \t") != std::string_view::npos || !(piece.seconds > 0)) {
      wire::pc::refuse(fmt::format(
          "'{}' is no piece of a course; write amperes (or Nm) and seconds, such as \"20A 0.3s, 6A 5s\".", part));
    }
    if (!pieces.empty() && pieces.front().mode != piece.mode) {
      wire::pc::refuse(
          fmt::format("'{}' has another unit than the pieces before it; a course is of current "
                      "or of torque, write one or the other.",
                      part));
    }
    pieces.push_back(piece);
  }
  if (pieces.empty() || pieces.size() > most) {
    wire::pc::refuse(
        fmt::format("The course has {} pieces; give 1 to {}, such as \"20A 0.3s, 6A 5s\".", pieces.size(), most));
  }
  return pieces;
}

}  // namespace console
