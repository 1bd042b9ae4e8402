// `ballast doctor` as people run it, on machines that lack this and that.
#include <gtest/gtest.h>

#include "tests/sil/shell.h"

namespace ballast {
namespace {

using test::bus_url;
using test::Folder;
using test::Outcome;

// Every line that is not ok has the command that mends it, or is about somebody else's channel.
TEST(Doctor, EveryFailureHasItsFix) {
  const Folder folder;
  // No Java, no compilers, no emulator, no display.
  const Outcome doctor =
      folder.run("B=$(command -v ballast); unset DISPLAY JAVA_HOME; PATH=/nowhere $B doctor --lcm '" + bus_url(0) +
                 "' --listen 0.1 --types nowhere.jar");
  EXPECT_EQ(doctor.exit_status, 2);
  for (const char* line :
       {"FAIL  java: no java in PATH\n        fix: apt-get install -y default-jre",
        "FAIL  types jar: nowhere.jar is missing\n        fix: ", "note  cross compiler: ",
        "fix: apt-get install -y g++-arm-none-eabi", "note  emulator: ", "fix: apt-get install -y qemu-system-arm",
        "note  display: ", "note  peers: no message on "}) {
    EXPECT_NE(doctor.out.find(line), std::string::npos) << line << "\n" << doctor.out;
  }
  std::istringstream lines(doctor.out);
  for (std::string line, next; std::getline(lines, line);) {
    if (!line.starts_with("FAIL") && !line.starts_with("note")) continue;
    std::getline(lines, next);
    EXPECT_TRUE(next.starts_with("        fix: ")) << line;
  }
}

TEST(Doctor, AUrlThatIsNoneFails) {
  const Folder folder;
  const Outcome doctor = folder.run("ballast doctor --lcm nonsense:// --listen 0.1");
  EXPECT_EQ(doctor.exit_status, 2);
  EXPECT_NE(doctor.out.find("FAIL  multicast: cannot use the LCM bus nonsense://"), std::string::npos) << doctor.out;
  EXPECT_NE(doctor.out.find("fix: ballast doctor --lcm 'udpm://239.255.76.67:7667?ttl=0'"), std::string::npos)
      << doctor.out;
  const Outcome unicast = folder.run("ballast doctor --lcm udpm://10.0.0.1:7667 --listen 0.1");
  EXPECT_NE(unicast.out.find("FAIL  multicast: 10.0.0.1 is no multicast group"), std::string::npos) << unicast.out;
  EXPECT_EQ(folder.run("ballast doctor --listen nan").exit_status, 1);
}

// Every program gives the same words, which lead here.
TEST(Doctor, IsNamedByEveryProgramThatGetsAUrlThatIsNone) {
  const Folder folder;
  for (const char* line : {"ballast run paper_ball --out r", "ballast run paper_ball --processes --out r",
                           "ballast move --mass 0 --to 1", "ballast operate status", "ballast watch",
                           "ballast-plant paper_ball", "ballast-controller paper_ball", "ballast-monitor paper_ball"}) {
    const Outcome refused = folder.run(std::string(line) + " --lcm nonsense://");
    EXPECT_EQ(refused.exit_status, 2) << line;
    EXPECT_NE(refused.err.find(": cannot use the LCM bus nonsense://; ballast doctor --lcm nonsense:// examines it\n"),
              std::string::npos)
        << line << "\n"
        << refused.err;
  }
}

TEST(Doctor, HearsARunAndFindsItSound) {
  const Folder folder;
  const std::string bus = " --lcm '" + bus_url(1) + "'";
  const Outcome doctor = folder.run("ballast run paper_ball --speed 1 --quiet --out r" + bus +
                                    " & run=$!; sleep 0.5; ballast doctor --listen 0.5" + bus + "; kill $run; wait");
  EXPECT_NE(doctor.out.find("ok    multicast: "), std::string::npos) << doctor.out;
  for (const char* channel : {"CONTACT", "PLANT_STATE", "SENSORS", "STEP_COMMAND", "CONTROLLER_STATUS", "TRIP"}) {
    EXPECT_NE(doctor.out.find(std::string("ok    BALLAST_") + channel + ": "), std::string::npos) << doctor.out;
  }
  EXPECT_NE(doctor.out.find("the same in every message"), std::string::npos) << doctor.out;
  EXPECT_EQ(doctor.out.find("DOCTOR"), std::string::npos) << "it does not talk on the run's bus";
}

}  // namespace
}  // namespace ballast
