// ballast operate go: plans a course to a place from where the robot is, and hands it over to its controller.
#include "tools/ballast/go_command.h"

#include <fmt/core.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <functional>
#include <future>
#include <iostream>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include "tools/ballast/bus_words.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/go_words.h"
#include "tools/go/go_plan.h"
#include "tools/go/lost_course.h"
#include "tools/go/standpoint.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"
#include "tools/recording/receive_buffer.h"
#include "tools/recording/scenario_beacon.h"
#include "tools/summary/controller_words.h"

namespace ballast {

namespace {

using go::place_text;
using program::short_number;
using program::short_time;
using Clock = hal::WallClock;

double seconds_since(Clock::time_point start) { return hal::Seconds(Clock::now() - start).count(); }

// Two numbers with a comma between them, and nothing else.
std::optional<Eigen::Vector2d> place_of(const std::string& text) {
  const char *at = text.data(), *const end = at + text.size();
  Eigen::Vector2d place_m;
  for (const int k : {0, 1}) {
    if (k == 1 && (at == end || *at++ != ',')) return std::nullopt;
    const auto [after, error] = std::from_chars(at, end, place_m[k]);
    if (error != std::errc() || !(std::fabs(place_m[k]) <= go::kFarthestPlace_m)) return std::nullopt;
    at = after;
  }
  if (at != end) return std::nullopt;
  return place_m;
}

std::string place_refusal(const char* key, const std::string& text) {
  return fmt::format("{0} = \"{1}\": is no place; allowed: X,Y in m, two numbers from -{2:g} to {2:g} without a space",
                     key, text, go::kFarthestPlace_m);
}

// A run as its bus tells of it.
class RunOnBus {
 public:
  explicit RunOnBus(hal::Bus& bus) : bus_(bus) {
    bus_.subscribe<scenario_piece_t>(hal::kChannelScenario, [this](const scenario_piece_t& m) { take(m); });
    bus_.subscribe<plant_state_t>(hal::kChannelPlantState, [this](const plant_state_t& m) { plant_ = m; });
    bus_.subscribe<operator_t>(hal::kChannelCourse, [this](const operator_t& m) { take(m); });
    bus_.subscribe<operator_t>(hal::kChannelOperator, [this](const operator_t& m) {
      if (m.command == operator_t::COMMAND_GO) {
        others_ = others_ || m.course != own_;
        part_at_.insert_or_assign(m.course, Clock::now());
      }
      take(m);
    });
  }
  RunOnBus(const RunOnBus&) = delete;
  RunOnBus& operator=(const RunOnBus&) = delete;

  // Everything that a course needs to be known: the scenario, a state, and the course that is followed.
  [[nodiscard]] bool known(const controller_status_t& status) const {
    return scenario_ && plant_ && (status.course == 0 || courses_.contains(status.course));
  }
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  [[nodiscard]] bool has_scenario() const { return scenario_.has_value(); }
  [[nodiscard]] const sim::Scenario& scenario() const { return *scenario_; }
  // From now on the parts of other courses are noticed.
  void hand_over(const go::HostCourse& course) {
    courses_.insert_or_assign(course.number, course);
    own_ = course.number;
    others_ = false;
  }
  [[nodiscard]] bool heard_others() const { return others_; }
  // For how long no part of this course has come since `from`; 0: all of them have.
  [[nodiscard]] double silence_s(std::int64_t course, Clock::time_point from) const {
    if (courses_.contains(course)) return 0;
    const auto part_at = part_at_.find(course);
    return seconds_since(part_at != part_at_.end() ? std::max(part_at->second, from) : from);
  }
  [[nodiscard]] go::Heard heard(const controller_status_t& status) const {
    const auto course = courses_.find(status.course);
    return {*scenario_, status, *plant_, course == courses_.end() ? std::nullopt : std::optional(course->second)};
  }

 private:
  void take(const scenario_piece_t& piece) {
    if (scenario_) return;
    const std::string text = pieces_.take(piece);
    if (text.empty()) return;
    const auto read = sim::parse_scenario(text, "the scenario on the bus");
    if (read.ok()) {
      scenario_ = read.scenario;
    } else {
      trouble_ = to_string(read.errors.front());
    }
  }
  void take(const operator_t& message) {
    if (auto course = parts_.take(message)) courses_.insert_or_assign(course->number, *course);
  }

  hal::Bus& bus_;
  sil::ScenarioPieces pieces_;
  go::CourseParts parts_;
  std::optional<sim::Scenario> scenario_;
  std::optional<plant_state_t> plant_;
  std::map<std::int64_t, go::HostCourse> courses_;
  std::string trouble_;
  std::int64_t own_ = 0;  // number of the course that is handed over here
  bool others_ = false;
  std::map<std::int64_t, Clock::time_point> part_at_;  // when the newest part of a course came
};

// One go, from the wish to the course in force, or with --wait to the place.
class Going {
  // The ball is there within this part of the way, or this far.
  static constexpr double kThere = 0.02, kLeastThere_m = 1e-3;
  static constexpr double kNear = 0.05;     // of the radius: feedback takes it away
  static constexpr int kMostDisturbed = 3;  // by other operators' courses

 public:
  // `task`: the places; plan() adds the rest.
  Going(const GoCommand& command, go::GoTask task, hal::Bus& bus, sil::BusOperator& end,
        const volatile std::sig_atomic_t* signalled)
      : command_(command), task_(std::move(task)), bus_(bus), end_(end), run_(bus), signalled_(signalled) {}

  int run() {
    if (const auto status = meet()) return *status;
    for (int times = 0;; ++times) {
      const int status = go_all_the_way();
      if (!lost_ || times == go::kMostGoesOn) return status;
    }
  }

 private:
  // Once: `lost_` where the ball has lost its course.
  int go_all_the_way() {
    lost_ = false;
    in_force_ = {};
    from_rest_.reset();
    int status = go();
    while (status == program::kExitCompleted && in_force_.on_the_way) {
      status = reach_the_rest();
      if (status == program::kExitCompleted) status = go();
    }
    const bool waits = command_.wait && in_force_.number != 0;
    return status == program::kExitCompleted && waits ? arrive() : status;
  }

  // Plans and hands over, to the place or to a rest on the way there, until that course is in force.
  int go() {
    // The longer a plan takes, the later it begins while the ball rolls. One that came too late shortens the next
    // search.
    constexpr double kFirstPatience_s = 0.55, kPatienceIfLate_s = 0.4, kMorePatience = 1.6;
    double patience_s = kFirstPatience_s;
    std::shared_ptr<const go::GoPlan> late;
    bool sent_again = false;
    for (;;) {
      if (const auto status = await_others()) return *status;
      if (is_replaced()) return ended_early();
      if (const auto status = halt_if_lost()) return *status;
      if (takes_no_course()) return refuse_mode();
      planned_on_ = end_.status().course;
      const std::int64_t from_tick = end_.status().tick + ticks_in(patience_s) + handover_ticks();
      std::string why;
      const auto at = go::standpoint_at(run_.heard(end_.status()), from_tick, why);
      if (!at) return refuse("no course: " + why);
      if (rests_there(*at)) return say_it_rests_there();
      go::GoOutcome outcome;
      if ((at->rests || at->hangs) && from_rest_ && begins_at(*from_rest_, at->at)) {
        outcome.plan = std::exchange(from_rest_, std::nullopt);
      } else {
        if (!in_force_.on_the_way) from_ = {at->at.place_m[0], at->at.place_m[1]};
        // A ball that has come to rest meanwhile is planned for from there.
        const bool rolls = !at->rests && !at->hangs;
        const auto rests = [&] { return rolls && end_.status().tick > from_tick && has_come_to_rest(); };
        const auto useless = [&] { return is_replaced() || rests(); };
        if (const auto status = plan(*at, task(true, late), useless, outcome)) return *status;
        if (!outcome.plan && !is_replaced() && rests()) {
          begun_ = Clock::now();
          late.reset();
          continue;
        }
      }
      if (is_replaced()) return ended_early();
      if (!outcome.plan && leaves_own_motion(*at)) {
        own_motion_ = false;
        if (const auto status = halt_first("no course is found in time from the motion that is under way"))
          return *status;
        continue;
      }
      if (!outcome.plan) return refuse_plan(outcome.why.empty() ? refused_ : outcome.why, *at);
      const bool last = seconds_since(begun_) >= command_.time_limit_s;
      const std::int64_t soonest = end_.status().tick + handover_ticks();
      bool is_late = true;
      if (at->rests || from_tick >= soonest || last) {
        const bool armed = end_.status().mode == controller_status_t::MODE_ARMED;
        const auto status = hand_over(*outcome.plan, at->rests ? (armed ? 0 : soonest) : from_tick, last);
        if (status) return *status;
        is_late = end_.status().refusal == controller_status_t::REFUSAL_LATE;
      }
      if (is_late && at->rests && !std::exchange(sent_again, true)) {
        from_rest_ = std::move(outcome.plan);
      } else if (is_late && !at->rests) {
        patience_s = late ? kMorePatience * patience_s : kPatienceIfLate_s;
        late = std::make_shared<const go::GoPlan>(std::move(*outcome.plan));
      } else {
        patience_s *= kMorePatience;
        late.reset();
      }
    }
  }

  // On the course or motion that it has followed to the end.
  [[nodiscard]] bool has_come_to_rest() const {
    const go::Heard heard = run_.heard(end_.status());
    if (!go::ball_rests(heard)) return false;
    std::string why;
    const auto at = go::standpoint_at(heard, end_.status().tick + 1, why);
    return at && at->hangs;
  }
  // The task's place is where the ball is and, as it may rock a little, where it will be.
  [[nodiscard]] bool rests_there(const go::Standpoint& at) const {
    const Eigen::Vector2d ahead_m(at.at.place_m[0], at.at.place_m[1]);
    const double off_m = std::max((place() - task_.to_m).norm(), (ahead_m - task_.to_m).norm());
    return at.hangs && !in_force_.on_the_way && task_.via_m.empty() && off_m <= kLeastThere_m;
  }
  [[nodiscard]] int say_it_rests_there() const {
    std::cout << fmt::format("the ball {}, at {}, {} mm from {}", kRestsThere, place_text(place()),
                             short_number(1e3 * (place() - task_.to_m).norm(), 0.01), place_text(task_.to_m))
              << std::endl;
    return program::kExitCompleted;
  }

  // A plan from rest serves where place and attitude differ by less than feedback takes away, and no mass has moved.
  [[nodiscard]] static bool begins_at(const go::GoPlan& plan, const plan::ReferencePoint& at) {
    constexpr double kTurn_rad = 0.02, kRate_radps = 0.03;
    constexpr double kRounding = 1e-6;  // rad or m, of masses; a step is far longer
    const sim::Scenario& moved = plan.moved;
    const auto& q = at.state.q;
    const Eigen::Quaterniond orientation(q[0], q[1], q[2], q[3]);
    const double off_m =
        std::hypot(moved.initial.position_W_m.x() - at.place_m[0], moved.initial.position_W_m.y() - at.place_m[1]);
    bool same =
        off_m < kNear * moved.ball.radius_m && moved.initial.orientation.angularDistance(orientation) < kTurn_rad;
    const plan::Vec& omega = at.state.omega_B;
    const Eigen::Vector3d omega_B_radps(omega.x, omega.y, omega.z);
    same = same && (moved.initial.angular_velocity_B_radps - omega_B_radps).norm() < kRate_radps;
    for (std::size_t i = 0; i < moved.masses.size(); ++i) {
      same = same && std::fabs(moved.masses[i].initial_position - at.state.position[i]) < kRounding;
    }
    return same;
  }

  [[nodiscard]] bool follows(const controller_status_t& s) const {
    return s.course == in_force_.number && s.mode == controller_status_t::MODE_RUNNING;
  }
  // A halt, a stop or another operator's course has ended the one to a rest on the way.
  [[nodiscard]] bool is_replaced() const { return in_force_.on_the_way && !follows(end_.status()); }
  // Counts from the end of the course in force; negative until then.
  [[nodiscard]] double past_its_end_s(const controller_status_t& s) const {
    const double time_s = static_cast<double>(s.tick - s.course_tick) * run_.scenario().run.control_period_s;
    return time_s - s.motion_delay_s - in_force_.duration_s;
  }

  // Plans the remaining way while the ball rolls to the end of the course in force, and waits for that. Where no plan
  // is found, go() tries again from there.
  int reach_the_rest() {
    begun_ = Clock::now();
    const controller_status_t status = end_.status();
    const double left_s = -past_its_end_s(status);
    const auto end_tick =
        status.tick + static_cast<std::int64_t>(std::ceil(left_s / run_.scenario().run.control_period_s));
    go::GoOutcome outcome;
    std::string why;
    if (const auto at = go::standpoint_at(run_.heard(status), end_tick, why)) {
      const auto useless = [&] { return watch_.lost(end_.status()) || !follows(end_.status()); };
      if (const auto failed = plan(*at, task(false, nullptr), useless, outcome)) return *failed;
      from_rest_ = std::move(outcome.plan);
    }
    const auto planned = Clock::now() - begun_;
    const int reached = reach_the_end([this] {
      return go::ball_rests(run_.heard(end_.status())) &&
             (place() - in_force_.end_m).norm() < kNear * run_.scenario().ball.radius_m;
    });
    begun_ = Clock::now() - planned;  // the time for planning does not run while the ball rolls
    return reached;
  }

  // Waits for the end of the course in force, and until `there` holds, for as long as feedback takes to bring a ball
  // there that was disturbed on its way.
  int reach_the_end(const std::function<bool()>& there) {
    constexpr double kSettles_s = 3;
    const auto over = [&](const controller_status_t& s) {
      lost_ = watch_.lost(s);
      const double over_s = past_its_end_s(s);
      return lost_ || !follows(s) || over_s >= kSettles_s || (over_s >= 0 && there());
    };
    const hal::Status status = end_.follow(over);
    if (status == hal::Status::kInterrupted) return interrupted();
    if (status != hal::Status::kOk) return bus_trouble(end_);
    if (lost_) {
      std::cout << "the ball has lost its course, at " << place_text(place()) << std::endl;
      return program::kExitEnvelope;
    }
    return follows(end_.status()) ? program::kExitCompleted : ended_early();
  }

  [[nodiscard]] int interrupted() const {
    const bool follows_it = in_force_.number != 0 && follows(end_.status());
    return could_not(follows_it ? "interrupted; the ball goes on to " + place_text(in_force_.end_m) : "interrupted");
  }

  [[nodiscard]] int ended_early() const {
    const controller_status_t& status = end_.status();
    const bool replaced = status.mode == controller_status_t::MODE_RUNNING && status.course != in_force_.number;
    std::cout << fmt::format("the course ended before the ball was there, at {}: {}", place_text(place()),
                             replaced ? "another operator's course took its place" : sil::status_text(status))
              << std::endl;
    return program::kExitEnvelope;
  }

  // Learns the run, and how fast it goes.
  std::optional<int> meet() {
    const std::int64_t first_tick = end_.status().tick;
    const auto start = Clock::now();
    constexpr double kListen_s = 0.05;
    const auto met = [&] {
      return !run_.trouble().empty() || (run_.known(end_.status()) && seconds_since(start) > kListen_s);
    };
    const hal::Status status = bus_.receive_until(hal::after(start, hal::Seconds(command_.bus.peer_timeout_s)), met);
    ticks_per_s_ = static_cast<double>(end_.status().tick - first_tick) / seconds_since(start);
    if (status == hal::Status::kInterrupted) return could_not("interrupted");
    if (status == hal::Status::kIo) return could_not("the LCM bus failed");
    if (!run_.trouble().empty()) return could_not(run_.trouble());
    if (status != hal::Status::kOk) return not_known();
    if (!run_.scenario().control.governor) {
      return refuse("this run has no governor, which certifies a course: its scenario needs control.governor = true");
    }
    params_ = program::make_controller_params("ballast", run_.scenario());
    if (params_ == nullptr) return program::kExitCouldNotRun;
    search_ticks_ = firmware::governor_params(*params_).search_ticks;
    return std::nullopt;
  }

  [[nodiscard]] int refuse_plan(const std::string& why, const go::Standpoint& at) const {
    const bool from_rest = at.rests || at.hangs || !go::beyond_one_course(run_.scenario(), at.at, task_).empty();
    std::string then = from_rest ? "" : "; the ball rolls: there may be one once it is halted";
    if (in_force_.on_the_way) then = "; the ball rests on its way, at " + place_text(place());
    return refuse(fmt::format("no course to {}: {}{}", place_text(task_.to_m), why, then));
  }

  [[nodiscard]] bool takes_no_course() const {
    const int mode = end_.status().mode;
    return mode == controller_status_t::MODE_DISARMED || mode == controller_status_t::MODE_TRIPPED;
  }
  // As the controller would, after the search.
  [[nodiscard]] int refuse_mode() const {
    controller_status_t refused = end_.status();
    refused.refusal = controller_status_t::REFUSAL_MODE;
    return refuse(sil::refused_text("course", sil::refusal_text(refused)));
  }

  [[nodiscard]] int not_known() const {
    const std::string what = run_.has_scenario() ? "the course that the controller follows" : "the run's scenario";
    return could_not(fmt::format("{} is not heard on this bus (listened on {} for {:g} s)", what, bus_.url(),
                                 command_.bus.peer_timeout_s));
  }

  [[nodiscard]] bool another_comes() const {
    const controller_status_t& status = end_.status();
    const std::int64_t coming = status.course_coming;
    if (coming == 0) return status.mode == controller_status_t::MODE_PENDING;
    return coming != number_ && coming != abandoned_;
  }

  // Another operator's course is not handed over any more, as its planner has died: its parts are silent for so long
  // that one whose parts all came before this go would have its certificate. `start`: of waiting for it.
  [[nodiscard]] bool never_comes(Clock::time_point start) const {
    constexpr double kSilence_s = 1;
    const controller_status_t& status = end_.status();
    return status.course_coming != 0 && status.mode != controller_status_t::MODE_PENDING &&
           run_.silence_s(status.course_coming, start) > kSilence_s + search_ticks_ / ticks_per_s_;
  }

  // Waits while another operator's course arrives, or waits for its certificate or its tick. One that does not come to
  // an end, because its planner has died, is replaced.
  std::optional<int> await_others() {
    if (another_comes()) {
      constexpr double kLongest_s = 5;
      say(fmt::format("another operator's course or move is about to begin: {}that", kWaitsFor));
      const auto start = Clock::now();
      const auto over = [&] { return !another_comes() || never_comes(start); };
      const hal::Status status = bus_.receive_until(hal::after(Clock::now(), hal::Seconds(kLongest_s)), over);
      if (status == hal::Status::kInterrupted) return could_not("interrupted");
      if (status == hal::Status::kIo) return could_not("the LCM bus failed");
      if (never_comes(start)) say(fmt::format("nothing more of that course is heard: {}", kTakesItsPlace));
      abandoned_ = end_.status().course_coming;
      begun_ = Clock::now();
    }
    const auto known = [&] { return run_.known(end_.status()); };
    const hal::Status status =
        bus_.receive_until(hal::after(Clock::now(), hal::Seconds(command_.bus.peer_timeout_s)), known);
    if (status == hal::Status::kInterrupted) return could_not("interrupted");
    if (status == hal::Status::kIo) return could_not("the LCM bus failed");
    return status == hal::Status::kOk ? std::nullopt : std::optional(not_known());
  }

  // Prints a line of the progress, once.
  void say(const std::string& line) {
    if (said_.insert(line).second) std::cout << line << std::endl;
  }

  // A halt or a stop is.
  static bool is_over(const controller_status_t& s) {
    return s.mode != controller_status_t::MODE_HALTING && s.mode != controller_status_t::MODE_STOPPING;
  }

  // A ball that is far from any motion is brought to rest first.
  std::optional<int> halt_if_lost() {
    if (!is_over(end_.status())) {
      std::cout << fmt::format("the controller is {}: {}the end of that", sil::mode_text(end_.status().mode), kWaitsFor)
                << std::endl;
      if (end_.follow(is_over) != hal::Status::kOk) return bus_trouble(end_);
      begun_ = Clock::now();
    }
    if (!go::needs_halt(run_.heard(end_.status()))) return std::nullopt;
    const bool backup = end_.status().backup_active != 0;
    return halt_first(backup ? "the governor has the ball on its backup" : "the ball is off its motion");
  }

  std::optional<int> halt_first(const std::string& why) {
    std::cout << fmt::format("{}: {}", why, kHaltsFirst) << std::endl;
    in_force_ = {};
    from_rest_.reset();
    if (const auto status = tell(end_, firmware::OperatorCommand::kHalt, "halt")) return status;
    if (end_.follow(is_over) != hal::Status::kOk) return bus_trouble(end_);
    begun_ = Clock::now();
    return std::nullopt;
  }

  // The scenario's own motion runs, and was not made to be left. A course is looked for from it for a short time.
  [[nodiscard]] bool leaves_own_motion(const go::Standpoint& at) const {
    const controller_status_t& status = end_.status();
    return own_motion_ && status.mode == controller_status_t::MODE_RUNNING && status.course == 0 && !at.rests &&
           !at.hangs && go::beyond_one_course(run_.scenario(), at.at, task_).empty();
  }

  [[nodiscard]] std::int64_t ticks_in(double wall_s) const {
    return static_cast<std::int64_t>(std::ceil(wall_s * ticks_per_s_));
  }
  // From the first part to the course's certificate. Each part is answered, within a millisecond or a tick, seldom two.
  [[nodiscard]] std::int64_t handover_ticks() const {
    constexpr int kMostPieces = 64;  // of a way with a rest on it
    const int values = firmware::kMostReferenceFloats + params_->ball.mass_count * 3 * kMostPieces;
    const std::int64_t parts = values / firmware::kCoursePart + 1;
    constexpr double kPart_s = 1.2e-3;
    return std::max(3 * parts / 2, ticks_in(static_cast<double>(parts) * kPart_s)) +
           static_cast<std::int64_t>(search_part_ * search_ticks_);
  }

  // `sets_out`: a long way may be planned up to a rest on it. `late`: a plan of the same that came too late, or null.
  [[nodiscard]] go::GoTask task(bool sets_out, std::shared_ptr<const go::GoPlan> late) const {
    go::GoTask task = task_;
    task.duration_s = command_.duration_s;
    task.objective = command_.objective == "time"     ? plan::Objective::kTime
                     : command_.objective == "effort" ? plan::Objective::kEffort
                                                      : plan::Objective::kFriction;
    task.sets_out = sets_out && task.via_m.empty() && !task.duration_s && task.objective != plan::Objective::kTime;
    task.late = std::move(late);
    return task;
  }

  // Plans in another thread, and listens to the bus meanwhile. `useless`: a plan would be, by what was heard.
  std::optional<int> plan(const go::Standpoint& standpoint, const go::GoTask& task,
                          const std::function<bool()>& useless, go::GoOutcome& outcome) {
    const plan::ReferencePoint& at = standpoint.at;
    constexpr double kOwnMotion_s = 2;
    double limit_s = command_.time_limit_s;
    if (leaves_own_motion(standpoint)) {
      if (!own_begun_) own_begun_ = Clock::now();
      limit_s = std::min(limit_s, hal::Seconds(*own_begun_ - begun_).count() + kOwnMotion_s);
    }
    std::atomic<bool> over = false;
    const auto stop = [&] { return over || *signalled_ != 0 || seconds_since(begun_) > limit_s; };
    const auto tell_of = [&](const std::string& tried) {
      constexpr double kSoon_s = 1;  // most plans are found by then
      if (command_.duration_s || seconds_since(begun_) > kSoon_s) say(tried);
    };
    auto planned = std::async(std::launch::async,
                              [&] { return go::plan_course(run_.scenario(), *params_, at, task, stop, tell_of); });
    const auto ready = [&] { return planned.wait_for(hal::Seconds(0)) == std::future_status::ready; };
    hal::Status status = hal::Status::kOk;
    while (!ready() && status != hal::Status::kIo && !useless()) {
      status = bus_.receive_until(hal::after(Clock::now(), hal::Seconds(0.005)), ready);
    }
    over = !ready();
    outcome = planned.get();
    if (*signalled_ != 0) return interrupted();
    if (status == hal::Status::kIo) return could_not("the LCM bus failed");
    return std::nullopt;
  }

  // Nullopt: it came too late, the governor took the ball on its backup meanwhile, another operator's course came
  // between, or the ball had to be halted first, and there is time for another plan.
  std::optional<int> hand_over(const go::GoPlan& plan, std::int64_t from_tick, bool last) {
    const double planned_s = seconds_since(begun_);
    const bool first = disturbed_ < kMostDisturbed;
    const std::int64_t followed = end_.status().course;
    if (first && (another_comes() || (followed != 0 && followed != planned_on_))) return plan_again();
    const auto start = Clock::now();
    const std::int64_t number = number_ = hal::draw_bus_number();
    const go::HostCourse course = go::make_course(number, from_tick, plan.moved, plan.reference);
    run_.hand_over(course);
    bool refused = false;
    const std::vector<firmware::CoursePart> parts = go::parts_of(course);
    for (const firmware::CoursePart& part : parts) {
      if (end_.tell(part) != hal::Status::kOk) return take_back(parts.front(), plan.end_m);
      refused = end_.status().refusal != controller_status_t::REFUSAL_NONE;
      if (refused) break;
    }
    const auto decided = [&](const controller_status_t& s) { return s.course == number || s.course_coming != number; };
    if (!refused && end_.follow(decided) != hal::Status::kOk) return take_back(parts.front(), plan.end_m);
    if (end_.status().course != number) {
      if (first && run_.heard_others()) return plan_again();
      return answer_refusal(followed, last);
    }
    in_force_ = {number, plan.on_the_way, plan.moved.duration_s, plan.end_m};
    watch_ = {};
    const std::string to = plan.on_the_way ? fmt::format(", {} {}", kOnItsWay, place_text(task_.to_m)) : "";
    std::cout << fmt::format(
                     "goes to {} in {} s from tick {} on{}, and needs f_s/N = {}, with its motors' swing at most {}; "
                     "planned in {:.2f} s, handed over in {:.2f} s",
                     place_text(plan.end_m), short_time(plan.moved.duration_s), end_.status().course_tick, to,
                     short_number(plan.need), short_number(plan.most_need), planned_s, seconds_since(start))
              << std::endl;
    return program::kExitCompleted;
  }

  // The hand-over has failed. An interrupted one is not to begin by itself later, nor to make the next operator wait: a
  // part that does not fit spoils the course.
  int take_back(firmware::CoursePart part, const Eigen::Vector2d& to_m) {
    if (*signalled_ == 0) return bus_trouble(end_);
    const controller_status_t& status = end_.status();
    const std::string to = place_text(to_m);
    if (status.course == part.course) return could_not("interrupted; the ball goes on to " + to);
    if (status.mode == controller_status_t::MODE_PENDING) {
      return could_not("interrupted; the course to " + to + " is about to begin; halt ends it");
    }
    part.first = part.count = 1;
    (void)end_.tell(part);  // once: an interrupted bus hears no answer
    return could_not("interrupted; the course to " + to + " is taken back");
  }

  // The controller has refused a course. `followed`: the one it follows. Nullopt: there is time for another plan.
  std::optional<int> answer_refusal(std::int64_t followed, bool last) {
    const std::int8_t refusal = end_.status().refusal;
    const bool is_late = refusal == controller_status_t::REFUSAL_LATE;
    if (is_late) search_part_ = std::min(2 * search_part_, 1.0);
    const std::string why = sil::refusal_text(end_.status());
    refused_ = sil::refused_text("course", why.empty() ? "another operator's took its place" : why);
    if (!why.empty() && run_.heard_others()) refused_ += "; another operator hands over courses, too";
    if ((is_late || refusal == controller_status_t::REFUSAL_NOT_CERTIFIED) && !last) return std::nullopt;
    // A motion that was started after a move runs from where the masses stood, which its scenario does not tell.
    if (refusal == controller_status_t::REFUSAL_OFF_COURSE && own_motion_ && followed == 0) {
      own_motion_ = false;
      return halt_first("the motion that is under way was not begun where its scenario begins");
    }
    return refuse(refused_);
  }

  // A few times: operators who plan again and again would disturb each other for ever.
  std::optional<int> plan_again() {
    ++disturbed_;
    begun_ = Clock::now();
    say(fmt::format("another operator's course came between: {}", kPlansAgain));
    return std::nullopt;
  }

  int arrive() {
    if (const int status = reach_the_end([this] { return is_there(); }); status != program::kExitCompleted)
      return status;
    const bool there = is_there();
    std::cout << fmt::format("is at {}, {} mm from there{}", place_text(place()),
                             short_number(1e3 * (place() - task_.to_m).norm(), 0.01),
                             there ? "" : fmt::format(": more than {} % of the way", 100 * kThere))
              << std::endl;
    return there ? program::kExitCompleted : program::kExitEnvelope;
  }

  // The ball's, by the newest messages.
  [[nodiscard]] Eigen::Vector2d place() const {
    const auto here = go::now(run_.heard(end_.status()));
    return {here.place_m[0], here.place_m[1]};
  }
  [[nodiscard]] bool is_there() const {
    return (place() - task_.to_m).norm() <= std::max(kThere * go::way_m(from_, task_), kLeastThere_m);
  }

  const GoCommand& command_;
  const go::GoTask task_;
  hal::Bus& bus_;
  sil::BusOperator& end_;
  RunOnBus run_;
  const volatile std::sig_atomic_t* signalled_;
  Clock::time_point begun_ = Clock::now();
  Eigen::Vector2d from_ = Eigen::Vector2d::Zero();  // where the way begins
  std::unique_ptr<firmware::ControllerParams> params_;
  double ticks_per_s_ = 0;
  int search_ticks_ = 0;
  double search_part_ = go::kFirstSearch;
  std::string refused_ = "the time for planning was over";  // why the controller refused the last course
  bool lost_ = false;
  struct {
    std::int64_t number = 0;
    bool on_the_way = false;  // it ends at a rest
    double duration_s = 0;
    Eigen::Vector2d end_m = Eigen::Vector2d::Zero();
  } in_force_;                                  // the newest course that was handed over here
  go::LostCourse watch_;                        // on that one
  std::optional<go::GoPlan> from_rest_;         // for the remaining way, or one that the controller refused as late
  bool own_motion_ = true;                      // a course is looked for from it
  std::optional<Clock::time_point> own_begun_;  // that search, with later ones where a plan came too late
  int disturbed_ = 0;                           // times that another operator's course came between
  std::int64_t number_ = 0;                     // of the newest course that was handed over here
  std::int64_t abandoned_ = 0;                  // of another's course that was waited for in vain
  std::int64_t planned_on_ = 0;                 // the course that the controller followed when the plan was begun
  std::set<std::string> said_;
};

}  // namespace

void add_go_options(CLI::App& command, GoCommand& options) {
  command.add_option("--to", options.to, "go: the place X,Y in m");
  command.add_option("--via", options.via, "go: a place X,Y on the way; can be repeated")->allow_extra_args(false);
  command.add_option("--time", options.duration_s, "go: duration in s; default: chosen")
      ->check(program::positive_finite());
  command
      .add_option("--objective", options.objective, "go: least friction, shortest time or least effort of the masses")
      ->check(program::one_of({"friction", "time", "effort"}))
      ->capture_default_str();
  command.add_option("--time-limit", options.time_limit_s, "go: wall time in s for planning")
      ->check(program::positive_finite())
      ->capture_default_str();
  command.add_flag("--wait", options.wait, "go: until the ball is there");
}

int go_on_bus(const GoCommand& command) {
  go::GoTask task;
  const auto to_m = place_of(command.to);
  if (!to_m) return refuse(place_refusal("--to", command.to));
  task.to_m = *to_m;
  for (const std::string& text : command.via) {
    const auto via_m = place_of(text);
    if (!via_m) return refuse(place_refusal("--via", text));
    task.via_m.push_back(*via_m);
  }
  const volatile std::sig_atomic_t* signalled = program::catch_signals();
  hal::Bus bus(with_receive_buffer(command.bus.url), signalled);
  if (!bus.good()) return program::refuse_bus("ballast", command.bus.url);
  sil::BusOperator end(bus, hal::Seconds(command.bus.peer_timeout_s));
  Going going(command, task, bus, end, signalled);
  if (end.connect() != hal::Status::kOk) return bus_trouble(end);
  return going.run();
}

}  // namespace ballast
