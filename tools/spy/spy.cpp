#include "tools/spy/spy.h"

#include <fmt/core.h>

#include <ballast/contact_t.hpp>
#include <ballast/controller_status_t.hpp>
#include <ballast/operator_t.hpp>
#include <ballast/plant_state_t.hpp>
#include <ballast/sensors_t.hpp>
#include <ballast/step_command_t.hpp>
#include <ballast/trip_t.hpp>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "tools/program/places.h"
#include "tools/program/subprocess.h"

namespace ballast::spy {

namespace {

namespace fs = std::filesystem;
using program::Finding;
using Verdict = Finding::Verdict;

constexpr int kOldestJava = 8;
const fs::path kSystemJars = "/usr/share/java";

fs::path types_jar(const SpyOptions& options) {
  return options.types_jar.empty() ? program::built_jars() / "ballast-types.jar" : options.types_jar;
}

// JAVA_HOME takes precedence over PATH, as is usual with Java.
fs::path java() {
  if (const char* home = std::getenv("JAVA_HOME"); home != nullptr && *home != '\0') {
    return fs::path(home) / "bin" / "java";
  }
  return program::find_program("java");
}

// 8 for `version "1.8.0_392"`, 17 for `version "17.0.15"`, 0 without a version.
int major_version(const std::string& text) {
  const auto quote = text.find("version \"");
  if (quote == std::string::npos) return 0;
  const char* end = text.data() + text.size();
  int first = 0, second = 0;
  const char* dot = std::from_chars(text.data() + quote + 9, end, first).ptr;
  if (first == 1 && dot != end && *dot == '.') std::from_chars(dot + 1, end, second);
  return second != 0 ? second : first;
}

Finding check_java() {
  const std::string fix = "apt-get install -y default-jre";
  const fs::path program = java();
  if (program.empty()) return {Verdict::kFail, "java", "no java in PATH", fix};
  const auto outcome = program::run_program({program.string(), "-version"});
  const int version = outcome.exit_status == 0 ? major_version(outcome.output) : 0;
  if (version == 0) return {Verdict::kFail, "java", program.string() + " does not run", fix};
  const std::string text = fmt::format("{} is Java {}", program.string(), version);
  if (version < kOldestJava) return {Verdict::kFail, "java", text + "; needed: 8 or later", fix};
  return {Verdict::kOk, "java", text, ""};
}

Finding check_file(const char* what, const fs::path& file, const std::string& fix) {
  std::error_code code;
  if (fs::is_regular_file(file, code)) return {Verdict::kOk, what, file.string(), ""};
  return {Verdict::kFail, what, file.string() + " is missing", fix};
}

std::string last_line(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  const auto end_of_line_before = text.rfind('\n');
  if (end_of_line_before != std::string::npos) text.erase(0, end_of_line_before + 1);
  return text;
}

// The command that builds the jars. Configuring again finds a Java compiler installed since.
std::string build_jars() {
  if (!program::installed_data().empty())
    return "build Ballast where default-jdk-headless and liblcm-java are installed";
  return "apt-get install -y default-jdk-headless liblcm-java && cmake " BALLAST_BUILD_DIR
         " && ninja -C " BALLAST_BUILD_DIR " tools/all";
}

template <class M>
std::string type() {
  return fmt::format("ballast.{}={:x}", M::getTypeName(), static_cast<std::uint64_t>(M::getHash()));
}

std::vector<std::string> launch(const SpyOptions& options) {
  const std::string class_path = types_jar(options).string() + ":" +
                                 (program::built_jars() / "ballast-spy.jar").string() + ":" +
                                 (kSystemJars / "lcm.jar").string() + ":" + (kSystemJars / "jchart2d.jar").string();
  return {java().string(),
          fmt::format("-Xmx{}m", options.heap_mb),
          "-Djava.net.preferIPv4Stack=true",
          "-cp",
          class_path,
          "ballast.spy.Launch",
          "--types",
          type<contact_t>(),
          type<plant_state_t>(),
          type<sensors_t>(),
          type<step_command_t>(),
          type<controller_status_t>(),
          type<trip_t>(),
          type<operator_t>()};
}

}  // namespace

std::vector<Finding> check_parts(const SpyOptions& options) {
  return {check_java(), check_file("lcm for java", kSystemJars / "lcm.jar", "apt-get install -y liblcm-java"),
          check_file("spy's plots", kSystemJars / "jchart2d.jar", "apt-get install -y libjchart2d-java"),
          check_file("spy launcher", program::built_jars() / "ballast-spy.jar", build_jars()),
          check_file("types jar", types_jar(options),
                     options.types_jar.empty() ? build_jars() : "--types with a jar that exists, or without --types")};
}

Finding check_types(const SpyOptions& options) {
  const auto outcome = program::run_program(launch(options));
  std::string message = last_line(outcome.output);
  if (outcome.exit_status == 0) return {Verdict::kOk, "types", message + ", all of this build", ""};
  constexpr std::string_view kPrefix = "ballast spy: ";  // the launcher's
  if (message.starts_with(kPrefix)) message.erase(0, kPrefix.size());
  if (message.empty()) message = "java ended without a message";
  return {Verdict::kFail, "types", fmt::format("{} in {}", message, types_jar(options).string()), build_jars()};
}

std::string become_spy(const SpyOptions& options) {
  auto argv = launch(options);
  argv.insert(argv.end(), {"--lcm", options.url});
  return program::become_program(argv);
}

}  // namespace ballast::spy
