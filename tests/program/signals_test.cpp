// The effect of signals on a program that catches them.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <thread>

#include "tools/program/program.h"

namespace ballast::program {
namespace {

using namespace std::chrono_literals;

// Writes a byte when it is ready and after each signal that it has caught. Never ends by itself.
[[noreturn]] void tell_signals(int to) {
  sigset_t none, stops;
  sigemptyset(&none);
  sigfillset(&stops);
  sigprocmask(SIG_BLOCK, &stops, nullptr);  // none comes but while it waits
  static_cast<void>(catch_signals());
  while (write(to, "", 1) == 1) sigsuspend(&none);
  _exit(1);
}

// timeout(1) sends its signal to its program, and then to the whole group.
TEST(Signals, ASecondOneKillsOnlyLater) {
  std::array<int, 2> ends{};
  ASSERT_EQ(pipe(ends.data()), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) tell_signals(ends[1]);
  close(ends[1]);
  char byte = 0;
  ASSERT_EQ(read(ends[0], &byte, 1), 1);
  kill(child, SIGSTOP);  // so that both come at once
  kill(child, SIGINT);
  kill(child, SIGTERM);
  kill(child, SIGCONT);
  EXPECT_EQ(read(ends[0], &byte, 1), 1) << "the same wish";
  std::this_thread::sleep_for(250ms);
  kill(child, SIGTERM);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGTERM) << status;
  close(ends[0]);
}

}  // namespace
}  // namespace ballast::program
