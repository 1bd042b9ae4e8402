// Sends operators' commands to the controller of the shown run, one at a time, without ever waiting for it.
#pragma once

#include <optional>
#include <string>

#include "firmware/control/inputs.h"
#include "hal/lcm/bus.h"

namespace ballast {

class LiveOperator {
 public:
  // The controller's answer, or what went wrong.
  struct Answer {
    std::string who;
    bool obeyed = false;
    std::string text;    // "start", or "the controller refuses the start: .."
    bool moves = false;  // a move that is obeyed: the status has its duration
  };

  // The bus must outlive the operator, and must not have joined a run.
  explicit LiveOperator(hal::Bus& bus) : bus_(bus) {}
  LiveOperator(const LiveOperator&) = delete;
  LiveOperator& operator=(const LiveOperator&) = delete;

  // Sends a command of `who` to the controller whose newest status this is. A stop and a halt replace a command that
  // has no answer yet; another command is then refused, with the reason.
  [[nodiscard]] std::optional<Answer> tell(const std::string& who, const std::string& what,
                                           const firmware::OperatorInput& input, const controller_status_t& status);

  // To be called often, with the shown run's newest status: repeats the message, and gives the answer once it is there.
  [[nodiscard]] std::optional<Answer> poll(const controller_status_t& status);
  // The run ended: the answer of a command under way.
  [[nodiscard]] std::optional<Answer> end();

  // A stop or a halt is on its way to the controller.
  [[nodiscard]] bool brakes() const;
  // The number by which messages of this operator are known.
  [[nodiscard]] std::int64_t sender() const { return sender_; }

 private:
  void publish(const operator_t& message, std::int64_t run_id);

  struct Pending {
    std::string who, what;
    firmware::OperatorInput input;
    operator_t message{};
    std::int64_t run_id = 0, commands_before = 0;
    hal::WallClock::time_point repeat_at, deadline;
  };

  hal::Bus& bus_;
  std::int64_t sender_ = hal::draw_bus_number();
  std::optional<Pending> pending_;
};

}  // namespace ballast
