// SPDX-License-Identifier: MIT
#include "thermal/housing_watch.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace {

using thermal::HousingWatch;
using thermal::Reading;

const Reading none{0.0f, false};

/// The model and the sensor go from one temperature to another in so many seconds; returns the last verdict.
HousingWatch::Verdict move(HousingWatch& watch, float model_from_degC, float model_by_K, float reads_from_degC,
                           float reads_by_K, int seconds) {
  HousingWatch::Verdict verdict{};
  for (int step = 1; step <= 100 * seconds; ++step) {
    const float share = static_cast<float>(step) / static_cast<float>(100 * seconds);
    const float model_degC = model_from_degC + share * model_by_K;
    watch.model_moved(model_degC);
    const auto heard = watch.hear({reads_from_degC + share * reads_by_K, true}, static_cast<double>(model_degC));
    if (heard.full) verdict = watch.judge(heard.above_model_K, 0.5f, 0.0f, 25.0);
  }
  return verdict;
}

HousingWatch known_at(float degC) {
  HousingWatch watch;
  watch.model_jumped(degC);
  watch.know_housing(25.0);
  move(watch, degC, 0.0f, degC, 0.0f, 1);
  return watch;
}

TEST(HousingWatch, GivesTheMeanOfHalfASecondAndLeavesOutWhatIsNoReading) {
  HousingWatch watch;
  int full = 0;
  for (int step = 0; step < 200; ++step) {
    const Reading reading = step % 4 == 1   ? none
                            : step % 4 == 2 ? Reading{std::nanf(""), true}
                                            : Reading{step % 4 == 0 ? 30.0f : 32.0f, true};
    const auto heard = watch.hear(reading, 30.0);
    if (!heard.full) continue;
    EXPECT_EQ(heard.first, full == 0);
    EXPECT_EQ(heard.reading_degC, 31.0f);
    EXPECT_EQ(heard.above_model_K, 1.0f);
    ++full;
  }
  EXPECT_EQ(full, 2) << "half of the readings are none";
  EXPECT_FALSE(watch.missing());
}

TEST(HousingWatch, MissesASensorAfter100MsOfSilenceAndOneThatIsTooSlow) {
  HousingWatch silent, slow;
  for (int step = 1; step <= 20; ++step) {
    EXPECT_EQ(silent.hear(none, 25.0).fell_silent, step == 10) << "said once";
    EXPECT_EQ(silent.missing(), step >= 10);
  }
  for (int step = 1; step <= 300; ++step) {
    (void)slow.hear(step % 5 == 0 ? Reading{25.0f, true} : none, 25.0);
    EXPECT_EQ(slow.missing(), step >= 200) << "fifty readings in two and a half seconds";
  }
}

TEST(HousingWatch, ASensorMayLowerALittleUntilItMovesWithTheLoad) {
  HousingWatch watch = known_at(40.0f);
  watch.note_pull(2.0f);
  EXPECT_NEAR(move(watch, 40.0f, 0.0f, 39.0f, 0.0f, 1).most_down_K, 1.5f, 0.01f);
  const auto verdict = move(watch, 40.0f, 5.0f, 39.0f, 5.0f, 10);
  EXPECT_TRUE(verdict.lives);
  EXPECT_EQ(verdict.most_down_K, 3.5f);
  EXPECT_EQ(watch.pulled_K(), 0.0f);
}

TEST(HousingWatch, OneThatStandsStillInALoadIsNotBelievedOnceItHasLowered) {
  for (const float pulled_K : {0.0f, 1.0f}) {
    HousingWatch watch = known_at(40.0f);
    watch.note_pull(pulled_K);
    const auto verdict = move(watch, 40.0f, 4.0f, 40.0f, 0.0f, 10);
    EXPECT_FALSE(verdict.lives);
    EXPECT_EQ(verdict.believed, pulled_K == 0.0f) << "it stands still, and has done no harm yet";
    EXPECT_EQ(watch.contradicts(), pulled_K > 0.0f);
  }
}

TEST(HousingWatch, OneThatComesOffAMotorWhichCoolsDoesNotLive) {
  HousingWatch honest = known_at(90.0f), off = known_at(90.0f);
  EXPECT_TRUE(move(honest, 90.0f, -5.0f, 90.0f, -5.0f, 10).lives);
  EXPECT_FALSE(move(off, 90.0f, -5.0f, 90.0f, -40.0f, 10).lives);
  EXPECT_TRUE(off.contradicts());
}

TEST(HousingWatch, HotterThanBelievableCountsTwiceAsMuchEachTime) {
  HousingWatch watch = known_at(40.0f);
  float expected_K = 5.0f;
  for (int mean = 0; mean < 4; ++mean, expected_K *= 2.0f)
    EXPECT_EQ(watch.judge(100.0f, 0.5f, 0.0f, 25.0).counts_as_above_K, expected_K);
  EXPECT_EQ(watch.judge(1.0f, 0.5f, 0.0f, 25.0).counts_as_above_K, 1.0f);
  EXPECT_EQ(watch.judge(100.0f, 0.5f, 0.0f, 25.0).counts_as_above_K, 5.0f) << "from the beginning again";
}

TEST(HousingWatch, NotANumberIsNotBelieved) {
  HousingWatch watch = known_at(40.0f);
  EXPECT_FALSE(watch.judge(std::nanf(""), 0.5f, 0.0f, 25.0).believed);
}

}  // namespace
