// A file without a disk, that other code can open by its name; gone with the object.
#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <span>
#include <string>

namespace ballast::program {

class MemoryFile {
 public:
  explicit MemoryFile(std::span<const std::uint8_t> bytes = {})
      : descriptor_(memfd_create("ballast", MFD_CLOEXEC)),
        good_(descriptor_ >= 0 &&
              write(descriptor_, bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size())) {}
  ~MemoryFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  [[nodiscard]] bool good() const { return good_; }  // it is there, with all of the bytes
  [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
  bool good_;
};

}  // namespace ballast::program
