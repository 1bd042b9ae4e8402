#include "tools/ballast/event_pipe.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <utility>

#include "tools/recording/log_event.h"

namespace ballast {

namespace {

constexpr std::chrono::seconds kLinger{5};
// A program that leaves so much unread has stopped reading.
constexpr std::size_t kMostWaiting = std::size_t{16} << 20;
constexpr std::size_t kLongestLine = std::size_t{1} << 16;

void make_nonblocking(const program::Descriptor& descriptor) {
  fcntl(descriptor.get(), F_SETFL, fcntl(descriptor.get(), F_GETFL) | O_NONBLOCK);
}

}  // namespace

std::string text_event(std::string_view channel, std::string_view content) {
  std::string event(sil::kEventHeaderSize + channel.size(), '\0');
  sil::write_event_header(event.data(), 0, 0, std::string(channel).c_str(), content.size());
  return event.append(content);
}

EventPipe::~EventPipe() {
  input_ = program::Descriptor();  // the program ends with its input
  if (child_.running()) (void)child_.wait(kLinger);
}

std::string EventPipe::start(const std::string& name, const std::vector<std::string>& arguments, bool answers) {
  signal(SIGPIPE, SIG_IGN);
  name_ = name;
  const std::string path = program::beside_this_program(name);
  auto to_child = program::open_pipe(), from_child = program::open_pipe();
  if (!to_child || !from_child) return program::cannot_start(path, {errno, std::generic_category()});
  program::ProcessStart start{
      .arguments = {path}, .input = to_child->reading.get(), .ends_with_parent = true, .own_group = true};
  start.arguments.insert(start.arguments.end(), arguments.begin(), arguments.end());
  if (answers) start.output = from_child->writing.get();
  if (const auto error = child_.start(start)) return program::cannot_start(path, error);
  // The child's ends close here, or else a write after the program's end would wait for ever.
  input_ = std::move(to_child->writing);
  make_nonblocking(input_);
  if (!answers) return "";
  output_ = std::move(from_child->reading);
  make_nonblocking(output_);
  return "";
}

void EventPipe::send(std::string events) {
  waiting_bytes_ += events.size();
  waiting_.push_back(std::move(events));
  flush();
}

void EventPipe::offer(std::string_view events) {
  if (!flush()) return;
  (void)!write(input_.get(), events.data(), events.size());  // EAGAIN: dropped. EPIPE: ended() says so
}

bool EventPipe::flush() {
  while (!waiting_.empty()) {
    const std::string& first = waiting_.front();
    const ssize_t written = write(input_.get(), first.data() + written_, first.size() - written_);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    written_ += static_cast<std::size_t>(written);
    if (written_ < first.size()) continue;
    waiting_bytes_ -= first.size();
    waiting_.pop_front();
    written_ = 0;
  }
  return true;
}

std::optional<std::string> EventPipe::next_line() {
  for (;;) {
    if (const std::size_t end = read_.find('\n'); end != std::string::npos) {
      std::string line = read_.substr(0, end);
      read_.erase(0, end + 1);
      return line;
    }
    char bytes[4096];
    const ssize_t size = read(output_.get(), bytes, sizeof bytes);
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return std::nullopt;
    if (read_.size() > kLongestLine) read_.clear();
    read_.append(bytes, static_cast<std::size_t>(size));
  }
}

std::string EventPipe::ended() {
  if (waiting_bytes_ > kMostWaiting) return name_ + " does not read what it is given";
  const auto end = child_.wait(std::chrono::seconds(0));
  return end ? fmt::format("{} ended with {}", name_, end->text()) : "";
}

}  // namespace ballast
