// A machine emulated by QEMU, with pipes to the program on it. QEMU ends with this object, and with this process
// however that ends.
#pragma once

#include <sched.h>
#include <sys/types.h>

#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hal/status.h"
#include "tools/program/descriptor.h"
#include "tools/program/subprocess.h"

namespace ballast::sil {

using Seconds = std::chrono::duration<double>;

// Keeps this thread, and processes that it starts, on one processor while the object lives. A plant and a QEMU that
// wait for each other never compute at once, and waking the other side is cheap on a processor that is awake. Where the
// system refuses, nothing changes but the speed.
class OneProcessor {
 public:
  OneProcessor();
  ~OneProcessor();
  OneProcessor(const OneProcessor&) = delete;
  OneProcessor& operator=(const OneProcessor&) = delete;

 private:
  cpu_set_t before_{};
  bool moved_ = false;
};

struct QemuOptions {
  std::string board = "mps2_an500";  // a folder of hal/; QEMU's machine has a hyphen there
  std::filesystem::path elf;
  int icount_shift = 2;  // an instruction takes 2^shift ns of the machine's time
  int pipe_pairs = 1;
  std::string arguments = "";  // for the program on the machine, after the names of its pipes
};

class QemuProcess {
 public:
  // Kills QEMU if it still runs when the object ends.
  QemuProcess() = default;

  // Empty, or why it could not be started.
  [[nodiscard]] std::string start(const QemuOptions& options);

  // Call once the machine runs and answers each message written to it: makes the answers faster.
  void expect_answers();

  // Writes all bytes. kPeerLost: the machine does not read any more, or not within the timeout.
  hal::Status write(int pair, std::span<const std::uint8_t> bytes, Seconds timeout);
  // Appends at least one byte to `bytes`. kEmpty: none came within the timeout. kPeerLost: the machine has ended.
  // kInterrupted: `interrupted` is set.
  hal::Status read(int pair, std::vector<std::uint8_t>& bytes, Seconds timeout,
                   const volatile std::sig_atomic_t* interrupted);
  // Closes this process's end for writing: the machine reads an end of file.
  void close_writing(int pair);

  // How QEMU ended, if it does so within the timeout: "exit status 3", "Killed"; "": it still runs.
  [[nodiscard]] std::string ended(Seconds timeout);
  // QEMU's own messages, without warnings.
  [[nodiscard]] std::string messages();
  [[nodiscard]] int exit_status() const { return exit_status_; }  // -1: it has not ended by itself
  [[nodiscard]] pid_t pid() const { return qemu_.pid(); }

 private:
  struct Pair {
    program::Descriptor to, from;
  };
  std::vector<Pair> pairs_;
  program::Descriptor messages_;  // QEMU's stderr
  std::optional<OneProcessor> one_processor_;
  program::Subprocess qemu_;  // last: ends first
  int exit_status_ = -1;
};

}  // namespace ballast::sil
