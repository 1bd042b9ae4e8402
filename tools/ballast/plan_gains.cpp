// ballast plan --gains: what a controller needs to follow a plan.
#include <fmt/core.h>

#include <iostream>

#include "tools/ballast/plan_command.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"
#include "tools/tracking/reference.h"

namespace ballast {
namespace {

int refuse(int status, const std::string& text) {
  program::complain("ballast", text);
  return status;
}

// An option that a search has and a table of gains has not; empty if there is none.
std::string foreign_option(const PlanCommand& command) {
  if (command.chart) return "--chart";
  if (!command.from.empty()) return "--from";
  if (command.time_limit_s) return "--time-limit";
  return "";
}

}  // namespace

int write_gains(const PlanCommand& command) {
  if (const std::string option = foreign_option(command); !option.empty())
    return refuse(program::kExitUsage, option + ": is for a search; allowed with --gains: --out, --quiet");
  const std::filesystem::path path = program::find_scenario(command.task);
  if (path.empty()) return program::kExitUsage;
  const auto read = sim::read_scenario(path);
  if (!read.ok()) {
    for (const auto& error : read.errors) std::cerr << to_string(error) << '\n';
    return program::kExitUsage;
  }
  const std::filesystem::path file = command.out.empty() ? read.scenario.name + "_gains.csv" : command.out;
  std::error_code same;
  if (std::filesystem::equivalent(path, file, same))
    return refuse(program::kExitUsage, "--out: is the plan itself; allowed: another file");
  firmware::BallParams ball;
  std::string why = program::to_ball_params(read.scenario.belief(), ball).value_or("");
  std::optional<plan::Tracking> tracking;
  if (why.empty()) tracking = plan::track(sim::as_believed(read.scenario), ball, why);
  if (!tracking) return refuse(program::kExitUsage, fmt::format("{}: {}", path.string(), why));
  const plan::GainTable table = plan::gain_table(*tracking);
  if (!write_file(file, plan::gain_csv(table)))
    return refuse(program::kExitCouldNotRun, fmt::format("{}: cannot be written", file.string()));
  if (command.quiet) return program::kExitCompleted;
  std::cout << fmt::format(
      "{}: reference and gains of {} masses, {} by {}, at {} times {} s apart: {} bytes as floats\n  written: {}\n",
      read.scenario.name, table.masses, table.masses, table.errors, table.samples,
      program::short_number(table.period_s), table.bytes(), file.string());
  return program::kExitCompleted;
}

}  // namespace ballast
