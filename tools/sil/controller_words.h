// What a controller's status says, in words for people.
#pragma once

#include <ballast/controller_status_t.hpp>
#include <cstdint>
#include <string>

namespace ballast::sil {

// "armed", "running", ..
std::string mode_text(std::int8_t mode);

// Why the operator's last command was not obeyed; empty: it was.
std::string refusal_text(const controller_status_t& status);

}  // namespace ballast::sil
