// SPDX-License-Identifier: MIT
#include "identify/discover.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "identify/answer/answer.hpp"
#include "identify/answer/experiment.hpp"
#include "identify/answer/gain.hpp"
#include "identify/answer/held_out.hpp"
#include "identify/answer/model_file.hpp"
#include "identify/answer/refusals.hpp"
#include "identify/answer/untold.hpp"
#include "identify/fit/leeway.hpp"
#include "identify/fit/replayed.hpp"
#include "identify/log/masks.hpp"
#include "identify/search/problem_of.hpp"
#include "identify/search/search.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

/// The most current an experiment may ask for, amplitude: what the logs show the motor and its drive to bear, or three
/// times the rating, an ordinary overload for seconds.
double most_A(const Problem& problem, const std::optional<wire::pc::MotorFile>& motor) {
  double square = 0;
  for (const Bins& log : problem.logs) {
    for (const Bin& bin : log.bins) square = std::max(square, bin.input[thermal::Drive::current_A2]);
  }
  const double rated_A = motor ? motor->motor.rated_current_A * amplitude_per_direct : 0;
  return std::max(std::sqrt(square), 3 * rated_A);
}

/// Logs to be fitted or scored together must have the same kind of heat; what else only some of them hold is taken for
/// nothing in the others, and said.
void compare_columns(const std::vector<Log>& logs, Report& report) {
  const Log& first = logs.front();
  for (const Log& log : logs) {
    if (log.has(Role::power) != first.has(Role::power) || log.torque_for_A != first.torque_for_A) {
      wire::pc::refuse_data(fmt::format("{}: its heat is recorded as a {}, that of {} as a {}; give logs of one kind.",
                                        log.name, heat_word(log), first.name, heat_word(first)));
    }
  }
  const std::pair<Role, const char*> taken[] = {{Role::speed, "nothing in it is taken to go by speed"},
                                                {Role::neighbour, "the neighbour is taken to be as warm as the sink"},
                                                {Role::frame, "the frame is taken to be as warm as the sink"}};
  for (const auto& [role, as] : taken) {
    const auto has = [role = role](const Log& log) { return log.has(role); };
    if (std::none_of(logs.begin(), logs.end(), has)) continue;
    for (const Log& log : logs) {
      if (!has(log))
        report.notes.push_back(
            fmt::format("{}: {} is missing, which another log has; {}.", log.name, own_name(role), as));
    }
  }
}

/// Two resistors as the motor's sheet has them, in place of those that were fitted.
Fit of_the_sheet(const Problem& problem, Fit fitted) {
  const Belief& sheet = problem.belief;
  fitted.x.head(4) << std::log(sheet.R1_K_per_W), std::log(sheet.R2_K_per_W), std::log(sheet.C1_J_per_K),
      std::log(sheet.C2_J_per_K);
  return fitted;
}

/// What a board is given. Where the data cannot choose, it must not take the milder model for true: of sets that tie or
/// are nearly as good as the named one, and of two resistors and what is likelier by the log and only too little to be
/// named, it gets the one that bears a push the shortest. Where nothing explains the log, no fit is worth more than a
/// sheet: of the sheet itself, too.
Offer for_the_board(const Problem& problem, const Found& found, const Fit& best, Report& report) {
  const bool unexplained = found.verdict == Verdict::unknown_cause || found.verdict == Verdict::insufficient;
  const thermal::Trust trust = trust_of(problem, best, unexplained ? thermal::sheet_trust : thermal::identified_trust);
  std::vector<Offer> open = {{best, trust}};
  if (names_causes(found.verdict) || found.verdict == Verdict::ambiguous) {
    for (const Candidate& c : found.sets) {
      if (c.likely) open.push_back({c.fit, trust_of(problem, c.fit)});
    }
  }
  if (found.verdict == Verdict::adequate) {
    for (const Candidate& c : found.singles) {
      if (c.likely) open.push_back({c.fit, trust});
    }
  }
  if (unexplained && problem.belief.known) open.push_back({of_the_sheet(problem, best), thermal::sheet_trust});
  if (open.size() == 1) return open.front();
  Offer given = most_cautious(problem, open);
  const std::string what = !given.fit.chosen.empty() ? listed(names_of(given.fit.chosen), " and ")
                           : given.fit.x == best.x   ? "two resistors"
                                                     : "two resistors of the sheet";
  report.reasoning.push_back(fmt::format(
      "The model written for the board is, of those that {}, the one that bears a push the shortest: {}.",
      unexplained ? "nothing speaks for (the fit, and the sheet)" : "the log bears out about as well", what));
  return given;
}

/// By how many rows the temperatures are ahead of the load. Many loggers write with a row what flowed before it.
double rows_ahead(const Problem& problem, const Fit& f) {
  const int delay = coordinate_of(f, Edit::delay);
  return delay < 0 ? 0 : -f.x[delay] / problem.logs.front().interval_s;
}

/// The search, and what speaks against answering by it.
struct Judged {
  Found found;
  std::string poor;     // why there is no verdict; empty: there is one
  bool misses = false;  // two resistors, more than noise explains: only the log is too short to say why
  bool vetoed = false;
};

/// Readings whose load is in no log are left out of the problem. `held_out`: part of the data is, and a cause that
/// spoils the last quarter of the rest is refused.
Judged judged(Problem& problem, const std::vector<Log>& logs, const std::optional<wire::pc::MotorFile>& motor,
              bool held_out, const Tell& doing) {
  Judged out;
  auto& [found, poor, misses, vetoed] = out;
  poor = too_poor(problem, logs);
  if (!poor.empty()) return out;
  found = search(problem, {}, {}, doing);
  if (found.early_s > 0) problem = heard(std::move(problem), found.early_s);
  doing("asking whether the logs can tell, and whether they are read right");
  poor = too_short(problem, found);
  misses = !poor.empty() && found.verdict != Verdict::adequate;
  if (poor.empty()) poor = suspicion(problem, found, logs, motor);
  if (poor.empty()) poor = clipped(found, logs);
  if (poor.empty()) poor = too_sparse(problem, found, logs);
  if (poor.empty()) poor = masses_in_each_others_place(problem, found, logs, motor);
  if (!poor.empty() || !held_out || found.chosen.fit.chosen.empty()) return out;
  const std::string refused = veto(problem, found.baseline.fit, found.chosen.fit);
  vetoed = !refused.empty();
  if (vetoed && found.verdict != Verdict::unknown_cause) {
    found.verdict = Verdict::unknown_cause;
    found.tied.clear();
    found.steps.push_back(refused);
  }
  return out;
}

/// The same fit, as unsure as a winding leaves it that is not read; what a sheet says of it is believed beside that.
Fit as_unsure_as_unseen(const Problem& problem, Fit f) {
  if (problem.any_core() || !f.valid()) return f;
  Problem unsure = problem;
  unsure.leeway = ordinary_leeway(problem, f);
  for (Leeway& more : leeway_of_an_unseen_winding(problem, f)) unsure.leeway.push_back(std::move(more));
  return as_wide_as_its_ridge(unsure, std::move(f));
}

/// All that is stated, or may be given to a board.
void widen_along_ridges(const Problem& problem, Found& found) {
  std::vector<Fit*> stated = {&found.baseline.fit, &found.chosen.fit};
  for (std::vector<Candidate>* some : {&found.singles, &found.sets}) {
    for (Candidate& c : *some) {
      if (c.likely) stated.push_back(&c.fit);
    }
  }
  for (Fit* f : stated) *f = as_unsure_as_unseen(problem, std::move(*f));
}

/// The answer with each row's current taken for what flowed before it, where that is why the load is ahead. Half a row
/// is averaged over (leeway.cpp). About one is a row's, and so is more where nothing remains of it then.
std::optional<Report> read_a_row_sooner(double ahead_rows, const std::vector<Log>& given,
                                        const std::optional<wire::pc::MotorFile>& motor, const HoldOut& held,
                                        const Tell& doing) {
  if (ahead_rows <= 0.6 || given.front().loaded_before) return std::nullopt;
  std::vector<Log> sooner = given;
  HoldOut held_sooner = held;
  for (std::vector<Log>* some : {&sooner, &held_sooner.logs})
    std::transform(some->begin(), some->end(), some->begin(),
                   [](const Log& log) { return loaded_before(log, "the temperatures ask it"); });
  Report report = discover(sooner, motor, held_sooner, doing);
  const bool remains =
      std::any_of(report.causes.begin(), report.causes.end(), [](const CauseLine& c) { return c.id == "clock_delay"; });
  if (ahead_rows >= 1.4 && remains) return std::nullopt;
  return report;
}

/// Where the logs together have no plain answer, or one that is of a log alone which lacks a column that others have:
/// the answer of those that have all of them. What that column would tell may be all that sets the others apart.
std::optional<Report> read_without_poorer_logs(const Found& found, const std::string& poor,
                                               const std::vector<Log>& given,
                                               const std::optional<wire::pc::MotorFile>& motor, const HoldOut& held,
                                               const Tell& doing) {
  std::string notes;
  std::vector<Log> whole;
  std::vector<bool> lacks;
  for (const Log& log : given) {
    std::string missing;
    for (const Role role : {Role::speed, Role::neighbour, Role::frame}) {
      const bool elsewhere = std::any_of(given.begin(), given.end(), [&](const Log& other) { return other.has(role); });
      if (elsewhere && !log.has(role)) missing = own_name(role);
    }
    lacks.push_back(!missing.empty());
    if (missing.empty())
      whole.push_back(log);
    else
      notes += fmt::format(" {} was left out: {} is missing in it, which may be why it does not go with the rest.",
                           log.name, missing);
  }
  if (notes.empty() || whole.empty()) return std::nullopt;
  const bool of_a_poorer =
      std::any_of(found.chosen.fit.chosen.begin(), found.chosen.fit.chosen.end(),
                  [&](const Chosen& c) { return c.log >= 0 && lacks[static_cast<std::size_t>(c.log)]; });
  const bool plain = poor.empty() && (found.verdict == Verdict::adequate || names_causes(found.verdict));
  if (plain && !of_a_poorer) return std::nullopt;
  Report report = discover(whole, motor, held, doing);
  if (report.verdict == Verdict::insufficient) return std::nullopt;
  report.sentence += notes;
  return report;
}

/// Why no board gets a set; empty when one does.
std::string why_no_model(const Problem& problem, const std::vector<Log>& logs, const Fit& offered,
                         const std::string& poor) {
  if (!poor.empty()) return "this log cannot tell; run the board with the motor's sheet";
  if (problem.heated_by_power()) return "the log tells a power and a board measures a current; record current_A";
  if (!problem.in_amperes()) return "the log tells a torque and a board measures a current; give --motor FILE";
  const auto needs = [&](Needs what) {
    return std::any_of(offered.chosen.begin(), offered.chosen.end(),
                       [what](const Chosen& c) { return cause_of(c).needs == what; });
  };
  // As warm as a board would have to take it, a frame that cools would not cool: the housing sensor would be doubted.
  if (needs(Needs::frame))
    return "it goes by the temperature of the frame, which no board measures; run the board with the motor's sheet";
  const auto guessed = std::find_if(logs.begin(), logs.end(), [](const Log& log) { return log.speed_guessed; });
  if (guessed != logs.end() && needs(Needs::speed))
    return fmt::format("it goes by speed, whose unit nobody told; say {}, or :rpm or :rev/s",
                       column_in(*guessed, Role::speed, "rad/s"));
  return "";
}

std::string why_no_experiment(const Problem& problem, Verdict verdict) {
  if (verdict == Verdict::insufficient) return "the log is too little for a verdict";
  if (verdict != Verdict::ambiguous) return "no causes tie";
  if (!problem.in_amperes()) return "the log tells no current that could be asked for";
  return "no course known here tells the tied causes apart and keeps the winding cool enough";
}

}  // namespace

Report discover(const std::vector<Log>& given, const std::optional<wire::pc::MotorFile>& motor, const HoldOut& held,
                const Tell& doing) {
  Report report;
  std::vector<Log> all = given, logs = given;
  all.insert(all.end(), held.logs.begin(), held.logs.end());
  compare_columns(all, report);
  // From here on `logs` is all that is looked at.
  if (held.fraction > 0) {
    for (Log& log : logs) log = without_last(std::move(log), held.fraction);
  }
  doing("fitting two resistors");
  Problem problem = problem_of(logs, motor);
  std::optional<Problem> unseen;
  if (held.fraction > 0 || !held.logs.empty()) unseen = unseen_of(problem, given, held);
  const Fit first = fit_baseline(problem);
  report.reasoning = noise_words(problem);
  auto [found, poor, misses, vetoed] = judged(problem, logs, motor, unseen.has_value(), doing);
  if (unseen && found.early_s > 0) unseen = heard(std::move(*unseen), found.early_s);
  widen_along_ridges(problem, found);
  if (auto fewer = read_without_poorer_logs(found, poor, given, motor, held, doing)) return *fewer;
  if (auto sooner = read_a_row_sooner(rows_ahead(problem, found.chosen.fit), given, motor, held, doing)) return *sooner;
  const bool extended = poor.empty() && !found.chosen.fit.chosen.empty() && found.verdict != Verdict::unknown_cause;
  // What is no explanation may foretell better than two resistors all the same: told with what was held out, and no
  // more: of 33 such sets 8 did worse on another log (those of score's outside and removed rows, seeds 893 and 894).
  const bool near = poor.empty() && !extended && !vetoed && !found.chosen.fit.chosen.empty();
  // Both models as the search fitted them last: with what no motor is without, and out of the valleys it knows.
  const Fit baseline = found.baseline.fit.valid() ? found.baseline.fit : first;
  const bool wrong = misses || (poor.empty() && found.verdict != Verdict::adequate);
  const Fit compared = wrong ? as_unsure_as_unseen(problem, closest(problem, baseline)) : baseline;
  judge_baseline(problem, compared, found.baseline.ratio, logs, motor, report);
  const Fit& answer = extended ? found.chosen.fit : baseline;
  if (!poor.empty()) {
    report.verdict = found.verdict = Verdict::insufficient;
    report.sentence = no_verdict(report, logs.size(), misses) + " " + poor;
    report.reasoning.insert(report.reasoning.end(), found.steps.begin(), found.steps.end());
    report.reasoning.push_back(poor);
  } else {
    report.extended_rmse = rmse_of(problem, extended || near ? closest(problem, found.chosen.fit) : answer);
    tell(problem, found, logs, report);
  }
  const Offer offer = for_the_board(problem, found, answer, report);
  if (extended) {
    add_extended(problem, answer, report, 0);
    report.extended = base_lines(problem, answer, std::max(1.0, answer.ratio()));
    // A heat that no longer depends on the winding, say, leaves R1 open.
    if (report.core_refusal.empty()) report.core_refusal = core_refusal(problem, answer);
    doing("playing a push on a board");
    if (report.core_refusal.empty()) report.gain = gain_of(problem, baseline, offer.fit);
    if (report.gain) report.gain->like = listed(names_of(offer.fit.chosen), " and ");
  }
  compare_with_sheet(problem, extended ? report.extended : report.baseline, extended, report);
  if (poor.empty()) {
    doing("looking for an experiment");
    report.experiment = experiment(problem, found, most_A(problem, motor));
    say(problem, found, report);
  }
  if (!report.experiment) report.no_experiment = why_no_experiment(problem, found.verdict);
  if (unseen) {
    doing("scoring what was held out");
    const Fit& tried = near ? found.chosen.fit : extended ? answer : compared;
    report.held_out = score_held_out(*unseen, problem, held, compared, tried, report);
    if (near) {
      report.held_out->nearest = ids_of(tried.chosen);
      report.held_out->like = listed(names_of(tried.chosen), " and ");
    }
    if (!report.held_out->against.empty()) report.sentence += " " + report.held_out->against;
  }
  shorten_names(report.plots);
  report.no_model = why_no_model(problem, logs, offer.fit, poor);
  if (!report.no_model.empty()) return report;
  report.model_toml = heat_set_toml(problem, offer.fit, report.sentence, offer.trust);
  report.baseline_toml = heat_set_toml(problem, baseline, "The two-resistor model as fitted, without what was found.",
                                       trust_of(problem, baseline));
  return report;
}

}  // namespace identify
