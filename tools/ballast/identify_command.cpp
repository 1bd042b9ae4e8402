// ballast identify: fits the robot's parameters to recorded runs, or proposes a motion that shows them.
#include <fmt/core.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "sim/scenario/check.h"
#include "sim/scenario/tree_nodes.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/stepper_run.h"
#include "tools/identify/excite.h"
#include "tools/identify/words.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"

namespace ballast {

namespace {

namespace fs = std::filesystem;

using program::short_number;
using program::short_time;

struct IdentifyCommand {
  std::vector<std::string> runs;
  double total_mass_kg = 0;  // 0: that of the scenario
  std::string write;         // empty: nothing is written
  std::string into;          // a scenario into whose copy the belief is written; empty: that of the first run
  std::string excite;        // a scenario; empty: runs are fitted
  std::vector<std::string> set;
  identify::ExciteOptions options;
};

// Empty, or why the file cannot be written.
std::string write_file(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text << std::flush;
  return file ? "" : path + ": cannot be written";
}

std::string file_text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string mass_text(const IdentifyCommand& command, double total_kg) {
  return fmt::format("  total mass  {} kg{}\n", short_number(total_kg),
                     command.total_mass_kg > 0
                         ? ", as given"
                         : ", that of the scenario: motion does not show it; weigh the robot (--total-mass)");
}

// The scenario of --into. `known` holds its believed ball alone.
struct Into {
  std::string name, toml;
  identify::Known known;
};

// Nullopt: it cannot be read, which is printed.
std::optional<Into> read_into(const std::string& file_or_name) {
  program::ScenarioOptions options;
  options.scenario = file_or_name;
  const auto scenario = program::load_scenario(options);
  if (!scenario) return std::nullopt;
  Into out{scenario->name, scenario->toml, {}};
  if (const auto why = program::to_ball_params(scenario->belief(), out.known.robot.ball)) {
    program::complain("ballast", file_or_name + ": " + *why);
    return std::nullopt;
  }
  return out;
}

int fit_runs(const IdentifyCommand& command) {
  std::vector<identify::Recording> recordings;
  std::string text;
  for (auto run = command.runs.begin(); run != command.runs.end(); ++run) {
    const std::string& folder = *run;
    std::error_code code;
    const bool again = std::any_of(command.runs.begin(), run,
                                   [&](const std::string& before) { return fs::equivalent(before, folder, code); });
    if (again) return refuse(folder + ": is given twice; allowed: different runs of one robot");
    identify::ReadRun read = identify::read_run(folder);
    if (!read.recording) return read.usage ? refuse(read.trouble) : could_not(read.trouble);
    if (!recordings.empty()) {
      if (const std::string why = identify::other_robot(recordings.front().known, read.recording->known); !why.empty())
        return refuse(fmt::format("{} and {} are of different robots: {}", command.runs.front(), folder, why));
    }
    const double used_s =
        static_cast<double>(read.recording->commanded.size()) * read.recording->known.control_period_s;
    text += fmt::format("  run         {}: {} s{}\n", folder, short_time(used_s),
                        read.recording->cut.empty() ? "" : ", up to where " + read.recording->cut);
    recordings.push_back(std::move(*read.recording));
  }
  const identify::Known known = recordings.front().known;
  std::optional<Into> into;
  if (!command.into.empty()) {
    into = read_into(command.into);
    if (!into) return program::kExitUsage;
    if (const std::string why = identify::other_geometry(known.robot.ball, into->known.robot.ball); !why.empty())
      return refuse(
          fmt::format("--into: {} and {} are of different robots: {}", command.runs.front(), command.into, why));
  }
  const double total_kg = command.total_mass_kg > 0 ? command.total_mass_kg : known.scale_mass_kg;
  const identify::Parameters parameters(known, total_kg);
  const volatile std::sig_atomic_t* interrupted = program::catch_signals();
  const identify::FitOutcome outcome =
      identify::fit(parameters, std::move(recordings), [interrupted] { return *interrupted == 0; });
  if (!outcome.fit) return could_not(outcome.trouble);
  const identify::Identified& fit = *outcome.fit;
  text += mass_text(command, total_kg);
  text += fmt::format("  fit         {} s, explained in parts of {} s{}\n", short_time(fit.used_s),
                      short_time(fit.segment_s), identify::excess_text(fit.excess));
  text += identify::identified_text(parameters, known, fit);
  if (!command.write.empty()) {
    const std::string toml =
        identify::believed_toml(into ? into->toml : file_text(fs::path(command.runs.front()) / "scenario.toml"),
                                parameters, into ? into->known : known, fit, sim::default_name(command.write));
    const sim::ScenarioResult read = sim::parse_scenario(toml, command.write);
    if (!read.ok()) return could_not("what was identified is no robot: " + sim::to_string(read.errors.front()));
    if (const std::string why = write_file(command.write, toml); !why.empty()) return could_not(why);
    text += identify::declared_text(identify::belief_error(parameters, fit));
    text += fmt::format("  written     {}: {} with what was identified as [believed]\n", command.write,
                        into ? into->name : "the scenario");
    if (read.scenario.plan.present)
      text += "  motion      that of a plan for what was believed before; plan its task again\n";
  }
  std::cout << text << std::flush;
  const bool nothing = fit.unknown.size() == static_cast<std::size_t>(parameters.count());
  return nothing ? program::kExitEnvelope : program::kExitCompleted;
}

// The believed robot under a motion: what it needs with its motors, and what would be identified of it.
struct Rehearsal {
  std::string refusal;  // why the motion is not proposed; empty: it is
  double mu_required = 0, least_normal_n = std::numeric_limits<double>::infinity();  // of all robots
  std::optional<identify::Identified> fit;
};

constexpr double kEnvelopeUse = 0.8;   // of the friction that the envelope allows
constexpr double kTorqueMargin = 0.1;  // part of the available torque that is left
constexpr int kRobotsOff = 4;          // that rehearse beside the believed one
constexpr double kOff = 0.1;           // parts by which they are off

// Runs a scenario of that motion. Its recording; none: `out` says why the motion is not proposed.
std::optional<identify::Recording> rehearsed(const sim::Scenario& scenario,
                                             const volatile std::sig_atomic_t* interrupted, Rehearsal& out) {
  identify::Known known;
  out.refusal = identify::know(scenario, known);
  if (!out.refusal.empty()) return std::nullopt;
  identify::Collector collector(known);
  const SteppedRun run = run_with_steppers(
      scenario, [interrupted] { return *interrupted != 0; },
      [&](const sil::Lap& lap, const sim::Plant::Sample&) {
        collector.take(lap.plant.sensors);
        if (lap.answer) collector.take(lap.answer->status);
      });
  if (!run.result) {
    out.refusal = run.refusal;
    return std::nullopt;
  }
  const sil::RunResult& result = *run.result;
  const double need = result.extrema.mu_required_max.value, normal_n = result.extrema.normal_force_min.value;
  const double most = kEnvelopeUse * scenario.envelope.friction_use * scenario.surface.static_friction;
  out.mu_required = std::max(out.mu_required, need);
  out.least_normal_n = std::min(out.least_normal_n, normal_n);
  identify::Recording recording = std::move(collector).finish();
  if (!recording.cut.empty())
    out.refusal = recording.cut;
  else if (result.end_reason != sil::EndReason::kCompleted)
    out.refusal = fmt::format("the run ends: {}", to_string(result.end_reason));
  else if (need > most)
    out.refusal = fmt::format("f_s/N = {} with its motors; allowed: {}", short_number(need), short_number(most));
  for (std::size_t i = 0; i < scenario.masses.size() && out.refusal.empty(); ++i) {
    const double left = result.motor_extrema[i].torque_margin;
    if (result.final_sample.lost_steps[i] != 0) out.refusal = fmt::format("motor {} loses steps", i);
    if (left < kTorqueMargin) out.refusal = fmt::format("motor {} has {} of its torque left", i, short_number(left));
  }
  if (!out.refusal.empty()) return std::nullopt;
  return recording;
}

// Rehearses a motion with the believed robot, of which the fit is, and with robots that are off.
Rehearsal rehearse(const sim::Scenario& believed, const volatile std::sig_atomic_t* interrupted) {
  Rehearsal out;
  std::optional<identify::Recording> recording = rehearsed(believed, interrupted, out);
  for (int robot = 1; robot <= kRobotsOff && out.refusal.empty(); ++robot) {
    static_cast<void>(
        rehearsed(identify::robot_off(believed, kOff, static_cast<std::uint64_t>(robot)), interrupted, out));
  }
  if (!out.refusal.empty()) return out;
  const identify::Known known = recording->known;
  const identify::Parameters parameters(known, known.scale_mass_kg);
  std::vector<identify::Recording> recordings;
  recordings.push_back(std::move(*recording));
  identify::FitOutcome fit =
      identify::fit(parameters, std::move(recordings), [interrupted] { return *interrupted == 0; });
  out.refusal = fit.trouble;
  out.fit = std::move(fit.fit);
  return out;
}

// Makes a motion smaller by this factor.
void shrink(identify::Excitation& excitation, double factor) {
  for (auto& motion : excitation.motion) {
    for (sim::MotionPiece& piece : motion) {
      piece.acceleration_start *= factor;
      piece.acceleration_end *= factor;
    }
  }
}

int excite(const IdentifyCommand& command) {
  program::ScenarioOptions options;
  options.scenario = command.excite;
  options.set = command.set;
  const auto scenario = program::load_scenario(options);
  if (!scenario) return program::kExitUsage;
  const sim::Scenario believed = sim::as_believed(*scenario);
  identify::Known known;
  if (const std::string why = identify::know(believed, known); !why.empty()) return refuse(command.excite + ": " + why);
  const identify::Parameters parameters(known, known.scale_mass_kg);
  const volatile std::sig_atomic_t* interrupted = program::catch_signals();
  identify::ExciteOptions search = command.options;
  search.progress = [interrupted] { return *interrupted == 0; };
  std::vector<identify::Excitation> found = identify::excitations(believed, known, parameters, search);
  if (*interrupted != 0) return could_not(program::interruption());
  const std::string name =
      command.write.empty() ? sim::name_with(scenario->name, "_excite") : sim::default_name(command.write);
  std::string refusal = "no motion keeps the believed robot inside the envelope";
  constexpr int kSmaller = 7;
  constexpr double kFactor = 0.8;
  for (int tries = 0; tries < kSmaller; ++tries) {
    for (identify::Excitation& excitation : found) {
      if (tries > 0) shrink(excitation, kFactor);
      const std::string toml = identify::excite_toml(scenario->toml, name, excitation);
      const sim::ScenarioResult read = sim::parse_scenario(toml, name);
      if (!read.ok()) {
        refusal = sim::to_string(read.errors.front());
        continue;
      }
      const Rehearsal rehearsal = rehearse(sim::as_believed(read.scenario), interrupted);
      if (*interrupted != 0) return could_not(program::interruption());
      if (!rehearsal.refusal.empty()) {
        refusal = rehearsal.refusal;
        continue;
      }
      const std::string path = command.write.empty() ? name + ".toml" : command.write;
      if (const std::string why = write_file(path, toml); !why.empty()) return could_not(why);
      std::cout
          << fmt::format(
                 "{}: {} s; the believed robot, and robots up to 10 % off, need f_s/N = {}, and N is at least {} N\n"
                 "  95 % intervals in a rehearsal\n{}"
                 "  written     {}; run it, then {} identify {}\n",
                 read.scenario.name, short_time(excitation.duration_s), short_number(rehearsal.mu_required),
                 short_number(rehearsal.least_normal_n), identify::intervals_text(parameters, *rehearsal.fit), path,
                 program::ballast_as_typed(), program::shell_word("runs/" + name))
          << std::flush;
      return program::kExitCompleted;
    }
  }
  program::complain("ballast", "no motion is proposed: " + refusal);
  return program::kExitEnvelope;
}

int identify_or_excite(const IdentifyCommand& command) {
  if (command.excite.empty() == command.runs.empty())
    return refuse("RUN and --excite: give the folders of runs, or a scenario to excite");
  if (!command.into.empty() && (command.write.empty() || !command.excite.empty()))
    return refuse(
        "--into: is written with what was identified from runs; allowed: RUN... --into SCENARIO --write FILE");
  if (command.excite.empty()) {
    return command.set.empty() ? fit_runs(command) : refuse("--set: only with --excite; a run has its scenario");
  }
  return excite(command);
}

}  // namespace

std::function<int()> add_identify_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("identify",
                               "Fits masses, centre of mass, inertia and rolling resistance to recorded runs, or "
                               "proposes a motion that shows them");
  auto options = std::make_shared<IdentifyCommand>();
  command->add_option("RUN", options->runs, "folders of runs of one robot")->check(program::not_empty());
  command
      ->add_option("--write", options->write,
                   "the file to write: the first run's scenario with what was identified as [believed], and its "
                   "intervals as [control.belief_error]; with --excite the motion's scenario, default NAME_excite.toml")
      ->check(program::not_empty());
  command
      ->add_option("--into", options->into,
                   "with --write: a scenario of the same robot, a file or a name that ships; FILE is it instead of the "
                   "first run's, named after FILE")
      ->check(program::not_empty());
  command
      ->add_option("--total-mass", options->total_mass_kg,
                   "the robot's mass in kg, by a scale; default: the sum of the scenario's masses")
      ->check(program::positive_finite());
  CLI::Option* excite =
      command
          ->add_option("--excite", options->excite, "propose a motion for this scenario: a file, or a name that ships")
          ->check(program::not_empty());
  command->add_option("--set", options->set, "with --excite: KEY=VALUE of the scenario");
  command
      ->add_option("--duration", options->options.duration_s,
                   "with --excite: length of the motion in s; default 100 sqrt(r / g)")
      ->needs(excite)
      ->check(program::positive_finite());
  command->add_option("--candidates", options->options.candidates, "with --excite: motions that are tried")
      ->needs(excite)
      ->check(program::whole_number(1, 10000))
      ->capture_default_str();
  command->add_option("--seed", options->options.seed, "with --excite: seed of the candidates")
      ->needs(excite)
      ->capture_default_str();
  return [options] { return identify_or_excite(*options); };
}

}  // namespace ballast
