// ballast watch: shows a run in a terminal while it runs.
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <iostream>
#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>

#include "hal/lcm/bus.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/foxglove_feed.h"
#include "tools/program/program.h"
#include "tools/recording/receive_buffer.h"
#include "tools/watch/view.h"

namespace ballast {

namespace {

constexpr double kPatience_s = 3;  // without a message, before that is reported

struct WatchCommand {
  std::string url = hal::kDefaultLcmUrl;
  double every_s = 0;  // 0: 0.1 on a terminal, 1 elsewhere
  double wait_s = 0;   // for the first message; 0: without limit
  bool forever = false;
  std::string foxglove;  // the scenario of the run that Foxglove shows; empty: none
  std::string host = "127.0.0.1";
  int port = 8765;
};

// Draws pages in place, each over the one before.
class Terminal {
 public:
  Terminal() : is_one_(isatty(STDOUT_FILENO) == 1 && knows_control_sequences()) {}
  [[nodiscard]] bool is_one() const { return is_one_; }
  // `page(width)` gives lines of at most that width. Lines below the screen are left out, since they could not be drawn
  // over.
  template <class Page>
  void show(const Page& page) {
    winsize size{};
    const bool known = ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 && size.ws_row > 1;
    const int width = known ? size.ws_col - 1 : 79, height = known ? size.ws_row - 1 : 24;
    if (width < width_) {
      std::cout << "\033[H\033[2J";  // the terminal has broken the old lines into an unknown number of lines
    } else if (lines_ > 0) {
      std::cout << "\033[" << lines_ << "A\r\033[J";
    }
    width_ = width;
    lines_ = 0;
    std::istringstream text(page(width));
    for (std::string line; lines_ < height && std::getline(text, line); ++lines_) std::cout << line << '\n';
    std::cout << std::flush;
  }

 private:
  static bool knows_control_sequences() {
    const char* name = std::getenv("TERM");
    return name != nullptr && *name != '\0' && std::string_view(name) != "dumb";
  }

  bool is_one_;
  int lines_ = 0, width_ = 0;
};

// Says why Foxglove shows no run, if it is so. A run of another scenario may be followed by one of the right one.
bool foxglove_fails(FoxgloveFeed& feed, const WatchCommand& command, bool& reported) {
  if (const std::string text = feed.ended(); !text.empty()) {
    program::complain("ballast", text);
    return true;
  }
  if (!feed.foreign()) {
    reported = false;
    return false;
  }
  if (!reported) {
    program::complain("ballast", "--foxglove " + command.foxglove +
                                     ": the run on this bus is of another scenario (every --set counts); allowed: the "
                                     "same, or the scenario.toml in the results folder of that run");
  }
  reported = true;
  return !command.forever;
}

int watch_run(const WatchCommand& command) {
  std::optional<sim::Scenario> scenario;
  if (!command.foxglove.empty()) {
    scenario =
        program::load_scenario({.scenario = command.foxglove, .set = {}, .fault = {}, .actuation = {}, .seed = {}});
    if (!scenario) return program::kExitUsage;
  }
  hal::Bus bus(with_receive_buffer(command.url), program::catch_signals());
  if (!bus.good()) return program::refuse_bus("ballast", command.url);
  const auto start = hal::WallClock::now();
  const auto now_s = [start] { return hal::Seconds(hal::WallClock::now() - start).count(); };
  std::optional<FoxgloveFeed> foxglove;
  if (scenario) {
    foxglove.emplace(*scenario);
    if (const std::string why = foxglove->start(command.host, command.port); !why.empty()) return could_not(why);
  }
  watch::View view;
  const auto subscribe = [&]<class M>(const char* channel, M*) {
    bus.subscribe<M>(channel, [&](const M& message) {
      view.observe(message, now_s());
      if (foxglove) foxglove->observe(message, now_s());
    });
  };
  subscribe(hal::kChannelContact, static_cast<contact_t*>(nullptr));
  subscribe(hal::kChannelPlantState, static_cast<plant_state_t*>(nullptr));
  subscribe(hal::kChannelSensors, static_cast<sensors_t*>(nullptr));
  subscribe(hal::kChannelControllerStatus, static_cast<controller_status_t*>(nullptr));
  subscribe(hal::kChannelStepCommand, static_cast<step_command_t*>(nullptr));
  subscribe(hal::kChannelTrip, static_cast<trip_t*>(nullptr));

  Terminal terminal;
  const hal::Seconds every(command.every_s > 0 ? command.every_s : terminal.is_one() ? 0.1 : 1.0);
  program::complain("ballast", "listening on " + command.url + "; Ctrl-C ends it");
  const auto show = [&] {
    if (view.empty()) return;
    if (terminal.is_one()) {
      terminal.show([&](int width) { return view.page(now_s(), width, bus.malformed()); });
    } else {
      std::cout << view.line(now_s(), bus.malformed()) << std::endl;
    }
  };
  const std::string no_message = "no message on " + command.url;
  const std::string hint = "; start a run: " + program::ballast_as_typed() + " run SCENARIO --speed 1 --lcm " +
                           program::shell_word(command.url);
  bool reported = false, foreign_reported = false;
  for (;;) {
    const auto over = [&] { return view.ended() && !command.forever; };
    hal::Status status = bus.receive_until(hal::after(hal::WallClock::now(), every), over);
    if (over()) {
      // The answers to the last tick still have to arrive.
      status = bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(0.1)), [] { return false; });
    }
    show();
    if (foxglove && foxglove_fails(*foxglove, command, foreign_reported)) return program::kExitCouldNotRun;
    if (status == hal::Status::kInterrupted) return program::kExitCompleted;
    if (status == hal::Status::kIo) {
      return could_not("the LCM bus " + command.url + " failed");
    }
    if (over()) return program::kExitCompleted;
    if (!std::cout) return program::kExitCouldNotRun;
    if (view.empty() && command.wait_s > 0 && now_s() >= command.wait_s) {
      return could_not(no_message + hint);
    }
    if (view.empty() && !reported && now_s() >= kPatience_s) {
      program::complain("ballast", no_message + " yet" + hint);
      reported = true;
    }
  }
}

}  // namespace

std::function<int()> add_watch_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("watch", "Shows a run in this terminal: margin, N, f_s/N, mode, trip, rates, drops");
  auto options = std::make_shared<WatchCommand>();
  command->add_option("--lcm", options->url, "URL of the LCM bus")->check(program::not_empty())->capture_default_str();
  command->add_option("--every", options->every_s, "seconds between updates; default 0.1, or 1 if not on a terminal")
      ->check(program::positive_finite());
  command->add_option("--wait", options->wait_s, "seconds to wait for the first message; default: no limit")
      ->check(program::positive_finite());
  command->add_flag("--forever", options->forever, "after the end of a run, wait for the next one");
  auto* foxglove = command->add_option("--foxglove", options->foxglove, "also show a run of this scenario to Foxglove");
  foxglove->type_name("SCENARIO")->check(program::not_empty());
  command->add_option("--port", options->port, "port of this machine for Foxglove; 0: any that is free")
      ->needs(foxglove)
      ->check(program::whole_number(0, 65535))
      ->capture_default_str();
  command->add_option("--host", options->host, "address of this machine for Foxglove")
      ->needs(foxglove)
      ->check(program::not_empty())
      ->capture_default_str();
  return [options] { return watch_run(*options); };
}

}  // namespace ballast
