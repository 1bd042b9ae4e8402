// A short text in memory that this process shares with children that are started later.
#pragma once

#include <sys/mman.h>

#include <string>

namespace ballast::program {

class SharedText {
 public:
  SharedText() {
    void* memory = mmap(nullptr, kBytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory != MAP_FAILED) text_ = static_cast<char*>(memory);  // zeros
  }
  ~SharedText() {
    if (text_ != nullptr) munmap(text_, kBytes);
  }
  SharedText(const SharedText&) = delete;
  SharedText& operator=(const SharedText&) = delete;

  [[nodiscard]] bool good() const { return text_ != nullptr; }
  // Keeps as much of the text as fits. One process at a time.
  void set(const std::string& text) { text_[text.copy(text_, kBytes - 1)] = '\0'; }
  [[nodiscard]] std::string text() const { return text_; }

 private:
  static constexpr std::size_t kBytes = 4096;
  char* text_ = nullptr;
};

}  // namespace ballast::program
