// The processors of this thread and of a process that it takes turns with: one message there, one back.
//
// Waking a sleeping processor is slow: on a virtual machine it takes half a turn and more. So this thread spins for its
// message while a second processor is free for the other process ("apart"). Where none is free, spinning makes turns
// several times slower. Messages that do not come while this thread spins reveal that. Then both share one processor
// for a while ("together"), where the waiting side sleeps and is woken cheaply; the while grows if this happens often.
// A CPU quota is not detected; pin with `taskset`.
#pragma once

#include <sched.h>
#include <sys/types.h>

#include <chrono>

namespace ballast::sil {

class Turns {
 public:
  static constexpr std::chrono::microseconds kSpin{1000};  // at most; a message usually takes a tenth of it
  // Late messages less than kForgiven turns apart show that other programs want the processors; a single one does not.
  // On an idle virtual machine with two processors one message in 500 to 3000 was late; beside another run, or a
  // program that never sleeps, one in 10 to 40.
  static constexpr int kForgiven = 64, kTooOften = 4 * kForgiven;
  // Turns together: twice as many as the last time, unless kLongApart turns went well in between.
  static constexpr int kShortestTogether = 500, kLongestTogether = 8000, kLongApart = 2000;

  Turns() = default;
  ~Turns();
  Turns(const Turns&) = delete;
  Turns& operator=(const Turns&) = delete;

  // Moves this thread, and processes it starts from now on, to one processor. Where the system does not allow that,
  // nothing changes here or below, which costs time only.
  void start();
  // Call once the process runs. Goes apart if there are two processors.
  void take_with(pid_t process);
  [[nodiscard]] bool apart() const { return apart_; }
  // While apart: a message has come, or has not come within kSpin.
  void came();
  void did_not_come();
  // While together: a message is waited for.
  void wait_together();

 private:
  void be_apart();
  void be_together();
  void move_process(const cpu_set_t& processors) const;

  cpu_set_t allowed_{};
  bool started_ = false;
  bool apart_ = false;
  pid_t process_ = 0;
  int late_ = 0, turns_apart_ = 0;
  int together_for_ = kShortestTogether / 2, together_left_ = 0;
};

}  // namespace ballast::sil
