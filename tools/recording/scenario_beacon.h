// Tells a run's scenario on its bus, so that a program that joins late learns the robot and its floor.
//
// A thread with a connection of its own sends scenario_piece_t at once and then once a second of the wall clock. The
// run never waits for it, and nothing of it is recorded.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

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
  void send(const std::string& url);

  scenario_piece_t piece_{};  // its fixed fields
  std::string text_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool over_ = false;
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
