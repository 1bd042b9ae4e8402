// A machine QEMU plays, with pipes to the program on it. It ends with this object, and with this process, however that
// ends.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "hal/status.h"
#include "tools/qemu/turns.h"

namespace ballast::sil {

using Seconds = std::chrono::duration<double>;

struct QemuOptions {
  std::string board = "mps2_an500";  // a folder of hal/; QEMU's machine has a hyphen there
  std::filesystem::path elf;
  int icount_shift = 2;  // an instruction takes 2^shift ns of the machine's time
  int pipe_pairs = 1;
  std::string arguments = "";  // for the program on the machine, after the names of its pipes
};

class QemuProcess {
 public:
  QemuProcess() = default;
  // Nobody waits for it: it is killed if it is still there.
  ~QemuProcess();
  QemuProcess(const QemuProcess&) = delete;
  QemuProcess& operator=(const QemuProcess&) = delete;

  // Empty, or why it could not be started.
  [[nodiscard]] std::string start(const QemuOptions& options);

  // Once the machine runs, and from now on answers to what it is written. Costs nothing but time if it does not.
  void take_turns();

  // All bytes. kPeerLost: the machine does not read any more, or not within the timeout.
  hal::Status write(int pair, std::span<const std::uint8_t> bytes, Seconds timeout);
  // What is there, at least one byte, appended to `bytes`. kEmpty: nothing within the timeout. kPeerLost: the machine
  // has ended. kInterrupted: `interrupted` is set.
  hal::Status read(int pair, std::vector<std::uint8_t>& bytes, Seconds timeout,
                   const volatile std::sig_atomic_t* interrupted);
  // Our end for writing: the machine reads an end of file.
  void close_writing(int pair);

  // How it ended, if it does so within the timeout: "" still there; "exit status 3"; "Killed".
  [[nodiscard]] std::string ended(Seconds timeout);
  // What QEMU itself had to say, warnings apart.
  [[nodiscard]] std::string said();
  [[nodiscard]] int exit_status() const { return exit_status_; }  // -1: not by itself
  [[nodiscard]] pid_t pid() const { return pid_; }

 private:
  struct Pair {
    int to = -1, from = -1;
  };
  std::vector<Pair> pairs_;
  int said_ = -1;  // QEMU's stderr
  Turns turns_;
  pid_t pid_ = 0;
  std::string end_;
  int exit_status_ = -1;
};

}  // namespace ballast::sil
