// ballast doctor: checks this machine, and prints the commands that fix what it lacks.
#include <fmt/core.h>
#include <unistd.h>

#include <iostream>
#include <memory>

#include "tools/ballast/commands.h"
#include "tools/doctor/machine.h"
#include "tools/doctor/peers.h"
#include "tools/program/program.h"
#include "tools/spy/spy.h"

namespace ballast {

namespace {

using program::Finding;

struct DoctorCommand {
  std::string url = hal::kDefaultLcmUrl;
  double listen_s = 1;
  std::filesystem::path types_jar;
};

class Report {
 public:
  void print(const Finding& finding) {
    using Verdict = Finding::Verdict;
    const char* mark = finding.verdict == Verdict::kOk ? "ok  " : finding.verdict == Verdict::kFail ? "FAIL" : "note";
    std::cout << fmt::format("{}  {}: {}\n", mark, finding.what, finding.text);
    if (!finding.fix.empty()) std::cout << fmt::format("        fix: {}\n", finding.fix);
    std::cout << std::flush;
    failed_ += finding.verdict == Verdict::kFail;
  }
  // Prints all findings. Returns whether all are ok.
  bool print(const std::vector<Finding>& findings) {
    bool good = true;
    for (const Finding& finding : findings) {
      print(finding);
      good = good && finding.verdict == Finding::Verdict::kOk;
    }
    return good;
  }
  [[nodiscard]] int failed() const { return failed_; }

 private:
  int failed_ = 0;
};

int examine(const DoctorCommand& command) {
  Report report;
  report.print(doctor::check_multicast(command.url));
  report.print(doctor::check_receive_buffer());
  const spy::SpyOptions spy{.url = command.url, .types_jar = command.types_jar};
  if (report.print(spy::check_parts(spy))) report.print(spy::check_types(spy));
  report.print(doctor::check_display());
  report.print(doctor::check_cross_compiler());
  report.print(doctor::check_qemu());
  doctor::Listener listener;
  const hal::Seconds time(command.listen_s);
  if (doctor::listen(command.url, time, listener)) {
    report.print(doctor::judge(listener, command.url, time));
  } else {
    report.print({Finding::Verdict::kFail, "peers", program::bad_bus(command.url),
                  "the fixes above, or " + program::ballast_as_typed() + " doctor"});
  }
  if (report.failed() == 0) return program::kExitCompleted;
  std::cout << fmt::format("{} {}{}\n", report.failed(), report.failed() == 1 ? "check fails" : "checks fail",
                           geteuid() == 0 ? "" : "; apt-get, ip and sysctl need root: sudo")
            << std::flush;
  return program::kExitCouldNotRun;
}

}  // namespace

std::function<int()> add_doctor_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("doctor", "Checks what this machine lacks for Ballast, and prints how to fix it");
  auto options = std::make_shared<DoctorCommand>();
  command->add_option("--lcm", options->url, "URL of the LCM bus")->check(program::not_empty())->capture_default_str();
  command->add_option("--listen", options->listen_s, "seconds to listen for messages on the bus")
      ->check(program::positive_finite())
      ->capture_default_str();
  command->add_option("--types", options->types_jar, "jar of message types; default: the one built with this program")
      ->check(program::not_empty());
  return [options] { return examine(*options); };
}

}  // namespace ballast
