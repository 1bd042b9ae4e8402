// The methods there are, by name.
#pragma once

#include <csignal>
#include <memory>
#include <span>
#include <string>

#include "tools/integrators/method.h"

namespace ballast::integrators {

enum class Form { kOde, kDae };  // rolling_ball_ode_f or rolling_ball_dae_g

struct Settings {
  double tolerance = 1e-10;  // relative and absolute: the local error of y is held below tolerance * (1 + |y|), or a
                             // part of it (MethodInfo::share)
  double fixed_step_s = 0;   // > 0: steps of about this length, whatever the error (see EvenSteps)
  const volatile std::sig_atomic_t* interrupted = nullptr;  // where it becomes true, the integration ends
};

enum class FixedSteps { kNever, kOnRequest, kAlways };

struct MethodInfo {
  const char* name;
  const char* counterpart;  // the paper's routine
  const char* order;
  Form form;
  FixedSteps fixed_steps;
  int looks;  // into how many parts its steps are cut to look for extrema: 1 where steps are far shorter than the
              // motion
  // Share of the tolerance that the local error gets. The errors of many short steps add up to more, so these methods
  // get less. At one tolerance all methods then end about equally far off.
  double share;
  std::unique_ptr<Method> (*construct)(Problem& problem, const Settings& settings);

  [[nodiscard]] std::unique_ptr<Method> make(Problem& problem, const Settings& settings) const;
};

// The share lowers no method's tolerance below this, where the error estimate is mostly rounding.
inline constexpr double kLeastShared = 2e-13;

std::span<const MethodInfo> all_methods();
const MethodInfo* find_method(const std::string& name);  // nullptr: none of that name

inline constexpr const char* kDefaultMethod = "dop853";

// explicit_methods.cpp
std::unique_ptr<Method> make_rk4(Problem& problem, const Settings& settings);
std::unique_ptr<Method> make_dopri5(Problem& problem, const Settings& settings);
std::unique_ptr<Method> make_dop853(Problem& problem, const Settings& settings);
// cvode.cpp
std::unique_ptr<Method> make_adams(Problem& problem, const Settings& settings);
std::unique_ptr<Method> make_bdf(Problem& problem, const Settings& settings);
// arkode.cpp
std::unique_ptr<Method> make_trbdf2(Problem& problem, const Settings& settings);
std::unique_ptr<Method> make_trapezoid(Problem& problem, const Settings& settings);
// radau5.cpp; serves both forms
std::unique_ptr<Method> make_radau5(Problem& problem, const Settings& settings);
// ida.cpp
std::unique_ptr<Method> make_ida(Problem& problem, const Settings& settings);

}  // namespace ballast::integrators
