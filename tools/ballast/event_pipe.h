// A program beside this one that is fed with events in LCM's event-log format on its standard input, and ends with it.
//
// The caller never waits for it: offered events are dropped while the program is behind, and sent ones are kept.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/program/descriptor.h"
#include "tools/program/subprocess.h"

namespace ballast {

// An event with this channel and content.
std::string text_event(std::string_view channel, std::string_view content);

class EventPipe {
 public:
  EventPipe() = default;
  // Ends the program, which has 5 s for what it still has to do.
  ~EventPipe();
  EventPipe(const EventPipe&) = delete;
  EventPipe& operator=(const EventPipe&) = delete;

  // Starts the program `name`. Empty, or the reason why it could not be started. Ignores SIGPIPE from here on.
  // `answers`: its standard output is read by next_line().
  [[nodiscard]] std::string start(const std::string& name, const std::vector<std::string>& arguments, bool answers);

  // Events that must arrive, in order. They wait until the program reads.
  void send(std::string events);
  // At most PIPE_BUF bytes of events, of which newer ones replace lost ones. They are written as a whole or dropped.
  void offer(std::string_view events);
  // Writes what waits, as far as the program reads. False: something still waits.
  bool flush();

  // The next line of the program's output, without its end. nullopt: there is none yet.
  [[nodiscard]] std::optional<std::string> next_line();

  // Why the program is of no use any more: "NAME ended with ..". Empty: it runs.
  [[nodiscard]] std::string ended();

 private:
  std::string name_;
  program::Subprocess child_;
  program::Descriptor input_, output_;
  std::deque<std::string> waiting_;
  std::size_t written_ = 0;        // of the first that waits
  std::size_t waiting_bytes_ = 0;  // in all
  std::string read_;               // output after the last whole line
};

}  // namespace ballast
