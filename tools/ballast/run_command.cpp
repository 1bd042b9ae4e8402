// ballast run: runs a scenario.
#include <fmt/core.h>

#include <iostream>
#include <memory>

#include "tools/ballast/children.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/firmware_option.h"
#include "tools/ballast/peer_faults.h"
#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"
#include "tools/program/subprocess.h"
#include "tools/qemu/qemu_firmware.h"
#include "tools/recording/record_run.h"
#include "tools/recording/scenario_beacon.h"
#include "tools/sil/lcm_peers.h"

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
  std::optional<sil::ScenarioBeacon> beacon;
  if (bus != nullptr) beacon.emplace(command.bus.url, record.run_id, scenario);
  const auto peers = sil::peers_in_process(scenario, params, program::to_monitor_limits(scenario),
                                           operator_bus ? &*operator_bus : nullptr);
  return sil::record_run("ballast", scenario, *peers, output, record);
}

// Runs the plant in this process, and controller and monitor as children.
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
  if (const auto why = children.start("ballast-monitor", arguments); !why.empty()) return could_not(why);
  if (has_controller) {
    if (const auto why = children.start("ballast-controller", arguments); !why.empty()) return could_not(why);
  }
  PeerFaults faults(scenario, children);
  sil::LcmPeersOptions options{.scenario_id = scenario.id,
                               .controller_expected = has_controller,
                               .start_timeout = hal::Seconds(command.bus.start_timeout_s),
                               .peer_timeout = hal::Seconds(command.bus.peer_timeout_s),
                               .peer_ended = [&faults] { return faults.look(); },
                               .verdicts_name_their_tick = !sil::has_link_faults(scenario)};
  sil::RecordOptions record = command.record;
  if (PeerFaults::any(scenario)) options.poll_period = hal::Seconds(1e-3);  // a peer may be slow by one short period
  sil::LcmPeers lcm_peers(bus, options);
  const sil::ScenarioBeacon beacon(command.bus.url, options.run_id, scenario);
  FaultyProcesses peers(lcm_peers, faults);
  record.unbuffered = true;
  record.run_options = " --processes" + program::as_typed(command.bus);
  return sil::record_run("ballast", scenario, peers, output, record);
}

// Prints the target's lines below the summary.
void print_target(const sil::TargetRecord& target) {
  if (target.ticks == 0) return;
  std::cout << fmt::format(
      "  firmware    on {} in QEMU{}: {} to {} instructions per tick (most in tick {}), {} in the mean\n", target.board,
      target.real_bytes == sizeof(float) ? ", model in single precision" : "", target.min_instructions,
      target.max_instructions, target.max_tick, target.sum_instructions / target.ticks);
  if (!target.end_report) return;
  std::cout << fmt::format("  pins        {} pulses given as commanded, at most {} us late; stack {} of {} bytes\n",
                           target.pulses, program::short_number(1e6 * target.max_late_counts / target.counter_hz),
                           target.end_report->stack_used_bytes, target.end_report->stack_bytes);
}

int run_in_qemu(const RunCommand& command, const sim::Scenario& scenario, const firmware::ControllerParams& params,
                lcm::LCM* bus, sil::OutputDir& output) {
  sil::RecordOptions record = command.record;
  record.bus = bus;
  record.run_id = hal::draw_bus_number();
  record.firmware_options = " --firmware " + command.firmware;
  if (!command.elf.empty())
    record.firmware_options += " --firmware-elf " + program::shell_word(std::filesystem::absolute(command.elf));
  sil::QemuFirmwareOptions options;
  options.qemu = qemu_options(command);
  options.start_timeout = sil::Seconds(command.bus.start_timeout_s);
  options.peer_timeout = sil::Seconds(command.bus.peer_timeout_s);
  options.interrupted = record.interrupted;
  std::optional<sil::OtherPlant> other_plant;
  if (bus != nullptr) record.other_plant = &other_plant.emplace(command.bus.url, record.run_id);
  std::optional<hal::Bus> operator_bus;
  if (bus != nullptr) operator_bus.emplace(command.bus.url);
  if (operator_bus) operator_bus->join(record.run_id);
  std::optional<sil::ScenarioBeacon> beacon;
  if (bus != nullptr) beacon.emplace(command.bus.url, record.run_id, scenario);
  auto owned = std::make_unique<sil::QemuFirmware>(scenario, params, options);
  const sil::QemuFirmware& firmware = *owned;
  sil::LocalPeers peers(program::to_monitor_limits(scenario), std::move(owned),
                        operator_bus ? &*operator_bus : nullptr);
  const int exit_status = sil::record_run("ballast", scenario, peers, output, record);
  if (!record.quiet && firmware.record().end_report) print_target(firmware.record());
  return exit_status;
}

void draw_pictures(const sil::OutputDir& output) {
  program::Subprocess plot;
  const auto error = plot.start(
      {.arguments = {program::beside_this_program("ballast-plot"), std::filesystem::absolute(output.path())}});
  if (error || plot.wait().exit_status != 0)
    program::complain("ballast", "the pictures could not be drawn; the run itself is complete");
}

// Empty, or why options do not fit each other, or need a controller that this scenario has not.
std::string option_refusal(const RunCommand& command, bool has_controller) {
  if (command.record.check_steps && !has_controller)
    return "--check-steps: a run with prescribed masses has no steps; allowed with steppers";
  if (command.in_qemu() && !has_controller) {
    return fmt::format("--firmware {}: a run with prescribed masses has no controller; allowed with steppers",
                       command.firmware);
  }
  if (command.in_qemu() && command.processes)
    return fmt::format("--firmware {}: not together with --processes", command.firmware);
  if (!command.in_qemu() && !command.elf.empty()) {
    return fmt::format("--firmware-elf: not with --firmware {}; allowed: with --firmware {} or {}", kHost, kQemu,
                       kQemuAn386);
  }
  if (command.by_hand && !has_controller)
    return "--by-hand: a run with prescribed masses has no controller; allowed with steppers";
  if (command.by_hand && !command.processes && command.url->count() == 0)
    return "--by-hand: there is no bus for an operator; allowed with --lcm or --processes";
  if (command.pictures && command.record.no_log)
    return "--pictures: not with --no-log, since they are drawn from the log";
  return "";
}

// Empty, or why the scenario's faults or its pace are not possible with these options.
std::string scenario_refusal(const RunCommand& command, const sim::Scenario& scenario) {
  using sil::PeersAre;
  std::string why;
  if (command.processes) why = sil::cannot_inject(scenario, PeersAre::kProcesses, "with --processes");
  if (command.in_qemu())
    why = sil::cannot_inject(scenario, PeersAre::kOutOfReach, "with --firmware " + command.firmware);
  if (why.empty() && command.record.check_steps)
    why = sil::cannot_inject(scenario, PeersAre::kOutOfReach, "with --check-steps");
  if (!why.empty()) return why;
  const double speed = command.record.speed;
  if (command.processes && speed > 0 && 2 * scenario.run.control_period_s / speed > command.bus.peer_timeout_s) {
    return "--speed: at this pace a tick takes more than half the peer timeout; give all processes a longer "
           "--peer-timeout";
  }
  return "";
}

int run(const RunCommand& given) {
  RunCommand command = given;
  std::vector<sim::ScenarioError> warnings;
  const auto scenario = program::load_scenario(command.scenario, &warnings);
  if (!scenario) return program::kExitUsage;
  // `ballast check` names implausible values. A run in which nothing moves is not what was meant.
  for (const sim::ScenarioError& warning : warnings) {
    if (warning.key == "task") program::complain("ballast", "warning: " + to_string(warning));
  }
  const bool has_controller = sim::has_controller(scenario->run.actuation);
  if (const auto why = option_refusal(command, has_controller); !why.empty()) return refuse(why);
  command.record.by_hand = command.by_hand;
  if (command.by_hand && command.record.speed == 0) command.record.speed = 1;  // a person needs the wall clock's pace
  if (const auto why = scenario_refusal(command, *scenario); !why.empty()) return refuse(why);
  std::unique_ptr<firmware::ControllerParams> params;  // null: there is no controller
  if (has_controller) {
    params = program::make_controller_params("ballast", *scenario);
    if (!params) return program::kExitUsage;
  }
  // The bus is opened before the folder is made, so that a run without a bus leaves no folder.
  command.record.interrupted = program::catch_signals();
  std::unique_ptr<hal::Bus> peers_bus;
  std::unique_ptr<lcm::LCM> watchers_bus;
  if (command.processes)
    peers_bus = std::make_unique<hal::Bus>(command.bus.url, command.record.interrupted);
  else if (command.url->count() > 0)
    watchers_bus = std::make_unique<lcm::LCM>(command.bus.url);
  if ((peers_bus && !peers_bus->good()) || (watchers_bus && !hal::usable(*watchers_bus, command.bus.url))) {
    return program::refuse_bus("ballast", command.bus.url);
  }
  sil::OutputDir output(command.out.empty() ? "runs/" + scenario->name : command.out);
  if (!output.good()) return could_not(output.error());
  if (command.by_hand) {
    command.record.begins = [url = command.bus.url, governed = scenario->control.governor] {
      const std::string ballast = program::ballast_as_typed(), bus = program::shell_word(url);
      std::cout << fmt::format("arms, and waits for an operator: {} operate start --lcm {}\n", ballast, bus);
      if (governed)
        std::cout << fmt::format("to send the ball to a place: {} operate go --to X,Y --lcm {}\n", ballast, bus);
      std::cout << fmt::format("in a browser: {} live --lcm {}", ballast, bus) << std::endl;
    };
  }

  const int exit_status = command.processes ? run_in_processes(command, *scenario, has_controller, *peers_bus, output)
                          : command.in_qemu()
                              ? run_in_qemu(command, *scenario, *params, watchers_bus.get(), output)
                              : run_in_one_process(command, *scenario, params.get(), watchers_bus.get(), output);
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
  options->url = command->get_option("--lcm")
                     ->description(
                         "URL of an LCM bus on which every message is also published; without it none is, "
                         "but with --processes, which use " +
                         options->bus.url + " then")
                     ->default_str("");
  command->add_option("--out", options->out, "folder for the results; default runs/NAME")->check(program::not_empty());
  command
      ->add_option("--speed", options->record.speed,
                   "simulated time per wall time; default: as fast as possible, with --by-hand 1")
      ->check(program::positive_finite());
  command->add_flag("--processes", options->processes, "plant, controller and monitor as three processes over LCM");
  command->add_flag("--by-hand", options->by_hand,
                    "arm the controller, and leave start, stop and moves to `ballast operate` and `ballast move` on "
                    "the bus; --speed is then 1 by default");
  add_firmware_options(*command, *options);
  command->add_flag("--no-log", options->record.no_log,
                    "keep no run.lcmlog, which takes 2.4 MB per simulated second at 1 kHz");
  command->add_flag("--pictures", options->pictures, "draw the pictures after the run");
  command->add_flag("--check-steps", options->record.check_steps,
                    "compare every step pulse with the motion, by independent code");
  command->add_flag("--quiet", options->record.quiet, "no progress bar and no summary");
  return [options] { return run(*options); };
}

}  // namespace ballast
