// ballast run: the main job.
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <memory>

#include "tools/ballast/children.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/firmware_option.h"
#include "tools/ballast/peer_faults.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/program/subprocess.h"
#include "tools/faults/faulty_peers.h"
#include "tools/sil/lcm_peers.h"
#include "tools/qemu/qemu_peers.h"
#include "tools/recording/record_run.h"

namespace ballast {

namespace {

struct RunCommand : FirmwareOption {
  program::ScenarioOptions scenario;
  program::BusOptions bus;
  CLI::Option* url = nullptr;
  std::string out;
  sil::RecordOptions record;
  bool processes = false;
  bool by_hand = false;
  bool pictures = false;
};

int fail(const std::string& text) {
  program::complain("ballast", text);
  return program::kExitCouldNotRun;
}

int run_in_one_process(const RunCommand& command, const sim::Scenario& scenario,
                       const firmware::ControllerParams* params, lcm::LCM* bus, sil::OutputDir& output) {
  sil::RecordOptions record = command.record;
  record.bus = bus;
  record.run_id = hal::draw_bus_number();
  std::optional<sil::OtherPlant> other_plant;
  if (bus != nullptr) record.other_plant = &other_plant.emplace(command.bus.url, record.run_id);
  std::optional<hal::Bus> operator_bus;
  if (bus != nullptr && params != nullptr) operator_bus.emplace(command.bus.url);
  if (operator_bus) operator_bus->join(record.run_id);
  const auto peers = sil::peers_in_process(scenario, params, program::to_monitor_limits(scenario),
                                           operator_bus ? &*operator_bus : nullptr);
  return sil::record_run("ballast", scenario, *peers, output, record);
}

// This process is the plant; controller and monitor are started beside it.
int run_in_processes(const RunCommand& command, const sim::Scenario& scenario, bool has_controller, hal::Bus& bus,
                     sil::OutputDir& output) {
  std::vector<std::string> arguments{command.scenario.scenario, "--lcm", command.bus.url};
  for (const auto& set : command.scenario.set) arguments.insert(arguments.end(), {"--set", set});
  for (const auto& fault : command.scenario.fault) arguments.insert(arguments.end(), {"--fault", fault});
  if (!command.scenario.actuation.empty())
    arguments.insert(arguments.end(), {"--actuation", command.scenario.actuation});
  if (command.scenario.seed) arguments.insert(arguments.end(), {"--seed", std::to_string(*command.scenario.seed)});
  arguments.insert(arguments.end(), {"--start-timeout", std::to_string(command.bus.start_timeout_s), "--peer-timeout",
                                     std::to_string(command.bus.peer_timeout_s)});
  Children children;
  if (const auto why = children.start("ballast-monitor", arguments); !why.empty()) return fail(why);
  if (has_controller) {
    if (const auto why = children.start("ballast-controller", arguments); !why.empty()) return fail(why);
  }
  PeerFaults faults(scenario, children);
  sil::LcmPeersOptions options{.scenario_id = scenario.id,
                               .controller_expected = has_controller,
                               .start_timeout = hal::Seconds(command.bus.start_timeout_s),
                               .peer_timeout = hal::Seconds(command.bus.peer_timeout_s),
                               .peer_ended = [&faults] { return faults.look(); },
                               .faults = sil::messages_suffer(scenario) ? &scenario : nullptr};
  sil::RecordOptions record = command.record;
  if (PeerFaults::any(scenario)) {
    options.look = hal::Seconds(1e-3);  // a peer may be slow by one short period
    options.before_tick = [&faults](std::int64_t tick) { return faults.strike(tick); };
  }
  sil::LcmPeers peers(bus, options);
  record.unbuffered = true;
  record.run_options = " --processes" + program::as_typed(command.bus);
  return sil::record_run("ballast", scenario, peers, output, record);
}

// The lines of the target under the summary.
void print_target(const sil::TargetRecord& target) {
  if (target.ticks == 0) return;
  std::printf(
      "  firmware    on %s in QEMU%s: %lld to %lld instructions per tick (most in tick %lld), %lld in the mean\n",
      target.board.c_str(), target.real_bytes == sizeof(float) ? ", model in single precision" : "",
      static_cast<long long>(target.min_instructions), static_cast<long long>(target.max_instructions),
      static_cast<long long>(target.max_tick), static_cast<long long>(target.sum_instructions / target.ticks));
  if (!target.farewell) return;
  std::printf("  pins        %lld pulses given as commanded, at most %.2f us late; stack %u of %u bytes\n",
              static_cast<long long>(target.pulses), 1e6 * target.max_late_counts / target.counter_hz,
              target.farewell->stack_used_bytes, target.farewell->stack_bytes);
}

int run_in_qemu(const RunCommand& command, const sim::Scenario& scenario, const firmware::ControllerParams& params,
                lcm::LCM* bus, sil::OutputDir& output) {
  sil::RecordOptions record = command.record;
  record.bus = bus;
  record.run_id = hal::draw_bus_number();
  record.firmware_options = " --firmware " + command.firmware;
  if (!command.elf.empty())
    record.firmware_options += " --firmware-elf " + program::shell_word(std::filesystem::absolute(command.elf));
  sil::QemuPeersOptions options;
  options.qemu = qemu_options(command);
  options.start_timeout = sil::Seconds(command.bus.start_timeout_s);
  options.peer_timeout = sil::Seconds(command.bus.peer_timeout_s);
  options.interrupted = record.interrupted;
  std::optional<sil::OtherPlant> other_plant;
  if (bus != nullptr) record.other_plant = &other_plant.emplace(command.bus.url, record.run_id);
  std::optional<hal::Bus> operator_bus;
  if (bus != nullptr) operator_bus.emplace(command.bus.url);
  if (operator_bus) operator_bus->join(record.run_id);
  if (operator_bus) options.operator_bus = &*operator_bus;
  sil::QemuPeers peers(scenario, params, program::to_monitor_limits(scenario), options);
  const int exit_status = sil::record_run("ballast", scenario, peers, output, record);
  if (!record.quiet && peers.record().farewell) print_target(peers.record());
  return exit_status;
}

void draw_pictures(const sil::OutputDir& output) {
  program::Subprocess plot;
  const auto error = plot.start(
      {.arguments = {program::beside_this_program("ballast-plot"), std::filesystem::absolute(output.path())}});
  if (error || plot.wait().exit_status != 0)
    program::complain("ballast", "the pictures could not be drawn; the run itself is complete");
}

int run(const RunCommand& command) {
  const auto scenario = program::load_scenario(command.scenario);
  if (!scenario) return program::kExitUsage;
  const bool has_controller = scenario->run.actuation == sim::Actuation::kStepper;
  if (command.record.check_steps && !has_controller) {
    program::complain("ballast", "--check-steps: a run with prescribed masses has no steps; allowed with steppers");
    return program::kExitUsage;
  }
  const bool in_qemu = command.in_qemu();
  if (in_qemu && (!has_controller || command.processes)) {
    program::complain("ballast", "--firmware " + command.firmware + ": " +
                                     (has_controller ? "not together with --processes"
                                                     : "a run with prescribed masses has no controller; allowed with "
                                                       "steppers"));
    return program::kExitUsage;
  }
  if (!in_qemu && !command.elf.empty()) {
    program::complain("ballast", std::string("--firmware-elf: is given, and --firmware is ") + kHost +
                                     ", which takes no file; allowed: with --firmware " + kQemu + " or " + kQemuAn386);
    return program::kExitUsage;
  }
  using Elsewhere = sil::FaultyPeers::Elsewhere;
  std::string why;
  if (command.processes) why = sil::FaultyPeers::not_possible(*scenario, Elsewhere::kProcesses, "with --processes");
  if (in_qemu) {
    why = sil::FaultyPeers::not_possible(*scenario, Elsewhere::kNothing, "with --firmware " + command.firmware);
  }
  if (why.empty() && command.record.check_steps) {
    why = sil::FaultyPeers::not_possible(*scenario, Elsewhere::kNothing, "with --check-steps");
  }
  if (!why.empty()) {
    program::complain("ballast", why);
    return program::kExitUsage;
  }
  auto params = std::make_unique<firmware::ControllerParams>();
  if (has_controller) {
    if (const auto refusal = program::to_controller_params(*scenario, *params)) {
      program::complain("ballast", *refusal);
      return program::kExitUsage;
    }
  }
  RunCommand with_signals = command;
  sil::RecordOptions& record = with_signals.record;
  record.by_hand = command.by_hand;
  if (command.by_hand) {
    if (!has_controller || (!command.processes && command.url->count() == 0)) {
      program::complain("ballast", std::string("--by-hand: ") +
                                       (has_controller ? "nobody could say anything; allowed with --lcm or --processes"
                                                       : "a run with prescribed masses has no controller to tell; "
                                                         "allowed with steppers"));
      return program::kExitUsage;
    }
    if (record.speed == 0) record.speed = 1;  // a hand is no faster
  }
  if (command.processes && record.speed > 0 &&
      2 * scenario->run.control_period_s / record.speed > command.bus.peer_timeout_s) {
    program::complain("ballast",
                      "--speed: at this pace a tick takes more than half the peer timeout; give all processes a longer "
                      "--peer-timeout");
    return program::kExitUsage;
  }
  // The bus before the folder: a run that cannot be leaves none behind.
  with_signals.record.interrupted = program::catch_signals();
  std::unique_ptr<hal::Bus> peers_bus;
  std::unique_ptr<lcm::LCM> watchers_bus;
  if (command.processes)
    peers_bus = std::make_unique<hal::Bus>(command.bus.url, with_signals.record.interrupted);
  else if (command.url->count() > 0)
    watchers_bus = std::make_unique<lcm::LCM>(command.bus.url);
  if ((peers_bus && !peers_bus->good()) || (watchers_bus && !watchers_bus->good())) {
    return program::refuse_bus("ballast", command.bus.url);
  }
  sil::OutputDir output(command.out.empty() ? "runs/" + scenario->name : command.out);
  if (!output.good()) return fail(output.error());

  const int exit_status =
      command.processes ? run_in_processes(with_signals, *scenario, has_controller, *peers_bus, output)
      : in_qemu         ? run_in_qemu(with_signals, *scenario, *params, watchers_bus.get(), output)
                        : run_in_one_process(with_signals, *scenario, has_controller ? params.get() : nullptr,
                                             watchers_bus.get(), output);
  if (command.pictures && (exit_status == program::kExitCompleted || exit_status == program::kExitEnvelope)) {
    draw_pictures(output);
  }
  return exit_status;
}

}  // namespace

std::function<int()> add_run_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("run", "Runs a scenario: controller, plant and monitor in lockstep");
  auto options = std::make_shared<RunCommand>();
  program::add_scenario_options(*command, options->scenario);
  program::add_bus_options(*command, options->bus);
  options->url = command->get_option("--lcm");
  command->add_option("--out", options->out, "folder for the results; default runs/NAME")->check(program::not_empty());
  command->add_option("--speed", options->record.speed, "simulated over wall time; default as fast as it goes")
      ->check(program::positive_finite());
  command->add_flag("--processes", options->processes, "plant, controller and monitor as three processes over LCM");
  command->add_flag("--by-hand", options->by_hand,
                    "arm the controller, and leave start, stop and moves to ballast operate and ballast move on the "
                    "bus; at the wall clock's pace unless --speed says otherwise");
  add_firmware_options(*command, *options);
  command->add_flag("--pictures", options->pictures, "draw the pictures when it is done");
  command->add_flag("--check-steps", options->record.check_steps,
                    "hold every step pulse against the motion, by other code than made it");
  command->add_flag("--quiet", options->record.quiet, "no progress bar and no summary");
  return [options] { return run(*options); };
}

}  // namespace ballast
