// A file in memory that other code can open by name. It is gone with the object.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <span>
#include <string>

#include "tools/program/descriptor.h"

namespace ballast::program {

class MemoryFile {
 public:
  explicit MemoryFile(std::span<const std::uint8_t> bytes = {})
      : descriptor_(memfd_create("ballast", MFD_CLOEXEC)),
        good_(descriptor_.good() &&
              write(descriptor_.get(), bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size())) {}

  // The file exists and holds all bytes.
  [[nodiscard]] bool good() const { return good_; }
  [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_.get()); }

 private:
  Descriptor descriptor_;
  bool good_;
};

}  // namespace ballast::program
