#include "tools/qemu/qemu_firmware.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <iterator>

#include "hal/lcm/channels.h"
#include "hal/target/build_id.h"

namespace ballast::sil {

using hal::Status;
namespace target = hal::target;

namespace {

std::string hex(std::uint64_t value) { return fmt::format("0x{:08x}", value); }

std::string number(double value) { return fmt::format("{:.17g}", value); }

// A program names its board in its first message; one for another processor may fail before that.
bool names_board(const std::filesystem::path& elf, const std::string& board) {
  std::ifstream file(elf, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  return bytes.find(board + '\0') != std::string::npos;
}

// The cause of a fault, from the bits of the fault status register (ARMv7-M, B3.2.15).
std::string fault_text(const target::FaultReport& words) {
  struct Bit {
    int bit;
    const char* text;
  };
  static constexpr Bit kBits[] = {{0, "instruction fetched from where none may be"},
                                  {1, "access to memory that allows none"},
                                  {8, "bus error on an instruction"},
                                  {9, "bus error on data"},
                                  {10, "bus error on data"},
                                  {16, "undefined instruction"},
                                  {17, "not in Thumb state"},
                                  {18, "bad return from an exception"},
                                  {19, "no such coprocessor"},
                                  {24, "unaligned access"},
                                  {25, "division by zero"}};
  for (const Bit& bit : kBits) {
    if ((words.cfsr >> bit.bit & 1) != 0) return bit.text;
  }
  return "fault";
}

std::string registers_text(const target::FaultReport& words) {
  std::string text = "pc " + hex(words.pc) + ", lr " + hex(words.lr) + ", sp " + hex(words.sp) + ", xpsr " +
                     hex(words.xpsr) + ", cfsr " + hex(words.cfsr) + ", hfsr " + hex(words.hfsr);
  if ((words.cfsr & 1u << 7) != 0) text += ", address " + hex(words.mmfar);
  if ((words.cfsr & 1u << 15) != 0) text += ", address " + hex(words.bfar);
  for (std::size_t i = 0; i < words.r.size(); ++i) text += ", r" + std::to_string(i) + " " + hex(words.r[i]);
  return text;
}

}  // namespace

QemuFirmware::QemuFirmware(const sim::Scenario& scenario, const firmware::ControllerParams& params,
                           QemuFirmwareOptions options)
    : scenario_(scenario),
      params_(params),
      options_(std::move(options)),
      world_(std::make_unique<target::World>()),
      reply_(std::make_unique<target::Reply>()),
      sent_(target::kMaxFrame) {}

std::string QemuFirmware::when() const {
  return tick_ ? "at tick " + std::to_string(*tick_) : std::string("before the first tick");
}

Status QemuFirmware::fail(Status status, const std::string& text, PeerFailure failure) {
  trouble_ = text;
  failure_ = failure;
  return status;
}

template <class M>
Status QemuFirmware::send_message(const M& message, std::int64_t tick) {
  const std::size_t size = target::encode(message, tick, sent_);
  if (size == 0) return fail(Status::kIo, "a message to the firmware is too long");
  const Status status = qemu_.write(0, std::span(sent_).first(size), options_.peer_timeout);
  if (status == Status::kOk) return status;
  // The firmware may have sent its cause before it stopped reading.
  target::Frame frame;
  if (const Status s = receive_frame(frame, options_.peer_timeout); s != Status::kOk) return s;
  return fail(Status::kPeerLost, "the firmware does not read any more " + when());
}

// kOk: a frame other than a cause of death, which becomes the failure.
Status QemuFirmware::receive_frame(target::Frame& frame, Seconds timeout) {
  received_.erase(received_.begin(), received_.begin() + static_cast<std::ptrdiff_t>(used_));
  used_ = 0;
  for (;;) {
    const target::FrameResult result = target::decode_frame(received_, frame);
    if (result.error == target::FrameError::kNone) {
      used_ = result.size;
      target::FaultReport words;
      if (frame.type == target::MessageType::kFaultReport && target::decode(frame, words)) return report_death(words);
      return Status::kOk;
    }
    if (result.error != target::FrameError::kIncomplete) {
      return fail(Status::kIo, "what came from the firmware " + when() + " is no message of this program's protocol");
    }
    if (const Status s = qemu_.read(0, received_, timeout, options_.interrupted); s != Status::kOk) {
      return no_answer(s, timeout);
    }
  }
}

Status QemuFirmware::no_answer(Status status, Seconds timeout) {
  if (status == Status::kInterrupted) return fail(status, "interrupted");
  if (status == Status::kEmpty) {
    return fail(Status::kPeerLost,
                "the firmware is lost: silent for " + fmt::format("{:g}", timeout.count()) + " s " + when());
  }
  const std::string end = qemu_.ended(Seconds(1));
  const std::string messages = qemu_.messages();
  return fail(Status::kPeerLost, "the link to the firmware was cut " + when() +
                                     (end.empty() ? "" : "; QEMU ended: " + end) +
                                     (messages.empty() ? "" : "; " + messages));
}

Status QemuFirmware::report_death(const target::FaultReport& words) {
  switch (words.cause) {
    case target::Cause::kFault:
      return fail(Status::kPeerLost,
                  "the firmware faulted " + when() + ": " + fault_text(words) + "; " + registers_text(words),
                  PeerFailure::kFirmwareFault);
    case target::Cause::kStackOverflow:
      return fail(Status::kPeerLost,
                  "the firmware faulted " + when() + ": its stack ran into the guard; " + registers_text(words),
                  PeerFailure::kFirmwareFault);
    case target::Cause::kWatchdog:
      return report_watchdog(registers_text(words));
    case target::Cause::kLink:
      break;
  }
  return fail(Status::kIo, "the firmware could not decode its messages " + when());
}

// No tick came back for kWatchdogPeriods. The firmware hangs, or so few instructions fit into these periods that a tick
// of this robot may well need more.
Status QemuFirmware::report_watchdog(const std::string& registers) {
  constexpr int kWatchdogPeriods = 4;  // hal/README.md
  // A tick that begins a stop and predicts it takes up to 6.5 times the most of other ticks (tools/firmware, 1 to 8
  // masses); before the first tick nothing is known but what the smallest robot needs.
  constexpr std::int64_t kStopFactor = 8, kSmallestRobot = 6500;
  const double period_s = params_.control_period_s;
  const std::int64_t fit =
      std::llround(kWatchdogPeriods * period_s * record_.counter_hz * record_.instructions_per_count);
  const std::int64_t may_need = kStopFactor * (record_.ticks > 0 ? record_.max_instructions : kSmallestRobot);
  if (fit >= may_need) {
    return fail(Status::kPeerLost, "the firmware hung " + when() + ": its watchdog ended it; " + registers,
                PeerFailure::kFirmwareHung);
  }
  return fail(Status::kPeerLost,
              "the firmware is late " + when() + ": run.control_period = " + fmt::format("{:g}", period_s) +
                  " s is too short for this target; its watchdog ended a tick that did not come back within " +
                  std::to_string(kWatchdogPeriods) + " periods, " + std::to_string(fit) + " instructions; " + registers,
              PeerFailure::kLate);
}

Status QemuFirmware::compare(const target::Hello& hello) {
  const target::Identity& other = hello.identity;
  const target::Identity ours{.sources = target::kSourcesId};
  if (options_.qemu.board != hello.board.c_str()) {
    return fail(
        Status::kForeignPeer,
        std::string("the firmware is built for ") + hello.board.c_str() + ", and QEMU plays " + options_.qemu.board,
        PeerFailure::kForeignFirmware);
  }
  const auto differs = [&](const char* what, auto here, auto there) {
    if (here == there) return false;
    static_cast<void>(fail(Status::kForeignPeer,
                           std::string("the firmware does not fit this program: ") + what + ": " +
                               std::to_string(there) + " there, " + std::to_string(here) + " here; " +
                               "it was built from other sources: build it again with tools/firmware",
                           PeerFailure::kForeignFirmware));
    return true;
  };
  // The target's model may be in single precision.
  if ((other.real_bytes != sizeof(float) &&
       differs("bytes of a real number", int{ours.real_bytes}, int{other.real_bytes})) ||
      differs("masses", ours.max_masses, other.max_masses) || differs("pieces", ours.max_pieces, other.max_pieces) ||
      differs("pieces of a rail", ours.max_rail_pieces, other.max_rail_pieces) ||
      differs("bursts", ours.max_bursts, other.max_bursts) ||
      differs("steps in a tick", ours.max_steps_per_tick, other.max_steps_per_tick) ||
      differs("sources", ours.sources, other.sources)) {
    return Status::kForeignPeer;
  }
  return Status::kOk;
}

Status QemuFirmware::send_params() {
  if (const Status s = send_message(params_, 0); s != Status::kOk) return s;
  const auto mass = std::make_unique<target::MassParams>();
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    const sim::Mass& from = scenario_.masses[i];
    mass->mass_kg = params_.ball.mass_kg[i];
    mass->rail = params_.ball.rail[i];
    mass->motor = params_.motor[i];
    mass->initial_position = from.initial_position;
    mass->initial_velocity = from.initial_velocity;
    mass->piece_count = static_cast<std::int32_t>(from.motion.size());
    for (std::size_t k = 0; k < from.motion.size(); ++k) {
      mass->pieces[k] = {from.motion[k].duration_s, from.motion[k].acceleration_start, from.motion[k].acceleration_end};
    }
    if (const Status s = send_message(*mass, 0); s != Status::kOk) return s;
  }
  const auto part = std::make_unique<target::ReferencePart>();
  const int values = target::reference_values(params_);
  for (int first = 0; first < values; first += part->count) {
    target::get_reference(params_.tracking, first, values, *part);
    if (const Status s = send_message(*part, 0); s != Status::kOk) return s;
  }
  return send_message(options_.commit, 0);
}

Status QemuFirmware::judge(const target::Verdict& verdict) {
  const auto refused = [&](const std::string& why) {
    return fail(Status::kForeignPeer, "the firmware refuses its parameters: " + why, PeerFailure::kForeignFirmware);
  };
  const std::string mass = "mass " + std::to_string(verdict.index) + ": ";
  switch (verdict.acceptance) {
    case target::Acceptance::kAccepted:
      break;
    case target::Acceptance::kRefused:
      return refused((verdict.index >= 0 ? mass : std::string()) + verdict.field.c_str() + " = " +
                     number(verdict.value) + "; allowed: " + verdict.allowed.c_str());
    case target::Acceptance::kIncomplete:
      return refused("masses, or values of the reference, are missing");
    case target::Acceptance::kMotion:
      return refused(mass + "its motion is no motion");
    case target::Acceptance::kPeriod:
      return refused("control_period = " + number(verdict.value) + " s: this board cannot keep it");
  }
  const std::uint32_t ours = target::fingerprint(params_, record_.real_bytes);
  if (verdict.fingerprint == ours) return Status::kOk;
  return fail(Status::kForeignPeer,
              "the firmware's parameters are not this run's: fingerprint " + hex(verdict.fingerprint) + " there, " +
                  hex(ours) + " here",
              PeerFailure::kForeignFirmware);
}

Status QemuFirmware::connect() {
  if (const std::string why = qemu_.start(options_.qemu); !why.empty()) {
    return fail(Status::kIo, why);
  }
  if (!names_board(options_.qemu.elf, options_.qemu.board)) {
    return fail(Status::kForeignPeer,
                options_.qemu.elf.string() + " is not built for " + options_.qemu.board + ", which QEMU plays",
                PeerFailure::kForeignFirmware);
  }
  target::Frame frame;
  target::Hello hello;
  if (const Status s = receive_frame(frame, options_.start_timeout); s != Status::kOk) return s;
  qemu_.expect_answers();
  if (!target::decode(frame, hello)) {
    return fail(Status::kForeignPeer, "the firmware does not introduce itself as this program expects",
                PeerFailure::kForeignFirmware);
  }
  record_.board = hello.board.c_str();
  record_.counter_hz = hello.counter_hz;
  record_.instructions_per_count = 1e9 / hello.counter_hz / static_cast<double>(1 << options_.qemu.icount_shift);
  record_.real_bytes = hello.identity.real_bytes;
  if (const Status s = compare(hello); s != Status::kOk) return s;
  if (const Status s = send_params(); s != Status::kOk) return s;
  if (const Status s = receive_frame(frame, options_.start_timeout); s != Status::kOk) return s;
  target::Verdict verdict;
  if (!target::decode(frame, verdict)) {
    return fail(Status::kForeignPeer, "the firmware does not answer to its parameters", PeerFailure::kForeignFirmware);
  }
  return judge(verdict);
}

// Checks the pulses that the step interrupt gave during `tick` against the command.
Status QemuFirmware::check_pulses(std::int64_t tick, const target::PlayedPulses& played) {
  if (!options_.commit.play || commanded_.tick != tick) return Status::kOk;
  const auto wrong = [&](int motor, int pulse, const std::string& what) {
    return fail(Status::kIo,
                "the pins did not do what was commanded in tick " + std::to_string(tick) + ": motor " +
                    std::to_string(motor) + ", pulse " + std::to_string(pulse) + ": " + what,
                PeerFailure::kLate);
  };
  for (int motor = 0; motor < commanded_.motor_count; ++motor) {
    int pulse = 0;
    std::int32_t at = 0;
    // Half the shortest time between pulses of this motor: pulses stay in order and at least so far apart.
    const double allowed_late_counts =
        record_.counter_hz / (2 * params_.motor[static_cast<std::size_t>(motor)].max_step_rate_hz);
    const auto next = [&]() -> const target::PlayedPulse* {
      while (at < played.count && played.pulse[static_cast<std::size_t>(at)].motor != motor) ++at;
      return at < played.count ? &played.pulse[static_cast<std::size_t>(at++)] : nullptr;
    };
    for (std::size_t b = 0; b < static_cast<std::size_t>(commanded_.burst_count); ++b) {
      const firmware::StepBurst& burst = commanded_.bursts[b];
      if (burst.motor != motor) continue;
      for (std::int64_t j = 0; j < burst.count; ++j, ++pulse) {
        const std::int64_t due = firmware::pulse_ticks(burst, j);
        const target::PlayedPulse* given = next();
        if (given == nullptr) return wrong(motor, pulse, "not given");
        if (given->due_ticks != due || given->direction != burst.direction) {
          return wrong(motor, pulse,
                       "given for timer tick " + std::to_string(given->due_ticks) + ", direction " +
                           std::to_string(given->direction) + "; commanded: " + std::to_string(due) + ", " +
                           std::to_string(burst.direction));
        }
        if (given->late_counts > allowed_late_counts) {
          return wrong(motor, pulse,
                       "given " + std::to_string(1e6 * given->late_counts / record_.counter_hz) + " us late");
        }
        ++record_.pulses;
        record_.max_late_counts = std::max<std::uint32_t>(record_.max_late_counts, given->late_counts);
      }
    }
    if (next() != nullptr) return wrong(motor, pulse, "given without a command");
  }
  return Status::kOk;
}

// The decoder accepts any run's ticks and counts; these must be this run's.
Status QemuFirmware::check_reply(std::int64_t tick) {
  const firmware::ControllerStatus& status = reply_->status;
  const firmware::StepCommand& steps = reply_->steps;
  const auto wrong = [&](const char* what, std::int64_t is, std::int64_t expected) {
    if (is == expected) return false;
    static_cast<void>(fail(Status::kIo, "the firmware's answer " + when() + " is not of this run: " + what + " " +
                                            std::to_string(is) + ", expected " + std::to_string(expected)));
    return true;
  };
  if (wrong("status.motor_count", status.motor_count, params_.ball.mass_count) ||
      wrong("status.scenario_id", status.scenario_id, params_.scenario_id) ||
      wrong("steps.motor_count", steps.motor_count, params_.ball.mass_count) ||
      wrong("steps.tick", steps.tick, tick + 1)) {
    return Status::kIo;
  }
  if (status.overruns == 0) return Status::kOk;
  // Finds the late tick. A tick that is late itself has taken about a control period or more up to its steps; otherwise
  // the tick before took too long after its steps.
  const double period_counts = params_.control_period_s * options_.commit.stretch * record_.counter_hz;
  const std::string instructions =
      std::to_string(static_cast<std::int64_t>(reply_->tick_counts * record_.instructions_per_count));
  if (reply_->tick_counts < period_counts / 2) return late_after(tick - 1);
  return fail(Status::kIo,
              "the firmware's tick " + std::to_string(tick) + " is late: the next one began before it was served (" +
                  instructions +
                  " instructions; run.control_period = " + fmt::format("{:g}", params_.control_period_s) + " s has " +
                  std::to_string(std::llround(period_counts * record_.instructions_per_count)) + ")",
              PeerFailure::kLate);
}

Status QemuFirmware::late_after(std::int64_t tick) {
  return fail(Status::kIo,
              "the firmware's tick " + std::to_string(tick) + " is late: the next one began before its end",
              PeerFailure::kLate);
}

// Commands go in the order of the log, which is the order of a replay.
Status QemuFirmware::send(Lap& lap) {
  const std::int64_t tick = lap.plant.sensors.tick;
  tick_ = tick;
  world_->last = lap.plant.sensors.last != 0;
  world_->sensors = hal::from_message(lap.plant.sensors);
  world_->has_verdict = lap.verdict.has_value();
  if (lap.verdict) world_->verdict = hal::from_message(*lap.verdict);
  world_->command_count = 0;
  const auto add = [this](const operator_t& command) {
    world_->commands[static_cast<std::size_t>(world_->command_count++)] = hal::from_message(command);
  };
  if (lap.command) add(*lap.command);
  for (const operator_t& heard : lap.heard) add(heard);
  return send_message(*world_, tick);
}

Status QemuFirmware::receive(Lap& lap) {
  const std::int64_t tick = *tick_;
  target::Frame frame;
  if (const Status s = receive_frame(frame, options_.peer_timeout); s != Status::kOk) return s;
  if (!target::decode(frame, *reply_) || frame.tick != tick || reply_->status.tick != tick) {
    return fail(Status::kIo, "the firmware's answer " + when() + " is out of turn or out of range");
  }
  if (const Status s = check_reply(tick); s != Status::kOk) return s;
  if (const Status s = check_pulses(tick - 1, reply_->played); s != Status::kOk) return s;
  commanded_ = commanded_next_;
  commanded_next_ = reply_->steps;
  count_instructions(tick);
  Answer& answer = lap.answer.emplace();
  answer.status = hal::to_message(reply_->status, params_.control_period_s);
  answer.steps = hal::to_message(reply_->steps, params_.control_period_s);
  return lap.plant.sensors.last != 0 ? finish() : Status::kOk;
}

void QemuFirmware::count_instructions(std::int64_t tick) {
  ++record_.ticks;
  const std::int64_t instructions = std::llround(reply_->tick_counts * record_.instructions_per_count);
  if (options_.instructions != nullptr) options_.instructions->push_back(instructions);
  record_.sum_instructions += instructions;
  record_.min_instructions = std::min(record_.min_instructions, instructions);
  if (instructions <= record_.max_instructions) return;
  record_.max_instructions = instructions;
  record_.max_tick = tick;
}

Status QemuFirmware::finish() {
  target::Frame frame;
  if (const Status s = receive_frame(frame, options_.peer_timeout); s != Status::kOk) return s;
  target::EndReport end_report;
  if (!target::decode(frame, end_report)) {
    return fail(Status::kIo, "the firmware does not report how it ended");
  }
  if (end_report.overruns > 0) return late_after(*tick_);
  if (const Status s = check_pulses(*tick_, end_report.played); s != Status::kOk) return s;
  record_.end_report = end_report;
  const std::string end = qemu_.ended(options_.peer_timeout);
  if (qemu_.exit_status() == 0) return Status::kOk;
  return fail(Status::kIo, "QEMU did not end well: " + (end.empty() ? std::string("it goes on") : end));
}

}  // namespace ballast::sil
