// ballast watch: a run in a terminal, as it happens.
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <iostream>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>

#include "hal/lcm/bus.h"
#include "tools/ballast/commands.h"
#include "tools/program/program.h"
#include "tools/watch/view.h"

namespace ballast {

namespace {

constexpr double kPatience_s = 3;  // with nobody there, before that is said

struct WatchCommand {
  std::string url = hal::kDefaultLcmUrl;
  double every_s = 0;  // 0: 0.1 on a terminal, 1 elsewhere
  double wait_s = 0;   // for the first message; 0: for ever
  bool forever = false;
};

// LCM leaves the receive buffer at the system's default unless the URL says otherwise.
std::string with_receive_buffer(const std::string& url) {
  if (!url.starts_with("udpm://") || url.find("recv_buf_size") != std::string::npos) return url;
  return url + (url.find('?') == std::string::npos ? "?" : "&") + "recv_buf_size=2097152";
}

// Draws over what it has drawn before.
class Terminal {
 public:
  Terminal() : is_one_(isatty(STDOUT_FILENO) == 1 && knows_control_sequences()) {}
  [[nodiscard]] bool is_one() const { return is_one_; }
  // `page(width)`: lines of at most that width. Those for which the screen has no room are left out: it could not be
  // drawn over them.
  template <class Page>
  void show(const Page& page) {
    winsize size{};
    const bool known = ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1 && size.ws_row > 1;
    const int width = known ? size.ws_col - 1 : 79, height = known ? size.ws_row - 1 : 24;
    if (width < width_) {
      std::cout << "\033[H\033[2J";  // the terminal has broken the lines that were there, nobody knows into how many
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

int watch_run(const WatchCommand& command) {
  hal::Bus bus(with_receive_buffer(command.url), program::catch_signals());
  if (!bus.good()) return program::refuse_bus("ballast", command.url);
  const auto start = hal::WallClock::now();
  const auto now_s = [start] { return hal::Seconds(hal::WallClock::now() - start).count(); };
  watch::View view;
  const auto hear = [&]<class M>(const char* channel, M*) {
    bus.subscribe<M>(channel, [&](const M& message) { view.see(message, now_s()); });
  };
  hear(hal::kChannelContact, static_cast<contact_t*>(nullptr));
  hear(hal::kChannelPlantState, static_cast<plant_state_t*>(nullptr));
  hear(hal::kChannelSensors, static_cast<sensors_t*>(nullptr));
  hear(hal::kChannelControllerStatus, static_cast<controller_status_t*>(nullptr));
  hear(hal::kChannelStepCommand, static_cast<step_command_t*>(nullptr));
  hear(hal::kChannelTrip, static_cast<trip_t*>(nullptr));

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
  const std::string would = "; " + program::ballast_as_typed() + " run SCENARIO --speed 1 --lcm " +
                            program::shell_word(command.url) + " would";
  bool said_so = false;
  for (;;) {
    const auto over = [&] { return view.ended() && !command.forever; };
    hal::Status status = bus.receive_until(hal::after(hal::WallClock::now(), every), over);
    if (over()) {
      // The answers to the last tick are on their way.
      status = bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(0.1)), [] { return false; });
    }
    show();
    if (status == hal::Status::kInterrupted) return program::kExitCompleted;
    if (status == hal::Status::kIo) {
      program::complain("ballast", "the LCM bus " + command.url + " failed");
      return program::kExitCouldNotRun;
    }
    if (over()) return program::kExitCompleted;
    if (!std::cout) return program::kExitCouldNotRun;
    if (view.empty() && command.wait_s > 0 && now_s() >= command.wait_s) {
      program::complain("ballast", "nobody has said anything on " + command.url + would);
      return program::kExitCouldNotRun;
    }
    if (view.empty() && !said_so && now_s() >= kPatience_s) {
      program::complain("ballast", "nobody has said anything on " + command.url + " yet" + would);
      said_so = true;
    }
  }
}

}  // namespace

std::function<int()> add_watch_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("watch", "Shows a run in this terminal: margin, N, f_s/N, mode, trip, rates, drops");
  auto options = std::make_shared<WatchCommand>();
  command->add_option("--lcm", options->url, "URL of the LCM bus")->check(program::not_empty())->capture_default_str();
  command->add_option("--every", options->every_s, "seconds between two looks; default 0.1, or 1 if not on a terminal")
      ->check(program::positive_finite());
  command->add_option("--wait", options->wait_s, "seconds to wait for the first message; default for ever")
      ->check(program::positive_finite());
  command->add_flag("--forever", options->forever, "go on after the end of a run, for the next one");
  return [options] { return watch_run(*options); };
}

}  // namespace ballast
