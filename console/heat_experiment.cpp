// SPDX-License-Identifier: MIT
#include "console/heat_experiment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "wire/pc/toml_file.hpp"
#include "wire/pc/user_error.hpp"

namespace console {
namespace {

using wire::pc::refuse;

constexpr double probe_s = 0.12;  // the ohmmeter needs 0.1 s, and a setpoint may come 5 ms late

/// What would take the motor for cooler than the board does.
void leave_out_cooler(Offer& offer, const Values& before) {
  constexpr struct {
    const char* name;
    float towards_cool;
  } rules[] = {{"R2_K_per_W", -1},      {"C2_J_per_K", 1},         {"housing_offset_K", 1},
               {"constant_heat_W", -1}, {"radiation_W_per_K", 1},  {"natural_convection", 1},
               {"speed_cooling", 1},    {"third_mass_J_per_K", 1}, {"trust_cooling_share", -1}};
  std::vector<std::string> left_out;
  for (const auto& [name, towards_cool] : rules) {
    const auto found = offer.values.find(name);
    if (found == offer.values.end() || !(towards_cool * (found->second - before.at(name)) > 0)) continue;
    left_out.push_back(fmt::format("{} {:.6g}", name, found->second));
    offer.values.erase(found);
  }
  if (left_out.empty()) return;
  offer.note += fmt::format(
      "; left out, since it takes the motor for cooler and nobody told how warm the room was (--ambient DEGC): {}",
      fmt::join(left_out, ", "));
}

/// Leads that nobody told of make the winding read too little, which looks like a housing sensor that reads too much;
/// of both meanings that is the hotter one. Differences of temperature are then larger by the gain, at the same heat.
void take_gain_for_leads(Offer& offer) {
  const auto gain = offer.values.find("sensor_gain_share");
  if (gain == offer.values.end() || !(gain->second > 0)) return;
  const float larger = 1 + gain->second;
  const auto times = [&](const char* name, float factor) {
    if (const auto found = offer.values.find(name); found != offer.values.end()) found->second *= factor;
  };
  for (const char* way : {"R1_K_per_W", "R2_K_per_W"}) times(way, larger);
  for (const char* less : {"C1_J_per_K", "C2_J_per_K", "third_mass_J_per_K", "radiation_W_per_K"})
    times(less, 1 / larger);
  if (const auto mass = offer.values.find("third_mass_J_per_K"); mass != offer.values.end() && mass->second > 0)
    times("third_mass_path_K_per_W", larger);
  // The conductance goes with that power of the difference.
  if (const auto power = offer.values.find("natural_convection"); power != offer.values.end())
    times("R2_K_per_W", std::pow(larger, power->second));
  offer.note += fmt::format(
      "; that the housing's sensor reads {:.0f} % too much is taken for leads (--leads) that were not told, the hotter "
      "of both",
      100 * gain->second);
  gain->second = 0;
}

/// A parameter of two resistors, or of them with what was found; nothing where the log does not tell it.
std::optional<double> told(const nlohmann::json& lines, const char* name) {
  for (const auto& line : lines) {
    const bool sure = line.value("determined", false) && !line.value("at_bound", true);
    if (sure && line.value("name", std::string()) == name) return line.value("value", NAN);
  }
  return {};
}

}  // namespace

double course_A(const Values& values) {
  return std::min(continuous_A(values), value_of(values, "current_limit_A") / larger_share);
}

std::vector<Piece> cold_course(const Values& values) {
  const double whole_A = course_A(values);
  // Five time constants as the board believes them, which may be off by a few times.
  const double rest_s = std::clamp(5 * value_of(values, "R1_K_per_W") * value_of(values, "C1_J_per_K"), 3.0, 20.0);
  const auto look = [&](double share) {
    return Piece{static_cast<float>(share * whole_A), static_cast<float>(probe_s)};
  };
  const Piece rest{0, static_cast<float>(rest_s)};
  std::vector<Piece> course;
  for (int i = 0; i < 4; ++i)
    course.insert(course.end(), {look(probe_share), look(larger_share), look(probe_share), rest});
  for (int i = 0; i < 5; ++i) course.insert(course.end(), {look(probe_share), rest});
  return course;
}

std::vector<Piece> designed_course(double course_A, double minutes) {
  // Shares of the continuous current and seconds: levels apart by design, bursts short enough for any winding that the
  // look-ahead of a healthy board allows, rests in between; the log begins at rest.
  constexpr struct {
    double share, seconds;
  } look = {probe_share, probe_s}, round[] = {{0.0, 10}, {0.9, 40}, look,      {0.9, 80}, look,
                                              {0.0, 3},  look,      {0.0, 7},  look,      {0.0, 40},
                                              {2.5, 2},  look,      {0.3, 15}, look,      {2.0, 4},
                                              look,      {0.3, 15}, look,      {2.5, 2},  look,
                                              {0.0, 20}, look,      {0.6, 90}, look,      {probe_share, 5},
                                              {0.0, 3},  look,      {0.0, 56}};
  std::vector<Piece> course;
  double left_s = 60 * minutes;
  for (int i = 0; left_s > 0; i = (i + 1) % static_cast<int>(std::size(round))) {
    const double seconds = std::min(round[i].seconds, left_s);
    course.push_back({static_cast<float>(round[i].share * course_A), static_cast<float>(seconds)});
    left_s -= seconds;
  }
  return course;
}

namespace {

/// Sources that a board has a parameter for; the winding's copper is its phase resistance.
constexpr struct {
  int node;  // 0 winding, 1 housing
  const char *drive, *parameter;
} board_sources[] = {
    {0, "speed2_rad2_per_s2", "winding_eddy_Nms"},
    {0, "current2_speed2", "ac_copper_loss_ohms2"},
    {0, "current_A", "bridge_loss_V"},
    {0, "enabled", "enabled_loss_W"},
    {1, "one", "constant_heat_W"},
    {1, "speed_rad_per_s", "speed_loss_linear_Nm"},
    {1, "speed2_rad2_per_s2", "speed_loss_quadratic_Nms"},
    {1, "speed3_rad3_per_s3", "windage_Nms2"},
    {1, "current_speed", "load_friction_Nm_per_A"},
    {1, "current_A2", "board_heat_ohm"},
};
/// And laws by which the housing cools.
constexpr struct {
  const char *law, *parameter;
} board_laws[] = {{"speed", "speed_cooling"}, {"natural_convection", "natural_convection"}};

}  // namespace

Values parameters_of_model(const std::string& path, const Values& before, std::string& why) {
  const toml::table file = wire::pc::parse_toml(path);
  wire::pc::need_kind("heat model", path, file);
  const auto array = [&](const char* key) {
    const toml::array* list = file[key].as_array();
    if (list == nullptr || !list->is_homogeneous(toml::node_type::table))
      refuse(fmt::format("{}: there is no [[{}]]; let identify --write-model write the file.", path, key));
    return *list;
  };
  const auto number = [](const toml::node& node, const char* key) { return (*node.as_table())[key].value_or(0.0); };
  const auto text = [](const toml::node& node, const char* key) {
    return (*node.as_table())[key].value_or(std::string());
  };
  const toml::array nodes = array("node"), links = array("link"), sources = array("source");
  if (file.at_path("housing_sensor.node").value_or(1) != 1)
    return why = "a housing sensor towards the winding", Values{};
  const bool mass = nodes.size() == 3 && !nodes[2].as_table()->contains("max_degC");
  if (nodes.size() != 2 && !mass) return why = "a hot spot, or more than one further mass", Values{};

  // Temperatures stay the same when heat, 1/R and C are multiplied by one number: here all goes by the board's copper.
  double scale = 0;
  Values found;
  for (const toml::node& node : sources) {
    if (text(node, "drive") != "current_A2" || number(node, "node") != 0) continue;
    scale = 1.5 * value_of(before, "phase_resistance_ohm") / number(node, "gain");
    found["copper_coefficient_per_K"] = static_cast<float>(number(node, "coefficient_per_K"));
  }
  if (!(scale > 0)) return why = "no heat by the current", Values{};
  const auto put = [&](const std::string& name, double value) { found[name] = static_cast<float>(value); };
  // What a model does not have, it has none of.
  for (const char* none : {"sensor_gain_share", "radiation_W_per_K", "neighbour_heat_W_per_K", "third_mass_J_per_K"})
    found[none] = 0;
  if (before.contains("third_mass_path_K_per_W")) found["third_mass_path_K_per_W"] = 1;  // its default: nothing to save
  for (const auto& source : board_sources) found[source.parameter] = 0;
  for (const auto& law : board_laws) found[law.parameter] = 0;

  put("C1_J_per_K", scale * number(nodes[0], "capacity_J_per_K"));
  put("C2_J_per_K", scale * number(nodes[1], "capacity_J_per_K"));
  if (mass) put("third_mass_J_per_K", scale * number(nodes[2], "capacity_J_per_K"));
  for (const toml::node& node : links) {
    const std::string law = text(node, "law"), to = text(node, "to");
    const auto from = number(node, "from"), to_node = number(node, "to");
    const double W_per_K = scale * number(node, "conductance_W_per_K");
    const auto known =
        std::find_if(std::begin(board_laws), std::end(board_laws), [&](const auto& entry) { return law == entry.law; });
    const bool constant = law == "constant";
    if (constant && to.empty() && from == 0 && to_node == 1)
      put("R1_K_per_W", 1 / W_per_K);
    else if (constant && to.empty() && mass && std::min(from, to_node) == 1 && std::max(from, to_node) == 2)
      put("third_mass_path_K_per_W", 1 / W_per_K);
    else if (from == 1 && to == "neighbour" && constant)
      put("neighbour_heat_W_per_K", W_per_K);
    else if (from == 1 && to == "ambient" && law == "radiation")
      put("radiation_W_per_K", W_per_K);
    else if (from == 1 && to == "ambient" && (constant || known != std::end(board_laws))) {
      put("R2_K_per_W", 1 / W_per_K);
      if (!constant) put(known->parameter, number(node, "k"));
    } else
      return why =
                 constant ? "heat flow to " + (to.empty() ? "another mass" : to) : "heat flow by the law '" + law + "'",
             Values{};
  }
  for (const toml::node& node : sources) {
    const std::string drive = text(node, "drive");
    const auto at = static_cast<int>(number(node, "node"));
    if (drive == "power_W" || (drive == "current_A2" && at == 0)) continue;  // no board measures power
    const auto known = std::find_if(std::begin(board_sources), std::end(board_sources),
                                    [&](const auto& entry) { return drive == entry.drive && at == entry.node; });
    if (known == std::end(board_sources)) return why = "heat that goes with " + drive, Values{};
    put(known->parameter, scale * number(node, "gain"));
  }
  // A model with none has found none, which is no reason to forget what the board was told.
  for (const auto& [name, key] : {std::pair{"housing_lag_s", "lag_s"}, {"housing_offset_K", "offset_K"}}) {
    if (const double value = file["housing_sensor"][key].value_or(0.0); value != 0) put(name, value);
  }
  put("sensor_gain_share", file.at_path("housing_sensor.gain_error").value_or(0.0));
  for (const auto& [name, key] : {std::pair{"trust_power_share", "power"},
                                  {"trust_inner_share", "inner_resistance"},
                                  {"trust_cooling_share", "cooling"},
                                  {"trust_correlation", "correlation"}}) {
    if (const auto value = file["trust"][key].value<double>()) put(name, *value);
  }
  for (const char* way : {"R1_K_per_W", "R2_K_per_W"}) {
    if (!found.contains(way)) return why = std::string("no ") + way, Values{};
  }
  for (auto at = found.begin(); at != found.end();) {
    if (!std::isfinite(at->second)) return why = "no finite " + at->first, Values{};
    const bool has = before.contains(at->first);
    if (!has && at->second != 0) return why = at->first + ", which its firmware does not know", Values{};
    at = has ? std::next(at) : found.erase(at);
  }
  return found;
}

Offer offer(const nlohmann::json& answer, const std::string& model_path, const Values& before, bool room_told) {
  const double housing_noise_K = value_of(before, "housing_noise_K");
  Offer offer;
  std::string why;
  const auto at = [&](const char* path) {
    return answer.is_object() ? answer.value(nlohmann::json::json_pointer(path), nlohmann::json()) : nlohmann::json();
  };
  const auto verdict = answer.is_object() ? answer.value("verdict", std::string()) : std::string();
  if (verdict == "insufficient") {
    offer.note = "this log cannot tell; the board's parameters stay as they are";
    return offer;
  }
  offer.values = parameters_of_model(model_path, before, why);
  const nlohmann::json plain = at("/baseline/parameters"), extended = at("/parameters_with_causes");
  bool tells_winding = at("/baseline/rmse_K/core").is_number();
  if (offer.values.empty()) {
    const auto miss = at("/baseline/rmse_K/housing");
    if (!miss.is_number() || miss.get<double>() > housing_noise_K) {
      offer.note = fmt::format("the model has {}, which this board's parameters cannot express", why);
      return offer;
    }
    for (const auto& [name, key] :
         {std::pair{"R1", "R1_K_per_W"}, {"R2", "R2_K_per_W"}, {"C1", "C1_J_per_K"}, {"C2", "C2_J_per_K"}}) {
      if (const auto value = told(plain, name)) offer.values[key] = static_cast<float>(*value);
    }
    tells_winding = tells_winding && verdict == "adequate";
    offer.note = fmt::format(
        "The board cannot express {}, but without it the housing is missed by {:.2f} K only, less than housing_noise_K",
        why, miss.get<double>());
  } else {
    const nlohmann::json& lines = extended.empty() ? plain : extended;
    tells_winding = tells_winding && told(lines, "R1") && told(lines, "C1");
    offer.note = "The board can express all of it";
  }
  // The ohmmeter's scale: 3 % more for an EC 16 at 130 degC than cold, and leads that may be longer than was told.
  constexpr float least_trust = 0.05f;
  for (const char* name : {"trust_power_share", "trust_inner_share", "trust_cooling_share"}) {
    if (const auto found = offer.values.find(name); found != offer.values.end())
      found->second = std::max(found->second, least_trust);
  }
  if (!tells_winding) {
    for (const char* name : {"R1_K_per_W", "C1_J_per_K", "trust_power_share", "trust_inner_share",
                             "trust_cooling_share", "trust_correlation"})
      offer.values.erase(name);
    offer.note +=
        "; R1 and C1 stay: a housing sensor alone does not tell the winding well enough (--turning reads "
        "the winding, where the shaft is free)";
  }
  if (tells_winding) take_gain_for_leads(offer);
  if (!room_told) leave_out_cooler(offer, before);
  return offer;
}

}  // namespace console
