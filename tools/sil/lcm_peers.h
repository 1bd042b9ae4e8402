// Controller and monitor in processes of their own, over LCM, in lockstep.
#pragma once

#include <functional>

#include "hal/lcm/bus.h"
#include "hal/lcm/channels.h"
#include "hal/lcm/operator_inbox.h"
#include "tools/sil/hearing.h"
#include "tools/sil/lap.h"

namespace ballast::sil {

struct LcmPeersOptions {
  std::int64_t run_id = hal::draw_bus_number();  // not 0; what hal/lcm/bus.h says of it
  std::int64_t scenario_id = 0;
  bool controller_expected = true;
  hal::Seconds start_timeout{30};  // until both peers are there
  hal::Seconds peer_timeout{2};    // from the plant's messages to the last answer
  // For whoever started the peers. Asked while waiting, at least so often: a line that says which peer has ended, or
  // empty.
  std::function<std::string()> peer_ended{};
  hal::Seconds look{0.1};
  // Likewise, before the plant speaks in a tick: whom they have started anew. The plant waits until those are there.
  struct StartedAnew {
    bool controller = false, monitor = false;
  };
  std::function<StartedAnew(std::int64_t tick)> before_tick{};
  // Whose faults the messages suffer; null: none does. Must outlive the peers.
  const sim::Scenario* faults = nullptr;
};

class LcmPeers : public Peers {
 public:
  // The bus must outlive the peers.
  LcmPeers(hal::Bus& bus, LcmPeersOptions options);
  LcmPeers(const LcmPeers&) = delete;
  LcmPeers& operator=(const LcmPeers&) = delete;

  hal::Status connect() override;
  hal::Status exchange(Lap& lap) override;
  [[nodiscard]] std::string trouble() const override { return trouble_; }
  [[nodiscard]] RefusedMessages refused() const override;

 private:
  template <class Done>
  hal::Status wait(hal::Seconds timeout, const Done& done);
  void lost(const std::string& when, hal::Seconds silence);
  hal::Status wait_for_the_new(const LcmPeersOptions::StartedAnew& anew);
  template <class M>
  [[nodiscard]] bool waits_for_another_run(const M& message) const;
  void check_scenario(std::int64_t scenario_id, const char* sender);
  template <class M>
  void accept(const M& message, std::int64_t tick, std::int64_t tick_due, std::optional<M>& mailbox,
              const char* sender);

  hal::Bus& bus_;
  LcmPeersOptions options_;
  std::int64_t tick_ = hal::kWaitingTick;  // of the answers waited for
  std::optional<trip_t> trip_;
  std::optional<controller_status_t> status_;
  std::optional<step_command_t> steps_;
  std::optional<sensors_t> echo_;  // our own, heard back
  hal::OperatorInbox operator_;
  std::optional<MotorHearing> motors_;
  bool controller_waits_ = false, monitor_waits_ = false;  // for a run, as one said that has just been started
  bool last_lap_ = false;
  bool tripped_ = false;                    // by some verdict of this run
  std::int64_t refused_by_controller_ = 0;  // as it said last
  hal::Status failure_ = hal::Status::kOk;  // found while receiving; trouble_ says what
  std::string trouble_;
};

}  // namespace ballast::sil
