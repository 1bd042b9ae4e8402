// One event of an LCM event log.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "hal/lcm/encode.h"

namespace ballast::sil {

// An event's sync word, number, time, and lengths of channel and data: big-endian.
inline constexpr std::size_t kEventHeaderSize = 28;
inline constexpr std::uint32_t kSyncWord = 0xEDA1DA01;

template <class M>
std::size_t event_size(const char* channel, const M& message) {
  return kEventHeaderSize + std::strlen(channel) + hal::encoded_size(message);
}

// Writes the header and the channel of an event, and returns where its data go.
inline char* write_event_header(char* at, std::int64_t number, std::int64_t utime, const char* channel,
                                std::size_t data_size) {
  const std::size_t channel_size = std::strlen(channel);
  hal::BigEndian(at) << kSyncWord << number << utime << static_cast<std::uint32_t>(channel_size)
                     << static_cast<std::uint32_t>(data_size);
  std::copy_n(channel, channel_size, at + kEventHeaderSize);
  return at + kEventHeaderSize + channel_size;
}

// Writes event_size() bytes.
template <class M>
void write_event(char* at, std::int64_t number, std::int64_t utime, const char* channel, const M& message) {
  hal::encode(message, write_event_header(at, number, utime, channel, hal::encoded_size(message)));
}

}  // namespace ballast::sil
