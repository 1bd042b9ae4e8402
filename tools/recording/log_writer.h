// Writes events in the format of LCM's logs. The caller's thread encodes them into a batch, and a thread of its own
// writes the batches, so that the lap does not wait for the file. A failure shows after up to two batches, and at the
// latest in flush(). The file then ends with the last batch that was written, or inside the one that was not. Nothing
// allocates memory after the constructor.
//
// All functions are for one thread, the caller's.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tools/recording/log_event.h"

namespace ballast::sil {

class LogWriter {
 public:
  // `at_once`: every event is in the file when append() returns, and there is no thread.
  LogWriter(const std::string& path, bool at_once);
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  // Returns the event's size in the file.
  template <class M>
  std::int64_t append(const char* channel, const M& message, std::int64_t utime) {
    const std::size_t size = event_size(channel, message);
    static_assert(sizeof message < kBatchBytes / 2);  // and a channel's name is far shorter
    if (filled_ + size > kBatchBytes) hand_over();
    write_event(&filling_[filled_], events_, utime, channel, message);
    ++events_;
    filled_ += size;
    if (at_once_) write_at_once();
    return static_cast<std::int64_t>(size);
  }

  // All events appended so far are in the file, or good() is false.
  void flush();
  [[nodiscard]] bool good() const { return !failed_; }
  // Names the file that could not be written, and why; valid once good() is false.
  [[nodiscard]] const std::string& error() const { return error_; }

 private:
  static constexpr std::size_t kBatchBytes = std::size_t{1} << 18;  // two of them stay in a core's cache

  void write_at_once();
  void hand_over();
  void run();
  void write(const char* bytes, std::size_t size);
  void fail(const char* why);

  bool at_once_;
  std::FILE* file_ = nullptr;
  // The caller's: the batch, its part in use, and the events so far.
  std::vector<char> filling_;
  std::size_t filled_ = 0;
  std::int64_t events_ = 0;
  std::string error_;  // complete before failed_ is set
  std::atomic<bool> failed_ = false;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<char> handed_over_;
  std::size_t handed_over_size_ = 0;  // 0: the thread is done with it
  bool ends_ = false;
  std::thread thread_;
};

}  // namespace ballast::sil
