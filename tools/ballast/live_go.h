// Plans courses for the live page: starts `ballast operate go` for each wish, and never waits for it. A planner that
// fails, hangs or is late costs the live server nothing.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/lcm/messages.h"
#include "tools/program/descriptor.h"
#include "tools/program/subprocess.h"

namespace ballast {

using FloorPlace = std::array<double, 2>;  // m, space frame

struct GoWish {
  std::string who;
  FloorPlace to{};
  std::vector<FloorPlace> via;  // in order
};

// A wish has at most so many places on the way.
inline constexpr std::size_t kMostVia = 20;

// Empty, or why no course is planned for it.
std::string wish_refusal(const GoWish& wish);
// "(0.5, 0.2) m by 3 places".
std::string wish_text(const GoWish& wish);

class LiveGo {
 public:
  // How a wish ended, in the words of the planner or about it.
  struct Answer {
    GoWish wish;
    bool obeyed = false;      // the controller follows the course, or the ball rests there already
    bool has_course = false;  // the controller follows a course of this wish
    std::string text;
  };

  explicit LiveGo(std::string url) : url_(std::move(url)) {}

  // Starts a planner for the run of this status. The one at work is killed. Empty, or why it could not be started.
  std::string start(GoWish wish, const controller_status_t& status);
  // Kills the planner. The wish that ends with it; none: there was none.
  std::optional<GoWish> drop();

  // To be called often. `status`: the newest of the shown run; null: the run has ended. A planner's work is of no use
  // after another command has stopped the masses, so it is killed then. A halt of its own is no such command.
  [[nodiscard]] std::optional<Answer> poll(const controller_status_t* status);

  // A line of the planner before its answer. To be called until there is none, and before poll(), which gives no answer
  // while a line is not told.
  struct Progress {
    std::string text;
    bool sets_out = false;  // a course to a rest on the way has come into force
  };
  [[nodiscard]] std::optional<Progress> progress();

  // The wish whose planner is at work; null: none.
  [[nodiscard]] const GoWish* wish() const { return wish_ ? &*wish_ : nullptr; }
  // That planner has said that it halts the ball first.
  [[nodiscard]] bool halts_first() const { return halts_first_; }

 private:
  using Clock = std::chrono::steady_clock;

  Answer give_up(const std::string& why);
  void read();
  // The first line that is not told yet, where it is progress.
  [[nodiscard]] std::optional<std::string> progress_line() const;
  // The planner has brought the controller into this mode.
  [[nodiscard]] bool halts_itself(int mode) const;

  std::string url_;
  std::optional<GoWish> wish_;
  std::int64_t run_id_ = 0;
  int mode_ = 0;  // of the controller, when the wish came
  Clock::time_point begun_;
  std::chrono::duration<double> patience_{};
  program::Subprocess planner_;
  program::Descriptor output_;
  std::string text_;         // what it has printed, and progress() has not told
  bool on_the_way_ = false;  // the ball rolls to a rest, as it has said
  bool halts_first_ = false;
};

}  // namespace ballast
