// SPDX-License-Identifier: MIT
#include "wire/pc/motor_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "wire/pc/names.hpp"
#include "wire/pc/toml_file.hpp"
#include "wire/pc/user_error.hpp"

namespace wire::pc {
namespace {

namespace fs = std::filesystem;

enum class Need { must, may };

/// One key of a motor file, in the units of motor sheets. What is outside of its range no motor is: a unit was
/// mistaken.
struct Key {
  const char* name;
  Need need;
  double low, high;
  double otherwise;  // value of a key that may be missing
};

// Defaults: the copper coefficient of IEC 60028, which is of 20 degC: taken at 25 degC it makes a winding of 155 degC
// heat by 0.7 % too much, to the safe side; no phase coupling, which is the safe side too.
constexpr Key keys[] = {
    {"terminal_resistance_ohm", Need::must, 1e-4, 1e4, 0},
    {"terminal_inductance_mH", Need::must, 1e-5, 1e4, 0},
    {"saliency", Need::may, 0.05, 20, 1},  // Lq / Ld
    {"torque_constant_mNm_per_A", Need::must, 1e-3, 1e6, 0},
    {"pole_pairs", Need::must, 1, 100, 0},
    {"rotor_inertia_gcm2", Need::must, 1e-5, 1e9, 0},
    {"rated_current_A", Need::must, 1e-3, 1e5, 0},
    {"R1_K_per_W", Need::must, 1e-4, 1e4, 0},
    {"R2_K_per_W", Need::must, 1e-4, 1e4, 0},
    {"tau_winding_s", Need::must, 1e-2, 1e6, 0},
    {"tau_motor_s", Need::must, 1e-2, 1e8, 0},
    {"winding_max_degC", Need::must, 50, 300, 0},
    {"copper_coefficient_per_K", Need::may, 0, 0.01, 0.00393},
    {"phase_coupling_W_per_K", Need::may, 0, 1e3, 0},
};
constexpr const char* text_keys[] = {"name", "source", "status"};
constexpr const char* surrogate = "surrogate";  // the one status there is

double number(const toml::table& table, const std::string& path, const char* name) {
  const Key& key =
      *std::find_if(std::begin(keys), std::end(keys), [&](const Key& k) { return std::string(k.name) == name; });
  const toml::node* node = table.get(name);
  if (node == nullptr) {
    if (key.need == Need::may) return key.otherwise;
    refuse(fmt::format("{}: the key '{}' is missing; add it (boards/motors/ has complete examples).", path, name));
  }
  const auto value = node->value<double>();
  if (!value) refuse(fmt::format("{}: '{}' must be a number.", path, name));
  if (!std::isgreaterequal(*value, key.low) || !std::islessequal(*value, key.high))  // quiet for NaN
    refuse(
        fmt::format("{}: {} = {:g} cannot be; of a motor it is {:g} to {:g}.", path, name, *value, key.low, key.high));
  return *value;
}

std::string text(const toml::table& table, const std::string& path, const char* name, const std::string& otherwise) {
  const toml::node* node = table.get(name);
  if (node == nullptr) return otherwise;
  const auto value = node->value<std::string>();
  if (!value) refuse(fmt::format("{}: '{}' must be a text in quotes.", path, name));
  return *value;
}

}  // namespace

std::vector<std::string> motor_names(const std::string& folder) { return toml_names(folder); }

MotorFile read_motor(const std::string& which, const std::string& folder) {
  const std::string path = find_toml("motor", which, folder);
  const toml::table table = parse_toml(path);
  need_kind("motor", path, table);

  std::vector<std::string> known;
  for (const Key& key : keys) known.push_back(key.name);
  known.insert(known.end(), std::begin(text_keys), std::end(text_keys));
  for (const auto& [key, node] : table) {
    const std::string name{key.str()};
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      const std::string hint = did_you_mean(name, known);
      refuse(fmt::format("{}: unknown key '{}'{}", path, name,
                         hint.empty() ? "; boards/motors/ has examples with every key." : hint));
    }
  }

  const auto get = [&](const char* name) { return number(table, path, name); };
  const double pole_pairs = get("pole_pairs");
  if (pole_pairs != std::floor(pole_pairs))
    refuse(fmt::format("{}: pole_pairs = {} must be a whole number.", path, pole_pairs));

  MotorFile file;
  file.id = fs::path(path).stem().string();
  file.name = text(table, path, "name", file.id);
  file.source = text(table, path, "source", "not stated");
  const std::string status = text(table, path, "status", "");
  file.surrogate = status == surrogate;
  if (!status.empty() && !file.surrogate)
    refuse(fmt::format("{}: status = '{}' is none; say '{}' or leave it out.", path, status, surrogate));

  const double R1 = get("R1_K_per_W"), R2 = get("R2_K_per_W");
  const double inductance_d_H = get("terminal_inductance_mH") * 1e-3 / 2;
  file.motor = Motor{
      .phase_resistance_ohm = get("terminal_resistance_ohm") / 2,
      .inductance_d_H = inductance_d_H,
      .inductance_q_H = inductance_d_H * get("saliency"),
      .flux_linkage_Wb = get("torque_constant_mNm_per_A") * 1e-3 / (std::sqrt(3.0) * pole_pairs),
      .pole_pairs = static_cast<int>(pole_pairs),
      .rotor_inertia_kg_m2 = get("rotor_inertia_gcm2") * 1e-7,
      .R1_K_per_W = R1,
      .R2_K_per_W = R2,
      .C1_J_per_K = get("tau_winding_s") / R1,  // sheet definition: tau_w = R1 C1, tau_m = R2 C2
      .C2_J_per_K = get("tau_motor_s") / R2,
      .copper_coefficient_per_K = get("copper_coefficient_per_K"),
      .winding_max_degC = get("winding_max_degC"),
      .phase_coupling_W_per_K = get("phase_coupling_W_per_K"),
      .rated_current_A = get("rated_current_A"),
  };
  return file;
}

}  // namespace wire::pc
