// SPDX-License-Identifier: MIT
#include "thermal/housing_watch.hpp"

#include <cmath>

namespace thermal {

namespace {

constexpr float dt_s = static_cast<float>(estimator_dt_s);

// A thermistor chain that is alive reads within these (both rails of the divider lie far outside).
constexpr float coldest_reading_degC = -40.0f, hottest_reading_degC = 200.0f;

constexpr int missing_steps = 10;       // 100 ms without a reading: safety table, NTC open or short
constexpr int slow_window_steps = 200;  // a sensor that needs longer to fill a window is no better than none: chosen
constexpr int known_after_means = 120;  // a minute: what a start without memory takes to prove itself

constexpr float most_pull_K = 3.5f;  // safety table: no winding is lowered by more than 5 K, which is 1.4 times that
constexpr float suspicious_pull_K = 0.3f;  // lowered by less, a stuck sensor does little harm: chosen
constexpr float pull_forgotten_K = most_pull_K / 1200.0f * dt_s;  // in 20 min, as slowly as an ambient drifts

// What of a movement is forgotten in a step: in 120 s (safety table: stuck or detached is found within that load).
constexpr float leak = dt_s / 120.0f;
// Of what the model expects: a sensor that comes off by half is not alive. Above 0.7 honest sensors fail as well, on
// motors that their sheet does not fit (at 0.9 these lose a tenth of their A^2 s, at 0.7 a hundredth).
constexpr float enough_movement_K = 3.0f, alive_share = 0.7f, stuck_share = 0.25f;
// A reading that falls by twice what the model does, and by this more, has come off a motor that cools: chosen; a motor
// of 60 K above a frost that its model does not know of falls by as much more in two minutes.
constexpr float off_share = 2.0f, off_K = 10.0f;

}  // namespace

bool Reading::usable() const { return valid && value > coldest_reading_degC && value < hottest_reading_degC; }

void HousingWatch::model_moved(float to_degC) {
  model_moved_K_ += to_degC - model_degC_ - leak * model_moved_K_;
  model_degC_ = to_degC;
  pulled_K_ = pulled_K_ > pull_forgotten_K ? pulled_K_ - pull_forgotten_K : 0.0f;
}

HousingWatch::Heard HousingWatch::hear(Reading reading, double model_degC) {
  Heard heard{};
  const bool usable = reading.usable();
  if (steps_since_full_ < slow_window_steps) ++steps_since_full_;
  if (!usable && silent_steps_ < missing_steps) ++silent_steps_;
  if (usable) silent_steps_ = 0;
  const bool silent = silent_steps_ == missing_steps, slow = steps_since_full_ == slow_window_steps;
  if ((silent || slow) && !missing_) heard.fell_silent = missing_ = true;
  if (silent) drop_window();
  if (!usable) return heard;
  reading_sum_degC_ += static_cast<double>(reading.value);
  model_sum_degC_ += model_degC;
  if (++window_ < window_steps) return heard;

  heard.full = true;
  heard.first = !read_;
  heard.reading_degC = static_cast<float>(reading_sum_degC_ / window_);
  heard.above_model_K = static_cast<float>((reading_sum_degC_ - model_sum_degC_) / window_);
  drop_window();
  steps_since_full_ = 0;
  if (!slow) missing_ = false;
  if (!read_) reading_slow_degC_ = heard.reading_degC;
  read_ = true;
  reading_slow_degC_ += (heard.reading_degC - reading_slow_degC_) * (window_steps * leak);
  reading_moved_K_ = heard.reading_degC - reading_slow_degC_;
  return heard;
}

void HousingWatch::drop_window() {
  window_ = 0;
  reading_sum_degC_ = model_sum_degC_ = 0.0;
}

bool HousingWatch::meet(bool sure, double ambient_degC) {
  trusted_ambient_degC_ = ambient_degC;
  housing_known_ = sure || ++met_ >= known_after_means;
  return housing_known_;
}

void HousingWatch::know_housing(double ambient_degC) {
  trusted_ambient_degC_ = ambient_degC;
  housing_known_ = true;
}

/// A sensor that moves with the load earns a new budget; one that stands still while the model moves is not believed.
HousingWatch::Verdict HousingWatch::judge(float above_model_K, float sigma_K, float kept_K, double ambient_degC) {
  Verdict verdict{};
  const float expected_K = std::abs(model_moved_K_);
  const float moved_K = model_moved_K_ < 0.0f ? -reading_moved_K_ : reading_moved_K_;
  const bool tested = expected_K >= enough_movement_K;
  const bool fallen = moved_K > off_share * expected_K && moved_K > expected_K + off_K;
  verdict.lives = tested && moved_K >= alive_share * expected_K && !fallen;
  verdict.warms = verdict.lives && model_moved_K_ > 0.0f;
  if (verdict.lives) {
    pulled_K_ = 0.0f;
    trusted_ambient_degC_ = ambient_degC;
  }
  const float gate_K = std::fmax(gate_sigmas * sigma_K, least_gate_K);
  const bool stuck = tested && moved_K < stuck_share * expected_K && pulled_K_ > suspicious_pull_K;
  const bool pulls_on = above_model_K < -least_gate_K - kept_K && pulled_K_ >= most_pull_K;
  verdict.believed = above_model_K > -gate_K - kept_K && !(above_model_K < 0.0f && (stuck || pulls_on));
  verdict.believed_till_now = !contradicts_;
  contradicts_ = !verdict.believed;
  if (!verdict.believed) return verdict;
  // Hotter than believable counts for as much as is believable, and each further time for twice as much: a glitch of a
  // second would raise the ambient for hours, and a housing that stays hot is followed within seconds.
  const float most_up_K = std::fmax(gate_K, hotter_K_);
  hotter_K_ = above_model_K > most_up_K ? 2.0f * most_up_K : 0.0f;
  verdict.counts_as_above_K = std::fmin(above_model_K, most_up_K);
  verdict.most_down_K = std::fmax(most_pull_K - pulled_K_, 0.0f);
  return verdict;
}

void HousingWatch::note_pull(float down_K) { pulled_K_ = std::fmax(pulled_K_ + down_K, 0.0f); }

}  // namespace thermal
