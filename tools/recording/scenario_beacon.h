// Tells a run's scenario and its courses on its bus, so that a program that joins late learns the robot, its floor and
// what it follows.
//
// A thread with a connection of its own sends scenario_piece_t at once and then ten times a second of the wall clock
// (one of more than 1.6 MB less often), and with it the parts of the newest courses that operators have handed over, on
// a channel for observers. The run never waits for it, and nothing of it is recorded.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <lcm/lcm-cpp.hpp>
#include <string>
#include <thread>
#include <vector>

#include "hal/lcm/messages.h"
#include "hal/lcm/scenario_piece.h"
#include "sim/scenario/scenario.h"

namespace ballast::sil {

class ScenarioBeacon {
 public:
  // `run_id`: the run's number on this bus. A bus that cannot be opened once more, and a scenario of more than 4 MB,
  // are not told; programs that draw the run then say that they wait for its scenario.
  ScenarioBeacon(std::string url, std::int64_t run_id, const sim::Scenario& scenario);
  ~ScenarioBeacon();
  ScenarioBeacon(const ScenarioBeacon&) = delete;
  ScenarioBeacon& operator=(const ScenarioBeacon&) = delete;

 private:
  void run(const std::string& url);
  [[nodiscard]] bool send_scenario(lcm::LCM& bus);
  [[nodiscard]] bool send_parts(lcm::LCM& bus);
  void hear(const operator_t& message);

  scenario_piece_t piece_{};  // its fixed fields
  std::string text_;
  std::deque<std::vector<operator_t>> courses_;  // parts of each, as they came
  std::deque<operator_t> outbox_;                // of them, still to be sent
  std::atomic<bool> over_ = false;
  std::thread thread_;
};

// Puts the pieces of one run's scenario together. They may come in any order, repeatedly, and of several runs.
class ScenarioPieces {
 public:
  // The scenario's file, once all of its pieces are there; else empty. A piece that contradicts those before it, as
  // one of another run does, begins anew.
  std::string take(const scenario_piece_t& piece);

 private:
  scenario_piece_t first_{};  // the fields of the piece that began
  std::vector<std::string> texts_;
};

}  // namespace ballast::sil
