// `ballast watch` as people run it, its output into a pipe.
#include <gtest/gtest.h>

#include "tests/sil/shell.h"

namespace ballast {
namespace {

using test::bus_url;
using test::Folder;
using test::Outcome;

TEST(Watch, FollowsARunToItsEndAndEndsWithIt) {
  const Folder folder;
  const std::string bus = " --lcm '" + bus_url(0) + "'";
  const Outcome watch = folder.run(
      "ballast watch --wait 30" + bus + " & watch=$!; sleep 0.5; ballast run paper_ball" + bus +
      " --speed 2 --set duration=1 --set envelope.friction_use=0.2 --quiet --out r; " + "wait $watch; echo status $?");
  EXPECT_NE(watch.out.find("status 0"), std::string::npos) << watch.out << watch.err;
  EXPECT_NE(watch.out.find("rolling"), std::string::npos) << watch.out;
  EXPECT_NE(watch.out.find("trip=friction"), std::string::npos) << watch.out;
  EXPECT_NE(watch.out.find("undecodable=0 ended"), std::string::npos) << watch.out;
}

TEST(Watch, SaysWhenNobodySpeaks) {
  const Folder folder;
  const Outcome watch = folder.run("ballast watch --wait 0.2 --lcm '" + bus_url(1) + "'");
  EXPECT_EQ(watch.exit_status, 2);
  EXPECT_EQ(watch.out, "");
  EXPECT_NE(watch.err.find("no message on "), std::string::npos) << watch.err;
}

TEST(Watch, CtrlCEndsItCleanly) {
  const Folder folder;
  // A shell starts what it puts in the background deaf to SIGINT; SIGTERM takes the same way.
  const Outcome watch = folder.run("ballast watch --lcm '" + bus_url(2) +
                                   "' & watch=$!; sleep 0.5; kill -TERM $watch; wait $watch; echo $?");
  EXPECT_EQ(watch.out, "0\n") << watch.err;
}

TEST(Watch, RefusesNonsense) {
  const Folder folder;
  EXPECT_EQ(folder.run("ballast watch --every nan").exit_status, 1);
  EXPECT_EQ(folder.run("ballast watch --wait -1").exit_status, 1);
  EXPECT_EQ(folder.run("ballast watch --lcm nonsense://").exit_status, 2);
}

}  // namespace
}  // namespace ballast
