// SPDX-License-Identifier: MIT
// Logs of a motor that is nothing like those of host-sim, for what a stranger may hand in: a traction drive of five
// masses (end winding, slots, teeth, yoke, rotor) in a water jacket, iron loss that falls as current weakens the field,
// copper loss that grows with speed, read to 0.05 K, channels that freeze. Own equations, own integration; identify has
// no cause for most of it and gets the file alone. Masses, conductances and losses are round numbers for a machine of
// 50 kW, spread about by the seed.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "identify/log/log.hpp"
#include "identify/log/table.hpp"

namespace tests {

/// Writes the log of motor `seed`, drives of one to three hours each at 2 Hz or 0.4 Hz, with the columns of
/// maps/paderborn.toml and the number of the drive, and returns its path.
inline std::string write_traction_log(const std::string& name, std::uint64_t seed, int drives = 1) {
  const std::string path = (std::filesystem::temp_directory_path() / name).string();
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto between = [&](double low, double high) {
    return low + (high - low) * std::uniform_real_distribution<>()(random);
  };
  const auto about = [&](double value, double spread) { return value * std::exp(spread * normal(random)); };
  const auto one_of = [&](std::initializer_list<double> list) { return list.begin()[random() % list.size()]; };

  enum Mass { end, slot, tooth, yoke, rotor, masses };
  const std::array<double, masses> J_per_K = {about(450, 0.2), about(900, 0.2), about(2500, 0.2), about(6000, 0.2),
                                              about(5500, 0.2)};
  struct Link {
    int from, to;  // a mass; below zero: coolant and ambient
    double W_per_K;
  };
  constexpr int coolant = -1, ambient = -2;
  const std::array<Link, 7> links = {{{end, slot, about(30, 0.3)},
                                      {slot, tooth, about(40, 0.3)},
                                      {tooth, yoke, about(60, 0.3)},
                                      {yoke, coolant, about(90, 0.3)},
                                      {tooth, rotor, about(6, 0.3)},
                                      {rotor, ambient, about(1.5, 0.4)},
                                      {end, ambient, about(1.5, 0.4)}}};
  const double ohm = about(0.0148, 0.1), copper_per_K = 0.00393, proximity_s2 = about(1e-6, 0.3), end_share = 0.35;
  const double hysteresis_W_s = about(0.5, 0.3), eddy_W_s2 = about(8e-4, 0.4), weakened_at_A = 400;
  std::ofstream out(path);
  out << "t_s,i_d,i_q,motor_speed,coolant,ambient,stator_winding,stator_yoke,profile_id\n";
  for (int drive = 0; drive < drives; ++drive) {
    const double coolant_degC = between(18, 60), coolant_s = 120, room_degC = about(23, 0.1), angle = between(0.3, 1.2);

    // Holds of load and speed, from one for the whole drive to hundreds; half of the drives keep their speed.
    struct Hold {
      double until_s, amplitude_A, rad_per_s;
    };
    const double seconds = 3600 * between(1.2, 3), rpm = between(1000, 5500);
    const bool one_speed = random() % 2 == 0;
    const int count = static_cast<int>(one_of({1, 2, 5, 12, 200}));
    std::vector<Hold> holds;
    for (int h = 0; h < count; ++h) {
      const double rests = count > 1 ? 0.1 : 0;
      const double amplitude_A = between(0, 1) < rests ? 0 : count > 1 ? between(40, 230) : between(80, 160);
      const double turns = one_speed ? rpm : between(0, 1) < 0.1 ? 0 : between(500, 5800);
      const double at_s = holds.empty() ? 0 : holds.back().until_s;
      holds.push_back({at_s + between(0.4, 1.6) * seconds / count, amplitude_A, turns * std::numbers::pi / 30});
    }
    holds.back().until_s = seconds;

    struct Channel {
      double frozen_until_s = 0, value = 0;
      bool may_freeze = false;
    };
    std::array<Channel, 4> channels;  // winding, yoke, coolant, ambient
    channels[0].may_freeze = channels[1].may_freeze = channels[2].may_freeze = true;
    const double every_s = one_of({0.5, 2.5}), dt = 0.1, freezes_per_s = 2 / seconds;
    std::array<double, masses> T;
    T.fill(room_degC);
    double water_degC = room_degC, air_degC = room_degC;
    std::size_t hold = 0;
    const auto steps = std::lround(seconds / dt), steps_per_row = std::lround(every_s / dt);
    for (long step = 0; step < steps; ++step) {
      const double t = static_cast<double>(step) * dt;
      while (t >= holds[hold].until_s && hold + 1 < holds.size()) ++hold;
      const double A = holds[hold].amplitude_A, w = holds[hold].rad_per_s;
      if (step % steps_per_row == 0) {
        const double truth[] = {(T[end] + T[slot]) / 2, T[yoke], water_degC, air_degC};
        for (std::size_t c = 0; c < channels.size(); ++c) {
          Channel& channel = channels[c];
          if (t < channel.frozen_until_s) continue;
          channel.value = truth[c] + 0.05 * normal(random);
          if (channel.may_freeze && between(0, 1) < freezes_per_s * every_s)
            channel.frozen_until_s = t + between(20, 200);
        }
        out << t << ',' << -A * std::sin(angle) + 0.05 * normal(random) << ','
            << A * std::cos(angle) + 0.05 * normal(random) << ',' << w * 30 / std::numbers::pi + 0.5 * normal(random)
            << ',' << channels[2].value << ',' << channels[3].value << ',' << channels[0].value << ','
            << channels[1].value << ',' << drive << '\n';
        air_degC += 0.002 * normal(random);
      }
      water_degC += dt / coolant_s * (coolant_degC - water_degC);
      const double copper_W = 1.5 * ohm * A * A * (1 + proximity_s2 * w * w);
      const double iron_W = (hysteresis_W_s * w + eddy_W_s2 * w * w) * (0.6 + 0.4 * std::pow(1 - A / weakened_at_A, 2));
      std::array<double, masses> W = {end_share * copper_W * (1 + copper_per_K * (T[end] - 20)),
                                      (1 - end_share) * copper_W * (1 + copper_per_K * (T[slot] - 20)), 0.6 * iron_W,
                                      0.4 * iron_W, 0.15 * iron_W};
      for (const Link& link : links) {
        const double beyond_degC = link.to == coolant ? water_degC : link.to == ambient ? air_degC : T[link.to];
        const double flow_W = link.W_per_K * (T[link.from] - beyond_degC);
        W[link.from] -= flow_W;
        if (link.to >= 0) W[link.to] += flow_W;
      }
      for (int m = 0; m < masses; ++m) T[m] += dt * W[m] / J_per_K[m];
    }
  }
  return path;
}

/// The same, as identify reads it: who calls gives a name of its own, since tests run side by side.
inline std::vector<identify::Log> traction_drives(const std::string& name, std::uint64_t seed, int drives = 1) {
  auto map = identify::read_map(HOTCORE_SOURCE_DIR "/identify/maps/paderborn.toml");
  identify::add_column(map, "session=profile_id");
  const std::string path = write_traction_log(name, seed, drives);
  auto logs = identify::logs_of(identify::read_table(path), map, std::nullopt);
  std::filesystem::remove(path);
  return logs;
}

}  // namespace tests
