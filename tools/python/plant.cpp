// The plant stepped by hand, for Python.
#include "sim/plant/plant.h"

#include <fmt/format.h>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <mutex>

#include "tools/python/bindings.h"
#include "tools/summary/summary_parts.h"

namespace ballast::python {
namespace {

constexpr std::int64_t kMostSteps = 100'000;  // of one motor in one advance(); bounds its memory
constexpr int kPeriodsBetweenSignals = 64;

const char* end_name(sim::PhysicsEnd end) {
  switch (end) {
    case sim::PhysicsEnd::kNone:
      return "";
    case sim::PhysicsEnd::kSlipped:
      return "slipped";
    case sim::PhysicsEnd::kDetached:
      return "detached";
    case sim::PhysicsEnd::kInconsistent:
      return "inconsistent";
  }
  return "";
}

// The plant with a lock, so that threads that share one do not meet in it.
class Plant {
 public:
  explicit Plant(const CheckedScenario& checked)
      : actuation_(checked.scenario.run.actuation),
        mass_count_(checked.scenario.masses.size()),
        period_s_(checked.scenario.run.control_period_s),
        plant_(checked.scenario) {}

  Plant(const Plant& other) : Plant(other, std::lock_guard(other.mutex_)) {}
  Plant& operator=(const Plant&) = delete;

  void advance(double dt_s, const std::vector<std::int64_t>& steps, const std::vector<double>& position,
               const std::vector<double>& velocity) {
    const py::gil_scoped_release unlocked;
    const std::lock_guard lock(mutex_);
    const double start_s = plant_.time_s(), end_s = start_s + dt_s;
    if (!position.empty()) plant_.lead_masses(end_s, position.data(), velocity.data());
    const std::vector<sim::StepPulse> pulses = evenly_spaced(steps, dt_s);
    auto next = pulses.begin();
    // A run goes on by control periods too; the plant bounds the number of its steps in each. The factor is there so
    // that rounding of dt_s / period does not add a period of almost no length.
    const auto periods = static_cast<std::int64_t>(std::max(1.0, std::ceil(dt_s / period_s_ * (1 - 1e-12))));
    for (std::int64_t k = 0; k < periods && plant_.end() == sim::PhysicsEnd::kNone; ++k) {
      const double from_s = plant_.time_s();
      const double to_s = k + 1 == periods ? end_s : start_s + static_cast<double>(k + 1) * period_s_;
      std::vector<sim::StepPulse> due;
      for (; next != pulses.end() && start_s + next->offset_s < to_s; ++next)
        due.push_back({std::max(0.0, start_s + next->offset_s - from_s), next->motor, next->direction});
      plant_.advance(to_s, due);
      if (k % kPeriodsBetweenSignals == kPeriodsBetweenSignals - 1) look_for_signals();
    }
  }

  py::dict state() {
    sim::Sample s;
    sim::PhysicsEnd end{};
    std::string why;
    {
      const py::gil_scoped_release unlocked;
      const std::lock_guard lock(mutex_);
      s = plant_.sample();
      end = plant_.end();
      why = plant_.end_text();
    }
    const auto of_masses = [this](const auto& values) {
      return py::array_t<double>(static_cast<py::ssize_t>(mass_count_), values.data());
    };
    py::dict out;
    out["time_s"] = s.time_s;
    out["regime"] = sil::regime_name(s.regime);
    out["orientation"] = s.orientation;
    out["angular_velocity_B_radps"] = s.angular_velocity_B_radps;
    out["position_W_m"] = s.position_W_m;
    out["velocity_W_mps"] = s.velocity_W_mps;
    out["mass_position"] = of_masses(s.mass_position);
    out["mass_velocity"] = of_masses(s.mass_velocity);
    out["normal_force_n"] = s.normal_force_n;
    out["static_friction_n"] = s.static_friction_n;
    out["friction_force_W_n"] = s.friction_force_W_n;
    out["floor_static_friction"] = s.floor_static_friction;
    out["normal_force_min_n"] = s.normal_force_min_n;
    out["mu_required_max"] = s.mu_required_max;
    out["end"] = end_name(end);
    out["end_text"] = why;
    return out;
  }

  [[nodiscard]] const char* actuation() const { return to_string(actuation_); }
  [[nodiscard]] std::size_t mass_count() const { return mass_count_; }

  [[nodiscard]] Plant copy() const {
    const py::gil_scoped_release unlocked;
    return *this;
  }

 private:
  Plant(const Plant& other, const std::lock_guard<std::mutex>&)
      : actuation_(other.actuation_),
        mass_count_(other.mass_count_),
        period_s_(other.period_s_),
        plant_(other.plant_) {}

  // Pulses in the middles of equal parts of the interval, in order of time.
  static std::vector<sim::StepPulse> evenly_spaced(const std::vector<std::int64_t>& steps, double dt_s) {
    std::vector<sim::StepPulse> pulses;
    for (std::size_t motor = 0; motor < steps.size(); ++motor) {
      const std::int64_t count = std::abs(steps[motor]);
      for (std::int64_t k = 0; k < count; ++k) {
        const double part = (static_cast<double>(k) + 0.5) / static_cast<double>(count);
        pulses.push_back({part * dt_s, static_cast<int>(motor), steps[motor] > 0 ? 1 : -1});
      }
    }
    std::stable_sort(pulses.begin(), pulses.end(),
                     [](const auto& a, const auto& b) { return a.offset_s < b.offset_s; });
    return pulses;
  }

  sim::Actuation actuation_;
  std::size_t mass_count_;
  double period_s_;
  mutable std::mutex mutex_;
  sim::Plant plant_;
};

}  // namespace

void add_plant(py::module_& module) {
  py::class_<Plant> plant(module, "Plant");
  forbid_pickles(plant);
  plant.def(py::init<const CheckedScenario&>(), py::arg("scenario"))
      .def("copy", &Plant::copy)
      .def("__copy__", &Plant::copy)
      .def("__deepcopy__", [](const Plant& self, const py::object&) { return self.copy(); })
      .def("advance", &Plant::advance, py::arg("dt_s"), py::arg("steps"), py::arg("position"), py::arg("velocity"))
      .def("state", &Plant::state)
      .def_property_readonly("actuation", &Plant::actuation)
      .def_property_readonly("mass_count", &Plant::mass_count);
  module.attr("most_steps") = kMostSteps;
}

}  // namespace ballast::python
