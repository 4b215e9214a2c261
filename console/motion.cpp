// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "console/commands.hpp"
#include "console/drive.hpp"
#include "console/live.hpp"

namespace console {
namespace {

std::uint8_t mask_of(const std::string& axis) { return axis == "both" ? 3 : axis == "1" ? 2 : 1; }

Json summary(const Driven& d) {
  return {{"seconds", d.seconds},
          {"peak_A", number(d.peak_A)},
          {"core_start_degC", number(d.start_degC)},
          {"core_peak_degC", number(d.peak_degC)},
          {"core_end_degC", number(d.end_degC)},
          {"held_back_s", d.held_back_s},
          {"limit", wire::text_of(d.limit).name}};
}

std::string told(const Driven& d, const std::string& whose) {
  std::string text =
      fmt::format("{} in {:.2f} s and disarmed: peak current {:.1f} A, core {:.1f} to {:.1f} degC",
                  whose.empty() ? "Done" : whose + ": done", d.seconds, d.peak_A, d.start_degC, d.end_degC);
  if (d.peak_degC > d.end_degC + 0.5f) text += fmt::format(" (peak {:.1f})", d.peak_degC);
  text += ".\n";
  if (d.held_back_s > 0.02) {
    const wire::CodeText why = wire::text_of(d.limit);
    text += fmt::format("Held back for {:.2f} s, at last because {}. What to do: {}.\n", d.held_back_s, why.happened,
                        why.advice);
  }
  return text;
}

/// `once_armed`: told when the first setpoint was taken.
void play(Console& console, const std::string& axis, const std::vector<Piece>& profile,
          const std::string& once_armed = "") {
  Session& session = console.session();
  const std::uint8_t mask = mask_of(axis);
  need_mode(console, mask, profile.front().mode);
  Live live(mask);
  std::array<Driven, wire::axis_count> driven;
  {
    Armed armed(session, mask);
    bool said = once_armed.empty();
    driven = drive(session, mask, profile, Along::q, [&](const wire::State& state, double time_s) {
      if (!said) console.tell(once_armed);
      said = true;
      if (!console.options.json) live.show(state, time_s);
    });
    armed.disarm();
  }
  if (axis != "both") {
    const Driven& one = driven[axis == "1" ? 1 : 0];
    return console.say(told(one, ""), summary(one));
  }
  console.say(told(driven[0], "Axis 0") + told(driven[1], "Axis 1"),
              {{"axis0", summary(driven[0])}, {"axis1", summary(driven[1])}});
}

/// Armed at a steady level until Ctrl-C or for so long.
void arm(Console& console, const std::string& axis, const Piece& piece) {
  play(console, axis, {piece}, fmt::format("Armed at {:g} {}; Ctrl-C disarms.", piece.level, unit_of(piece.mode)));
}

/// What setpoints mean: chosen if `wish` names one, and told.
void mode(Console& console, const std::string& axis, const std::string& wish) {
  Session& session = console.session();
  if (!wish.empty())
    session.choose(mask_of(axis), wish == "torque" ? wire::ControlMode::torque : wire::ControlMode::current);
  const wire::State state = session.state();
  std::string text;
  Json json = Json::object();
  for (int a = 0; a < wire::axis_count; ++a) {
    if ((mask_of(axis) >> a & 1) == 0) continue;
    const wire::ControlMode control = state.axis[a].control;
    text += fmt::format("axis {}: {} mode, setpoints in {}\n", a, wire::text_of(control), unit_of(control));
    json[fmt::format("axis{}", a)] = {{"control", wire::text_of(control)}};
  }
  console.say(text, json);
}

void stop(Console& console, const std::string& axis) {
  console.session().disarm(mask_of(axis));
  console.say(fmt::format("Disarmed: {}.\n", axis == "both" ? "both axes" : "axis " + axis), {{"disarmed", axis}});
}

void calibrate(Console& console, const std::string& axis) {
  std::string text;
  Json json = Json::object();
  for (int a = 0; a < wire::axis_count; ++a) {
    if ((mask_of(axis) >> a & 1) == 0) continue;
    const wire::Offsets offsets = console.session().calibrate(a);
    text += fmt::format("axis {}: the current sensors' offsets are {:.3f}, {:.3f}, {:.3f} A\n", a, offsets.phase_A[0],
                        offsets.phase_A[1], offsets.phase_A[2]);
    json[fmt::format("axis{}", a)] = {{"offset_A", offsets.phase_A}};
  }
  console.say(text, json);
}

void fault(Console& console, const std::string& axis, bool clear) {
  std::string text;
  Json json = Json::object();
  for (int a = 0; a < wire::axis_count; ++a) {
    if ((mask_of(axis) >> a & 1) == 0) continue;
    const wire::FaultEvidence evidence = console.session().fault(a);
    const wire::CodeText code = wire::text_of(evidence.fault);
    const std::string sentence = fault_sentence(evidence);
    text += fmt::format("axis {}: {}.\n", a, sentence.empty() ? "no fault" : sentence);
    json[fmt::format("axis{}", a)] = {{"fault", code.name},
                                      {"happened", code.happened},
                                      {"value", number(evidence.value)},
                                      {"threshold", number(evidence.threshold)},
                                      {"unit", code.unit},
                                      {"age_s", number(evidence.age_s)},
                                      {"advice", code.advice}};
    if (!clear || evidence.fault == 0) continue;
    const auto one = static_cast<std::uint8_t>(1 << a);
    clear_fault(console.session(), one);
    text += "        cleared; the axis is off.\n";
    json[fmt::format("axis{}", a)]["cleared"] = true;
  }
  console.say(text, json);
}

Json members_of(const wire::Outlook& outlook) {
  return {{"feasible", outlook.feasible != 0},
          {"peak_degC", number(outlook.peak_degC)},
          {"limits_after_s", number(outlook.limits_after_s)},
          {"share_before_limit", number(outlook.share_before_limit)}};
}

std::string sentence_of(const wire::Outlook& outlook) {
  if (outlook.feasible != 0)
    return fmt::format("the hottest winding would reach {:.1f} degC, doubt included", outlook.peak_degC);
  const std::string unlimited =
      std::isfinite(outlook.peak_degC)
          ? fmt::format(" (unlimited, doubt included, the winding would reach {:.0f} degC)", outlook.peak_degC)
          : "";
  return fmt::format(
      "the limit is met after {:.2f} s and {:.0f} % of the ampere-seconds; from there on less "
      "is delivered{}",
      outlook.limits_after_s, 100 * outlook.share_before_limit, unlimited);
}

/// As the board looks at it: in amperes. Torque counts as the axis itself would count it.
std::vector<wire::Segment> segments_of(Console& console, int axis, const std::vector<Piece>& course) {
  std::vector<wire::Segment> segments;
  const auto get = [&](const char* name) {
    const std::string whole = fmt::format("axis{}.{}", axis, name);
    const float value = console.session().get(console.session().parameters().named(whole)).front();
    if (!std::isfinite(value)) refuse(fmt::format("{} is not set; set it, or ask in amperes.", whole));
    return value;
  };
  const bool torque = course.front().mode == wire::ControlMode::torque;
  const float Nm_per_A = torque ? 1.5f * get("pole_pairs") * get("flux_linkage_Wb") : 1.0f;
  for (const Piece& piece : course) segments.push_back({piece.seconds, piece.level / Nm_per_A});
  return segments;
}

/// The board looks at heat alone, and would say yes to what its axis never gives.
void need_within_limit(Console& console, int axis, const std::vector<wire::Segment>& segments) {
  const std::string name = fmt::format("axis{}.current_limit_A", axis);
  const float limit_A = console.session().get(console.session().parameters().named(name)).front();
  for (const wire::Segment& segment : segments) {
    if (!(std::fabs(segment.current_A) > limit_A)) continue;
    refuse(fmt::format("{:g} A is more than the axis ever gives, {} is {:g}; ask for less.", segment.current_A, name,
                       limit_A));
  }
}

/// How long to rest until the course fits, s, to a twentieth; +infinity where the board does not look that far.
float wait_s(Console& console, int axis, const std::vector<wire::Segment>& segments, float whole_s, bool standing) {
  const auto fits = [&](float rest_s) {
    std::vector<wire::Segment> rested = {{rest_s, 0.0f}};
    rested.insert(rested.end(), segments.begin(), segments.end());
    return console.session().ask(axis, rested, standing).feasible != 0;
  };
  float little_s = 0, enough_s = 0.999f * (wire::longest_ask_s - whole_s);  // rounding makes no course too long
  if (segments.size() == wire::max_segments || !(enough_s > 0) || !fits(enough_s)) return INFINITY;
  while (enough_s - little_s > 0.05f * enough_s) {
    stop_if_interrupted("Stopped; nothing was changed.");
    const float middle_s = 0.5f * (little_s + enough_s);
    (fits(middle_s) ? enough_s : little_s) = middle_s;
  }
  return enough_s;
}

/// Both ways that the phases may share the heat. The answer goes by a standing rotor, which heats one phase up to twice
/// as much, unless the caller knows that it turns.
void ask(Console& console, const std::string& axis, const std::string& course, bool turns) {
  const std::vector<Piece> pieces = profile_in(course, wire::max_segments);
  float whole_s = 0;
  for (const Piece& piece : pieces) whole_s += piece.seconds;
  if (!(whole_s <= wire::longest_ask_s)) {
    refuse(fmt::format("The course lasts {:g} s; the board looks {:g} s ahead, shorten it.", whole_s,
                       wire::longest_ask_s));
  }
  const int index = axis == "1" ? 1 : 0;
  const std::vector<wire::Segment> segments = segments_of(console, index, pieces);
  need_within_limit(console, index, segments);
  const wire::Outlook standing = console.session().ask(index, segments, true);
  const wire::Outlook turning = console.session().ask(index, segments, false);
  const bool stands = standing.feasible != 0, goes = turning.feasible != 0;
  std::string text = stands && goes ? "Yes, standing or turning.\n"
                     : !goes        ? "Not in full, standing or turning.\n"
                     : turns        ? "Yes, as long as it turns.\n"
                                    : "Not in full where the rotor stands; --turning answers for one that turns.\n";
  text += fmt::format("  standing, the hottest phase at any angle:  {}.\n", sentence_of(standing));
  text += fmt::format("  turning, all phases share the heat:        {}.\n", sentence_of(turning));
  const bool by_turning = turns || (stands && !goes);
  const bool feasible = by_turning ? goes : stands;
  if (!feasible) console.tell("Looking for a rest after which it fits ...\n");
  const float rest_s = feasible ? 0 : wait_s(console, index, segments, whole_s, !by_turning);
  if (rest_s > 0)
    text += std::isfinite(rest_s) ? fmt::format("  After {:.2g} s of rest it fits.\n", rest_s)
                                  : fmt::format(
                                        "  It does not fit after any rest that the board can look beyond, {:g} s "
                                        "with the course itself.\n",
                                        wire::longest_ask_s);
  Json json = members_of(by_turning ? turning : standing);
  json["wait_s"] = number(rest_s);
  json["assumed"] = by_turning ? "turning" : "standing";
  json["standing"] = members_of(standing);
  json["turning"] = members_of(turning);
  console.say(text, json);
}

}  // namespace

void add_motion(CLI::App& app, Console& console) {
  struct Arguments {
    std::string axis;
    std::vector<std::string> course;  // quoted or not
    std::string mode;
    int times = 1;
    float iq_A = 0, torque_Nm = 0, seconds = longest_s;
    bool clear = false, turns = false;
  };
  const auto with_axis = [&](CLI::App* command, const std::string& otherwise, bool both) {
    auto a = std::make_shared<Arguments>();
    a->axis = otherwise;
    command->add_option("--axis", a->axis, both ? "0, 1 or both" : "0 or 1")
        ->capture_default_str()
        ->check(both ? CLI::IsMember({"0", "1", "both"}) : CLI::IsMember({"0", "1"}));
    return a;
  };

  CLI::App* command = app.add_subcommand("arm", "hold an axis armed at a steady current or torque until Ctrl-C");
  auto a = with_axis(command, "0", true);
  CLI::Option* const iq = command->add_option("--iq", a->iq_A, "amperes")->capture_default_str();
  CLI::Option* const torque = command->add_option("--torque", a->torque_Nm, "N m, in torque mode")->excludes(iq);
  command->add_option("--seconds", a->seconds, "disarm by itself after so long")->check(between(0, longest_s));
  command->callback([&console, a, torque] {
    arm(console, a->axis,
        torque->count() > 0 ? Piece{a->torque_Nm, a->seconds, wire::ControlMode::torque} : Piece{a->iq_A, a->seconds});
  });

  command = app.add_subcommand("mode", "what setpoints mean, current or torque; or tell it");
  a = with_axis(command, "both", true);
  command->add_option("MODE", a->mode, "current or torque; every start begins with current")
      ->check(CLI::IsMember({"current", "torque"}));
  command->callback([&console, a] { mode(console, a->axis, a->mode); });

  command = app.add_subcommand("run", "arm, play a course of current or torque, disarm");
  a = with_axis(command, "0", true);
  command->add_option("COURSE", a->course, "such as \"20A 0.3s, 0A 1s, 6A 5s\", in torque mode \"50mNm 1s\"")
      ->required();
  command->add_option("--times", a->times, "play it so often, one after the other")
      ->capture_default_str()
      ->check(between(1, 1000));
  command->callback([&console, a] {
    const std::vector<Piece> once = profile_in(fmt::to_string(fmt::join(a->course, " ")), 1000);
    std::vector<Piece> course;
    for (int i = 0; i < a->times; ++i) course.insert(course.end(), once.begin(), once.end());
    play(console, a->axis, course);
  });

  command = app.add_subcommand("stop", "disarm");
  a = with_axis(command, "both", true);
  command->callback([&console, a] { stop(console, a->axis); });

  command = app.add_subcommand("calibrate", "learn the current sensors' offsets at rest");
  a = with_axis(command, "both", true);
  command->callback([&console, a] { calibrate(console, a->axis); });

  command = app.add_subcommand("fault", "what happened, the evidence, and what to do");
  a = with_axis(command, "both", true);
  command->add_flag("--clear", a->clear, "clear it; the axis stays off until armed");
  command->callback([&console, a] { fault(console, a->axis, a->clear); });

  command = app.add_subcommand("ask", "could this course be driven now, and how hot would the winding get?");
  a = with_axis(command, "0", false);
  command->add_option("COURSE", a->course, "such as \"20A 0.3s, 6A 5s\"")->required();
  command->add_flag("--turning", a->turns, "answer for a rotor that turns all the time; else for one that may stand");
  command->callback([&console, a] { ask(console, a->axis, fmt::to_string(fmt::join(a->course, " ")), a->turns); });
}

}  // namespace console
