// The firmware on a microcontroller emulated by QEMU, in lockstep.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/target/messages.h"
#include "tools/qemu/qemu_process.h"
#include "tools/sil/peer.h"

namespace ballast::sil {

struct QemuFirmwareOptions {
  QemuOptions qemu;
  hal::target::Commit commit;
  Seconds start_timeout{30};  // until the firmware has accepted its parameters
  Seconds peer_timeout{2};    // for the answer to a tick
  const volatile std::sig_atomic_t* interrupted = nullptr;
  std::vector<std::int64_t>* instructions = nullptr;  // if given, takes each tick's, rounded as in TargetRecord
};

// The target's figures over a run.
struct TargetRecord {
  std::string board;
  std::uint8_t real_bytes = 0;  // of a number of its model
  double instructions_per_count = 0;
  std::int64_t ticks = 0;  // answered
  // Instructions of a tick, each rounded to whole instructions. Where a count is several instructions long, rounding
  // removes where in a count the tick began, which depends on how the link's bytes came.
  std::int64_t min_instructions = std::numeric_limits<std::int64_t>::max(), max_instructions = 0, sum_instructions = 0;
  std::int64_t max_tick = 0;          // the tick of max_instructions
  std::int64_t pulses = 0;            // of the step interrupt, each checked against the command
  std::uint32_t max_late_counts = 0;  // of them
  std::optional<hal::target::EndReport> end_report;
  std::uint32_t counter_hz = 0;
};

class QemuFirmware final : public Peer {
 public:
  // `params` are those of `scenario`, accepted by firmware::validate(). Both must outlive the firmware.
  QemuFirmware(const sim::Scenario& scenario, const firmware::ControllerParams& params, QemuFirmwareOptions options);

  hal::Status connect() override;
  hal::Status send(Lap& lap) override;
  hal::Status receive(Lap& lap) override;
  [[nodiscard]] bool computes_in_parallel() const override { return true; }
  [[nodiscard]] std::string trouble() const override { return trouble_; }
  [[nodiscard]] PeerFailure failure() const override { return failure_; }
  [[nodiscard]] pid_t pid() const { return qemu_.pid(); }  // 0: it does not run
  [[nodiscard]] const TargetRecord& record() const { return record_; }

 private:
  hal::Status fail(hal::Status status, const std::string& text, PeerFailure failure = PeerFailure::kLost);
  template <class M>
  hal::Status send_message(const M& message, std::int64_t tick);
  hal::Status receive_frame(hal::target::Frame& frame, Seconds timeout);
  hal::Status no_answer(hal::Status status, Seconds timeout);
  hal::Status report_death(const hal::target::FaultReport& words);
  hal::Status report_watchdog(const std::string& registers);
  hal::Status compare(const hal::target::Hello& hello);
  hal::Status send_params();
  hal::Status judge(const hal::target::Verdict& verdict);
  hal::Status check_reply(std::int64_t tick);
  hal::Status late_after(std::int64_t tick);
  hal::Status check_pulses(std::int64_t tick, const hal::target::PlayedPulses& played);
  void count_instructions(std::int64_t tick);
  hal::Status finish();
  [[nodiscard]] std::string when() const;

  const sim::Scenario& scenario_;
  const firmware::ControllerParams& params_;
  QemuFirmwareOptions options_;
  std::unique_ptr<hal::target::World> world_;
  std::unique_ptr<hal::target::Reply> reply_;
  std::optional<std::int64_t> tick_;  // being exchanged
  // Commands with pulses not reported yet: of this tick and the next.
  firmware::StepCommand commanded_, commanded_next_;
  std::vector<std::uint8_t> received_, sent_;
  std::size_t used_ = 0;  // of received_
  TargetRecord record_;
  std::string trouble_;
  PeerFailure failure_ = PeerFailure::kLost;
  QemuProcess qemu_;
};

}  // namespace ballast::sil
