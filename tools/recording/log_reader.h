// Reads an LCM event log event by event. The file may hold anything.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

namespace ballast::sil {

struct LogEvent {
  std::int64_t number = 0;     // counts from 0 in a whole log
  std::int64_t timestamp = 0;  // us
  std::string channel;
  std::vector<char> data;
};

class LogReader {
 public:
  // Check error() first.
  explicit LogReader(const std::string& path);

  // False: no more events. damage() is then empty, or says where and why reading stopped before the end of the file.
  bool next(LogEvent& event);

  // After damage: goes on with the next event behind it. False: nothing behind it looks like an event.
  bool resume();

  [[nodiscard]] const std::string& error() const { return error_; }    // the file is no event log; empty: it is
  [[nodiscard]] const std::string& damage() const { return damage_; }  // "damaged at byte 28: no event starts there"

 private:
  bool read_header(LogEvent& event, std::int64_t& data_size);

  std::ifstream file_;
  std::int64_t offset_ = 0, size_ = 0;
  std::string error_, damage_;
};

}  // namespace ballast::sil
