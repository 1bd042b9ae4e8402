#include "tools/recording/log_reader.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tools/recording/log_event.h"

namespace ballast::sil {

namespace {

constexpr std::int64_t kHeaderSize = kEventHeaderSize;

constexpr const char* kNoLog = "this run was made with --no-log, which keeps no log; run it again without";

// Whether the run whose log this would be has a summary that says so.
bool keeps_no_log(const std::filesystem::path& log) {
  std::ifstream file(log.parent_path() / "summary.json");
  const auto summary = nlohmann::json::parse(file, nullptr, false);
  std::error_code code;
  return log.filename() == "run.lcmlog" && !std::filesystem::exists(log, code) && summary.is_object() &&
         summary.contains("log_bytes") && summary["log_bytes"].is_null();
}

std::uint64_t big_endian(const unsigned char* bytes, int count) {
  std::uint64_t value = 0;
  for (int i = 0; i < count; ++i) value = value << 8 | bytes[i];
  return value;
}

}  // namespace

LogReader::LogReader(const std::string& path) {
  std::error_code code;
  if (std::filesystem::is_directory(path, code)) {
    error_ = path + ": is a folder; allowed: an LCM event log";
    return;
  }
  file_.open(path, std::ios::binary | std::ios::ate);
  if (!file_) {
    const char* why = std::strerror(errno);
    error_ = path + ": " + (keeps_no_log(path) ? kNoLog : std::string("cannot be read: ") + why);
    return;
  }
  size_ = file_.tellg();
  file_.seekg(0);
  LogEvent event;
  std::int64_t data_size = 0;
  if (!read_header(event, data_size)) {
    error_ = path + (size_ <= 0 ? ": is empty" : ": is no LCM event log");
    return;
  }
  file_.seekg(0);
}

// Parses a header. Of the channel's name it sets only the length.
bool LogReader::read_header(LogEvent& event, std::int64_t& data_size) {
  unsigned char header[kHeaderSize];
  if (offset_ + kHeaderSize > size_ || !file_.read(reinterpret_cast<char*>(header), kHeaderSize)) {
    damage_ = "cut off inside an event at byte " + std::to_string(offset_);
    return false;
  }
  const auto channel_size = static_cast<std::int32_t>(big_endian(header + 20, 4));
  data_size = static_cast<std::int32_t>(big_endian(header + 24, 4));
  if (big_endian(header, 4) != kSyncWord || channel_size < 0 || data_size < 0) {
    damage_ = "damaged at byte " + std::to_string(offset_) + ": no event starts there";
    return false;
  }
  if (channel_size + data_size > size_ - offset_ - kHeaderSize) {
    damage_ = "cut off inside an event at byte " + std::to_string(offset_);
    return false;
  }
  event.number = static_cast<std::int64_t>(big_endian(header + 4, 8));
  event.timestamp = static_cast<std::int64_t>(big_endian(header + 12, 8));
  event.channel.resize(static_cast<std::size_t>(channel_size));
  return true;
}

bool LogReader::resume() {
  if (damage_.empty()) return false;
  constexpr std::size_t kLongestChannel = 63;  // LCM's own limit
  file_.clear();
  file_.seekg(offset_ + 1);
  std::uint32_t last_bytes = 0;
  for (std::int64_t end = offset_ + 1; end < size_; ++end) {
    last_bytes = last_bytes << 8 | static_cast<unsigned char>(file_.get());
    if (last_bytes != kSyncWord || end - 3 <= offset_) continue;
    const std::int64_t damaged_at = offset_;
    offset_ = end - 3;
    file_.seekg(offset_);
    LogEvent event;
    std::int64_t data_size = 0;
    if (read_header(event, data_size) && !event.channel.empty() && event.channel.size() <= kLongestChannel) {
      damage_.clear();
      file_.seekg(offset_);
      return true;
    }
    offset_ = damaged_at;
    file_.clear();
    file_.seekg(end + 1);
  }
  return false;
}

bool LogReader::next(LogEvent& event) {
  if (!error_.empty() || !damage_.empty() || offset_ == size_) return false;
  std::int64_t data_size = 0;
  if (!read_header(event, data_size)) return false;
  event.data.resize(static_cast<std::size_t>(data_size));
  file_.read(event.channel.data(), static_cast<std::streamsize>(event.channel.size()));
  file_.read(event.data.data(), data_size);
  if (!file_) {
    damage_ = "cannot be read at byte " + std::to_string(offset_);
    return false;
  }
  offset_ += kHeaderSize + static_cast<std::int64_t>(event.channel.size()) + data_size;
  return true;
}

}  // namespace ballast::sil
