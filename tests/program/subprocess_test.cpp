// Child processes: their files, their ends, and that none is left behind.
#include "tools/program/subprocess.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <array>
#include <chrono>
#include <thread>
#include <utility>

#include "tools/program/descriptor.h"

namespace ballast::program {
namespace {

using namespace std::chrono_literals;

ProcessStart shell(const std::string& line) { return {.arguments = {"sh", "-c", line}}; }

std::string read_all(const Descriptor& from) {
  std::string text;
  std::array<char, 256> buffer;
  for (ssize_t size; (size = read(from.get(), buffer.data(), buffer.size())) > 0;)
    text.append(buffer.data(), static_cast<std::size_t>(size));
  return text;
}

bool exists(pid_t pid) { return kill(pid, 0) == 0; }

TEST(Subprocess, EndsWithAStatusOrBySignal) {
  Subprocess child;
  ASSERT_FALSE(child.start(shell("exit 3")));
  const ProcessEnd end = child.wait();
  EXPECT_EQ(end.exit_status, 3);
  EXPECT_EQ(end.text(), "exit status 3");
  EXPECT_FALSE(child.running());
  EXPECT_EQ(child.wait(0s)->exit_status, 3);  // observed earlier

  Subprocess killed;
  ASSERT_FALSE(killed.start(shell("kill -KILL $$")));
  EXPECT_EQ(killed.wait().signal, SIGKILL);
  EXPECT_EQ(killed.wait().exit_status, -1);
  EXPECT_EQ(killed.wait().text(), "Killed");
}

TEST(Subprocess, ThatCannotBeStartedIsAnErrorAndLeavesNoChild) {
  Subprocess child;
  const std::error_code error = child.start({.arguments = {"no-such-program-of-ballast"}});
  EXPECT_EQ(error, std::errc::no_such_file_or_directory);
  EXPECT_EQ(cannot_start("x", error), "x: cannot be started: No such file or directory");
  EXPECT_FALSE(child.running());
  EXPECT_EQ(child.start({.arguments = {"/"}}), std::errc::permission_denied);
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1) << "a child is left";
  EXPECT_EQ(run_program({"no-such-program-of-ballast"}).exit_status, -1);
}

TEST(Subprocess, WaitsNoLongerThanTheTimeout) {
  Subprocess child;
  ASSERT_FALSE(child.start(ProcessStart{.arguments = {"sleep", "600"}}));
  EXPECT_FALSE(child.wait(0s).has_value());
  EXPECT_FALSE(child.wait(20ms).has_value());
  EXPECT_TRUE(child.running());
  child.send(SIGTERM);
  const auto end = child.wait(60s);
  ASSERT_TRUE(end.has_value());
  EXPECT_EQ(end->signal, SIGTERM);
}

TEST(Subprocess, IsKilledWithItsObjectAndMovesWithIt) {
  pid_t pid = 0;
  {
    Subprocess second;
    {
      Subprocess first;
      ASSERT_FALSE(first.start({.arguments = {"sleep", "600"}}));
      pid = first.pid();
      second = std::move(first);
    }
    EXPECT_EQ(second.pid(), pid);
    EXPECT_TRUE(exists(pid));
  }
  EXPECT_FALSE(exists(pid));
}

// The further descriptors arrive as 3, 4, ... whatever their numbers are here, also where these overlap.
TEST(Subprocess, GetsTheDescriptorsItIsGiven) {
  auto a = open_pipe(), b = open_pipe(), out = open_pipe();
  ASSERT_TRUE(a && b && out);
  ASSERT_EQ(write(a->writing.get(), "a\n", 2), 2);
  ASSERT_EQ(write(b->writing.get(), "b\n", 2), 2);
  ProcessStart start = shell("read x <&3; read y <&4; echo $x$y; echo e >&2; read z || echo end of file");
  start.input = ProcessStart::kNull;
  start.output = start.error = out->writing.get();
  // In this order each is the number that the other is to get, where these are the lowest ones free.
  start.further = {b->reading.get(), a->reading.get()};
  Subprocess child;
  ASSERT_FALSE(child.start(start));
  out->writing = Descriptor();
  EXPECT_EQ(read_all(out->reading), "ba\ne\nend of file\n");
  EXPECT_EQ(child.wait().exit_status, 0);
}

TEST(Subprocess, HasDefaultSignalActionsAndAGroupOfItsOwn) {
  const auto before = signal(SIGTERM, [](int) {});
  sigset_t term, mask;
  sigemptyset(&term);
  sigaddset(&term, SIGTERM);
  sigprocmask(SIG_BLOCK, &term, &mask);
  ProcessStart start = ProcessStart{.arguments = {"sleep", "600"}};
  start.own_group = true;
  Subprocess child;
  ASSERT_FALSE(child.start(start));
  sigprocmask(SIG_SETMASK, &mask, nullptr);
  signal(SIGTERM, before);
  EXPECT_EQ(getpgid(child.pid()), child.pid());
  child.send(SIGTERM);
  EXPECT_EQ(child.wait().signal, SIGTERM);
}

// A child of a child: it ends with the process that started it.
TEST(Subprocess, EndsWithItsParent) {
  auto pipe = open_pipe();
  ASSERT_TRUE(pipe);
  Subprocess parent;
  ASSERT_FALSE(parent.start([&] {
    Subprocess child;
    if (child.start({.arguments = {"sleep", "600"}, .ends_with_parent = true})) return 1;
    const pid_t pid = child.pid();
    static_cast<void>(!write(pipe->writing.get(), &pid, sizeof pid));
    for (;;) pause();
  }));
  pid_t pid = 0;
  ASSERT_EQ(read(pipe->reading.get(), &pid, sizeof pid), static_cast<ssize_t>(sizeof pid));
  EXPECT_TRUE(exists(pid));
  parent.send(SIGKILL);
  parent.wait();
  // Another process takes the end of the orphan, sooner or later; until then it is a zombie, which reads as no file.
  const auto sleeps = [&] {
    return !std::filesystem::exists("/proc/" + std::to_string(pid) + "/exe") ? false : exists(pid);
  };
  for (int i = 0; i < 3000 && sleeps(); ++i) std::this_thread::sleep_for(10ms);
  EXPECT_FALSE(sleeps());
}

TEST(Subprocess, RunsAFunctionInACopyOfThisProcess) {
  int here = 0;
  Subprocess child;
  ASSERT_FALSE(child.start([&] { return here = 7; }));
  EXPECT_EQ(child.wait().exit_status, 7);
  EXPECT_EQ(here, 0);
}

TEST(RunProgram, CollectsBothOutputs) {
  const ProgramOutcome outcome = run_program({"sh", "-c", "echo one; echo two >&2; cat; exit 4"});
  EXPECT_EQ(outcome.exit_status, 4);
  EXPECT_EQ(outcome.output, "one\ntwo\n");
}

}  // namespace
}  // namespace ballast::program
