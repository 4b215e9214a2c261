// SPDX-License-Identifier: MIT
#include "identify/log/bins.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

#include "identify/log/median.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using thermal::Boundary;
using thermal::Drive;

/// 36,000 take a search 5 s on two cores (fit_speed), so these half a minute.
constexpr double most_bins = 200000;
/// Of the current with its ripple, rms: without it there is less, but for what two sensors differ by.
constexpr double most_sampled_share = 1.1;

Drive heater(const Bins& log) { return log.has_power ? Drive::power_W : Drive::current_A2; }

/// Missing cells replaced by the line between their neighbours.
std::vector<double> bridged(std::vector<double> v, const std::vector<double>& t) {
  std::size_t last = v.size();
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (std::isnan(v[i])) continue;
    if (last == v.size()) {
      for (std::size_t k = 0; k < i; ++k) v[k] = v[i];
    } else if (i > last + 1) {
      for (std::size_t k = last + 1; k < i; ++k) {
        const double share = t[i] > t[last] ? (t[k] - t[last]) / (t[i] - t[last]) : 0;
        v[k] = v[last] + share * (v[i] - v[last]);
      }
    }
    last = i;
  }
  for (std::size_t k = last + 1; last < v.size() && k < v.size(); ++k) v[k] = v[last];
  return v;
}

/// White noise of one reading. Second differences ignore slopes; the median ignores steps and the rest.
double reading_noise(const std::vector<double>& v) {
  std::vector<double> seen, second;
  for (const double x : v) {
    if (!std::isnan(x)) seen.push_back(x);
  }
  for (std::size_t i = 2; i < seen.size(); ++i) second.push_back(std::abs(seen[i] - 2 * seen[i - 1] + seen[i - 2]));
  // Steps of the load, and what a gap lies between, are outliers here: clipped at five standard deviations, as the
  // median tells them. A coarse channel repeats itself; of it the median of what moves does.
  double middle = median(second);
  if (middle == 0) {
    std::vector<double> moved;
    std::copy_if(second.begin(), second.end(), std::back_inserter(moved), [](double d) { return d > 0; });
    middle = moved.empty() ? 0 : median(moved);
  }
  constexpr double middle_of_normal = 0.6745;  // the median of its size, in standard deviations
  const double most = 5 * middle / middle_of_normal;
  double sum = 0;
  for (const double d : second) sum += std::min(d, most) * std::min(d, most);
  return second.empty() ? 0 : std::sqrt(sum / (6 * static_cast<double>(second.size())));
}

struct Inputs {
  std::vector<double> amplitude_A, sampled_A, power_W, speed_rad_per_s, boundary_degC[thermal::boundary_count];
  std::vector<bool> enabled;
};

/// Length of the current vector with the sign of its torque, from iq_A and, where it is there, id_A.
std::vector<double> sampled_A(const Log& log) {
  const auto& t = log.of(Role::time);
  std::vector<double> out = bridged(log.of(Role::iq), t);
  if (!log.has(Role::id)) return out;
  const std::vector<double> id_A = bridged(log.of(Role::id), t);
  for (std::size_t k = 0; k < t.size(); ++k) out[k] = std::copysign(std::hypot(id_A[k], out[k]), out[k]);
  return out;
}

double square(const std::vector<double>& v) { return std::inner_product(v.begin(), v.end(), v.begin(), 0.0); }

Inputs inputs_of(const Log& log, Bins& out) {
  const auto& t = log.of(Role::time);
  Inputs in;
  if (log.has(Role::current)) {
    in.amplitude_A = bridged(log.of(Role::current), t);
    for (double& i : in.amplitude_A) i *= amplitude_per_direct;
    in.sampled_A = in.amplitude_A;
    if (log.has(Role::iq)) {
      std::vector<double> sampled = sampled_A(log);
      if (square(sampled) <= most_sampled_share * most_sampled_share * square(in.amplitude_A))
        in.sampled_A = std::move(sampled);
      else
        out.notes.push_back(
            "iq_A (an amplitude) carries more than current_A (direct) allows and is not used; check both units.");
    }
  } else {
    in.amplitude_A = in.sampled_A = log.has(Role::iq) ? sampled_A(log) : std::vector<double>(t.size(), 0.0);
  }
  out.has_power = log.has(Role::power);
  out.torque_for_A = log.torque_for_A;
  out.averaged = log.averaged;
  in.power_W = out.has_power ? bridged(log.of(Role::power), t) : std::vector<double>(t.size(), 0.0);
  out.has_speed = log.has(Role::speed);
  in.speed_rad_per_s = out.has_speed ? bridged(log.of(Role::speed), t) : std::vector<double>(t.size(), 0.0);

  std::vector<double> sink;
  if (log.has(sink_of(log))) {
    sink = bridged(log.of(sink_of(log)), t);
    out.sink_unwatched = log.sink_typed;
    if (sink_of(log) == Role::coolant) out.notes.push_back("The coolant is taken as the sink.");
  } else {
    const double first = std::isnan(log.sink_degC) ? first_degC(log) : log.sink_degC;
    sink.assign(t.size(), first);
    out.sink_assumed = out.sink_unwatched = true;
    out.notes.push_back(fmt::format(
        "No ambient temperature was recorded; what the log begins at, {:.1f} degC, is taken for it.", first));
  }
  for (auto& b : in.boundary_degC) b = sink;
  out.has_frame = log.has(Role::frame);
  if (out.has_frame) in.boundary_degC[static_cast<int>(Boundary::frame)] = bridged(log.of(Role::frame), t);
  out.has_neighbour = log.has(Role::neighbour);
  if (out.has_neighbour) in.boundary_degC[static_cast<int>(Boundary::neighbour)] = bridged(log.of(Role::neighbour), t);
  return in;
}

void add_readings(Bins& out, const Log& log, Role role, double Bin::*value, float Bin::*where, float Bin::*number) {
  const auto& t = log.of(Role::time);
  const auto& y = log.of(role);
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (std::isnan(y[i])) continue;
    const double place = t[i] / out.width_s;
    const auto b = static_cast<std::size_t>(place + 1e-9);
    if (b >= out.bins.size()) continue;
    Bin& bin = out.bins[b];
    bin.*value = bin.*number == 0 ? y[i] : bin.*value + y[i];
    bin.*where += static_cast<float>(std::max(0.0, place - static_cast<double>(b)));
    bin.*number += 1;
  }
  for (Bin& bin : out.bins) {
    if (bin.*number == 0) continue;
    bin.*value /= static_cast<double>(bin.*number);
    bin.*where /= bin.*number;
  }
}

/// White noise of one row's current, from stretches in which nothing turns and hardly anything flows; those in which it
/// moves of itself do not count.
double noise_at_rest_A(const Inputs& in) {
  constexpr std::size_t rows = 20, least = 3;  // of the stretches: a middle one of three has one beside itself to spare
  // Of the log's rms, and more than its noise: where that was a fifth, at an eighth rest was not seen and a name became
  // a tie, at a half the name stayed (one hidden log, speed_cooling).
  constexpr double hardly = 0.25;
  // Times the middle one's square: white noise is more in one stretch of 340 (of 100,000 drawn).
  constexpr double still = 3;
  const double most2 = hardly * hardly * square(in.amplitude_A) / static_cast<double>(in.amplitude_A.size());
  std::vector<double> noise2;
  for (std::size_t from = 0; from + rows <= in.amplitude_A.size(); from += rows) {
    double sum2 = 0, second2 = 0, fastest = 0;
    for (std::size_t k = from; k < from + rows; ++k) {
      sum2 += in.amplitude_A[k] * in.amplitude_A[k];
      fastest = std::max(fastest, std::abs(in.speed_rad_per_s[k]));
      if (k >= from + 2) second2 += std::pow(in.amplitude_A[k] - 2 * in.amplitude_A[k - 1] + in.amplitude_A[k - 2], 2);
    }
    if (fastest < stalled_rad_per_s && sum2 <= rows * most2) noise2.push_back(second2 / (6 * (rows - 2)));
  }
  if (noise2.size() < least) return 0;
  const double most = still * median(noise2);
  double sum2 = 0, n = 0;
  for (const double x : noise2) {
    if (x <= most) sum2 += x, n += 1;
  }
  return std::sqrt(sum2 / n);
}

/// Where speed goes with the current it tells it too, and with less noise: heat that goes by speed would explain what
/// the current alone does. Each row's current moves towards what a polynomial in speed says of it, as far as noise is
/// part of what the two differ by; returns that share.
double moved_towards_speed(Inputs& in, double noise_A) {
  double fastest = 0;
  for (const double w : in.speed_rad_per_s) fastest = std::max(fastest, std::abs(w));
  if (!(noise_A > 0) || !(fastest > 0)) return 0;
  using Powers = Eigen::Vector<double, 8>;  // to the third, of size and with sign
  const auto powers = [&](std::size_t i) {
    const double w = std::abs(in.speed_rad_per_s[i]) / fastest, sign = in.speed_rad_per_s[i] < 0 ? -1 : 1;
    Powers p;
    p << 1, w, w * w, w * w * w, sign, sign * w, sign * w * w, sign * w * w * w;
    return p;
  };
  Eigen::Matrix<double, 8, 8> squares = Eigen::Matrix<double, 8, 8>::Zero();
  Powers products = Powers::Zero();
  for (std::size_t i = 0; i < in.amplitude_A.size(); ++i) {
    const Powers p = powers(i);
    squares += p * p.transpose();
    products += p * in.amplitude_A[i];
  }
  const Powers by_speed = squares.completeOrthogonalDecomposition().solve(products);
  double apart2 = 0;
  for (std::size_t i = 0; i < in.amplitude_A.size(); ++i)
    apart2 += std::pow(in.amplitude_A[i] - by_speed.dot(powers(i)), 2) / static_cast<double>(in.amplitude_A.size());
  const double share = std::min(1.0, noise_A * noise_A / apart2);
  if (share < 0.5) return 0;  // the current tells more than speed does
  for (std::size_t i = 0; i < in.amplitude_A.size(); ++i)
    in.amplitude_A[i] -= share * (in.amplitude_A[i] - by_speed.dot(powers(i)));
  return share;
}

/// Bin::housing_ahead and core_ahead, means over the bin's readings. Inputs hold from one sample to the next, and none
/// was read before the log began.
void add_ahead(Bins& out, const Log& log, const Inputs& in) {
  const auto& t = log.of(Role::time);
  const auto &housing = log.of(Role::housing), &core = log.of(Role::core);
  const auto heat = [&](std::size_t i) {
    return out.has_power ? in.power_W[i] : in.amplitude_A[i] * in.amplitude_A[i];
  };
  double integral = 0;  // since the bin began
  std::size_t now = 0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const std::size_t b = out.bin_at(t[i]);
    if (b >= out.bins.size()) break;
    const double into_s = std::max(0.0, t[i] - out.width_s * static_cast<double>(b));
    if (b != now) integral = i > 0 ? heat(i - 1) * into_s : 0;
    now = b;
    Bin& bin = out.bins[b];
    const double ahead = integral - bin.input[heater(out)] * into_s;
    if (!housing.empty() && !std::isnan(housing[i])) bin.housing_ahead += ahead / static_cast<double>(bin.housing_n);
    if (!core.empty() && !std::isnan(core[i])) bin.core_ahead += ahead / static_cast<double>(bin.core_n);
    if (i + 1 < t.size()) integral += heat(i) * (t[i + 1] - t[i]);
  }
}

/// Rows in which the bridge is on. A sensor's offset and noise at rest, four standard deviations of the current's (one
/// row in 16,000 has more) or a hundredth of the most that is read, do not switch it on.
std::vector<bool> enabled(const Inputs& in, double noise_A) {
  const auto least = [](const std::vector<double>& v) { return 0.01 * largest_magnitude(v); };
  const double least_A = std::max(4 * noise_A, least(in.amplitude_A));
  const double least_rad_per_s = least(in.speed_rad_per_s);
  std::vector<bool> on(in.amplitude_A.size());
  for (std::size_t i = 0; i < on.size(); ++i)
    on[i] = std::abs(in.amplitude_A[i]) > least_A || std::abs(in.speed_rad_per_s[i]) > least_rad_per_s;
  return on;
}

/// A whole number of samples a bin, so that all bins hold equally many.
double width_s_of(const Log& log, double usual_s, double finest_s) {
  const double duration_s = log.of(Role::time).back();
  const double wanted_s = std::max({usual_s, finest_s, duration_s / most_bins});
  return usual_s * std::max(1.0, std::round(wanted_s / usual_s));
}

/// Each sample's drives and boundaries, for as long as it holds, as means over the bins that it touches. `more_A2`:
/// what flows beside what the samples' squares say.
void add_inputs(Bins& out, const Log& log, double usual_s, const Inputs& in, double more_A2) {
  const auto& t = log.of(Role::time);
  std::vector<double> covered(out.bins.size(), 0.0);
  for (std::size_t i = 0; i < t.size(); ++i) {
    const double end = i + 1 < t.size() ? t[i + 1] : t[i] + usual_s;
    const bool pauses = i + 1 < t.size() && resumes(log, t[i], t[i + 1]);
    double from = t[i];
    for (std::size_t b = out.bin_at(from); b < out.bins.size() && from < end; ++b) {
      const double held = pauses && from > t[i] ? 0 : 1;  // for the rest of its bin: what flows in a pause is not known
      const double to = std::min(end, out.width_s * static_cast<double>(b + 1));
      const double share = std::max(0.0, to - from) / out.width_s;
      Bin& bin = out.bins[b];
      covered[b] += share;
      add_moment(bin, share, held * in.amplitude_A[i], held * in.sampled_A[i], held * in.speed_rad_per_s[i]);
      bin.input[Drive::current_A2] += share * held * more_A2;
      bin.input[Drive::power_W] += share * held * in.power_W[i];
      bin.input[Drive::enabled] += in.enabled[i] ? share * held : 0;
      for (int s = 0; s < thermal::boundary_count; ++s) bin.input.boundary_degC[s] += share * in.boundary_degC[s][i];
      from = to;
    }
  }
  for (std::size_t b = 0; b < out.bins.size(); ++b) {
    Bin& bin = out.bins[b];
    const double scale = covered[b] > 0 ? 1 / covered[b] : 0;
    for (double& d : bin.input.drive) d *= scale;
    for (double& d : bin.input.boundary_degC) d *= scale;
    bin.signed_A *= scale;
    bin.stalled_A2 *= scale;
  }
}

/// What a housing's first readings are averaged over at most: half a minute moves it little.
constexpr double first_s = 30;

double first_reading(const Bins& log, double Bin::*reading, std::size_t from, std::size_t to, int most,
                     double within_s = first_s) {
  double sum = 0;
  int n = 0;
  for (std::size_t k = from; k < to && n < most && static_cast<double>(k - from) * log.width_s < within_s; ++k) {
    if (!std::isnan(log.bins[k].*reading)) sum += log.bins[k].*reading, ++n;
  }
  return n > 0 ? sum / n : missing;
}

void find_starts(Bins& out, const Log& log) {
  for (const double s : log.resumes_s) {
    const std::size_t bin = out.bin_at(s);
    if (bin <= out.starts.back().bin || bin >= out.bins.size()) continue;
    const auto& t = log.of(Role::time);
    const double told_s = *std::prev(std::lower_bound(t.begin(), t.end(), s)) + out.interval_s;
    const auto silent = static_cast<std::size_t>(std::ceil(told_s / out.width_s - 1e-9));
    out.starts.push_back({.bin = bin, .paused = bin - std::min(silent, bin)});
  }
  for (std::size_t i = 0; i < out.starts.size(); ++i) {
    Start& start = out.starts[i];
    const std::size_t to = i + 1 < out.starts.size() ? out.starts[i + 1].bin : out.bins.size();
    start.core_degC = first_reading(out, &Bin::core_degC, start.bin, to, 1);
    start.housing_degC = first_reading(out, &Bin::housing_degC, start.bin, to, first_readings);
    // A coarse sensor says nothing before its first step, and no more than a step has passed until then.
    if (std::isnan(start.housing_degC))
      start.housing_degC = first_reading(out, &Bin::housing_degC, start.bin, to, 1, out.duration_s());
  }
  out.begins_warm = std::abs(out.starts.front().housing_degC - out.bins.front().input.boundary_degC[0]) >
                    soaked_K + out.housing_step_K;
}

void find_idle(Bins& out) {
  const auto heat = [by = heater(out)](const Bin& bin) { return std::abs(bin.input[by]); };
  double most_heat = 0, most_speed = 0;
  for (const Bin& bin : out.bins) {
    most_heat = std::max(most_heat, heat(bin));
    most_speed = std::max(most_speed, bin.input[Drive::speed_rad_per_s]);
  }
  // Nor does a sensor's noise end an idle stretch.
  const double noise_A2 = out.has_power ? 0 : out.current_noise_A * out.current_noise_A;
  const double least_heat = std::max(idle_heat_share * most_heat, 4 * noise_A2);
  for (Bin& bin : out.bins)
    bin.idle = heat(bin) <= least_heat && bin.input[Drive::speed_rad_per_s] <= idle_speed_share * most_speed + 1e-9;
}

}  // namespace

void add_moment(Bin& bin, double share, double amplitude_A, double sampled_A, double speed_rad_per_s) {
  const double a = std::abs(sampled_A), w = std::abs(speed_rad_per_s), a2 = amplitude_A * amplitude_A;
  thermal::HeatInput<>& in = bin.input;
  in[Drive::one] += share;
  in[Drive::current_A2] += share * a2;
  in[Drive::current_A] += share * a;
  in[Drive::speed_rad_per_s] += share * w;
  in[Drive::speed2_rad2_per_s2] += share * w * w;
  in[Drive::speed3_rad3_per_s3] += share * w * w * w;
  in[Drive::current2_speed2] += share * a * a * w * w;
  in[Drive::current_speed] += share * a * w;
  in[Drive::speed_to_0_8] += share * (w > 0 ? std::pow(w, 0.8) : 0);
  bin.signed_A += share * sampled_A;
  bin.stalled_A2 += w < stalled_rad_per_s ? share * a2 : 0;
}

Bins bins_of(const Log& log, double finest_s) {
  Bins out;
  out.name = log.name;
  out.missing_share = log.missing_share;
  out.gap_share = log.gap_share;
  out.housing_step_K = log.housing_step_K;
  out.core_step_K = log.core_step_K;
  out.core_reference = log.core_reference;
  out.notes = log.notes;
  out.has_housing = log.has(Role::housing);
  out.has_core = log.has(Role::core);
  out.housing_noise_K =
      log.housing_step_K > 0 ? step_noise_share * log.housing_step_K : reading_noise(log.of(Role::housing));
  out.core_noise_K = reading_noise(log.of(Role::core));

  const auto& t = log.of(Role::time);
  const double usual_s = row_period_s(t);
  const auto refuse_log = [&](const std::string& what) { wire::pc::refuse_data(log.name + ": " + what); };
  if (t.size() > 1 && !(usual_s > 0))
    refuse_log("most rows have the time of the row before them; write the time with more digits, or each row once.");
  if (t.size() < 30)
    refuse_log(
        fmt::format("only {} row{} over {:.1f} s, and 30 are the least to fit a motor; record more of them (a "
                    "temperature that was read now and then may leave its cell empty).",
                    t.size(), t.size() == 1 ? "" : "s", t.back()));
  if (std::isnan(first_degC(log)))
    refuse_log(
        fmt::format("no temperature is read in its {:.0f} s; hold out less, or read the sensor earlier.", t.back()));
  out.interval_s = usual_s;
  out.width_s = width_s_of(log, usual_s, finest_s);
  const auto count = static_cast<std::size_t>((t.back() + usual_s) / out.width_s + 1e-6);
  out.bins.assign(std::max<std::size_t>(count, 1), Bin{});
  for (Bin& bin : out.bins) bin.housing_degC = bin.core_degC = missing;
  Inputs in = inputs_of(log, out);
  out.current_noise_A = noise_at_rest_A(in);
  const bool rippled = in.sampled_A != in.amplitude_A;
  const double to_speed = moved_towards_speed(in, out.current_noise_A);
  if (!rippled) in.sampled_A = in.amplitude_A;
  in.enabled = enabled(in, out.current_noise_A);
  out.noisy_share = 1 - to_speed;
  // What rest shows flows, or is the sensor's: half of it is taken for heat, and fits average over the other (leeway).
  // Of the square of a current that was moved, noise left less than nothing.
  const double noise2_in_square = to_speed > 0 ? to_speed - 1 : 1;
  add_inputs(out, log, usual_s, in, (0.5 - noise2_in_square) * out.current_noise_A * out.current_noise_A);
  if (!log.has(Role::speed)) {
    for (Bin& bin : out.bins) bin.stalled_A2 = 0;  // it may have turned
  }
  add_readings(out, log, Role::housing, &Bin::housing_degC, &Bin::housing_at, &Bin::housing_n);
  add_readings(out, log, Role::core, &Bin::core_degC, &Bin::core_at, &Bin::core_n);
  add_ahead(out, log, in);
  find_starts(out, log);
  find_idle(out);
  return out;
}

void forget_readings(Bins& log, std::size_t from, std::size_t before) {
  for (std::size_t k = from; k < std::min(before, log.bins.size()); ++k) {
    log.bins[k].housing_n = log.bins[k].core_n = 0;
    log.bins[k].housing_degC = log.bins[k].core_degC = missing;
  }
}

Bins merged(const Bins& log, std::size_t together) {
  Bins out = log;
  out.width_s = log.width_s * static_cast<double>(together);
  out.bins.clear();
  for (Start& start : out.starts) start.bin = (start.bin + together - 1) / together, start.paused /= together;
  // Of a bin in which the log begins again only what was before.
  const auto begun_again = [&](std::size_t k) {
    return std::any_of(log.starts.begin(), log.starts.end(), [&](const Start& start) {
      return start.bin % together != 0 && k >= start.bin && k / together == start.bin / together;
    });
  };
  for (std::size_t first = 0; first < log.bins.size(); first += together) {
    const std::size_t count = std::min(together, log.bins.size() - first);
    const double share = 1 / static_cast<double>(count);
    Bin all{};
    all.idle = true;
    const auto add_reading = [&](const Bin& bin, std::size_t k, double Bin::*value, float Bin::*where,
                                 float Bin::*number) {
      if (bin.*number == 0 || begun_again(first + k)) return;
      all.*number += bin.*number;
      const float part = bin.*number / all.*number;
      all.*value += (bin.*value - all.*value) * static_cast<double>(bin.*number) / static_cast<double>(all.*number);
      all.*where += ((static_cast<float>(k) + bin.*where) / static_cast<float>(together) - all.*where) * part;
    };
    for (std::size_t k = 0; k < count; ++k) {
      const Bin& bin = log.bins[first + k];
      for (int d = 0; d < thermal::drive_count; ++d) all.input.drive[d] += share * bin.input.drive[d];
      for (int b = 0; b < thermal::boundary_count; ++b)
        all.input.boundary_degC[b] += share * bin.input.boundary_degC[b];
      all.signed_A += share * bin.signed_A;
      all.stalled_A2 += share * bin.stalled_A2;
      all.uneven_A4 += share * bin.uneven_A4;
      all.idle = all.idle && bin.idle;
      add_reading(bin, k, &Bin::housing_degC, &Bin::housing_at, &Bin::housing_n);
      add_reading(bin, k, &Bin::core_degC, &Bin::core_at, &Bin::core_n);
    }
    double ahead = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const Bin& bin = log.bins[first + k];
      const double more = bin.input[heater(log)] - all.input[heater(log)];
      const auto at_reading = [&](float where, double own, float n, float of) {
        return n > 0 && of > 0
                   ? (ahead + more * log.width_s * static_cast<double>(where) + own) * static_cast<double>(n / of)
                   : 0;
      };
      all.housing_ahead += at_reading(bin.housing_at, bin.housing_ahead, bin.housing_n, all.housing_n);
      all.core_ahead += at_reading(bin.core_at, bin.core_ahead, bin.core_n, all.core_n);
      ahead += more * log.width_s;
    }
    if (all.housing_n == 0) all.housing_degC = missing;
    if (all.core_n == 0) all.core_degC = missing;
    out.bins.push_back(all);
  }
  return out;
}

}  // namespace identify
