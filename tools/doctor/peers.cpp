#include "tools/doctor/peers.h"

#include <fmt/core.h>

#include <algorithm>
#include <chrono>
#include <lcm/lcm-cpp.hpp>

#include "hal/lcm/bus.h"
#include "hal/lcm/channels.h"
#include "hal/lcm/messages.h"
#include "hal/lcm/scenario_piece.h"
#include "tools/program/program.h"

namespace ballast::doctor {

namespace {

using program::Finding;
using Verdict = Finding::Verdict;

constexpr std::chrono::seconds kLongestWait{1};

template <class M>
void note_sender(const M& message, Channel& channel) {
  if constexpr (requires { message.scenario_id; }) channel.scenario_ids.insert(message.scenario_id);
  if (message.run_id != 0) channel.run_ids.insert(message.run_id);
}

template <class M>
void judge_message(const void* data, std::size_t size, Channel& channel) {
  M message{};
  if (!hal::has_hash(data, size, M::getHash())) {
    ++channel.foreign;
    channel.fingerprint = 0;
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < 8 && i < size; ++i) channel.fingerprint = channel.fingerprint << 8 | bytes[i];
  } else if (!hal::decode(data, size, message)) {
    ++channel.malformed;
  } else {
    note_sender(message, channel);
  }
}

using Judge = void (*)(const void*, std::size_t, Channel&);
const std::map<std::string, Judge> kJudges = {{hal::kChannelContact, judge_message<contact_t>},
                                              {hal::kChannelPlantState, judge_message<plant_state_t>},
                                              {hal::kChannelSensors, judge_message<sensors_t>},
                                              {hal::kChannelStepCommand, judge_message<step_command_t>},
                                              {hal::kChannelControllerStatus, judge_message<controller_status_t>},
                                              {hal::kChannelTrip, judge_message<trip_t>},
                                              {hal::kChannelOperator, judge_message<operator_t>},
                                              {hal::kChannelScenario, judge_message<scenario_piece_t>}};

// A bus other than this one: the same group with another port.
std::string another_bus(const std::string& url) {
  return url.find(":7667") == std::string::npos ? "udpm://239.255.76.67:7667?ttl=0" : "udpm://239.255.76.67:7668?ttl=0";
}

}  // namespace

void Listener::hear(const std::string& name, const void* data, std::size_t size) {
  if (name == "LCM_SELF_TEST") return;  // LCM sends it whenever a program connects
  Channel& channel = channels_[name];
  ++channel.count;
  if (const auto judge = kJudges.find(name); judge != kJudges.end()) judge->second(data, size, channel);
}

int wait_ms(hal::WallClock::duration left) {
  return static_cast<int>(std::chrono::duration_cast<std::chrono::milliseconds>(
                              std::clamp<hal::WallClock::duration>(left, std::chrono::seconds(0), kLongestWait))
                              .count());
}

bool listen(const std::string& url, hal::Seconds time, Listener& listener) {
  lcm::LCM lcm(url);
  if (!hal::usable(lcm, url)) return false;
  const auto hear = [](const lcm::ReceiveBuffer* buffer, const std::string& channel, Listener* out) {
    out->hear(channel, buffer->data, buffer->data_size);
  };
  lcm.subscribeFunction(".*", +hear, &listener)->setQueueCapacity(10000);
  const auto deadline = hal::after(hal::WallClock::now(), time);
  for (;;) {
    const int wait = wait_ms(deadline - hal::WallClock::now());
    if (wait <= 0) return true;
    if (lcm.handleTimeout(wait) < 0) return false;
  }
}

std::vector<Finding> judge(const Listener& listener, const std::string& url, hal::Seconds time) {
  if (listener.channels().empty()) {
    return {{Verdict::kNote, "peers", fmt::format("no message on {} for {:g} s", url, time.count()),
             program::ballast_as_typed() + " run paper_ball --speed 1 --lcm " + program::shell_word(url)}};
  }
  std::vector<Finding> findings;
  std::set<std::int64_t> scenarios, runs;
  for (const auto& [name, channel] : listener.channels()) {
    const std::string rate = fmt::format("{:.0f} messages/s", static_cast<double>(channel.count) / time.count());
    scenarios.insert(channel.scenario_ids.begin(), channel.scenario_ids.end());
    runs.insert(channel.run_ids.begin(), channel.run_ids.end());
    if (!kJudges.contains(name)) {
      findings.push_back({Verdict::kNote, name, rate + ", not a channel of Ballast", ""});
    } else if (channel.foreign > 0) {
      findings.push_back({Verdict::kFail, name,
                          fmt::format("{} of {} have the fingerprint {:x}: they are of another build", channel.foreign,
                                      channel.count, channel.fingerprint),
                          "end that program, ninja -C build, and start it again; or --lcm '" + another_bus(url) + "'"});
    } else if (channel.malformed > 0) {
      findings.push_back({Verdict::kFail, name, fmt::format("{} of {} do not decode", channel.malformed, channel.count),
                          "end the program that sends them; or --lcm '" + another_bus(url) + "'"});
    } else {
      findings.push_back({Verdict::kOk, name, rate + ", all decoded", ""});
    }
  }
  std::string ids;
  for (const std::int64_t id : scenarios) {
    ids += fmt::format("{}{:016x}", ids.empty() ? "" : ", ", static_cast<std::uint64_t>(id));
  }
  if (scenarios.size() > 1) {
    findings.push_back({Verdict::kFail, "scenario", "several on one bus, whose messages mix: " + ids,
                        "give each run a bus of its own: --lcm '" + another_bus(url) + "'"});
  } else if (!scenarios.empty()) {
    findings.push_back({Verdict::kOk, "scenario", ids + ", the same in every message", ""});
  }
  if (runs.size() > 1) {
    findings.push_back({Verdict::kFail, "runs", fmt::format("{} on one bus within {:g} s", runs.size(), time.count()),
                        "give each run a bus of its own: --lcm '" + another_bus(url) + "'"});
  }
  return findings;
}

}  // namespace ballast::doctor
