// SPDX-License-Identifier: MIT
#include "identify/score_logs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "identify/discover.hpp"
#include "wire/pc/user_error.hpp"

namespace identify {
namespace {

using wire::pc::refuse;

/// Ids in a truth file (host-sim record --hide writes them): { "causes": [ { "id": ... } ] }.
std::vector<std::string> truth_in(const std::string& path) {
  std::ifstream in(path);
  const auto json = nlohmann::json::parse(in, nullptr, false);
  if (!json.is_object() || !json.contains("causes") || !json["causes"].is_array()) {
    refuse(path + ": is no truth file; host-sim record --hide writes one beside each log.");
  }
  std::vector<std::string> ids;
  for (const auto& cause : json["causes"])
    ids.push_back(cause.is_string()   ? cause.get<std::string>()
                  : cause.is_object() ? cause.value("id", std::string("?"))
                                      : "?");
  std::sort(ids.begin(), ids.end());
  return ids;
}

const char* outcome_of(const Report& report, const std::vector<std::string>& named,
                       const std::vector<std::string>& truth) {
  if (names_causes(report.verdict)) return named == truth ? "named right" : "named wrong";
  if (report.verdict == Verdict::ambiguous) {
    const bool among = std::find(report.tied.begin(), report.tied.end(), truth) != report.tied.end();
    return among ? "tied with the truth" : "tied without it";
  }
  if (report.verdict == Verdict::adequate) return truth.empty() ? "rightly silent" : "silent";
  return "unknown or insufficient";
}

/// How often each answer was given to each truth. Columns have numbers, for names are long.
void print_confusions(const std::map<std::string, std::map<std::string, int>>& answers_to) {
  std::map<std::string, int> columns;
  for (const auto& [truth, answers] : answers_to) columns.insert(answers.begin(), answers.end());
  int number = 0;
  fmt::print("\n{:<40}", "truth \\ answer");
  for (auto& [answer, column] : columns) fmt::print("{:>4}", column = ++number);
  for (const auto& [truth, answers] : answers_to) {
    fmt::print("\n{:<40}", truth);
    for (const auto& [answer, column] : columns)
      fmt::print("{:>4}", answers.contains(answer) ? std::to_string(answers.at(answer)) : ".");
  }
  fmt::print("\n");
  for (const auto& [answer, column] : columns) fmt::print("{:>4}  {}\n", column, answer);
}

}  // namespace

void score_logs(const std::vector<std::string>& logs, const std::vector<std::string>& truths, const ReadLogs& read,
                const std::optional<wire::pc::MotorFile>& motor) {
  if (truths.size() != logs.size()) {
    refuse(fmt::format("--score: {} truth files for {} logs; give one for each, in the same order.", truths.size(),
                       logs.size()));
  }
  for (const std::string& path : truths) {
    if (!std::filesystem::is_regular_file(path))
      refuse("--score: " + path + ": there is no such file; check the path.");
  }
  std::map<std::string, int> outcomes;
  std::map<std::string, std::map<std::string, int>> answers_to;
  fmt::print("{:<40} {:<32} {:<18} {}\n", "log", "truth", "verdict", "answer");
  for (std::size_t i = 0; i < logs.size(); ++i) {
    const Report report = discover(read(logs[i]), motor);
    const auto truth = truth_in(truths[i]);
    std::vector<std::string> named;
    for (const auto& cause : report.causes) named.push_back(cause.id);
    std::sort(named.begin(), named.end());
    const std::string outcome = outcome_of(report, named, truth);
    const std::string hidden = fmt::format("{}", fmt::join(truth, " + ")),
                      name = fmt::format("{}", fmt::join(named, " + "));
    ++outcomes[outcome];
    const std::string verdict = word(report.verdict);
    ++answers_to[hidden.empty() ? "nothing" : hidden][names_causes(report.verdict) ? name : verdict];
    fmt::print("{:<40} {:<32} {:<18} {} ({})\n", logs[i], hidden, verdict, name, outcome);
  }
  for (const auto& [outcome, count] : outcomes) fmt::print("{:>5}  {}\n", count, outcome);
  print_confusions(answers_to);
}

}  // namespace identify
