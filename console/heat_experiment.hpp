// SPDX-License-Identifier: MIT
// What the console does itself about thermal identification: the course of current that is run, and what of the model
// that was found fits into a board's parameters. Pure: no board, no program.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "console/motor_sheet.hpp"
#include "console/profile.hpp"

namespace console {

/// What the shares of both courses are of: the continuous current, or as much less as lets the larger current flow.
double course_A(const Values& values);

/// At this current the winding's resistance is read, as share of that: what dead time adds hangs on the
/// rotor's angle, which may creep, by 8 K of an EC 16 at 0.9, and by 1.7 K here.
inline constexpr double probe_share = 1.8, larger_share = 2.5;
/// While all is cold: four times the probe, the larger current and the probe; then five times the probe; and after each
/// a rest in which the winding cools.
std::vector<Piece> cold_course(const Values& values);
/// Steps of a minute and more tell the housing's resistance and capacity, bursts of seconds the winding's, rests both;
/// after each burst and in rests the winding is read. Amperes are shares of course_A up to 2.5 times; the
/// governor may cut bursts, which the log then shows.
std::vector<Piece> designed_course(double course_A, double minutes);

/// Parameters that the model file of identify (--write-model) comes to on this board, of which `before` is known; empty
/// if the model has something that they cannot express, and `why` says what.
Values parameters_of_model(const std::string& path, const Values& before, std::string& why);

/// What is offered to be written, and a sentence that says why not more.
struct Offer {
  Values values;
  std::string note;
};

/// From identify's answer (JSON) and model file. A housing sensor alone tells the winding's R1 and C1 only through a
/// housing that hardly feels them: a small effect outside the model moves them by tens of percent, to the cold side as
/// well, so they are offered only where the winding's resistance was read. If the model found has more than parameters
/// can express, R2 and C2 of the plain two-resistor fit are, provided that it misses the housing by less than
/// `housing_noise_K`, which the board grants anyway. Unless the room was told, nothing is offered that takes the motor
/// for cooler than `before`: from a log that begins above its room it seems to cool better than it does, at 20 K twice
/// as well.
Offer offer(const nlohmann::json& answer, const std::string& model_path, const Values& before, bool room_told);

}  // namespace console
