#include "tools/cluster/crash_notice.h"

#include <unistd.h>

#include <csignal>
#include <cstddef>
#include <initializer_list>

namespace ballast::cluster {
namespace {

volatile std::uint64_t first_row = 0, row_count = 0;
volatile int this_rank = 0;

// Text in a buffer of fixed size, for a signal handler.
class Text {
 public:
  void add(const char* text) {
    while (*text != '\0' && length_ < sizeof text_) text_[length_++] = *text++;
  }
  void add(std::uint64_t number) {
    char digits[21] = {};
    std::size_t at = sizeof digits - 1;
    do {
      digits[--at] = static_cast<char>('0' + number % 10);
      number /= 10;
    } while (number != 0);
    add(digits + at);
  }
  void print() const { static_cast<void>(!write(STDERR_FILENO, text_, length_)); }

 private:
  char text_[200] = {};
  std::size_t length_ = 0;
};

void on_crash(int signal) {
  Text text;
  text.add("ballast-sweep: rank ");
  text.add(static_cast<std::uint64_t>(this_rank));
  text.add(" died of signal ");
  text.add(static_cast<std::uint64_t>(signal));
  if (row_count == 0) {
    text.add(" before its first row\n");
  } else {
    text.add(" in rows ");
    text.add(first_row);
    text.add(" to ");
    text.add(first_row + row_count - 1);
    text.add("; the finished blocks are kept, and --resume continues\n");
  }
  text.print();
  raise(signal);  // the default action is restored (SA_RESETHAND)
}

}  // namespace

void announce_crashes(int rank) {
  this_rank = rank;
  struct sigaction action {};
  action.sa_handler = on_crash;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_NODEFER);
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT}) sigaction(signal, &action, nullptr);
}

void set_rows_at_work(std::uint64_t first, std::uint64_t count) {
  first_row = first;
  row_count = count;
}

}  // namespace ballast::cluster
