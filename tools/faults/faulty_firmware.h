// The firmware in the plant's process, with faults on the links to it; it may be killed, frozen, restarted, slow or
// overrun.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "hal/control_loop.h"
#include "hal/lockstep/lockstep_board.h"
#include "tools/faults/faulty_monitor.h"
#include "tools/sil/peer.h"

namespace ballast::sil {

class FaultyFirmware final : public Peer {
 public:
  // `params` must have been accepted by firmware::validate(). `monitor` hears every status; null in a replay. All must
  // outlive the firmware.
  FaultyFirmware(const sim::Scenario& scenario, const firmware::ControllerParams& params, FaultyMonitor* monitor);

  hal::Status send(Lap& lap) override;
  // Leaves the answer empty in a tick in which the firmware does not speak. A slow firmware's answer is of an earlier
  // tick.
  hal::Status receive(Lap& lap) override;
  [[nodiscard]] std::string trouble() const override { return trouble_; }
  [[nodiscard]] PeerFailure failure() const override { return failure_; }
  [[nodiscard]] RefusedMessages refused() const override { return {links_.counters(), 0}; }

  // For a replay, before a tick: whether the recorded controller answered in it. Over a bus the plant waits for a peer
  // that is frozen or slow, and the firmware answers in that very tick.
  void set_answers_now(bool answers) { answers_now_ = answers; }

 private:
  // The messages that reach the controller in one tick.
  struct Inbox {
    std::int64_t tick;
    bool last;
    hal::TickMail mail;
    std::vector<operator_t> commands;
  };
  struct DueAnswer {
    std::int64_t due_tick;
    Answer answer;
  };
  void restart();
  hal::Status serve_tick(const Inbox& inbox, std::optional<Answer>& answer);
  [[nodiscard]] std::int64_t overruns(double time_s) const;

  const sim::Scenario& scenario_;
  const firmware::ControllerParams& params_;
  FaultyMonitor* monitor_;
  ControllerLinks links_;
  PeerFaultClock faults_;
  PeerState now_;
  bool answers_now_ = false;

  hal::LockstepBoard board_;
  std::optional<hal::ControlLoop<hal::LockstepBoard>> loop_;
  std::deque<Inbox> inbox_;
  std::deque<DueAnswer> answers_;
  std::string trouble_ = "the controller did not answer";
  PeerFailure failure_ = PeerFailure::kLost;
};

}  // namespace ballast::sil
