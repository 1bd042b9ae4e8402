#include "tools/ballast/bus_words.h"

#include <fmt/core.h>

#include "hal/lcm/messages.h"
#include "tools/ballast/commands.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"
#include "tools/summary/controller_words.h"

namespace ballast {

int bus_trouble(const sil::BusOperator& operator_end) { return could_not(operator_end.trouble()); }

std::optional<int> tell(sil::BusOperator& operator_end, const firmware::OperatorInput& input, const std::string& what) {
  if (operator_end.tell(input) != hal::Status::kOk) return bus_trouble(operator_end);
  const bool moves = input.command == firmware::OperatorCommand::kMove;
  const std::string refusal = sil::refusal_text(operator_end.status(), moves ? &input.move : nullptr);
  if (refusal.empty()) return std::nullopt;
  return refuse("the controller refuses the " + what + ": " + refusal);
}

std::string plan_text(const controller_status_t& status) {
  return fmt::format("{} s; {}", program::short_time(status.plan_duration_s),
                     sil::predicted_text(hal::from_message(status).plan));
}

std::string positions_text(const controller_status_t& status) {
  std::string text;
  for (int i = 0; i < status.motor_count; ++i) {
    text += (i == 0 ? "" : ", ") + program::short_number(status.commanded_position[i]);
  }
  return text;
}

}  // namespace ballast
