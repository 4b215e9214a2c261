// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "console/commands.hpp"
#include "console/live.hpp"
#include "console/plot.hpp"
#include "console/recorder.hpp"
#include "wire/pc/files.hpp"

namespace console {
namespace {

void list_signals(Console& console, bool names_only) {
  const Dictionary& dictionary = console.session().signals();
  if (names_only) {
    const auto known = dictionary.names();
    return console.say(fmt::format("{}\n", fmt::join(known, "\n")), known);
  }
  std::string text;
  Json json = Json::object();
  for (const Target& target : dictionary.all()) {
    text += fmt::format("{:<32} {}\n", full_name(target), target.what->doc);
    json[full_name(target)] = {{"unit", target.what->unit}, {"doc", target.what->doc}};
  }
  console.say(text, json);
}

/// Of one axis only, if `axis` is one.
std::vector<Target> signals_named(Console& console, const std::vector<std::string>& names, int axis = -1) {
  std::vector<Target> targets;
  for (const std::string& name : names) {
    const std::size_t before = targets.size();
    for (const Target& target : console.session().signals().named(name)) {
      if (axis < 0 || target.axis == axis || target.axis == wire::no_axis) targets.push_back(target);
    }
    if (targets.size() == before)
      refuse(fmt::format("{} is not of axis {}; choose --axis, or leave it out.", name, axis));
  }
  if (targets.size() > wire::max_signals) {
    refuse(fmt::format("{} signals are too many; {} go at once (axis0.NAME is one axis only).", targets.size(),
                       wire::max_signals));
  }
  return targets;
}

constexpr double least_span = 1e-3;  // of a scale; a steady signal is a line, not its last digit

/// Chosen signals as curves, one plot a unit.
class Curves {
 public:
  explicit Curves(std::vector<Target> signals) : signals_(std::move(signals)), trails_(signals_.size()) {}

  void add(const link::RowsView& view) {
    for (std::size_t s = 0; s < trails_.size(); ++s) {
      for (std::size_t r = 0; r < view.head.rows; ++r) trails_[s].push_back(view.value(r, s));
      if (trails_[s].size() > 4000) trails_[s].erase(trails_[s].begin(), trails_[s].end() - 2000);
    }
  }

  std::string drawn(int width, int height, bool colours) {
    std::map<std::string, std::vector<PlotLine>> by_unit;
    for (std::size_t s = 0; s < signals_.size(); ++s) {
      const float last = trails_[s].empty() ? std::nanf("") : trails_[s].back();
      by_unit[signals_[s].what->unit].push_back({fmt::format("{} {:.4g}", full_name(signals_[s]), last), trails_[s]});
    }
    std::string text;
    for (const auto& [unit, lines] : by_unit) {
      Scale& scale = scales_.try_emplace(unit, Scale{unit, least_span}).first->second;
      text += plot(lines, scale, width, height, colours);
    }
    return text;
  }

  Json last() const {
    Json json = Json::object();
    for (std::size_t s = 0; s < signals_.size(); ++s)
      json[full_name(signals_[s])] = trails_[s].empty() ? Json(nullptr) : number(trails_[s].back());
    return json;
  }

 private:
  std::vector<Target> signals_;
  std::vector<std::vector<float>> trails_;
  std::map<std::string, Scale> scales_;  // by unit
};

/// Chosen signals, by telemetry.
void watch_signals(Console& console, const std::vector<std::string>& names, double rate_Hz, double seconds) {
  Session& session = console.session();
  const std::vector<Target> signals = signals_named(console, names);
  Curves curves(signals);
  const double pwm_Hz = session.hello().pwm_Hz;
  session.subscribe(signals, static_cast<std::uint16_t>(std::clamp(pwm_Hz / rate_Hz, 1.0, 65535.0)),
                    [&](const link::RowsView& view) { curves.add(view); });
  const double start_s = session.now_s();
  int lines = 0;
  while (!interrupted() && session.now_s() - start_s < seconds) {
    session.wait_until(session.now_s() + (console.options.json || on_terminal() ? 0.1 : 0.5));
    if (console.options.json) {
      Json json = {{"time_s", session.now_s() - start_s}};
      json.update(curves.last());
      console.say("", json);
      continue;
    }
    std::string text = curves.drawn(terminal_width(), 8, in_colours());
    if (on_terminal()) {
      if (lines > 0) put(fmt::format("\033[{}A\033[J", lines));
      const TerminalSize size = terminal_size();
      const Fitted shown = fitted(text, size.columns, size.rows);
      text = shown.text, lines = shown.rows;
    }
    console.say(text, {});
  }
  session.unsubscribe();
}

/// Waits until then, or Ctrl-C.
void wait_or_stop(Session& session, double time_s) {
  while (!interrupted() && session.now_s() < time_s) session.wait_until(std::min(session.now_s() + 0.1, time_s));
}

void watch(Console& console, const std::vector<std::string>& names, const std::string& axis, double rate_Hz,
           double seconds) {
  if (!names.empty()) return watch_signals(console, names, rate_Hz, seconds);
  Session& session = console.session();
  Live live(axis == "both" ? 3 : axis == "1" ? 2 : 1);
  BoardTime time(session.hello().pwm_Hz);
  const double start_s = session.now_s();
  // Of a rate that the board does not reach, as many as it does; none is made up for.
  for (double next_s = start_s; next_s - start_s <= seconds;
       next_s = std::max(next_s + 1.0 / rate_Hz, session.now_s())) {
    wait_or_stop(session, next_s);
    if (interrupted()) break;
    const wire::State state = session.state();
    const double time_s = time.at(state.period);
    if (console.options.json)
      console.say("", json_of(state, time_s));
    else
      live.show(state, time_s);
  }
}

void log(Console& console, const std::vector<std::string>& names, const std::string& axis, const std::string& path,
         bool force, double rate_Hz, double seconds) {
  wire::pc::need_new_file(path, force);
  Session& session = console.session();
  const int index = axis == "1" ? 1 : 0;
  const std::vector<Target> signals =
      names.empty() ? usual_signals(session.signals(), index) : signals_named(console, names, index);
  Recorder recorder(session, path, fmt::format("axis {}", index), signals, rate_Hz);
  console.tell(fmt::format("Logging axis {} at {:g} Hz; Ctrl-C ends it.", index, recorder.rate_Hz()));
  const double start_s = session.now_s();
  try {
    while (!interrupted() && session.now_s() - start_s < seconds)
      session.wait_until(std::min(session.now_s() + 0.1, start_s + seconds));
    recorder.finish();
  } catch (const UserError& error) {
    recorder.file().end(error);
  }
  std::string text = fmt::format("Written: {} ({} rows, {:.1f} s).\n", path, recorder.rows(), recorder.seconds());
  if (recorder.dropped() > 0)
    text += fmt::format("{} rows were lost on the way; ask for fewer signals or a lower --rate.\n", recorder.dropped());
  console.say(text, {{"written", path},
                     {"rows", recorder.rows()},
                     {"seconds", recorder.seconds()},
                     {"rate_Hz", recorder.rate_Hz()},
                     {"dropped", recorder.dropped()}});
}

struct CaptureArguments {
  std::vector<std::string> names;
  std::string trigger, edge = "now", path = "capture.csv";
  bool force = false;
  float level = 0;
  std::uint16_t pre = 100, post = 400, decimation = 1;
};

void capture(Console& console, const CaptureArguments& a) {
  wire::pc::need_new_file(a.path, a.force);
  Session& session = console.session();
  const std::vector<Target> signals = signals_named(console, a.names);
  static const std::map<std::string, wire::Edge> edges = {
      {"now", wire::Edge::now}, {"rising", wire::Edge::rising}, {"falling", wire::Edge::falling}};
  wire::CaptureOrder order{{static_cast<std::uint8_t>(signals.front().what->id), signals.front().axis},
                           edges.at(a.edge),
                           0,
                           a.level,
                           a.pre,
                           a.post,
                           a.decimation};
  if (!a.trigger.empty()) {
    const std::vector<Target> triggers = session.signals().named(a.trigger);
    if (triggers.size() > 1)
      refuse(fmt::format("--trigger {}: one signal triggers, and this may be {} or {}; say which.", a.trigger,
                         full_name(triggers.front()), full_name(triggers.back())));
    order.trigger = {static_cast<std::uint8_t>(triggers.front().what->id), triggers.front().axis};
  }
  const std::size_t most_rows =
      session.hello().capture_words / (signals.size() + 1);  // one word a row is its time stamp
  if (std::size_t{a.pre} + a.post > most_rows) {
    refuse(fmt::format("{} rows of {} signals do not fit the board; at most {} rows, or fewer signals.", a.pre + a.post,
                       signals.size(), most_rows));
  }
  std::vector<std::string> columns;
  for (const Target& signal : signals) columns.push_back(full_name(signal));
  const std::string head =
      preamble(session, fmt::format("capture, time 0 is the trigger ({} {:g})", a.edge, a.level), signals);
  session.capture(order, signals);
  wire::CaptureStatus status = session.capture_status();
  if (status.phase == wire::CapturePhase::waiting) console.tell("Waiting for the trigger; Ctrl-C gives up.");
  while (status.phase != wire::CapturePhase::complete) {
    if (interrupted()) {
      session.capture({{0, 0}, wire::Edge::now, 0, 0, 0, 0, 1}, {});
      throw UserError(Exit::interrupted, "No trigger came; the capture was given up and nothing was written.");
    }
    session.wait_until(session.now_s() + 0.02);
    status = session.capture_status();
  }
  if (status.signals != signals.size()) {
    throw UserError(Exit::refused,
                    "The board captured other signals than were ordered; end other programs and try again.");
  }
  LogFile file(a.path, head, columns);
  std::vector<PlotLine> lines(signals.size());
  std::vector<float> values, row(signals.size());
  try {
    for (int next = 0; next < status.rows;) {
      values.clear();
      std::uint32_t period = 0;
      next += session.capture_read(static_cast<std::uint16_t>(next), static_cast<int>(signals.size()), values, period);
      for (std::size_t at = 0; at < values.size(); at += row.size()) {
        const auto periods = static_cast<std::int32_t>(period - status.trigger_period);  // wraps
        period += status.decimation;
        std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(at), row.size(), row.begin());
        file.add(periods / double{session.hello().pwm_Hz}, row);
        for (std::size_t s = 0; s < row.size(); ++s) lines[s].values.push_back(row[s]);
      }
    }
    file.finish();
  } catch (const UserError& error) {
    file.end(error);
  }
  std::string text;
  for (std::size_t s = 0; s < lines.size(); ++s) {
    lines[s].label = columns[s];
    Scale scale{signals[s].what->unit, least_span};
    text += plot({lines[s]}, scale, terminal_width(), 6, in_colours());
  }
  text += fmt::format("Written: {} ({} rows, {} of them before the trigger; the picture shows the last ones).\n",
                      a.path, status.rows, status.pre);
  console.say(text, {{"written", a.path}, {"rows", status.rows}, {"before_trigger", status.pre}, {"signals", columns}});
}

}  // namespace

void add_records(CLI::App& app, Console& console) {
  struct Arguments {
    std::vector<std::string> names;
    std::string axis = "both", path;
    double rate_Hz = 20, seconds = longest_s;
    bool names_only = false, force = false;
  };
  auto s = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("signals", "what can be watched, logged and captured");
  command->add_flag("--names", s->names_only, "only the names, one a line");
  command->callback([&console, s] { list_signals(console, s->names_only); });

  auto w = std::make_shared<Arguments>();
  command = app.add_subcommand("watch", "live values and curves until Ctrl-C; with --json one line a state");
  command->add_option("SIGNAL", w->names, "signals to draw instead of the usual view, such as axis0.ia_A");
  command->add_option("--axis", w->axis, "0, 1 or both")
      ->capture_default_str()
      ->check(CLI::IsMember({"0", "1", "both"}));
  command->add_option("--rate", w->rate_Hz, "states or rows a second")
      ->capture_default_str()
      ->check(between(0.01, 2000.0));
  command->add_option("--seconds", w->seconds, "end by itself after so long")->check(between(0, longest_s));
  command->callback([&console, w] { watch(console, w->names, w->axis, w->rate_Hz, w->seconds); });

  auto l = std::make_shared<Arguments>();
  l->axis = "0", l->rate_Hz = 100;
  command = app.add_subcommand("log", "write telemetry of one axis to a file that 'identify' reads as it is");
  command->add_option("SIGNAL", l->names, "signals; without any, what identify needs and what the board estimates");
  command
      ->add_option("--out", l->path, "a new .csv file; what the codes of mode, limit and fault mean stands at its top")
      ->required();
  command->add_option("--axis", l->axis, "0 or 1")->capture_default_str()->check(CLI::IsMember({"0", "1"}));
  command->add_option("--rate", l->rate_Hz, "rows a second, at most the PWM frequency")
      ->capture_default_str()
      ->check(between(0.5, 1e6));
  command->add_option("--seconds", l->seconds, "end by itself after so long")->check(between(0, longest_s));
  command->add_flag("--force", l->force, "write over a file that is there");
  command->callback([&console, l] { log(console, l->names, l->axis, l->path, l->force, l->rate_Hz, l->seconds); });

  auto c = std::make_shared<CaptureArguments>();
  command = app.add_subcommand("capture", "a short stretch at full PWM rate, from before to after a trigger");
  command->add_option("SIGNAL", c->names, "signals, such as axis0.ia_A axis0.ib_A")->required();
  command->add_option("--trigger", c->trigger, "signal that triggers; the first SIGNAL unless given");
  command->add_option("--edge", c->edge, "now, or rising or falling through --level")
      ->capture_default_str()
      ->check(CLI::IsMember({"now", "rising", "falling"}));
  command->add_option("--level", c->level, "in the trigger's unit")->capture_default_str()->check(between(-1e30, 1e30));
  command->add_option("--pre", c->pre, "rows before the trigger")->capture_default_str()->check(between(0, 65535));
  command->add_option("--post", c->post, "rows from the trigger on")->capture_default_str()->check(between(1, 65535));
  command->add_option("--decimation", c->decimation, "PWM periods a row")
      ->capture_default_str()
      ->check(between(1, 65535));
  command->add_option("--out", c->path, "a new .csv file")->capture_default_str();
  command->add_flag("--force", c->force, "write over a file that is there");
  command->callback([&console, c] { capture(console, *c); });
}

}  // namespace console
