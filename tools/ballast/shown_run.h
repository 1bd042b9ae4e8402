// Chooses which run of a bus is shown: the first one heard, until it ends or is silent.
#pragma once

#include <cstdint>
#include <optional>

namespace ballast {

class ShownRun {
 public:
  enum class Heard : std::uint8_t {
    kOther,  // of another run, or of a peer that waits for one: not shown
    kSame,
    kFirst  // the first message of a run that is shown from now on
  };

  // A message of a run, at the wall clock's seconds.
  Heard hear(std::int64_t run_id, double now_s) {
    if (run_id == 0) return Heard::kOther;
    const bool first = run_id_ != run_id;
    if (first && run_id_ && !ended_ && now_s - heard_s_ < kSilent_s) return Heard::kOther;
    if (first) ended_ = false;
    run_id_ = run_id;
    heard_s_ = now_s;
    return first ? Heard::kFirst : Heard::kSame;
  }
  // The shown run has said that it ends.
  void end() { ended_ = true; }

  [[nodiscard]] bool ended() const { return ended_; }
  [[nodiscard]] std::int64_t run_id() const { return run_id_.value_or(0); }  // 0: none yet

 private:
  static constexpr double kSilent_s = 3;  // after this time without a message, another run may be shown

  std::optional<std::int64_t> run_id_;
  bool ended_ = false;
  double heard_s_ = 0;
};

}  // namespace ballast
