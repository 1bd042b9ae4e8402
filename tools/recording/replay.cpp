#include "tools/recording/replay.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <deque>
#include <filesystem>
#include <iterator>
#include <limits>
#include <utility>

#include "hal/lcm/channels.h"
#include "hal/lcm/encode.h"
#include "tools/faults/injection.h"
#include "tools/recording/log_reader.h"
#include "tools/recording/output_dir.h"
#include "tools/recording/recorder.h"

namespace ballast::sil {

namespace fs = std::filesystem;

namespace {

// Clears the fields that belong to a bus, which a log does not have.
void strip(controller_status_t& message) { message.run_id = message.refused_messages = 0; }
template <class M>
void strip(M& message) {
  message.run_id = 0;
}

template <class M>
bool same_bytes(const M& a, const M& b) {
  std::vector<char> bytes_a(hal::encoded_size(a)), bytes_b(hal::encoded_size(b));
  hal::encode(a, bytes_a.data());
  hal::encode(b, bytes_b.data());
  return bytes_a == bytes_b;
}

// The messages of one tick in a log.
struct RecordedLap {
  std::optional<contact_t> contact;
  std::optional<plant_state_t> state;
  std::optional<sensors_t> sensors;
  std::optional<trip_t> trip;
  std::optional<controller_status_t> status;
  std::optional<step_command_t> steps;

  [[nodiscard]] bool empty() const { return !contact && !state && !sensors && !trip && !status && !steps; }
  [[nodiscard]] bool complete() const { return contact && state && sensors && trip && status && steps; }
  // Complete for a tick in which peers may be silent or late.
  [[nodiscard]] bool has_inputs() const {
    return contact && state && sensors && status.has_value() == steps.has_value();
  }
  [[nodiscard]] const char* missing() const {
    return !contact   ? hal::kChannelContact
           : !state   ? hal::kChannelPlantState
           : !sensors ? hal::kChannelSensors
           : !trip    ? hal::kChannelTrip
           : !status  ? hal::kChannelControllerStatus
                      : hal::kChannelStepCommand;
  }
};

// Reads a log lap by lap. All commands of operators are read first.
class RecordedRun {
 public:
  // `peers_answer`: every tick has a verdict, a status and a step command of that tick. In the log of a run with faults
  // it need not; there a tick is all that is recorded between one contact message and the next.
  RecordedRun(const std::string& path, bool peers_answer) : reader_(path), peers_answer_(peers_answer) {
    LogReader first(path);
    LogEvent event;
    operator_t message{};
    contact_t contact{};
    std::size_t before = 0;  // commands of laps that have begun
    while (first.next(event)) {
      if (event.channel == hal::kChannelOperator && take(event, message)) commands_.push_back({message});
      if (event.channel != hal::kChannelContact || before == commands_.size() || !take(event, contact)) continue;
      for (; before < commands_.size(); ++before) commands_[before].tick = contact.tick;
    }
  }

  // False: there are no more whole laps. trouble() says why the log cannot be used, end() where it stops.
  bool next(RecordedLap& lap) {
    if (!peers_answer_) return next_as_recorded(lap);
    lap = RecordedLap();
    for (LogEvent event; trouble_.empty() && reader_.next(event);) {
      if (!put(event, lap)) return false;
      if (lap.complete()) return true;
    }
    if (trouble_.empty() && !reader_.error().empty()) trouble_ = reader_.error();
    if (trouble_.empty() && !lap.empty()) end_ = std::string("its last tick is not whole: no ") + lap.missing();
    if (!reader_.damage().empty()) end_ = reader_.damage();
    return false;
  }
  // The command that the controller counted in this tick. As in hal::OperatorQueue, a stop drops the commands that
  // wait. Over a bus the controller may hear a command before the recorder does.
  std::optional<operator_t> next_command(std::int64_t tick) {
    const auto later =
        std::find_if(commands_.begin(), commands_.end(), [tick](const Said& s) { return s.tick > tick; });
    const auto stop = std::find_if(std::make_reverse_iterator(later), commands_.rend(),
                                   [](const Said& s) { return s.message.command == operator_t::COMMAND_STOP; });
    if (stop != commands_.rend()) commands_.erase(commands_.begin(), stop.base() - 1);
    if (commands_.empty()) return std::nullopt;
    const operator_t command = commands_.front().message;
    commands_.pop_front();
    return command;
  }

  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  [[nodiscard]] const std::string& end() const { return end_; }
  // Once next() is false: the reason in end() and the last tick after it, if the log goes on behind that point.
  std::optional<ReplayResult::Gap> gap() {
    // More of the run may follow behind damage.
    if (!gap_ && reader_.damage().empty()) return std::nullopt;
    do {
      for (LogEvent event; reader_.next(event);) {
        contact_t contact{};
        if (event.channel == hal::kChannelContact && hal::decode(event.data.data(), event.data.size(), contact) &&
            contact.tick > tick_.value_or(contact.tick)) {
          goes_on_to_ = std::max(goes_on_to_, contact.tick);
          gap_ = true;
        }
      }
    } while (reader_.resume());
    if (!gap_) return std::nullopt;
    return ReplayResult::Gap{end_, goes_on_to_};
  }
  [[nodiscard]] std::size_t commands_left() const { return commands_.size(); }

 private:
  bool next_as_recorded(RecordedLap& lap) {
    lap = std::exchange(ahead_, RecordedLap());
    for (LogEvent event; trouble_.empty() && reader_.next(event);) {
      contact_t contact{};
      bool good = true;
      if (event.channel == hal::kChannelContact && take(event, contact)) {
        (lap.empty() ? lap : ahead_).contact = contact;
        if (ahead_.contact) return whole(lap) && follows(lap.contact->tick);
      }
      if (event.channel == hal::kChannelPlantState) good = take_one(event, lap.state);
      if (event.channel == hal::kChannelSensors) good = take_one(event, lap.sensors);
      if (event.channel == hal::kChannelTrip) good = take_one(event, lap.trip);
      if (event.channel == hal::kChannelControllerStatus) good = take_one(event, lap.status);
      if (event.channel == hal::kChannelStepCommand) good = take_one(event, lap.steps);
      if (!good && trouble_.empty()) trouble_ = event.channel + ": twice in one tick: no log of a run with faults";
    }
    if (trouble_.empty() && !reader_.error().empty()) trouble_ = reader_.error();
    if (!reader_.damage().empty()) end_ = reader_.damage();
    return trouble_.empty() && !lap.empty() && whole(lap) && follows(lap.contact->tick);
  }
  template <class M>
  bool take_one(const LogEvent& event, std::optional<M>& slot) {
    M message{};
    if (slot || !take(event, message)) return false;
    slot = message;
    return true;
  }
  bool whole(const RecordedLap& lap) {
    if (lap.has_inputs()) {
      const std::int64_t tick = lap.contact->tick;
      if (lap.state->tick == tick && lap.sensors->tick == tick) return true;
      return cut("tick " + std::to_string(tick) + " is not whole", lap.sensors->tick);
    }
    if (ahead_.contact)
      return cut("tick " + std::to_string(lap.contact->tick) + " is not whole: no " + lap.missing(),
                 ahead_.contact->tick);
    if (end_.empty()) end_ = std::string("its last tick is not whole: no ") + lap.missing();
    return false;
  }
  // Marks a gap: more of the log follows. Always false.
  bool cut(const std::string& why, std::int64_t later_tick) {
    end_ = why;
    gap_ = true;
    goes_on_to_ = later_tick;
    return false;
  }
  bool follows(std::int64_t tick) {
    if (tick_ && tick == *tick_ + 2) return cut("tick " + std::to_string(*tick_ + 1) + " is not in it", tick);
    if (tick_ && tick != *tick_ + 1) {
      return cut(tick > *tick_
                     ? "ticks " + std::to_string(*tick_ + 1) + " to " + std::to_string(tick - 1) + " are not in it"
                     : "tick " + std::to_string(tick) + " follows tick " + std::to_string(*tick_),
                 tick);
    }
    tick_ = tick;
    return true;
  }

  template <class M>
  bool take(const LogEvent& event, M& message) {
    if (!hal::decode(event.data.data(), event.data.size(), message)) {
      if (trouble_.empty()) {
        trouble_ =
            event.channel + ": not a " + M::getTypeName() +
            " of this build, or out of range; the log was recorded by a build with other messages, or is damaged";
      }
      return false;
    }
    strip(message);
    return true;
  }

  // `later`: how many ticks the message is ahead of its lap.
  template <class M>
  bool put(const LogEvent& event, std::optional<M>& slot, std::int64_t later = 0) {
    M message{};
    if (!take(event, message)) return false;
    const std::int64_t tick = message.tick - later;
    if (tick == hal::kWaitingTick) return true;  // peers that wait, in a log of a bus
    if (tick_ && tick <= *tick_) {
      return cut("in " + event.channel + " tick " + std::to_string(tick) + " follows tick " + std::to_string(*tick_) +
                     ": more than one run, or messages out of order",
                 tick);
    }
    if (slot) return cut("tick " + std::to_string(tick_ ? *tick_ + 1 : tick - 1) + " is not whole", tick);
    slot = message;
    return true;
  }

  bool put(const LogEvent& event, RecordedLap& lap) {
    bool good = true;
    if (event.channel == hal::kChannelContact) good = put(event, lap.contact);
    if (event.channel == hal::kChannelPlantState) good = put(event, lap.state);
    if (event.channel == hal::kChannelSensors) good = put(event, lap.sensors);
    if (event.channel == hal::kChannelTrip) good = put(event, lap.trip);
    if (event.channel == hal::kChannelControllerStatus) good = put(event, lap.status);
    if (event.channel == hal::kChannelStepCommand) good = put(event, lap.steps, 1);
    if (good && lap.complete()) {
      const std::int64_t tick = lap.sensors->tick;
      const bool one_tick = lap.contact->tick == tick && lap.state->tick == tick && lap.trip->tick == tick &&
                            lap.status->tick == tick && lap.steps->tick == tick + 1;
      if (!one_tick) return cut("tick " + std::to_string(tick_ ? *tick_ + 1 : tick) + " is not whole", tick);
      return follows(tick);
    }
    return good;
  }

  LogReader reader_;
  bool peers_answer_;
  RecordedLap ahead_;  // of a log with faults: what has been read of the next tick
  struct Said {
    operator_t message;
    std::int64_t tick = std::numeric_limits<std::int64_t>::max();  // of the lap it is logged in; none: after the last
  };
  std::deque<Said> commands_;
  std::optional<std::int64_t> tick_;  // of the last whole lap
  bool gap_ = false;
  std::int64_t goes_on_to_ = 0;
  std::string trouble_, end_;
};

// Tells from a model's numbers whether it has floats. A short double, such as a weight in round numbers, may happen to
// be a float, so only floats that use their last three bits count.
class Precision {
 public:
  void observe(double number) {
    if (!std::isfinite(number)) return;
    const auto as_float = static_cast<float>(number);
    if (static_cast<double>(as_float) != number) {
      doubles_ = true;
    } else if ((std::bit_cast<std::uint32_t>(as_float) & 7u) != 0) {
      floats_ = true;
    }
  }
  [[nodiscard]] std::optional<bool> floats() const {
    if (doubles_) return false;
    return floats_ ? std::optional(true) : std::nullopt;
  }

 private:
  bool doubles_ = false, floats_ = false;
};

ReplayResult failed(ReplayResult result, ReplayResult::End end, const std::string& why) {
  result.end = end;
  result.trouble = why;
  return result;
}

}  // namespace

LogScenario scenario_of_log(const std::string& log_path) {
  LogReader reader(log_path);
  if (!reader.error().empty()) return {std::nullopt, reader.error()};
  for (LogEvent event; reader.next(event);) {
    if (event.channel != hal::kChannelSensors) continue;
    sensors_t sensors{};
    if (hal::decode(event.data.data(), event.data.size(), sensors)) return {sensors.scenario_id, ""};
    return {std::nullopt, log_path + ": " + event.channel + ": not a sensors_t of this build, or out of range"};
  }
  return {std::nullopt, log_path + ": has no " + hal::kChannelSensors + ": nothing to replay" +
                            (reader.damage().empty() ? "" : "; " + reader.damage())};
}

ReplayResult replay(const sim::Scenario& scenario, const std::string& log_path, Peer& firmware,
                    const std::string& replayed_log, const ReplayOptions& options) {
  using End = ReplayResult::End;
  ReplayResult result;
  RecordedRun recorded(log_path, !has_peer_faults(scenario));
  if (firmware.connect() != hal::Status::kOk) return failed(result, End::kFailed, firmware.trouble());
  Recorder recorder(replayed_log);
  std::int64_t given = 0;
  bool last = false, before_it = false;
  Precision precision;
  std::optional<Rejudge> rejudge;
  if (options.judge) rejudge.emplace(scenario, *options.judge);
  for (RecordedLap was; recorded.next(was);) {
    const std::int64_t tick = was.sensors->tick;
    before_it = result.ticks == 0 && tick > options.until_tick;
    if (tick > options.until_tick) break;
    const std::int64_t counted = was.status ? was.status->operator_commands : given;
    const auto unusable = [&](const std::string& why) {
      return failed(result, End::kUnusable, log_path + ": tick " + std::to_string(tick) + ": " + why);
    };
    if (was.sensors->scenario_id != scenario.id) return unusable("is of another scenario than the ticks before");
    if (result.ticks == 0 && (tick > 0 || counted > 1)) {
      const auto whole = (fs::path(log_path).parent_path() / ".." / "run.lcmlog").lexically_normal();
      const bool in_black_box = fs::exists(whole.parent_path() / kBlackBox / "blackbox.json");
      return unusable("the log begins in the middle of a run, and what the controller knew there is not in it" +
                      (in_black_box ? "; the whole run is in " + whole.string() : ""));
    }
    // A restarted controller has forgotten the commands before.
    if (counted == 0 && has_peer_faults(scenario)) given = 0;
    if (counted < given || counted > given + 1) {
      return unusable("the controller counts " + std::to_string(counted) + " commands after " + std::to_string(given));
    }
    Lap lap;
    lap.plant = {*was.contact, *was.state, *was.sensors};
    lap.verdict = was.trip;
    if (options.before_tick) options.before_tick(was.status && was.status->tick == tick);
    if (counted > given) {
      lap.command = recorded.next_command(tick);
      if (!lap.command) return unusable("the controller was given a command that is not in the log");
      ++given;
    }
    if (firmware.exchange(lap) != hal::Status::kOk) return failed(result, End::kFailed, firmware.trouble());

    if (lap.command) recorder.record(hal::kChannelOperator, *lap.command);
    recorder.record(hal::kChannelContact, *was.contact);
    recorder.record(hal::kChannelPlantState, *was.state);
    recorder.record(hal::kChannelSensors, *was.sensors);
    if (was.trip) recorder.record(hal::kChannelTrip, *was.trip);
    if (lap.answer) recorder.record(hal::kChannelControllerStatus, lap.answer->status);
    if (lap.answer) recorder.record(hal::kChannelStepCommand, lap.answer->steps);
    if (!recorder.good()) return failed(result, End::kFailed, recorder.error());

    if (rejudge) {
      Lap said{{*was.contact, *was.state, *was.sensors}, {}, {}, was.trip, {}};
      if (was.status) said.answer = Answer{*was.status, *was.steps};
      rejudge->observe(said);
    }
    if (result.ticks++ == 0) result.first_tick = tick;
    result.last_tick = tick;
    if (was.status) precision.observe(was.status->normal_force_n);
    const bool same =
        lap.answer.has_value() == was.status.has_value() &&
        (!lap.answer || (same_bytes(lap.answer->status, *was.status) && same_bytes(lap.answer->steps, *was.steps)));
    if (!same) {
      ++result.ticks_that_differ;
      if (!result.first_difference) result.first_difference = tick;
    }
    const bool tripped = lap.answer && lap.answer->status.mode == controller_status_t::MODE_TRIPPED;
    if (tripped && !result.trip) result.trip = lap.answer->status;
    last = was.sensors->last != 0;
    if (last) break;
    if (options.interrupted != nullptr && *options.interrupted != 0) {
      return failed(result, End::kFailed, "interrupted");
    }
  }
  if (!recorder.close()) return failed(result, End::kFailed, recorder.error());
  if (!recorded.trouble().empty()) return failed(result, End::kUnusable, log_path + ": " + recorded.trouble());
  if (result.ticks == 0) {
    const std::string why = before_it                ? "it begins after tick " + std::to_string(options.until_tick)
                            : recorded.end().empty() ? "no tick of a controller"
                                                     : recorded.end();
    return failed(result, before_it ? End::kAskedForNothing : End::kUnusable, log_path + ": nothing to replay: " + why);
  }
  result.recorded_floats = precision.floats();
  if (rejudge) {
    result.misjudged = rejudge->first();
    result.ticks_misjudged = rejudge->ticks_with_findings();
    if (!rejudge->judges_verdicts()) {
      result.notes.emplace_back(
          "the log does not tell what a monitor with faults heard: its verdicts are not judged again");
    }
  }
  if (last || result.last_tick >= options.until_tick) return result;
  result.gap = recorded.gap();
  if (result.gap) return result;
  if (!recorded.end().empty()) result.notes.push_back("the log ends early: " + recorded.end());
  if (recorded.end().empty()) {
    result.notes.emplace_back("the log ends without the run's last tick: the run did not come to its end");
  }
  return result;
}

}  // namespace ballast::sil
