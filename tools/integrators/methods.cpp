#include "tools/integrators/methods.h"

#include <algorithm>

namespace ballast::integrators {

std::span<const MethodInfo> all_methods() {
  static constexpr MethodInfo kMethods[] = {
      {"rk4", "-", "4", Form::kOde, FixedSteps::kAlways, 1, 1, make_rk4},
      {"dopri5", "ode45", "5", Form::kOde, FixedSteps::kOnRequest, 4, 1, make_dopri5},
      {"dop853", "-", "8", Form::kOde, FixedSteps::kOnRequest, 4, 1, make_dop853},
      {"adams", "ode113", "1-12", Form::kOde, FixedSteps::kNever, 4, 0.05, make_adams},
      {"bdf", "ode15s", "1-5", Form::kOde, FixedSteps::kNever, 4, 0.05, make_bdf},
      {"trapezoid", "ode23t", "2", Form::kOde, FixedSteps::kNever, 1, 0.002, make_trapezoid},
      {"trbdf2", "ode23tb", "2", Form::kOde, FixedSteps::kNever, 1, 0.002, make_trbdf2},
      {"radau5", "radau5", "5", Form::kOde, FixedSteps::kOnRequest, 4, 1, make_radau5},
      {"radau5_dae", "radau5", "5", Form::kDae, FixedSteps::kOnRequest, 4, 1, make_radau5},
      {"ida", "ode15s", "1-5", Form::kDae, FixedSteps::kNever, 4, 0.05, make_ida},
  };
  return kMethods;
}

std::unique_ptr<Method> MethodInfo::make(Problem& problem, const Settings& settings) const {
  Settings own = settings;
  own.tolerance = std::max(share * settings.tolerance, std::min(settings.tolerance, kLeastShared));
  return construct(problem, own);
}

const MethodInfo* find_method(const std::string& name) {
  for (const MethodInfo& method : all_methods()) {
    if (name == method.name) return &method;
  }
  return nullptr;
}

}  // namespace ballast::integrators
