// The firmware on a microcontroller that QEMU plays, in lockstep; the monitor stays in this process.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>

#include "hal/lcm/bus.h"
#include "hal/lcm/operator_inbox.h"
#include "hal/target/messages.h"
#include "tools/monitor/monitor.h"
#include "tools/sil/lap.h"
#include "tools/qemu/qemu_process.h"

namespace ballast::sil {

struct QemuPeersOptions {
  QemuOptions qemu;
  hal::target::Commit commit;
  Seconds start_timeout{30};  // until the firmware has accepted its parameters
  Seconds peer_timeout{2};    // for the answer to a tick
  const volatile std::sig_atomic_t* interrupted = nullptr;
  hal::Bus* operator_bus = nullptr;  // on which to listen to operators; must outlive the peers
};

// What the target told of itself.
struct TargetRecord {
  std::string board;
  std::uint8_t real_bytes = 0;  // of a number of its model
  double instructions_per_count = 0;
  std::int64_t ticks = 0;  // answered
  // Of a tick. Each rounded to whole instructions: where these are several counts long, that takes away where in a
  // count the tick began, which depends on how the link's bytes happened to come.
  std::int64_t min_instructions = std::numeric_limits<std::int64_t>::max(), max_instructions = 0, sum_instructions = 0;
  std::int64_t max_tick = 0;          // whose were max_instructions
  std::int64_t pulses = 0;            // given by the step interrupt, each held against the command
  std::uint32_t max_late_counts = 0;  // of them
  std::optional<hal::target::Farewell> farewell;
  std::uint32_t counter_hz = 0;
};

class QemuPeers : public Peers {
 public:
  // `params` are those of `scenario`, accepted by firmware::validate(). Both must outlive this.
  QemuPeers(const sim::Scenario& scenario, const firmware::ControllerParams& params,
            const monitor::MonitorLimits& limits, QemuPeersOptions options);

  hal::Status connect() override;
  hal::Status exchange(Lap& lap) override;
  [[nodiscard]] bool are_waited_for() const override { return true; }
  [[nodiscard]] RefusedMessages refused() const override { return refused_operators(options_.operator_bus, operator_); }
  [[nodiscard]] std::string trouble() const override { return trouble_; }
  [[nodiscard]] int exit_status() const override { return exit_status_; }
  [[nodiscard]] pid_t pid() const { return qemu_.pid(); }  // 0: it is not there
  [[nodiscard]] const TargetRecord& record() const { return record_; }

 private:
  hal::Status fail(hal::Status status, const std::string& text, int exit_status);
  hal::Status receive(hal::target::Frame& frame, Seconds timeout);
  hal::Status no_answer(hal::Status status, Seconds timeout);
  hal::Status say_last_words(const hal::target::LastWords& words);
  hal::Status say_watchdog(const std::string& registers);
  hal::Status compare(const hal::target::Hello& hello);
  hal::Status send_params();
  hal::Status judge(const hal::target::Verdict& verdict);
  hal::Status check_reply(std::int64_t tick);
  hal::Status late_after(std::int64_t tick);
  hal::Status check_pulses(std::int64_t tick, const hal::target::PlayedPulses& played);
  hal::Status hear_operators(Lap& lap);
  hal::Status finish();
  template <class M>
  hal::Status send(const M& message, std::int64_t tick);
  [[nodiscard]] std::string when() const;

  const sim::Scenario& scenario_;
  const firmware::ControllerParams& params_;
  QemuPeersOptions options_;
  monitor::Monitor monitor_;
  std::unique_ptr<hal::target::World> world_;
  std::unique_ptr<hal::target::Reply> reply_;
  std::optional<std::int64_t> controller_tick_;  // of the newest status
  std::optional<monitor::Estimate> estimate_;    // in it
  std::optional<std::int64_t> tick_;             // being exchanged
  // Commands of which the pulses have not been reported: of this tick and the next.
  firmware::StepCommand commanded_, commanded_next_;
  std::vector<std::uint8_t> received_, sent_;
  std::size_t used_ = 0;  // of received_
  TargetRecord record_;
  hal::OperatorInbox operator_;
  std::string trouble_;
  int exit_status_;
  QemuProcess qemu_;
};

}  // namespace ballast::sil
