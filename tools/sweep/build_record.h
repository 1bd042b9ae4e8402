// The build that computes a sweep. Another compiler, C library or kind of processor may round differently, so that the
// blocks of one sweep have to come from one build.
#pragma once

#include <filesystem>
#include <string>

#include "tools/recording/output_dir.h"

namespace ballast::sweep {

// Program, its linker's build id, C library, and whether that one uses fused multiply-add on this processor.
[[nodiscard]] std::string this_build();

// The build that began the folder; empty: none is recorded.
[[nodiscard]] std::string recorded_build(const std::filesystem::path& folder);

// Empty, or why this build must not continue in the folder.
[[nodiscard]] std::string build_refusal(const std::filesystem::path& folder);

// False: output.error() says why.
[[nodiscard]] bool record_build(sil::OutputDir& output);

}  // namespace ballast::sweep
