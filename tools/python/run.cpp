// Whole runs for Python, with the results that `ballast run` leaves.
#include <pybind11/stl.h>

#include <csignal>
#include <exception>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/python/bindings.h"
#include "tools/recording/record_run.h"
#include "tools/summary/friction_run.h"
#include "tools/summary/required_friction.h"

namespace ballast::python {
namespace {

// The signals that a run without the interpreter's lock gets.
class Interrupts {
 public:
  [[nodiscard]] const volatile std::sig_atomic_t* flag() const { return &interrupted_; }
  // Lets Python handle signals; where a handler raises something, the run ends.
  void look() {
    if (raised_) return;
    try {
      look_for_signals();
    } catch (...) {
      raised_ = std::current_exception();
      interrupted_ = SIGINT;
    }
  }
  void rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 private:
  volatile std::sig_atomic_t interrupted_ = 0;
  std::exception_ptr raised_;
};

struct RunEnd {
  int exit_status = 0;
  std::vector<std::string> complaints;  // warnings, and why it could not be done
};

// Runs without the interpreter's lock.
RunEnd run_unlocked(const CheckedScenario& checked, const std::string& folder, bool no_log, double speed) {
  const sim::Scenario& scenario = checked.scenario;
  RunEnd end;
  Interrupts interrupts;
  sil::RecordOptions options;
  options.quiet = true;
  options.no_log = no_log;
  options.speed = speed;
  options.interrupted = interrupts.flag();
  options.complain = [&end](const std::string& text) { end.complaints.push_back(text); };
  options.progress = [&](double, double) { interrupts.look(); };
  sil::OutputDir output(folder);
  if (!output.good()) {
    end.exit_status = program::kExitCouldNotRun;
    end.complaints.push_back(output.error());
    return end;
  }
  const auto peers = sil::peers_in_process(scenario, checked.params.get(), program::to_monitor_limits(scenario));
  end.exit_status = sil::record_run("ballast", scenario, *peers, output, options);
  interrupts.rethrow();
  return end;
}

py::tuple run(const CheckedScenario& checked, const std::string& folder, bool no_log, double speed) {
  RunEnd end;
  {
    const py::gil_scoped_release unlocked;
    end = run_unlocked(checked, folder, no_log, speed);
  }
  return py::make_tuple(end.exit_status, end.complaints);
}

std::string friction(const CheckedScenario& checked) {
  sil::FrictionRun run;
  {
    const py::gil_scoped_release unlocked;
    Interrupts interrupts;
    run = sil::run_for_friction(checked.scenario, interrupts.flag(), [&](double, double) { interrupts.look(); });
    interrupts.rethrow();
  }
  if (!run.refusal.empty()) raise_run_error(run.refusal);
  if (run.result.status != hal::Status::kOk) raise_run_error(run.result.trouble);
  auto json = sil::required_friction_json(run.result, sil::floor_verdicts(run.scenario, run.result));
  const sim::Extremum& most = run.result.extrema.mu_required_max;
  json["mu_required"] = {{"max", most.value}, {"time", most.time_s}};
  json["end"] = {{"reason", to_string(run.result.end_reason)}, {"time", run.result.final_sample.time_s}};
  json["page"] = sil::friction_run_text(run);
  return json.dump();
}

}  // namespace

void add_run(py::module_& module) {
  module.def("friction", &friction, py::arg("scenario"));
  module.def("run", &run, py::arg("scenario"), py::arg("folder"), py::arg("no_log"), py::arg("speed"));
}

}  // namespace ballast::python
