// The URL of a bus of which a program must miss nothing, though a run sends more than the system's default buffer
// holds while the program is not scheduled.
#pragma once

#include <string>

namespace ballast {

// LCM uses the system's default receive buffer unless the URL gives a size.
inline std::string with_receive_buffer(const std::string& url) {
  if (!url.starts_with("udpm://") || url.find("recv_buf_size") != std::string::npos) return url;
  return url + (url.find('?') == std::string::npos ? "?" : "&") + "recv_buf_size=2097152";
}

}  // namespace ballast
