#include "tools/program/places.h"

#include <fmt/format.h>

#include <fstream>

#include "tools/program/subprocess.h"

namespace ballast::program {

namespace fs = std::filesystem;

fs::path installed_data() {
  fs::path folder = beside_this_program(BALLAST_DATA_FROM_PROGRAMS).lexically_normal();
  std::error_code code;
  return fs::is_directory(folder / "scenarios", code) ? folder : fs::path();
}

fs::path shipped_scenarios() {
  const fs::path data = installed_data();
  return data.empty() ? fs::path(BALLAST_SCENARIO_DIR) : data / "scenarios";
}

fs::path built_jars() {
  const fs::path data = installed_data();
  return (data.empty() ? fs::path(BALLAST_BUILD_DIR) : data) / "java";
}

std::string version() { return BALLAST_VERSION; }

std::string version_text() {
  const fs::path data = installed_data();
  std::ifstream file((data.empty() ? fs::path(BALLAST_BUILD_DIR) : data) / "commit");
  std::string commit;
  if (!(file >> commit)) commit = "unknown";
  return fmt::format("{} (commit {})", version(), commit);
}

}  // namespace ballast::program
