#include "tools/recording/log_writer.h"

#include <pthread.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <new>
#include <system_error>
#include <utility>

#include "tools/program/processors.h"

namespace ballast::sil {

namespace {

constexpr std::size_t kLongestReason = 128;

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
  try {
    filling_.resize(kBatchBytes);
    if (!at_once_) handed_over_.resize(kBatchBytes);
  } catch (const std::bad_alloc&) {
    fail(std::strerror(ENOMEM));
    return;
  }
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
    changed_.wait(lock, [&] { return handed_over_size_ == 0; });
    std::swap(filling_, handed_over_);
    handed_over_size_ = std::exchange(filled_, 0);
  }
  changed_.notify_all();
}

void LogWriter::flush() {
  if (!thread_.joinable()) return;
  if (filled_ > 0) hand_over();
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return handed_over_size_ == 0; });
}

void LogWriter::run() {
  // The caller may keep to one processor, which it shares with an emulator.
  program::use_all_processors();
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return ends_ || handed_over_size_ > 0; });
    if (handed_over_size_ == 0) return;
    lock.unlock();
    write(handed_over_.data(), handed_over_size_);  // the caller leaves it alone until its size is 0
    lock.lock();
    handed_over_size_ = 0;
    changed_.notify_all();
  }
}

void LogWriter::write_at_once() {
  write(filling_.data(), filled_);
  filled_ = 0;
}

void LogWriter::write(const char* bytes, std::size_t size) {
  if (!failed_ && std::fwrite(bytes, 1, size, file_) != size) fail(std::strerror(errno));
}

// Allocates no memory.
void LogWriter::fail(const char* why) {
  error_.append(why, std::min(std::strlen(why), error_.capacity() - error_.size()));
  failed_ = true;
}

}  // namespace ballast::sil
