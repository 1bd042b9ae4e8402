// --firmware and --firmware-elf: the machine on which the controller of a run or a replay runs.
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
  std::string elf;  // empty: the one in this build tree
  [[nodiscard]] bool in_qemu() const { return firmware != kHost; }
};

// `option` must outlive the parsing.
inline void add_firmware_options(CLI::App& command, FirmwareOption& option) {
  command
      .add_option("--firmware", option.firmware,
                  "host: compiled into this program; qemu: built for a Cortex-M7 and run in QEMU; qemu-an386: built "
                  "for a Cortex-M4F with the model in single precision")
      ->check(program::one_of({kHost, kQemu, kQemuAn386}))
      ->capture_default_str();
  command.add_option("--firmware-elf", option.elf, "ELF file for QEMU; default: the one that tools/firmware builds")
      ->check(program::not_empty());
}

// QEMU's machine and the firmware on it.
inline sil::QemuOptions qemu_options(const FirmwareOption& option) {
  sil::QemuOptions qemu;
  if (option.firmware == kQemuAn386) qemu.board = "mps2_an386";
  qemu.elf = option.elf.empty() ? program::default_firmware(qemu.board) : option.elf;
  return qemu;
}

}  // namespace ballast
