#include "tools/ballast/bus_words.h"

#include "tools/ballast/commands.h"
#include "tools/summary/controller_words.h"

namespace ballast {

int bus_trouble(const sil::BusOperator& operator_end) { return could_not(operator_end.trouble()); }

std::optional<int> tell(sil::BusOperator& operator_end, const firmware::OperatorInput& input, const std::string& what) {
  if (operator_end.tell(input) != hal::Status::kOk) return bus_trouble(operator_end);
  const bool moves = input.command == firmware::OperatorCommand::kMove;
  const std::string refusal = sil::refusal_text(operator_end.status(), moves ? &input.move : nullptr);
  if (refusal.empty()) return std::nullopt;
  return refuse(sil::refused_text(what, refusal));
}

}  // namespace ballast
