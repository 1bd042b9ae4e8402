// ballast live: serves a page that shows the run on a bus and operates it.
#include <fmt/core.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>

#include "hal/lcm/bus.h"
#include "hal/lcm/scenario_piece.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/event_pipe.h"
#include "tools/ballast/live_feed.h"
#include "tools/ballast/live_go.h"
#include "tools/ballast/live_operator.h"
#include "tools/ballast/live_others.h"
#include "tools/ballast/longest_move.h"
#include "tools/go/lost_course.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"
#include "tools/recording/receive_buffer.h"

namespace ballast {

namespace {

using firmware::OperatorCommand;
using Json = nlohmann::json;

constexpr hal::Seconds kLookEvery{0.01};  // at requests of the page

struct LiveCommand {
  std::string url = hal::kDefaultLcmUrl;
  std::string listen = "127.0.0.1";
  int port = 8766;
};

// A request of the page: {"who": .., "do": "arm"}, or "move" with "mass", "to" and "speed_fraction", or "go" with the
// place "to" and the places "via".
struct Request {
  std::string who, what;
  bool is_space = false;  // the space bar: the halt or the stop that is of use now
  firmware::OperatorInput input;
  std::optional<GoWish> wish;  // of a go
  std::string refusal;         // not empty: it is not sent
  std::string needless;        // not empty: it is not sent, because what it asks for is under way
};

std::optional<double> number_in(const Json& request, const char* key) {
  const auto found = request.find(key);
  if (found == request.end() || !found->is_number()) return std::nullopt;
  return found->get<double>();
}

firmware::OperatorInput move_of(const Json& json, const controller_status_t& status, std::string& refusal) {
  const auto mass = number_in(json, "mass"), to = number_in(json, "to"), fraction = number_in(json, "speed_fraction");
  firmware::MoveRequest move;
  if (!mass || !to || *mass != std::floor(*mass)) {
    refusal = "it names no mass, or no target";
  } else if (*mass < 0 || *mass >= status.motor_count) {
    refusal = "there is no mass " + std::to_string(static_cast<long long>(*mass)) + " (they count from 0)";
  } else {
    const auto i = static_cast<std::size_t>(*mass);
    move.masses = 1u << i;
    move.target_position[i] = *to;
    move.speed_fraction = fraction.value_or(1);
  }
  return move;
}

std::optional<FloorPlace> place_in(const Json& json) {
  if (!json.is_array() || json.size() != 2 || !json[0].is_number() || !json[1].is_number()) return std::nullopt;
  return FloorPlace{json[0].get<double>(), json[1].get<double>()};
}

GoWish wish_of(const std::string& who, const Json& json, std::string& refusal) {
  GoWish wish{who, {}, {}};
  const auto to = json.contains("to") ? place_in(json["to"]) : std::nullopt;
  const Json via = json.value("via", Json::array());
  bool good = to.has_value() && via.is_array();
  if (good) {
    wish.to = *to;
    for (const Json& one : via) {
      const auto place = place_in(one);
      good = good && place;
      wish.via.push_back(place.value_or(FloorPlace{}));
    }
  }
  refusal = good ? wish_refusal(wish) : "it names no place [x, y]";
  return wish;
}

// The space bar sends this: the ball comes to rest where a governor can bring it there, else its masses do.
OperatorCommand brake_of(const controller_status_t& status, bool governor) {
  const bool halts = status.mode == controller_status_t::MODE_RUNNING || status.mode == controller_status_t::MODE_ARMED;
  return governor && halts ? OperatorCommand::kHalt : OperatorCommand::kStop;
}

// Empty, or why another press of the space bar sends nothing. A stop would end a halt: the masses would rest, and the
// ball would roll on.
std::string needless_brake(const controller_status_t& status, bool governor) {
  if (status.mode == controller_status_t::MODE_HALTING) return "the ball is being halted already";
  if (status.mode != controller_status_t::MODE_STOPPING) return "";
  return std::string("the masses are stopping already") +
         (governor ? "; press again once they rest, to halt the ball" : "");
}

// `governor`: the run has one.
std::optional<Request> read_request(const std::string& line, const controller_status_t& status, bool governor) {
  const Json json = Json::parse(line, nullptr, false);
  if (!json.is_object() || !json.contains("who") || !json.contains("do")) return std::nullopt;
  Request request;
  request.who = json["who"].get<std::string>();
  request.what = json["do"].get<std::string>();
  if (request.what == "arm") {
    request.input = OperatorCommand::kArm;
  } else if (request.what == "start") {
    request.input = OperatorCommand::kStart;
  } else if (request.what == "stop") {
    request.input = OperatorCommand::kStop;
  } else if (request.what == "halt") {
    request.input = OperatorCommand::kHalt;
  } else if (request.what == "reset") {
    request.input = OperatorCommand::kReset;
  } else if (request.what == "brake") {
    request.is_space = true;
    request.needless = needless_brake(status, governor);
    request.input = brake_of(status, governor);
    request.what = request.input.command == OperatorCommand::kHalt ? "halt" : "stop";
  } else if (request.what == "move") {
    request.input = move_of(json, status, request.refusal);
  } else if (request.what == "go") {
    request.wish = wish_of(request.who, json, request.refusal);
  } else {
    return std::nullopt;
  }
  return request;
}

// Connects the page's requests with the controller, and its answers with the page.
class Control {
 public:
  Control(hal::Bus& bus, const std::string& url, LiveFeed& feed)
      : operator_(bus), others_(operator_.sender()), go_(url), feed_(feed) {}

  void hear(const operator_t& message) {
    const controller_status_t* status = feed_.controller();
    if (status != nullptr && message.run_id == status->run_id) others_.hear(message, *status);
  }

  void take(const std::string& line) {
    const controller_status_t* status = feed_.controller();
    if (status == nullptr) {
      feed_.say(LiveFeed::Kind::kRefusal, "no controller is at work on this bus");
      return;
    }
    // Its scenario may not be known yet, or is of another version.
    const bool governor = feed_.has_governor() || status->governed != 0;
    const std::optional<Request> request = read_request(line, *status, governor);
    if (!request) return;
    if (!request->refusal.empty()) {
      feed_.say(LiveFeed::Kind::kRefusal, request->who + ": " + request->what + ": " + request->refusal);
      return;
    }
    if (request->wish) {
      followed_.reset();
      go(*request->wish, *status);
      return;
    }
    // A course that is planned must not begin after a newer command. Arming moves nothing.
    if (request->what != "arm") {
      drop_go(*request);
      followed_.reset();
    }
    if (!request->needless.empty()) {
      feed_.say(LiveFeed::Kind::kCommand, request->who + ": " + request->needless);
    } else if (!(request->is_space && operator_.brakes())) {
      report(operator_.tell(request->who, request->what, request->input, *status));
    }
  }

  void poll() {
    const controller_status_t* status = feed_.controller();
    const auto told = status != nullptr ? operator_.poll(*status) : operator_.end();
    if (told && told->obeyed && told->text == kTakeBack) {
      feed_.say(LiveFeed::Kind::kRefusal, taken_back_);
    } else {
      report(told);
    }
    if (status != nullptr && told && told->moves) limit_move(told->who, *status);
    while (const auto progress = go_.progress()) {
      if (progress->sets_out && status != nullptr) course_before_ = status->course;
      feed_.say(LiveFeed::Kind::kPlan, go_.wish()->who + ": go: " + progress->text);
    }
    if (const auto answer = go_.poll(status)) {
      feed_.set_wish(nullptr);
      feed_.say(answer->obeyed ? LiveFeed::Kind::kPlan : LiveFeed::Kind::kRefusal,
                answer->wish.who + ": go: " + answer->text);
      const int times = followed_ ? followed_->times : 0;
      followed_.reset();
      if (answer->has_course) followed_ = Followed{answer->wish, course_before_, std::nullopt, times, {}};
    }
    if (status == nullptr) followed_.reset();
    if (status != nullptr) {
      for (const LiveOthers::Said& said : others_.poll(*status)) report(said);
    }
    if (followed_ && go_.wish() == nullptr) follow(*status);
  }

 private:
  // The newest course of the page, until it is over.
  struct Followed {
    GoWish wish;
    std::int64_t before = 0;             // number of the course before
    std::optional<std::int64_t> number;  // none: not heard yet
    int times = 0;                       // that the ball has gone on after it had lost its course
    go::LostCourse watch;
  };

  // A ball that has lost its course is halted, and goes on from there.
  void follow(const controller_status_t& status) {
    const bool running = status.mode == controller_status_t::MODE_RUNNING;
    if (!followed_->number) {
      if (running && status.course != followed_->before) followed_->number = status.course;
      return;
    }
    const bool over = status.at_rest != 0 && status.backup_active == 0;
    if (!running || status.course != *followed_->number || over) {
      followed_.reset();
    } else if (followed_->watch.lost(status)) {
      const GoWish wish = followed_->wish;
      if (followed_->times == go::kMostGoesOn) {
        followed_.reset();
        feed_.say(LiveFeed::Kind::kRefusal, wish.who + ": go: the ball has lost its course again");
        return;
      }
      ++followed_->times;
      feed_.say(LiveFeed::Kind::kCommand, wish.who + ": go: the ball has lost its course: goes on from there");
      go(wish, status);
    }
  }

  void go(const GoWish& wish, const controller_status_t& status) {
    course_before_ = status.course;
    const std::string why = go_.start(wish, status);
    feed_.set_wish(go_.wish());
    if (why.empty()) {
      feed_.say(LiveFeed::Kind::kCommand, wish.who + ": go to " + wish_text(wish) + ": planning");
    } else {
      feed_.say(LiveFeed::Kind::kRefusal, wish.who + ": go: " + why);
    }
  }

  void drop_go(const Request& newer) {
    const auto dropped = go_.drop();
    if (!dropped) return;
    feed_.set_wish(nullptr);
    feed_.say(LiveFeed::Kind::kCommand, dropped->who + ": go: dropped by the " + newer.what + " of " + newer.who);
  }

  void report(const std::optional<LiveOperator::Answer>& answer) {
    if (!answer) return;
    feed_.say(answer->obeyed ? LiveFeed::Kind::kCommand : LiveFeed::Kind::kRefusal, answer->who + ": " + answer->text);
  }

  // The planner at work speaks for the viewer who asked. Its course is told with its answer.
  void report(const LiveOthers::Said& said) {
    if (go_.wish() != nullptr && said.command == operator_t::COMMAND_GO) return;
    const bool planner = go_.wish() != nullptr && said.command == operator_t::COMMAND_HALT && go_.halts_first();
    const std::string who = planner ? go_.wish()->who + ": go" : "another operator";
    feed_.say(said.refused ? LiveFeed::Kind::kRefusal : LiveFeed::Kind::kCommand, who + ": " + said.text);
  }

  // Takes back a move that is longer than `ballast move` makes.
  void limit_move(const std::string& who, const controller_status_t& status) {
    const bool moves =
        status.mode == controller_status_t::MODE_PENDING || status.mode == controller_status_t::MODE_MOVING;
    const double most_s = longest_move_s(feed_.duration_s());
    if (!moves || status.plan_duration_s <= most_s) return;
    taken_back_ = fmt::format(
        "{}: the move takes {} s and is taken back; allowed: at most {} s; a nearer target or a greater "
        "speed takes less, and `ballast move --force` in a terminal makes longer moves",
        who, program::short_time(status.plan_duration_s), most_s);
    report(operator_.tell(who, kTakeBack, OperatorCommand::kStop, status));
  }

  static constexpr const char* kTakeBack = "stop of the move";

  LiveOperator operator_;
  LiveOthers others_;
  LiveGo go_;
  LiveFeed& feed_;
  std::int64_t course_before_ = 0;  // followed when the newest wish came, or from then on to a rest on its way
  std::optional<Followed> followed_;
  std::string taken_back_;  // why the newest move is; told when that is obeyed
};

int live(const LiveCommand& command) {
  hal::Bus bus(with_receive_buffer(command.url), program::catch_signals());
  if (!bus.good()) return program::refuse_bus("ballast", command.url);
  EventPipe pipe;
  const std::string why =
      pipe.start("ballast-live", {"--listen=" + command.listen, "--port=" + std::to_string(command.port)}, true);
  if (!why.empty()) return could_not(why);
  LiveFeed feed(pipe);
  const auto start = hal::WallClock::now();
  const auto subscribe = [&](const char* channel, auto* type) {
    using M = std::remove_pointer_t<decltype(type)>;
    bus.subscribe<M>(
        channel, [&](const M& message) { feed.observe(message, hal::Seconds(hal::WallClock::now() - start).count()); });
  };
  subscribe(hal::kChannelContact, static_cast<contact_t*>(nullptr));
  subscribe(hal::kChannelPlantState, static_cast<plant_state_t*>(nullptr));
  subscribe(hal::kChannelControllerStatus, static_cast<controller_status_t*>(nullptr));
  subscribe(hal::kChannelTrip, static_cast<trip_t*>(nullptr));
  subscribe(hal::kChannelScenario, static_cast<scenario_piece_t*>(nullptr));
  subscribe(hal::kChannelOperator, static_cast<operator_t*>(nullptr));
  subscribe(hal::kChannelCourse, static_cast<operator_t*>(nullptr));
  Control control(bus, command.url, feed);
  bus.subscribe<operator_t>(hal::kChannelOperator, [&](const operator_t& message) { control.hear(message); });
  for (;;) {
    const hal::Status status = bus.receive_until(hal::after(hal::WallClock::now(), kLookEvery), [] { return false; });
    if (status == hal::Status::kInterrupted) return program::kExitCompleted;
    if (status == hal::Status::kIo) return could_not("the LCM bus " + command.url + " failed");
    while (const auto line = pipe.next_line()) control.take(*line);
    control.poll();
    feed.update();
    pipe.flush();
    if (const std::string text = pipe.ended(); !text.empty()) return could_not(text);
  }
}

}  // namespace

std::function<int()> add_live_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("live", "Serves a page that shows the run on a bus in 3-d and operates it");
  auto options = std::make_shared<LiveCommand>();
  command->add_option("--lcm", options->url, "URL of the LCM bus")->check(program::not_empty())->capture_default_str();
  command->add_option("--port", options->port, "port of the page; 0: any that is free")
      ->check(program::whole_number(0, 65535))
      ->capture_default_str();
  command
      ->add_option("--listen", options->listen,
                   "address of this machine for the page; other machines reach any but 127.0.0.1")
      ->type_name("ADDRESS")
      ->check(program::not_empty())
      ->capture_default_str();
  return [options] { return live(*options); };
}

}  // namespace ballast
