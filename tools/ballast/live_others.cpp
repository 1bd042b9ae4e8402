#include "tools/ballast/live_others.h"

#include <algorithm>
#include <utility>

#include "tools/summary/controller_words.h"

namespace ballast {

namespace {

constexpr std::size_t kMostSenders = 64;
constexpr std::size_t kMostSaid = 16;  // between two polls
constexpr hal::Seconds kPatience{2};   // for an answer, as operators have it

const char* command_name(std::int8_t command) {
  switch (command) {
    case operator_t::COMMAND_ARM:
      return "arm";
    case operator_t::COMMAND_START:
      return "start";
    case operator_t::COMMAND_STOP:
      return "stop";
    case operator_t::COMMAND_RESET:
      return "reset";
    case operator_t::COMMAND_MOVE:
      return "move";
    case operator_t::COMMAND_HALT:
      return "halt";
    default:
      return "course";
  }
}

}  // namespace

// Copies of a message, and all parts of a course but the first, are not new.
bool LiveOthers::is_new(const operator_t& message) {
  auto found =
      std::find_if(senders_.begin(), senders_.end(), [&](const Sender& s) { return s.number == message.sender; });
  if (found == senders_.end()) {
    if (senders_.size() == kMostSenders) senders_.pop_front();
    found = senders_.insert(senders_.end(), {message.sender, message.sequence, 0});
  } else {
    if (message.sequence <= found->newest) return false;
    found->newest = message.sequence;
  }
  if (message.command != operator_t::COMMAND_GO) return true;
  return std::exchange(found->course, message.course) != message.course;
}

void LiveOthers::hear(const operator_t& message, const controller_status_t& status) {
  const bool of_the_run = message.sender == 0, part = message.command == operator_t::COMMAND_GO;
  if (message.sender == own_ || of_the_run) return;
  if (part) waiting_.reset();  // the controller counts each of them, so the next answer may be that
  if (said_.size() == kMostSaid || !is_new(message)) return;
  said_.push_back({message.command, false, command_name(message.command)});
  if (part) return;
  waiting_ = Waiting{message, status.run_id, status.operator_commands, hal::after(hal::WallClock::now(), kPatience)};
}

std::vector<LiveOthers::Said> LiveOthers::poll(const controller_status_t& status) {
  if (waiting_ && (status.run_id != waiting_->run_id || hal::WallClock::now() >= waiting_->deadline)) waiting_.reset();
  if (waiting_ && status.operator_commands > waiting_->commands_before) {
    const operator_t& message = waiting_->message;
    const firmware::OperatorInput input = hal::from_message(message);
    const bool moves = message.command == operator_t::COMMAND_MOVE;
    const std::string refusal = sil::refusal_text(status, moves ? &input.move : nullptr);
    if (!refusal.empty())
      said_.push_back({message.command, true, sil::refused_text(command_name(message.command), refusal)});
    waiting_.reset();
  }
  return std::exchange(said_, {});
}

}  // namespace ballast
