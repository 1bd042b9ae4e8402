#include "tools/ballast/live_go.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <system_error>

#include "tools/ballast/go_words.h"
#include "tools/go/go_plan.h"
#include "tools/program/program.h"
#include "tools/summary/controller_words.h"

namespace ballast {

namespace {

// For planning, and for the planner to hand over and to end.
constexpr double kPlan_s = 20, kPlanPerVia_s = 5, kEnd_s = 40;
constexpr std::size_t kLongestText = 6000;

std::string option(const char* name, const FloorPlace& place) {
  return fmt::format("--{}={:.9g},{:.9g}", name, place[0], place[1]);
}

bool is_near(const FloorPlace& place) {
  return std::all_of(place.begin(), place.end(),
                     [](double x) { return std::fabs(x) <= go::kFarthestPlace_m; });  // no NaN
}

bool masses_move(const controller_status_t& status) {
  const double* const velocity = status.commanded_velocity;
  return std::any_of(velocity, velocity + status.motor_count, [](double v) { return v != 0; });
}

// In these modes the masses stop or do not move, and a course that was planned before must not begin.
bool is_stopped(int mode) {
  return mode == controller_status_t::MODE_STOPPING || mode == controller_status_t::MODE_HALTING ||
         mode == controller_status_t::MODE_TRIPPED || mode == controller_status_t::MODE_DISARMED;
}

// The lines of a planner as one, without the prefix of errors.
std::string in_one_line(const std::string& text) {
  std::string out;
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find('\n', from), text.size());
    std::string_view line = std::string_view(text).substr(from, end - from);
    if (line.starts_with(kErrorPrefix)) line.remove_prefix(kErrorPrefix.size());
    if (!line.empty()) out.append(out.empty() ? "" : "; ").append(line);
    from = end + 1;
  }
  return out;
}

}  // namespace

std::string wish_refusal(const GoWish& wish) {
  if (wish.via.size() > kMostVia)
    return fmt::format("{} places on the way; allowed: at most {}", wish.via.size(), kMostVia);
  if (!is_near(wish.to) || !std::all_of(wish.via.begin(), wish.via.end(), is_near))
    return fmt::format("a place is too far away; allowed: coordinates up to {:g} m", go::kFarthestPlace_m);
  return "";
}

std::string wish_text(const GoWish& wish) {
  const std::string to = go::place_text({wish.to[0], wish.to[1]});
  if (wish.via.empty()) return to;
  return fmt::format("{} by {} {}", to, wish.via.size(), wish.via.size() == 1 ? "place" : "places");
}

std::string LiveGo::start(GoWish wish, const controller_status_t& status) {
  (void)drop();
  const std::string path = program::beside_this_program("ballast");
  auto pipe = program::open_pipe();
  if (!pipe) return program::cannot_start(path, {errno, std::generic_category()});
  const double limit_s = kPlan_s + kPlanPerVia_s * static_cast<double>(wish.via.size());
  program::ProcessStart start{.arguments = {path, "operate", "go", "--lcm", url_, option("to", wish.to),
                                            fmt::format("--time-limit={}", limit_s)},
                              .input = program::ProcessStart::kNull,
                              .output = pipe->writing.get(),
                              .error = pipe->writing.get(),
                              .ends_with_parent = true,
                              .own_group = true};
  for (const FloorPlace& place : wish.via) start.arguments.push_back(option("via", place));
  if (const auto error = planner_.start(start)) return program::cannot_start(path, error);
  output_ = std::move(pipe->reading);
  fcntl(output_.get(), F_SETFL, fcntl(output_.get(), F_GETFL) | O_NONBLOCK);
  text_.clear();
  on_the_way_ = halts_first_ = false;
  wish_ = std::move(wish);
  run_id_ = status.run_id;
  mode_ = status.mode;
  begun_ = Clock::now();
  patience_ = std::chrono::duration<double>(limit_s + kEnd_s);
  return "";
}

std::optional<GoWish> LiveGo::drop() {
  if (!wish_) return std::nullopt;
  planner_ = program::Subprocess();  // kills it
  output_ = program::Descriptor();
  return std::exchange(wish_, std::nullopt);
}

std::optional<LiveGo::Answer> LiveGo::poll(const controller_status_t* status) {
  if (!wish_) return std::nullopt;
  read();
  const auto end = planner_.wait(std::chrono::seconds(0));
  if (end) read();                           // what it printed between the last read and its end
  if (progress_line()) return std::nullopt;  // to be told first
  if (!end) {
    if (on_the_way_ && status != nullptr && masses_move(*status))
      begun_ = Clock::now();  // the planner waits for the ball
    if (status == nullptr || status->run_id != run_id_) return give_up("the run ended before the course was planned");
    if (is_stopped(status->mode) && !is_stopped(mode_) && !halts_itself(status->mode))
      return give_up("dropped: the controller is " + std::string(sil::mode_text(status->mode)));
    if (Clock::now() - begun_ > patience_)
      return give_up(fmt::format("the planner did not end within {} s", patience_.count()));
    return std::nullopt;
  }
  const bool obeyed = end->exit_status == program::kExitCompleted;
  Answer answer{*drop(), obeyed, obeyed && text_.find(kRestsThere) == std::string::npos, in_one_line(text_)};
  if (answer.text.empty()) answer.text = "the planner ended: " + end->text();
  return answer;
}

std::optional<LiveGo::Progress> LiveGo::progress() {
  if (!wish_) return std::nullopt;
  read();
  const std::optional<std::string> line = progress_line();
  if (!line) return std::nullopt;
  text_.erase(0, line->size() + 1);
  Progress progress{*line};
  halts_first_ = halts_first_ || progress.text.find(kHaltsFirst) != std::string::npos;
  if (progress.text.find(kOnItsWay) != std::string::npos) {
    progress.sets_out = on_the_way_ = true;
    halts_first_ = false;
    mode_ = controller_status_t::MODE_RUNNING;
  }
  return progress;
}

bool LiveGo::halts_itself(int mode) const {
  const bool halts = mode == controller_status_t::MODE_HALTING || mode == controller_status_t::MODE_STOPPING;
  return halts && halts_first();
}

LiveGo::Answer LiveGo::give_up(const std::string& why) { return {*drop(), false, false, why}; }

std::optional<std::string> LiveGo::progress_line() const {
  const std::size_t end = text_.find('\n');
  if (!wish_ || end == std::string::npos) return std::nullopt;
  const std::string line = text_.substr(0, end);
  // Another line is not known, but is no answer where one of the planner follows.
  const bool goes_on = !line.starts_with(kErrorPrefix) && text_.find('\n', end + 1) != std::string::npos;
  return goes_on || is_progress(line) ? std::optional(line) : std::nullopt;
}

void LiveGo::read() {
  for (;;) {
    char bytes[4096];
    const ssize_t size = ::read(output_.get(), bytes, sizeof bytes);
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return;
    text_.append(bytes, std::min(static_cast<std::size_t>(size), kLongestText - std::min(text_.size(), kLongestText)));
  }
}

}  // namespace ballast
