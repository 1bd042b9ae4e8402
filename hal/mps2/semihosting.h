// Files and exit of the host that runs QEMU, by ARM's semihosting (ARM IHI 0054, "Semihosting for AArch32 and
// AArch64"). QEMU only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace ballast::hal::mps2::semihosting {

inline std::int32_t call(std::uint32_t operation, const void* arguments) {
  register std::uint32_t r0 asm("r0") = operation;
  register const void* r1 asm("r1") = arguments;
  asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
  return static_cast<std::int32_t>(r0);
}

enum class Mode : std::uint32_t { kRead = 1, kWrite = 5 };  // fopen's "rb" and "wb"

// Returns a handle; below 0: the file could not be opened.
inline std::int32_t open(const char* name, std::size_t length, Mode mode) {
  const std::uint32_t arguments[3] = {reinterpret_cast<std::uint32_t>(name), static_cast<std::uint32_t>(mode), length};
  return call(0x01, arguments);
}

// Returns the bytes transferred. Semihosting returns those that are missing.
inline std::size_t transfer(std::uint32_t operation, std::int32_t file, const std::uint8_t* bytes, std::size_t size) {
  const std::uint32_t arguments[3] = {static_cast<std::uint32_t>(file), reinterpret_cast<std::uint32_t>(bytes), size};
  const std::int32_t missing = call(operation, arguments);
  return missing < 0 || static_cast<std::size_t>(missing) > size ? 0 : size - static_cast<std::size_t>(missing);
}

// Waits for at least one byte; 0: the other end is closed.
inline std::size_t read(std::int32_t file, std::span<std::uint8_t> bytes) {
  return transfer(0x06, file, bytes.data(), bytes.size());
}
inline std::size_t write(std::int32_t file, std::span<const std::uint8_t> bytes) {
  return transfer(0x05, file, bytes.data(), bytes.size());
}

// The words QEMU was given with arg=..., separated by spaces. False: there are none, or they do not fit.
inline bool command_line(std::span<char> text) {
  std::uint32_t arguments[2] = {reinterpret_cast<std::uint32_t>(text.data()), text.size()};
  return call(0x15, arguments) == 0;
}

[[noreturn]] inline void exit(std::uint32_t status) {
  const std::uint32_t arguments[2] = {0x20026, status};  // ADP_Stopped_ApplicationExit
  for (;;) call(0x20, arguments);
}

}  // namespace ballast::hal::mps2::semihosting
