#include "tools/recording/log_writer.h"

#include <pthread.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <exception>
#include <new>
#include <system_error>

#include "tools/program/processors.h"

namespace ballast::sil {

namespace {

constexpr std::uint32_t kSyncWord = 0xEDA1DA01;
constexpr std::size_t kLongestReason = 128;

template <class T>
void put(T value, std::vector<char>& to) {
  for (std::size_t i = sizeof value; i-- > 0;) to.push_back(static_cast<char>(value >> (8 * i)));
}

}  // namespace

LogWriter::LogWriter(const std::string& path, bool at_once)
    : at_once_(at_once), file_(std::fopen(path.c_str(), "wb")), error_(path + ": cannot be written: ") {
  const int open_error = errno;
  error_.reserve(error_.size() + kLongestReason);
  if (file_ == nullptr) {
    fail(std::strerror(open_error));
    return;
  }
  std::setvbuf(file_, nullptr, _IONBF, 0);  // batches are large
  if (at_once_) return;
  // Signals are for the caller's thread.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  try {
    thread_ = std::thread(&LogWriter::run, this);
  } catch (const std::system_error&) {
    at_once_ = true;  // no thread is to be had
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

LogWriter::~LogWriter() {
  flush();
  if (thread_.joinable()) {
    {
      const std::lock_guard lock(mutex_);
      ends_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  if (file_ != nullptr) std::fclose(file_);
}

void LogWriter::hand_over() {
  {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return handed_over_.empty(); });
    std::swap(filling_, handed_over_);
  }
  changed_.notify_all();
}

void LogWriter::flush() {
  if (!thread_.joinable()) return;
  if (!filling_.empty()) hand_over();
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return handed_over_.empty(); });
}

void LogWriter::run() {
  // The caller may keep to one processor, which it shares with an emulator.
  program::use_all_processors();
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return ends_ || !handed_over_.empty(); });
    if (handed_over_.empty()) return;
    lock.unlock();
    write(handed_over_);  // the caller leaves it alone until it is empty
    lock.lock();
    handed_over_.clear();
    changed_.notify_all();
  }
}

void LogWriter::write(const Bytes& batch) {
  if (failed_) return;
  try {
    encode_all(batch);
  } catch (const std::bad_alloc&) {
    fail(std::strerror(ENOMEM));
    return;
  } catch (const std::exception& error) {
    fail(error.what());
    return;
  }
  if (std::fwrite(encoded_.data(), 1, encoded_.size(), file_) != encoded_.size()) fail(std::strerror(errno));
}

void LogWriter::encode_all(const Bytes& batch) {
  encoded_.clear();
  for (std::size_t at = 0; at < batch.size();) {
    Header header;
    std::memcpy(&header, &batch[at], sizeof header);
    const char* message = &batch[at + sizeof header];
    at += sizeof header + header.size;
    const std::size_t channel_length = std::strlen(header.channel);
    put(kSyncWord, encoded_);
    put(static_cast<std::uint64_t>(events_++), encoded_);
    put(static_cast<std::uint64_t>(header.utime), encoded_);
    put(static_cast<std::uint32_t>(channel_length), encoded_);
    const std::size_t size_at = encoded_.size();
    put(std::uint32_t{0}, encoded_);
    encoded_.insert(encoded_.end(), header.channel, header.channel + channel_length);
    const std::size_t data_at = encoded_.size();
    header.encode(message, encoded_);
    const auto size = static_cast<std::uint32_t>(encoded_.size() - data_at);
    for (std::size_t i = 0; i < sizeof size; ++i) encoded_[size_at + i] = static_cast<char>(size >> (24 - 8 * i));
  }
}

// Allocates no memory: its lack may be the reason.
void LogWriter::fail(const char* why) {
  error_.append(why, std::min(std::strlen(why), error_.capacity() - error_.size()));
  failed_ = true;
}

}  // namespace ballast::sil
