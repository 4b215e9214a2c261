// SPDX-License-Identifier: MIT
// Which causes does the data ask for? Fits every cause alone, then every pair worth it, and decides, or abstains.
//
// A wrong name is worse than no name. The decision therefore knows five ends: nothing is missing; one set of causes
// stands clear; several sets are as good (a tie); something is missing and no known cause explains it; too poor to say.
#pragma once

#include "identify/search/candidates.hpp"
#include "identify/search/doing.hpp"

namespace identify {

/// What the decision asks for: twice the logarithm of evidence where nothing else is said.
struct Margins {
  /// 3 alarms on 1000 clean logs (duty and designed, seeds from 3200); by chance evidence is exceeded e times less
  /// often for every two more.
  double detect = 13;
  double second = 10, tie = 6;  // a slow disturbance without a name is a rival as well
  /// Of a motor with a sheet, a cause alone that leads others alone by so much is named. With 6 here as well, 27 more
  /// of 1469 logs were a tie that began with the truth, and 3 one that did not (duty and designed, seeds 72000 to
  /// 72019, as far as looked at). Elsewhere the lead stays 6: two causes together imitate what is in no table more
  /// often (of 78 logs with the truth taken out, seeds 81000 to 81002, 3 more would be named), and without a sheet 3 of
  /// 5 more names were wrong (of 224 logs, seeds 770, 91000 and 91001).
  double tie_alone = 3;
  /// Pairs that are behind by less are asked again where the housing is believed no closer than a model can be right,
  /// and are tied with the best that they are near there. Of 13 logs, a row a second, of a motor of three masses in a
  /// row two were named wrongly, and are tied with the truth now; of 52 logs with two effects (score pairs-duty and
  /// pairs-designed, seed 770) one of 39 right names became a tie, and of 14 with effects outside the table (--blind,
  /// seed 890) none changed.
  double pairs_near = 60;
  /// Of a set where the housing is believed no closer than a model can be right. Of 36 whole boards with nothing hidden
  /// one gained 19.0 and the others too little to be asked (gain --clean, designed 5001 to 5016 and 5201 to 5208, duty
  /// 5101 to 5112); radiation of a whole board (4109) gained 18.1 and 18.8, a board_heat (score, 771132) 18.8, and 157
  /// other effects rightly named 30 and more.
  double still = 15;
  /// Of a cause that is too little for a name, in the same way, for a board not to take it for excluded. Of 36 boards
  /// with nothing hidden (those of `still`) one's hot spot gained more (5015); four that sparse readings do not name
  /// (gain, seeds 504, 1810, 10083, 10094) gained 1.1 to 8.7.
  double likelier = 1;
  /// Of a slow disturbance beside a set of causes: above it the set is not complete. Rightly named causes gained less
  /// than 4 in 19 of 20 logs and 12.5 at most (157 logs, duty and designed, seeds 660, 661, 800, 801).
  double remains = 15;
  /// Of parts of the log that are fitted each for itself, the housing believed no closer than a model can be right:
  /// above it one set of parameters does not serve all. Rightly named sets gained 17.9 at most (87 logs, duty and
  /// designed, seeds 900, 901), effects outside the table 19 and more in 30 of 36 (seeds 900 to 902).
  double parts = 18.5;
  /// What is explained over what is left, to be named as the larger part. Of effects outside the table that left more
  /// than `remains` 2 of 34 passed (seeds 870 to 873), of one effect over eleven small ones 28 of 35 (770, 870, 871).
  double dominance = 4;
  /// Or: the disturbance left beside the causes, of what the baseline misses, K over K. Ten drives of a traction motor
  /// of five masses, simulated apart from this repository and read to 0.05 K, left 0.015 to 0.037. Outside effects that
  /// nothing else names left 0.08 and more (140 logs, duty and designed, seeds 870 to 872, 890, 891, 895 to 897, 900,
  /// 901), but for one thermostat (901), every answer to which then holds a cooling change.
  double small_part = 0.05;
  /// The same where no rest shows how the sensors wander: what is left may be theirs. Beside an imitation, outside
  /// effects left 0.1 and more in 25 of 26 such logs (seeds 660, 661, 800, 801).
  double small_part_unrested = 0.1;
  /// The same for a tie: nine tenths of the squares are then explained. Not enough for a name.
  double small_part_unseen = 0.3;
  /// Sets that differ by less than this times what the best leaves are near it: a winding wanders twice as much.
  double left_apart = 2;
  /// What the noise of the current moves, so many times, may be that: a cause must move more, and sets that differ by
  /// less are tied. Two standard deviations: speed that goes with the current tells it with less noise, and explained
  /// better what the current alone explains.
  double of_current = 2;
  /// Of averages of speed, what two sets that both go by speed may differ by in evidence, as a share of it: an average
  /// tells no squares. Of 10 logs of 1 s averages of a walk whose motor hides a law of speed, a wrong law led the right
  /// one by up to 6 % (host-sim record duty --hide, seeds 12 to 46).
  double of_averaged_speed = 0.1;
  /// What a cause must move, rms, in the winding or at the sensor, to be worth a name: a thermistor's wander.
  double worth_K = 0.05;
  /// The same of a second cause: thrice that.
  double noticeable_K = 0.15;
  /// Of a slow disturbance, to be more than sensors': somewhat above that wander. None of 200 clean logs (duty and
  /// designed, seeds 790, 791, structure 0.1 and 1) and of 20 whole boards (gain --clean, designed 5001 to 5008, duty
  /// 5101 to 5112) is called unknown by it.
  double disturbed_K = 0.06;
};

/// Of each log, what a veto is tried on: three quarters are left to show every kind of load.
inline constexpr double veto_share = 0.25;

enum class Verdict { adequate, explained, partly_explained, ambiguous, unknown_cause, insufficient };
const char* word(Verdict verdict);
/// Of the whole or of most of it.
inline bool names_causes(Verdict v) { return v == Verdict::explained || v == Verdict::partly_explained; }

/// Is one of its masses a winding? Those shipped are within a factor of two of their sheet; a hot spot may be the
/// winding, and what is heavy its teeth. Without a sheet: a winding heavier than any housing beside a hot spot is none.
bool holds_a_winding(const Problem& problem, const Fit& fit);

struct Found {
  Fit plain_baseline;  // without leeway, to the noise of the recording
  Candidate baseline;
  std::vector<Candidate> singles;              // best first, one per cause (per log for causes that pick one)
  std::vector<Candidate> sets;                 // sets of the size that was chosen, best first
  Candidate chosen;                            // what is believed best, whatever the verdict
  std::vector<std::vector<std::string>> tied;  // ids of the sets that are as good as the best, itself first
  std::vector<double> own_evidence;            // of each cause chosen: over the set without it
  double early_s = 0;    // by how much temperatures are ahead of the load: the last readings of each log were left out
  double remains_K = 0;  // of a slow disturbance that the sets named or tied leave
  bool doubted = false;  // no cause is known, for a slow disturbance explains as much as the first set
  Noise noise;           // of the readings, as the best model's residuals show it
  Verdict verdict = Verdict::insufficient;
  std::vector<std::string> steps;  // the reasoning in plain words
};

/// `without`: ids left out of the table (tests take the truth away and expect "unknown"). Insufficient where no motor
/// near what is believed can be simulated.
Found search(const Problem& problem, const Margins& margins = {}, const std::vector<std::string>& without = {},
             const Tell& doing = tell_nobody);

}  // namespace identify
