// Controller and monitor in processes of their own, over LCM, in lockstep.
#pragma once

#include <functional>

#include "hal/lcm/bus.h"
#include "hal/lcm/channels.h"
#include "tools/sil/operator_ear.h"
#include "tools/sil/peer.h"

namespace ballast::sil {

struct LcmPeersOptions {
  std::int64_t run_id = hal::draw_bus_number();  // not 0; see hal/lcm/bus.h
  std::int64_t scenario_id = 0;
  bool controller_expected = true;
  hal::Seconds start_timeout{30};  // until both peers are there
  hal::Seconds peer_timeout{2};    // from the plant's messages to the last answer
  // For a program that has started the peers. Called while waiting, at least every `poll_period`: a line that says
  // which peer has ended, or empty.
  std::function<std::string()> peer_ended{};
  hal::Seconds poll_period{0.1};
  // False: the first verdict after the plant's messages answers them, whatever tick it names.
  bool verdicts_name_their_tick = true;
};

class LcmPeers final : public Peer {
 public:
  // The bus must outlive the peers.
  LcmPeers(hal::Bus& bus, LcmPeersOptions options);
  LcmPeers(const LcmPeers&) = delete;
  LcmPeers& operator=(const LcmPeers&) = delete;

  hal::Status connect() override;
  hal::Status send(Lap& lap) override;
  hal::Status receive(Lap& lap) override;
  // Between two laps, after a peer has been started again: waits until it is there, so that it hears the whole of the
  // next tick.
  hal::Status wait_for_restarted(bool controller, bool monitor);
  [[nodiscard]] std::string trouble() const override { return trouble_; }
  [[nodiscard]] RefusedMessages refused() const override;

 private:
  template <class Done>
  hal::Status wait(hal::Seconds timeout, const Done& done);
  void lost(const std::string& when, hal::Seconds silence);
  void on_trip(const trip_t& message);
  void on_status(const controller_status_t& message);
  template <class M>
  [[nodiscard]] bool waits_for_another_run(const M& message) const;
  void check_scenario(std::int64_t scenario_id, const char* sender);
  template <class M>
  void accept(const M& message, std::int64_t tick, std::int64_t tick_due, std::optional<M>& mailbox,
              const char* sender);
  void fail(hal::Status status, const std::string& why);

  hal::Bus& bus_;
  LcmPeersOptions options_;
  std::int64_t tick_ = hal::kWaitingTick;  // of the answers waited for
  std::optional<trip_t> trip_;
  std::optional<controller_status_t> status_;
  std::optional<step_command_t> steps_;
  std::optional<sensors_t> echo_;  // this process's own, given back by the bus
  OperatorEar ear_;
  bool controller_waits_ = false, monitor_waits_ = false;  // a peer that has just been started waits for a run
  bool last_lap_ = false;
  bool tripped_ = false;                    // by some verdict of this run
  std::int64_t refused_by_controller_ = 0;  // as in its last status
  hal::Status failure_ = hal::Status::kOk;  // found while receiving, with trouble_
  std::string trouble_;
};

}  // namespace ballast::sil
