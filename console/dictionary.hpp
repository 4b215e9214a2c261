// SPDX-License-Identifier: MIT
// What the board itself says it has: parameters and signals with unit, range and doc, under the names people type.
//
//   axis1.current_limit_A   of one axis      current_limit_A   of both      setpoint*   all that begin so
#pragma once

#include <string>
#include <vector>

#include "console/link/messages.hpp"

namespace console {

using link::Description;

/// One value on the board: what it is, and whose (0, 1 or wire::no_axis).
struct Target {
  const Description* what;
  std::uint8_t axis;
};

/// "current_limit_A": the name and, unless it is a bare number, the unit.
std::string full_name(const Description& what);
/// "axis1.current_limit_A", or without the axis where it belongs to the whole board.
std::string full_name(const Target& target);

/// Parameters, or signals.
class Dictionary {
 public:
  Dictionary(std::string kind, std::vector<Description> entries)
      : kind_(std::move(kind)), entries_(std::move(entries)) {}

  const std::vector<Description>& entries() const { return entries_; }
  /// Every target there is, axis by axis.
  std::vector<Target> all() const;
  /// What a name stands for, at least one. Throws UserError (usage), naming the nearest and `where` it stood.
  std::vector<Target> named(const std::string& name, const std::string& where = "") const;
  /// "axis1.current_limit_A (A, 0 to 100)" for a sentence; of what is not declared, its number.
  std::string told(std::uint16_t id, std::uint8_t axis) const;
  /// Every full name, with and without the axis: for completion.
  std::vector<std::string> names() const;

 private:
  std::string kind_;  // "parameter"
  std::vector<Description> entries_;
};

}  // namespace console
