// --firmware and --firmware-elf: what the controller of a run or of a replay runs on.
#pragma once

#include <string>

#include "tools/program/program.h"
#include "tools/qemu/qemu_process.h"

namespace ballast {

inline constexpr const char* kHost = "host";
inline constexpr const char* kQemu = "qemu";
inline constexpr const char* kQemuAn386 = "qemu-an386";

struct FirmwareOption {
  std::string firmware = kHost;
  std::string elf;  // empty: the one built beside this program
  [[nodiscard]] bool in_qemu() const { return firmware != kHost; }
};

// `option` must outlive the parsing.
inline void add_firmware_options(CLI::App& command, FirmwareOption& option) {
  command
      .add_option("--firmware", option.firmware,
                  "host: compiled into this program; qemu: the one built for a microcontroller, a Cortex-M7, in QEMU; "
                  "qemu-an386: a Cortex-M4F, its model in single precision")
      ->check(CLI::IsMember({kHost, kQemu, kQemuAn386}))
      ->capture_default_str();
  command
      .add_option("--firmware-elf", option.elf, "for a --firmware in QEMU; default: the one tools/firmware has built")
      ->check(program::not_empty());
}

// Of a firmware in QEMU: which machine, and the program on it.
inline sil::QemuOptions qemu_options(const FirmwareOption& option) {
  sil::QemuOptions qemu;
  if (option.firmware == kQemuAn386) qemu.board = "mps2_an386";
  qemu.elf = option.elf.empty() ? program::default_firmware(qemu.board) : option.elf;
  return qemu;
}

}  // namespace ballast
