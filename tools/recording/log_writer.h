// Writes events in the format of LCM's logs from a thread of its own, so that the lap neither encodes nor waits for the
// file. The caller's thread only copies messages. A failure, lack of memory included, shows after up to two batches,
// and at the latest in flush(). The file then ends with the last batch that was written, or inside the one that was
// not.
//
// All functions are for one thread, the caller's.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

namespace ballast::sil {

class LogWriter {
 public:
  // `at_once`: every event is in the file when append() returns, and there is no thread.
  LogWriter(const std::string& path, bool at_once);
  ~LogWriter();
  LogWriter(const LogWriter&) = delete;
  LogWriter& operator=(const LogWriter&) = delete;

  // `channel` must outlive this object. Returns the event's size in the file.
  template <class M>
  std::int64_t append(const char* channel, const M& message, std::int64_t utime) {
    static_assert(std::is_trivially_copyable_v<M>);
    const Header header{channel, &encode<M>, utime, sizeof(M)};
    const std::size_t start = filling_.size();
    filling_.resize(start + sizeof header + sizeof message);
    std::memcpy(&filling_[start], &header, sizeof header);
    std::memcpy(&filling_[start + sizeof header], &message, sizeof message);
    if (at_once_) {
      write(filling_);
      filling_.clear();
    } else if (filling_.size() >= kBatchBytes) {
      hand_over();
    }
    return kEventHeaderSize + static_cast<std::int64_t>(std::strlen(channel)) + message.getEncodedSize();
  }

  // All events appended so far are in the file, or good() is false.
  void flush();
  [[nodiscard]] bool good() const { return !failed_; }
  // Names the file that could not be written, and why; valid once good() is false.
  [[nodiscard]] const std::string& error() const { return error_; }

 private:
  // An event's sync word, number, time, and lengths of channel and data: big-endian.
  static constexpr std::int64_t kEventHeaderSize = 28;
  static constexpr std::size_t kBatchBytes = std::size_t{1} << 16;  // stays in a core's cache

  using Bytes = std::vector<char>;
  // Precedes each message of a batch.
  struct Header {
    const char* channel;
    void (*encode)(const char* message, Bytes& to);
    std::int64_t utime;
    std::size_t size;
  };

  // Appends the encoded message.
  template <class M>
  static void encode(const char* from, Bytes& to) {
    M message;
    std::memcpy(&message, from, sizeof message);
    const std::size_t start = to.size();
    const int size = message.getEncodedSize();
    to.resize(start + static_cast<std::size_t>(size));
    message.encode(&to[start], 0, size);
  }

  void hand_over();
  void run();
  void write(const Bytes& batch);
  void encode_all(const Bytes& batch);
  void fail(const char* why);

  bool at_once_;
  std::FILE* file_ = nullptr;
  Bytes filling_;            // the caller's
  Bytes encoded_;            // the writing thread's
  std::int64_t events_ = 0;  // the writing thread's
  std::string error_;        // complete before failed_ is set
  std::atomic<bool> failed_ = false;

  std::mutex mutex_;
  std::condition_variable changed_;
  Bytes handed_over_;  // empty: the thread is done with it
  bool ends_ = false;
  std::thread thread_;
};

}  // namespace ballast::sil
