// The processors of this thread and of a process it takes turns with: one message there, one back.
//
// Apart: on any processors, so each on one of its own, and this thread looks for the message again and again, for to
// wake a processor from its sleep is dear, on a virtual machine as dear as half a turn and more. Together: both on one
// processor, where who waits sleeps; the other wakes it cheaply. Apart is faster where two processors are free for it,
// and several times slower where they are not. Which it is shows in messages that do not come while they are looked
// for; then it is together for a while, the longer the more often that happens. Who is given a share of more processors
// (a quota) and not processors of his own has to say so (taskset): that does not show.
#pragma once

#include <sched.h>
#include <sys/types.h>

#include <chrono>

namespace ballast::sil {

class Turns {
 public:
  static constexpr std::chrono::microseconds kLookedFor{1000};  // at most, of messages that take a tenth of it
  // Late messages that lie less than kForgiven turns apart add up to others who want a processor; a late one now and
  // then does not. On an idle virtual machine with two processors one in 500 to 3000 was late; beside another run, or a
  // program that never sleeps, one in 10 to 40.
  static constexpr int kForgiven = 64, kTooOften = 4 * kForgiven;
  // Turns: twice as many as the last time, unless it went well for kLongApart in between.
  static constexpr int kShortestTogether = 500, kLongestTogether = 8000, kLongApart = 2000;

  Turns() = default;
  ~Turns();
  Turns(const Turns&) = delete;
  Turns& operator=(const Turns&) = delete;

  // Together, with what this thread starts from now on. Where the system does not allow it nothing is changed here or
  // below, which costs time only.
  void start();
  // The process has been started: apart, if there are two processors.
  void take_with(pid_t process);
  [[nodiscard]] bool apart() const { return apart_; }
  // A message has come, or has not come in kLookedFor. Only while apart.
  void came();
  void did_not_come();
  // A message is waited for otherwise.
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
