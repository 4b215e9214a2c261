// SPDX-License-Identifier: MIT
// Which rows of a table belong together: those of one motor, and of one session each.
#pragma once

#include <string>
#include <vector>

#include "identify/log/table.hpp"

namespace identify {

/// Rows of a table, and what tells them from its others; empty where they are all.
struct Session {
  std::string name;
  std::vector<std::size_t> rows;
};

/// Leaves only the rows in which a column says this, "motor=left"; empty: all. Throws UserError (usage) where there is
/// no such column or no such row.
void keep_rows(Table& table, const std::string& choice);

/// The rows of each value of a column, numbers first and rising; all as one where `column` is negative. Rows in which
/// it says nothing belong to none.
std::vector<Session> sessions_of(const Table& table, int column);

/// What tells apart motors that share a table, each with rows of its own in turn or from its own first time on: a
/// sentence; empty where nothing does. `time`: empty where a person tells the rows apart, or there is none. `heat`,
/// `temperature`: columns that each of them fills. `known`: columns that have another meaning.
std::string several_motors(const Table& table, const std::vector<double>& time, std::size_t heat,
                           std::size_t temperature, const std::vector<std::size_t>& known);

}  // namespace identify
