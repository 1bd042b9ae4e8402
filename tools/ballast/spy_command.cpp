// ballast spy: shows every message of a run in lcm-spy.
#include <lcm/lcm-cpp.hpp>
#include <memory>

#include "hal/lcm/bus.h"
#include "tools/ballast/commands.h"
#include "tools/program/program.h"
#include "tools/spy/spy.h"

namespace ballast {

namespace {

bool good(const program::Finding& part) {
  if (part.verdict == program::Finding::Verdict::kOk) return true;
  program::complain("ballast", part.what + ": " + part.text + "\n  fix: " + part.fix);
  return false;
}

int spy_on(const spy::SpyOptions& options) {
  for (const program::Finding& part : spy::check_parts(options)) {
    if (!good(part)) return program::kExitCouldNotRun;
  }
  if (!good(spy::check_types(options))) return program::kExitCouldNotRun;
  // lcm-spy itself does not notice that a bus cannot be used.
  lcm::LCM lcm(options.url);
  if (!hal::usable(lcm, options.url)) return program::refuse_bus("ballast", options.url);
  return could_not(spy::become_spy(options));
}

}  // namespace

std::function<int()> add_spy_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("spy", "Shows every message of a run in lcm-spy; a click on a number plots it");
  auto options = std::make_shared<spy::SpyOptions>();
  options->url = hal::kDefaultLcmUrl;
  command->add_option("--lcm", options->url, "URL of the LCM bus")->check(program::not_empty())->capture_default_str();
  command->add_option("--types", options->types_jar, "jar of message types; default: the one built with this program")
      ->check(program::not_empty());
  command->add_option("--heap", options->heap_mb, "limit of the Java heap in MB")
      ->check(program::whole_number(64, 65536))
      ->capture_default_str();
  return [options] { return spy_on(*options); };
}

}  // namespace ballast
