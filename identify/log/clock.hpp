// SPDX-License-Identifier: MIT
// When each row was written: what clocks tell too coarsely, out of order, from another day or not at all is put right,
// and what cannot be is refused.
#pragma once

#include <vector>

#include "identify/log/log.hpp"
#include "identify/log/rows.hpp"

namespace identify {

/// Sorts rows of which some few, each for itself, stand up to five too late, as of messages that overtook each other;
/// how many did. A clock that was set back stays so for more than a row.
std::size_t put_in_order(std::vector<std::size_t>& rows, const std::vector<double>& time);

/// Takes rows away that say again, time and all, what the row before them says; how many.
std::size_t drop_repeated(std::vector<std::size_t>& rows, const Table& table, const std::vector<double>& time);

/// A column of the time since the first row of a session, of rows that are a period apart.
Source give_clock(Table& table, const std::vector<Session>& sessions, double period_s);

/// Refuses a clock that counts in no seconds: from 1970 (1e11 s is in the year 5138), or for longer than any recording.
void check_epoch(const Log& log, double first_cell);

/// The only column called date that tells a day in each row; -1: none, or several.
int date_column(const Table& table);

/// Adds the day that such a column tells to a time of day; false: there is none, or the time has a day.
bool add_days(Table& table, std::size_t time_column);

/// Is a column of numbers a time of day by its name, as ms_today is?
bool counts_from_midnight(const std::string& name);

/// A time of day that falls by half a day or more has passed midnight; one that rises by nearly a day is a row from
/// before it, out of order.
void pass_midnights(Log& log);

/// Refuses time that runs backwards, with what to do about it. `rows`: of the table, in the log's order.
void check_time(const Table& table, const Log& log, const std::vector<std::size_t>& rows);

/// Refuses rows without a clock that stand in another order than they were recorded in, as those of data sets that were
/// sorted by a column or shuffled. `read`: how many readings of the motor there were before its glitches were masked.
void check_rows_follow(const Log& log, std::size_t read);

/// Times told too coarsely for the rows, in whole seconds most often: rows that share one are spread until the next.
void spread_shared_times(Log& log);

}  // namespace identify
