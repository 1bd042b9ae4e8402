// ballast plan: from a task to a motion that holds.
#include "tools/ballast/plan_command.h"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iostream>
#include <limits>
#include <memory>
#include <sstream>

#include "tools/ballast/commands.h"
#include "tools/ballast/stepper_run.h"
#include "tools/plan/alternatives.h"
#include "tools/plan/write_plan.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"
#include "tools/summary/controller_words.h"

namespace ballast {

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

std::function<bool()> stop_of(const PlanCommand& command, Clock::time_point start,
                              const volatile std::sig_atomic_t* signalled, double allowance_s) {
  return [start, signalled, limit_s = command.time_limit_s, allowance_s] {
    return *signalled != 0 || (limit_s && seconds_since(start) > *limit_s + allowance_s);
  };
}

std::string in_the_way(const std::filesystem::path& path) {
  std::error_code error;
  const auto status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status) || std::filesystem::is_regular_file(status)) return "";
  return fmt::format("{} {}: it stays as it is; allowed: a new name, or an earlier file", path.string(),
                     std::filesystem::is_directory(status) ? "is a folder" : "is a device, a pipe or a socket");
}

bool write_file(const std::filesystem::path& path, const std::string& text) {
  const std::filesystem::path draft = path.string() + ".draft";
  {
    std::ofstream stream(draft, std::ios::binary);
    stream << text;
    stream.close();
    if (!stream) return false;
  }
  std::error_code error;
  std::filesystem::rename(draft, path, error);
  return !error;
}

std::optional<plan::TaskFile> task_of(const PlanCommand& command) {
  const std::filesystem::path path = program::find_scenario(command.task);
  if (path.empty()) return std::nullopt;
  std::vector<sim::ScenarioError> errors;
  auto task = plan::read_task(path, errors);
  if (task) return task;
  for (const auto& error : errors) std::cerr << to_string(error) << '\n';
  if (!errors.empty() && errors.front().key == "task")
    std::cerr << fmt::format("`{} new NAME` writes a robot with a [task]\n", program::ballast_as_typed());
  return std::nullopt;
}

ProgressLine::ProgressLine(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

bool ProgressLine::due() const { return !quiet_ && seconds_since(shown_) >= (terminal_ ? 0.1 : 1.0); }

void ProgressLine::show(const std::string& text) {
  shown_ = Clock::now();
  fmt::print(stderr, "{}{}{}", terminal_ ? "\r\x1b[K" : "", text, terminal_ ? "" : "\n");
  std::fflush(stderr);
  open_ = terminal_;
}

void ProgressLine::end() {
  if (open_) fmt::print(stderr, "\r\x1b[K");
  open_ = false;
}

namespace {

using program::short_number;
using program::short_time;

constexpr double kNegligible_m = 1e-6;  // a place is met within 1 mm

int refuse(int status, const std::string& text) {
  program::complain("ballast", text);
  return status;
}

std::string file_text(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

// Why a plan cannot be written here; empty: it can. A scenario without [plan] is someone's own.
std::string plan_refusal(const std::filesystem::path& toml_path, const std::filesystem::path& json_path) {
  for (const auto& path : {toml_path, json_path}) {
    if (std::string why = in_the_way(path); !why.empty()) return why;
  }
  if (!std::filesystem::exists(toml_path)) return "";
  const std::string text = file_text(toml_path);
  if (text.empty() || text.starts_with("[plan]") || text.find("\n[plan]") != std::string::npos) return "";
  return toml_path.string() + " is no plan: it stays as it is; allowed: another --out, or an earlier plan";
}

// Takes the plan of an earlier search out of the way, so that nobody takes it for this task's. Returns what it did.
std::string set_aside(const std::filesystem::path& toml_path) {
  std::error_code error;
  if (!std::filesystem::exists(toml_path, error)) return "";
  const std::filesystem::path aside = std::filesystem::path(toml_path).replace_extension(".old.toml");
  std::filesystem::rename(toml_path, aside, error);
  if (error)
    return fmt::format("; {} is of an earlier search and could not be renamed: do not run it", toml_path.string());
  return fmt::format("; the plan of an earlier search is now {}", aside.string());
}

// The governed run of a plan with its motors misses what the plan itself reaches. Empty: it does not.
std::string missed_text(const plan::TaskFile& task, const plan::Plan& plan, const sil::RunResult& run) {
  if (run.refusal) return sil::refused_text("start", sil::refusal_text(*run.refusal));
  if (run.end_reason != sil::EndReason::kCompleted) return "";  // it does not hold
  constexpr double kOfWay = 0.01, kLeast_m = 1e-3;
  const Eigen::Vector2d end_m = run.final_sample.position_W_m.head<2>(),
                        planned_m = plan.run.final.position_W_m.head<2>();
  const double way_m = (planned_m - task.scenario.initial.position_W_m.head<2>()).norm(),
               off_m = (end_m - planned_m).norm();
  if (!task.task.at_rest || off_m <= std::max(kOfWay * way_m, kLeast_m)) return "";
  std::string text = fmt::format("the ball ends {} mm from there", short_number(1e3 * off_m, 0.1));
  if (run.governor && run.governor->bent_ticks > 0)
    text += fmt::format("; the governor bends {} % of the commands, to keep the friction that its motors' swing needs",
                        short_number(100 * run.governor->share(run.governor->bent_ticks), 0.1));
  return text;
}

// `missed`: missed_text().
std::string outcome_text(const plan::TaskFile& task, const plan::Outcome& outcome,
                         const std::optional<plan::StepperRun>& with_steppers, const std::string& missed,
                         const std::string& file) {
  const plan::Plan& p = *outcome.plan;
  const auto& mu = p.run.extrema.mu_required_max;
  std::string text =
      fmt::format("{}: found. The ball gets to ({}, {}) m in {} s{}, {} mm off, and needs f_s/N = {} at t = {} s\n",
                  task.scenario.name, short_number(p.run.final.position_W_m[0], kNegligible_m),
                  short_number(p.run.final.position_W_m[1], kNegligible_m), short_time(p.grid.duration_s),
                  task.task.at_rest ? " and rests there" : "", short_number(1e3 * p.goal_error_m, 1e3 * kNegligible_m),
                  short_number(mu.value), short_time(mu.time_s));
  if (with_steppers) {
    const sim::Extremum& need = with_steppers->mu_required_max;
    const bool completed = with_steppers->end_reason == to_string(sil::EndReason::kCompleted);
    text += completed
                ? fmt::format("  with its steppers it needs f_s/N = {} at t = {} s\n", short_number(need.value),
                              short_time(need.time_s))
                : fmt::format(
                      "  with its steppers it does not hold: {} at t = {} s, where f_s/N = {}. What would help: {} "
                      "tune {}\n",
                      with_steppers->end_reason, short_time(with_steppers->end_time_s), short_number(need.value),
                      program::ballast_as_typed(), program::shell_word(file));
  }
  if (!missed.empty())
    text += fmt::format("  with its steppers it does not get there: {}. What would help: more time (task.duration)\n",
                        missed);
  text += fmt::format("  limited by: {}\n", outcome.binding);
  text += fmt::format("  written: {}; run it with: {} run {}\n", file, program::ballast_as_typed(),
                      program::shell_word(file));
  return text;
}

int plan_task(const PlanCommand& command) {
  const auto start = Clock::now();
  const auto task = task_of(command);
  if (!task) return program::kExitUsage;
  const std::filesystem::path path = program::find_scenario(command.task);
  const std::filesystem::path toml_path =
      command.out.empty() ? plan::plan_name(task->scenario.name) + ".toml" : command.out;
  const std::filesystem::path json_path = std::filesystem::path(toml_path).replace_extension(".json");
  if (toml_path == json_path)
    return refuse(program::kExitUsage, "--out: ends in .json; allowed: a name for the scenario, such as plan.toml");
  std::error_code same;
  if (std::filesystem::equivalent(path, toml_path, same)) {
    return refuse(program::kExitUsage, "--out: is the task itself; allowed: another file");
  }
  if (const std::string why = plan_refusal(toml_path, json_path); !why.empty()) return refuse(program::kExitUsage, why);

  plan::SearchOptions options;
  if (!command.from.empty()) {
    const auto motion = sim::read_scenario(command.from);
    if (!motion.ok()) return refuse(program::kExitUsage, to_string(motion.errors.front()));
    if (motion.scenario.masses.size() != task->scenario.masses.size()) {
      return refuse(program::kExitUsage,
                    fmt::format("--from: {} has {} masses; allowed: the task's number, {}", command.from,
                                motion.scenario.masses.size(), task->scenario.masses.size()));
    }
    for (const sim::Mass& mass : motion.scenario.masses) options.from.push_back(mass.motion);
    options.quick = true;
  }
  const volatile std::sig_atomic_t* signalled = program::catch_signals();
  ProgressLine line(command.quiet);
  options.seed = command.seed;
  options.stop = stop_of(command, start, signalled);
  options.progress = [&](int iteration, double best, double need, double error) {
    if (!line.due()) return;
    const std::string found = std::isfinite(best) ? "best plan so far: f_s/N = " + short_number(best) : "no plan yet";
    line.show(fmt::format("{:.0f} s, iteration {}: {}; this try: f_s/N = {}, constraints violated by {}",
                          seconds_since(start), iteration, found, short_number(need), program::significant(error, 1)));
  };
  options.stepper_need = [&](const sim::Scenario& moved) {
    const SteppedRun run = run_with_steppers(moved, options.stop);
    const bool completed = run.result && run.result->end_reason == sil::EndReason::kCompleted;
    return completed ? run.result->extrema.mu_required_max.value : std::numeric_limits<double>::infinity();
  };
  const plan::Problem problem = plan::make_problem(*task);
  plan::Outcome outcome = plan::search(problem, task->scenario, options);
  if (!outcome.plan && *signalled != 0)
    outcome.binding = "interrupted before a plan was found";
  else if (outcome.status == plan::Status::kNotFound && !options.stop())
    outcome.binding +=
        plan::alternatives_text(*task, plan::find_alternatives(*task, outcome, options, [&](const std::string& what) {
          if (line.due()) line.show(fmt::format("{:.0f} s, no plan; looking for {}", seconds_since(start), what));
        }));
  line.end();

  std::string toml;
  std::optional<plan::StepperRun> with_steppers;
  std::string stepper_refusal, missed;
  bool cut_off = false;  // the run with its motors
  if (outcome.plan) {
    toml = plan::plan_toml(file_text(path), *task, *outcome.plan);
    const auto written = sim::parse_scenario(toml, toml_path.string());
    if (!written.ok()) {
      return refuse(program::kExitCouldNotRun, "the plan is no good scenario: " + to_string(written.errors.front()));
    }
    if (written.scenario.run.actuation == sim::Actuation::kStepper && *signalled == 0) {
      sim::Scenario believed = sim::as_believed(written.scenario);
      believed.surface.patches = task->scenario.surface.patches;
      const auto late = stop_of(command, start, signalled, kMotorsAllowance_s);
      const SteppedRun run = run_with_steppers(believed, late);
      if (run.result && !run.result->refusal) with_steppers = need_of(*run.result);
      if (run.result) missed = missed_text(*task, *outcome.plan, *run.result);
      cut_off = !run.result && late();
      if (!cut_off) stepper_refusal = run.refusal;
    }
  }
  const std::string json =
      plan::outcome_json(*task, outcome, with_steppers ? &*with_steppers : nullptr, command.seed, seconds_since(start));
  if (outcome.plan && !write_file(toml_path, toml))
    return refuse(program::kExitCouldNotRun, fmt::format("{}: cannot be written", toml_path.string()));
  if (!write_file(json_path, json))
    return refuse(program::kExitCouldNotRun, fmt::format("{}: cannot be written", json_path.string()));
  if (!outcome.plan)
    return refuse(program::kExitEnvelope,
                  fmt::format("{}: no plan: {}{}", task->scenario.name, outcome.binding, set_aside(toml_path)));
  if (!command.quiet)
    std::cout << outcome_text(*task, outcome, with_steppers, missed, toml_path.string()) << std::flush;
  if (*signalled != 0)
    program::complain("ballast", "interrupted: this is the best plan so far, not rolled with its steppers");
  else if (cut_off)
    program::complain("ballast", "--time-limit: ended the run of the plan with its steppers");
  if (!stepper_refusal.empty()) {
    return refuse(program::kExitCouldNotRun,
                  fmt::format("{}: the plan holds with prescribed masses, and does not run with its steppers: {}",
                              toml_path.string(), stepper_refusal));
  }
  return program::kExitCompleted;
}

}  // namespace

std::function<int()> add_plan_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("plan", "Finds a motion of the masses that takes the ball where a task says");
  auto options = std::make_shared<PlanCommand>();
  command->add_option("TASK", options->task, "scenario file with a [task]")->required()->check(program::not_empty());
  command->add_option("--out", options->out, "file for the plan; default NAME_plan.toml, and .json beside it")
      ->check(program::not_empty());
  command->add_option("--from", options->from, "plan of a similar task, from which the search starts")
      ->check(program::not_empty());
  command->add_option("--seed", options->seed, "seed of the random starts")->capture_default_str();
  command->add_option("--time-limit", options->time_limit_s, "wall time in s after which the best plan so far is taken")
      ->check(program::positive_finite());
  command->add_flag("--quiet", options->quiet, "no progress and no summary");
  command->add_flag("--chart", options->chart,
                    "no plan, but what the robot can do over the distance: the least friction over the time, and the "
                    "shortest time over the floor");
  command->add_flag("--gains", options->gains,
                    "no plan, but the reference and the feedback gains about the plan that TASK already is");
  return [options] {
    if (options->gains) return write_gains(*options);
    return options->chart ? chart_task(*options) : plan_task(*options);
  };
}

}  // namespace ballast
