// ballast doctor: what this machine lacks, and the commands that mend it.
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
  void say(const Finding& finding) {
    using Verdict = Finding::Verdict;
    const char* mark = finding.verdict == Verdict::kOk ? "ok  " : finding.verdict == Verdict::kFail ? "FAIL" : "note";
    std::cout << mark << "  " << finding.what << ": " << finding.text << '\n';
    if (!finding.fix.empty()) std::cout << "        fix: " << finding.fix << '\n';
    std::cout << std::flush;
    failed_ += finding.verdict == Verdict::kFail;
  }
  // Says them all; whether all are ok.
  bool say(const std::vector<Finding>& findings) {
    bool good = true;
    for (const Finding& finding : findings) {
      say(finding);
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
  report.say(doctor::look_at_multicast(command.url));
  report.say(doctor::look_at_receive_buffer());
  const spy::SpyOptions spy{.url = command.url, .types_jar = command.types_jar};
  if (report.say(spy::look_for_parts(spy))) report.say(spy::look_at_types(spy));
  report.say(doctor::look_at_display());
  report.say(doctor::look_at_cross_compiler());
  report.say(doctor::look_at_qemu());
  doctor::Listener listener;
  const hal::Seconds time(command.listen_s);
  if (doctor::listen(command.url, time, listener)) {
    report.say(doctor::judge(listener, command.url, time));
  } else {
    report.say({Finding::Verdict::kFail, "peers", program::bad_bus(command.url),
                "what mends the lines above, or " + program::ballast_as_typed() + " doctor"});
  }
  if (report.failed() == 0) return program::kExitCompleted;
  std::cout << report.failed() << (report.failed() == 1 ? " line fails" : " lines fail")
            << (geteuid() == 0 ? "" : "; apt-get, ip and sysctl need root: sudo") << std::endl;
  return program::kExitCouldNotRun;
}

}  // namespace

std::function<int()> add_doctor_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("doctor", "Looks for what this machine lacks, and says how to mend it");
  auto options = std::make_shared<DoctorCommand>();
  command->add_option("--lcm", options->url, "URL of the LCM bus")->check(program::not_empty())->capture_default_str();
  command->add_option("--listen", options->listen_s, "seconds to listen to who talks there")
      ->check(program::positive_finite())
      ->capture_default_str();
  command->add_option("--types", options->types_jar, "another types jar than the one built with this program")
      ->check(program::not_empty());
  return [options] { return examine(*options); };
}

}  // namespace ballast
