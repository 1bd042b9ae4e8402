#include "tools/sweep/build_record.h"

#include <elf.h>
#include <fmt/format.h>
#include <gnu/libc-version.h>
#include <link.h>

#include <cstring>
#include <fstream>

namespace ballast::sweep {
namespace {

constexpr const char* kFile = "build.txt";

// Reads the build id from the notes of one segment.
std::string build_id_in(const char* notes, std::size_t size) {
  constexpr std::size_t kAlignment = 4;
  const auto aligned = [](std::size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; };
  for (std::size_t at = 0; at + sizeof(ElfW(Nhdr)) <= size;) {
    ElfW(Nhdr) note;
    std::memcpy(&note, notes + at, sizeof note);
    const std::size_t value = at + sizeof note + aligned(note.n_namesz);
    if (note.n_type == NT_GNU_BUILD_ID && value + note.n_descsz <= size) {
      std::string id;
      for (std::size_t i = 0; i < note.n_descsz; ++i)
        id += fmt::format("{:02x}", static_cast<unsigned char>(notes[value + i]));
      return id;
    }
    at = value + aligned(note.n_descsz);
  }
  return "";
}

// The first object that dl_iterate_phdr names is the program itself.
int take_build_id(dl_phdr_info* object, std::size_t, void* id) {
  for (int i = 0; i < object->dlpi_phnum; ++i) {
    const ElfW(Phdr)& segment = object->dlpi_phdr[i];
    if (segment.p_type != PT_NOTE || segment.p_align != 4) continue;
    const std::string found =
        build_id_in(reinterpret_cast<const char*>(object->dlpi_addr + segment.p_vaddr), segment.p_memsz);
    if (!found.empty()) *static_cast<std::string*>(id) = found;
  }
  return 1;
}

bool has_fused_multiply_add() {
#if defined(__x86_64__)
  return __builtin_cpu_supports("fma") != 0;
#else
  return true;
#endif
}

}  // namespace

std::string this_build() {
  std::string id;
  dl_iterate_phdr(take_build_id, &id);
  std::error_code code;
  const std::string program = std::filesystem::read_symlink("/proc/self/exe", code).filename().string();
  return fmt::format("{} {}, C library {}{}", program, id.empty() ? "without build id" : id, gnu_get_libc_version(),
                     has_fused_multiply_add() ? " with FMA" : "");
}

std::string recorded_build(const std::filesystem::path& folder) {
  std::ifstream stream(folder / kFile);
  std::string line;
  std::getline(stream, line);
  return line;
}

std::string build_refusal(const std::filesystem::path& folder) {
  const std::string began = recorded_build(folder), now = this_build();
  if (began.empty() || began == now) return "";
  return fmt::format(
      "{}: was begun by {}; this is {}, which may compute other bits; allowed: the program that began, or another "
      "--out",
      folder.string(), began, now);
}

bool record_build(sil::OutputDir& output) { return output.write(kFile, this_build() + "\n"); }

}  // namespace ballast::sweep
