// ballast-target-figures BUILD BOARD SLOW_MHZ FAST_MHZ: what the firmware costs on a microcontroller, in instructions
// as QEMU counts them, and as shares of a tick at these clocks. BUILD/BOARD/bin has the programs for the board. The
// same numbers every time, to an instruction.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include "hal/target/wire.h"
#include "sim/scenario/reader.h"
#include "tests/target/step_load.h"
#include "tools/benchmarks/target_run.h"
#include "tools/program/program.h"
#include "tools/qemu/qemu_process.h"

namespace ballast {
namespace {

using benchmarks::count_instructions;
using benchmarks::CountedRun;

struct Target {
  std::string board;  // a folder of hal/
  std::filesystem::path folder;
  double slow_mhz, fast_mhz;  // of microcontrollers with such a processor
};

// The paper's ball with so many masses: those there are, again and again, together as heavy as the three, on a floor
// that always holds.
sim::Scenario ball_with(std::size_t masses) {
  auto read = sim::read_scenario(sim::find_scenario("paper_ball", BALLAST_SCENARIO_DIR), {});
  sim::Scenario scenario = read.scenario;
  const auto three = scenario.masses;
  scenario.masses.clear();
  for (std::size_t i = 0; i < masses; ++i) {
    scenario.masses.push_back(three[i % three.size()]);
    scenario.masses.back().mass_kg *= static_cast<double>(three.size()) / static_cast<double>(masses);
  }
  scenario.surface.static_friction = std::numeric_limits<double>::infinity();
  return scenario;
}

double weight_n(const sim::Scenario& scenario) {
  double mass_kg = scenario.ball.mass_kg;
  for (const auto& mass : scenario.masses) mass_kg += mass.mass_kg;
  return mass_kg * scenario.gravity_mps2;
}

// For a tenth of a second.
sim::Fault push(double force_n, double time_s) {
  sim::Fault push;
  push.kind = sim::FaultKind::kPush;
  push.time_s = time_s;
  push.end_s = time_s + 0.1;
  push.value = force_n;
  push.direction_W = {0.6, 0.8, 0};
  return push;
}

CountedRun measure(const sim::Scenario& scenario, const Target& target, const soak::OperatorScript& script = {},
                   std::vector<std::int64_t>* instructions = nullptr) {
  return count_instructions(scenario, target.board, target.folder, script, instructions);
}

void print_tick(const char* what, std::size_t masses, const sil::TargetRecord& r, const Target& target) {
  const auto worst = static_cast<double>(r.max_instructions);
  // A megahertz is 1000 clocks in a tick of 1 kHz.
  std::printf("tick         %zu mass%-3s %-12s min %6lld  mean %6.0f  max %7.0f in tick %-6lld %5.1f %% / %4.1f %%\n",
              masses, masses == 1 ? "" : "es", what, static_cast<long long>(r.min_instructions),
              static_cast<double>(r.sum_instructions) / static_cast<double>(r.ticks), worst,
              static_cast<long long>(r.max_tick), worst / (10 * target.slow_mhz), worst / (10 * target.fast_mhz));
}

bool same(const sil::TargetRecord& a, const sil::TargetRecord& b) {
  return a.ticks == b.ticks && a.min_instructions == b.min_instructions && a.max_instructions == b.max_instructions &&
         a.sum_instructions == b.sum_instructions && a.max_tick == b.max_tick;
}

void ticks(const Target& target) {
  std::printf(
      "%s\n             instructions per tick; the last two: of a 1 kHz tick at %.0f / %.0f MHz, at an instruction a "
      "clock.\n             QEMU counts instructions, not cycles: the processor needs more or fewer\n",
      target.board.c_str(), target.slow_mhz, target.fast_mhz);
  for (const std::size_t masses : {1u, 3u, 8u}) {
    sim::Scenario scenario = ball_with(masses);
    const CountedRun whole = measure(scenario, target);
    print_tick("whole run", masses, whole.record, target);
    // A twentieth above the least N of the run, towards the weight, so that the monitor trips.
    scenario.envelope.min_normal_force_n = 0.05 * weight_n(scenario) + 0.95 * whole.normal_force_min_n;
    const CountedRun stop = measure(scenario, target);
    if (!stop.tripped) throw std::runtime_error("the run that was to be stopped was not");
    print_tick("with a stop", masses, stop.record, target);
    if (!same(stop.record, measure(scenario, target).record))
      throw std::runtime_error("a second run counts differently");
  }
}

// The cost of estimation, tick by tick: `desk_ball`, whose three masses make the same steps whatever the sensors are.
void estimation(const Target& target) {
  const auto measured = [&](const char* words, const std::vector<std::string>& sensors) {
    std::vector<std::string> overrides{"duration=1", "run.hold=0.5"};
    overrides.insert(overrides.end(), sensors.begin(), sensors.end());
    const auto read = sim::read_scenario(sim::find_scenario("desk_ball", BALLAST_SCENARIO_DIR), overrides);
    if (!read.ok()) throw std::runtime_error(to_string(read.errors[0]));
    std::vector<std::int64_t> instructions;
    print_tick(words, read.scenario.masses.size(), measure(read.scenario, target, {}, &instructions).record, target);
    return instructions;
  };
  const std::string part = "sensors.preset=bmi088_calibrated", encoder = "sensors.encoder.resolution=0.0015";
  const std::vector<std::int64_t> ideal = measured("ideal sensors", {});
  const auto added = [&](const char* words, const std::vector<std::string>& sensors) {
    const std::vector<std::int64_t> ticks = measured(words, sensors);
    if (ticks.size() != ideal.size()) throw std::runtime_error("runs of different lengths");
    std::int64_t sum = 0, worst = 0;
    std::size_t at = 0;
    for (std::size_t k = 0; k < ticks.size(); ++k) {
      const std::int64_t more = ticks[k] - ideal[k];
      sum += more;
      if (more > worst) {
        worst = more;
        at = k;
      }
    }
    std::printf("estimation   %-12s adds %lld instructions a tick in the mean, %lld at most, in tick %lld\n", words,
                static_cast<long long>(sum / static_cast<std::int64_t>(ticks.size())), static_cast<long long>(worst),
                static_cast<long long>(at) - 500);
  };
  added("contact", {part, "sensors.attitude=sensed"});
  added("estimated", {part});
  added("and encoders", {part, encoder});
  added("late, fixes", {part, encoder, "sensors.latency=0.005", "sensors.position_fix.rate=10.0",
                        "sensors.position_fix.noise=0.005", "sensors.position_fix.delay=0.1"});
}

// Instructions that feedback along the motion adds to a tick of `desk_ball`. The true robot is not the believed one and
// is pushed, so that the masses have to do something else than the motion says; alone, and with estimation, a latency
// and places from outside.
void tracking(const Target& target) {
  const auto measured = [&](const char* words, bool tracks, bool estimates) {
    std::vector<std::string> overrides{"duration=3", "believed.ball.mass=0.82", "control.governor=false"};
    if (tracks) overrides.emplace_back("control.tracking=true");
    if (estimates) {
      for (const char* more : {"sensors.preset=bmi088_calibrated", "sensors.latency=0.005",
                               "sensors.position_fix.rate=10", "run.hold=0.5"}) {
        overrides.emplace_back(more);
      }
    }
    auto read = sim::read_scenario(sim::find_scenario("desk_ball", BALLAST_SCENARIO_DIR), overrides);
    if (!read.ok()) throw std::runtime_error(to_string(read.errors[0]));
    read.scenario.faults = {push(0.2 * weight_n(read.scenario), 1)};
    const CountedRun run = measure(read.scenario, target);
    if (run.tripped) throw std::runtime_error("the pushed run tripped");
    print_tick(words, read.scenario.masses.size(), run.record, target);
    return static_cast<double>(run.record.sum_instructions) / static_cast<double>(run.record.ticks);
  };
  const double open = measured("pushed", false, false);
  const double alone = measured("tracked", true, false) - open;
  const double both = measured("and estimated", true, true) - open;
  std::printf(
      "tracking     3 masses, 1 kHz, mean of a tick: %.0f instructions, with estimation, a latency and a fix %.0f\n",
      alone, both);
}

// Instructions of a whole tick under the governor: a motion that it leaves alone, and one that it has to bend; tracking
// along a motion with estimation, a latency and places from outside, all together; the latter two with errors of the
// belief declared; with steppers, a ball that a push drives out of its cone, and one that is halted.
void governor(const Target& target) {
  const auto show = [&](const char* words, const sim::Scenario& scenario, const soak::OperatorScript& script = {}) {
    print_tick(words, scenario.masses.size(), measure(scenario, target, script).record, target);
  };
  const auto scenario_of = [&](const char* name, std::vector<std::string> overrides) {
    overrides.insert(overrides.end(), {"control.governor=true", "control.friction_use=1"});
    const auto read = sim::read_scenario(sim::find_scenario(name, BALLAST_SCENARIO_DIR), overrides);
    if (!read.ok()) throw std::runtime_error(to_string(read.errors[0]));
    return read.scenario;
  };
  const auto measured = [&](const char* words, const char* name, std::vector<std::string> overrides) {
    overrides.emplace_back("run.actuation=\"ideal\"");
    show(words, scenario_of(name, std::move(overrides)));
  };
  measured("governed", "paper_ball", {});
  measured("bent", "paper_ball", {"surface.static_friction=0.16", "surface.kinetic_friction=0.1"});
  measured("uncertain", "paper_ball",
           {"surface.static_friction=0.27", "surface.kinetic_friction=0.1", "control.belief_error.mass=0.01"});
  const std::vector<std::string> all{"duration=3",
                                     "believed.ball.mass=0.82",
                                     "control.tracking=true",
                                     "sensors.preset=bmi088_calibrated",
                                     "sensors.latency=0.005",
                                     "sensors.position_fix.rate=10",
                                     "run.hold=0.5"};
  measured("and tracked", "desk_ball", all);
  std::vector<std::string> uncertain = all;
  uncertain.insert(uncertain.end(), {"control.belief_error.mass=0.05", "control.belief_error.center_of_mass=0.00075"});
  measured("all uncertain", "desk_ball", uncertain);
  const auto with_push = [&](const std::vector<std::string>& overrides) {
    sim::Scenario scenario = scenario_of("desk_ball", overrides);
    scenario.faults = {push(0.2 * weight_n(scenario), 0.5)};
    return scenario;
  };
  show("and pushed", with_push(all));
  show("and halted", scenario_of("desk_ball", all), {.commands = {{1500, firmware::OperatorCommand::kHalt}}});
  show("everything", with_push(uncertain));
}

void steps(const Target& target) {
  sil::QemuProcess qemu;
  const sil::QemuOptions options{.board = target.board, .elf = target.folder / "step_cost.elf"};
  if (const auto why = qemu.start(options); !why.empty()) throw std::runtime_error(why);
  constexpr std::size_t kRecord = 28;
  std::vector<std::uint8_t> bytes;
  while (bytes.size() < 3 * kRecord) {
    if (qemu.read(0, bytes, sil::Seconds(60), nullptr) != hal::Status::kOk) {
      throw std::runtime_error("step_cost.elf ended: " + qemu.ended(sil::Seconds(1)) + " " + qemu.messages());
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    hal::target::Reader in(std::span<const std::uint8_t>(bytes).subspan(i * kRecord, kRecord));
    std::uint32_t motors = 0, offset = 0, commanded = 0, given = 0, idle_turns = 0, turns = 0, late = 0;
    for (auto* field : {&motors, &offset, &commanded, &given, &idle_turns, &turns, &late}) in(*field);
    // Without pulses the turns fill the 100 control ticks of 1 ms.
    const double total = 0.1 * 1e9 / (1 << options.icount_shift);
    const double used = total * (static_cast<double>(idle_turns) - turns) / idle_turns;
    std::printf(
        "step         %u motor%s at 50 kHz%s: %.1f instructions a step, all in (Klipper: %d cycles); %u of %u given, "
        "at most %.2f us late\n",
        motors, motors == 1 ? "" : "s",
        motors == 1   ? ""
        : offset == 0 ? ", in phase"
                      : ", staggered",
        used / given, motors == 1 ? 70 : 60, given, commanded, late / 25.0);
  }
}

// The generator's own instructions, and the step interrupt's beside the whole controller tick.
void load(const Target& target) {
  sil::QemuProcess qemu;
  const sil::QemuOptions options{.board = target.board, .elf = target.folder / "step_load.elf"};
  if (const auto why = qemu.start(options); !why.empty()) throw std::runtime_error(why);
  std::vector<std::uint8_t> bytes;
  while (bytes.size() < hal::test::kStepLoadBytes) {
    if (qemu.read(0, bytes, sil::Seconds(60), nullptr) != hal::Status::kOk) {
      throw std::runtime_error("step_load.elf ended: " + qemu.ended(sil::Seconds(1)) + " " + qemu.messages());
    }
  }
  hal::test::StepLoad load;
  hal::target::Reader in(bytes);
  hal::test::step_load_fields(in, load);
  const double per_ns = 1.0 / (1 << options.icount_shift);
  for (const auto& g : load.generator) {
    const double instructions = 40 * per_ns * g.counts;  // a count of 25 MHz
    std::printf("generator    %4.1f steps a tick, %-16s %6.0f instructions a tick, %6.1f a step\n",
                static_cast<double>(g.pulses) / g.ticks, g.steps_per_tick == 0 ? "S-curves" : "constant speed",
                instructions / g.ticks, instructions / g.pulses);
  }
  for (const auto& t : load.together) {
    const double all = 1e3 * t.period_us * per_ns, turn = all * hal::test::kLoadTicks / t.turns_idle;
    const double tick = turn * (static_cast<double>(t.turns_idle) - t.turns_tick) / hal::test::kLoadTicks;
    const double step = turn * (static_cast<double>(t.turns_tick) - t.turns_pulses) / t.given;
    std::printf(
        "together     %u motor%s at 50 kHz beside the whole tick of %u us: %.1f instructions a step, all in; %.0f the "
        "tick; %u "
        "of "
        "%u given, at most %.2f us late; %u ticks late\n",
        t.motors, t.motors == 1 ? "" : "s", t.period_us, step, tick, t.given, t.commanded, t.late_counts / 25.0,
        t.late_ticks);
  }
}

}  // namespace
}  // namespace ballast

int main(int argc, char** argv) {
  using namespace ballast;
  const double slow_mhz = argc == 5 ? std::strtod(argv[3], nullptr) : 0,
               fast_mhz = argc == 5 ? std::strtod(argv[4], nullptr) : 0;
  if (!(slow_mhz > 0 && fast_mhz > 0)) {
    std::fprintf(stderr, "usage: ballast-target-figures BUILD BOARD SLOW_MHZ FAST_MHZ\n");
    return program::kExitUsage;
  }
  const Target target{argv[2], std::filesystem::path(argv[1]) / argv[2] / "bin", slow_mhz, fast_mhz};
  try {
    ticks(target);
    estimation(target);
    tracking(target);
    governor(target);
    steps(target);
    load(target);
  } catch (const std::exception& error) {
    program::complain("ballast-target-figures", error.what());
    return program::kExitCouldNotRun;
  }
  return 0;
}
