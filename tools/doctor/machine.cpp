#include "tools/doctor/machine.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <lcm/lcm-cpp.hpp>

#include "hal/lcm/channels.h"
#include "tools/program/program.h"
#include "tools/program/subprocess.h"

namespace ballast::doctor {

namespace {

using program::Finding;
using Verdict = Finding::Verdict;

// A quarter of a second of a run at 1 kHz: 6 messages per tick, each with the kernel's bookkeeping 1.3 KiB on average.
constexpr int kReceiveBufferBytes = 2 << 20;
constexpr char kMachine[] = "mps2-an500";

class Socket {
 public:
  Socket() : descriptor_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {}
  ~Socket() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  [[nodiscard]] int get() const { return descriptor_; }

 private:
  int descriptor_;
};

// GROUP of udpm://GROUP:PORT?..., with LCM's default for an empty one.
std::string group_of(const std::string& url) {
  const auto start = url.find("://") + 3;
  const std::string group = url.substr(start, url.find_first_of(":?/", start) - start);
  return group.empty() ? "239.255.76.67" : group;
}

// A port that is nobody's now: a run on the URL's own port must not hear the test. 0: there is none, and no message
// will come back.
int free_port() {
  const Socket socket;
  sockaddr_in here{};
  here.sin_family = AF_INET;
  socklen_t size = sizeof here;
  if (bind(socket.get(), reinterpret_cast<const sockaddr*>(&here), sizeof here) != 0 ||
      getsockname(socket.get(), reinterpret_cast<sockaddr*>(&here), &size) != 0) {
    return 0;
  }
  return ntohs(here.sin_port);
}

// One message of `size` bytes there and back on this URL, within a second.
bool comes_back(const std::string& url, std::size_t size) {
  lcm::LCM lcm(url);
  if (!lcm.good()) return false;
  std::size_t heard = 0;
  const auto hear = [](const lcm::ReceiveBuffer* buffer, const std::string&, std::size_t* out) {
    *out = buffer->data_size;
  };
  lcm.subscribeFunction("BALLAST_DOCTOR", +hear, &heard);
  const std::string message(size, 'x');
  if (lcm.publish("BALLAST_DOCTOR", message.data(), static_cast<unsigned>(size)) != 0) return false;
  return lcm.handleTimeout(1000) > 0 && heard == size;
}

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

}  // namespace

Finding look_at_multicast(const std::string& url) {
  const std::string what = "multicast";
  if (!url.starts_with("udpm://")) {
    if (lcm::LCM(url).good()) return {Verdict::kOk, what, "not used by " + url, ""};
    return {Verdict::kFail, what, program::bad_bus(url),
            program::ballast_as_typed() + " doctor --lcm " + program::shell_word(hal::kDefaultLcmUrl)};
  }
  const std::string group = group_of(url);
  sockaddr_in there{};
  there.sin_family = AF_INET;
  there.sin_port = htons(9);
  if (inet_pton(AF_INET, group.c_str(), &there.sin_addr) != 1 || !IN_MULTICAST(ntohl(there.sin_addr.s_addr))) {
    return {Verdict::kFail, what, group + " is no multicast group", program::ballast_as_typed() + " doctor"};
  }
  const Socket socket;
  if (connect(socket.get(), reinterpret_cast<const sockaddr*>(&there), sizeof there) != 0) {
    return {Verdict::kFail, what, "no route to " + group + ": " + std::strerror(errno),
            "ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo"};
  }
  const std::string own = "udpm://" + group + ":" + std::to_string(free_port()) + "?ttl=0";
  // The second is larger than a datagram: LCM cuts it up.
  for (const std::size_t bytes : {std::size_t{1000}, std::size_t{100000}}) {
    if (comes_back(own, bytes)) continue;
    return {Verdict::kFail, what, std::to_string(bytes) + " bytes sent to " + group + " do not come back",
            "ip link set lo multicast on && ip route replace 224.0.0.0/4 dev lo"};
  }
  return {Verdict::kOk, what, "what is sent to " + group + " comes back", ""};
}

Finding look_at_receive_buffer() {
  const Socket socket;
  int got = 0;
  socklen_t size = sizeof got;
  setsockopt(socket.get(), SOL_SOCKET, SO_RCVBUF, &kReceiveBufferBytes, sizeof kReceiveBufferBytes);
  getsockopt(socket.get(), SOL_SOCKET, SO_RCVBUF, &got, &size);
  got /= 2;  // Linux gives twice what it is asked for, and says so
  if (got >= kReceiveBufferBytes) return {Verdict::kOk, "receive buffer", std::to_string(got) + " bytes", ""};
  const std::string wanted = std::to_string(kReceiveBufferBytes);
  return {Verdict::kFail, "receive buffer",
          "at most " + std::to_string(got) + " bytes: who watches a run may miss messages; wanted " + wanted,
          "sysctl -w net.core.rmem_max=" + wanted};
}

Finding look_at_cross_compiler() {
  const std::string what = "cross compiler";
  const std::string fix = "apt-get install -y g++-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib";
  if (program::find_program("arm-none-eabi-g++").empty()) {
    return {Verdict::kNote, what, "no arm-none-eabi-g++: the firmware cannot be built for the microcontroller", fix};
  }
  const auto outcome = program::run_program({"arm-none-eabi-g++", "-std=c++20", "-mthumb", "-mcpu=cortex-m7",
                                             "-mfpu=fpv5-d16", "-mfloat-abi=hard", "--specs=nano.specs", "-include",
                                             "array", "-include", "math.h", "-fsyntax-only", "-x", "c++", "/dev/null"});
  if (outcome.exit_status != 0) {
    return {Verdict::kNote, what, "arm-none-eabi-g++ does not work: " + first_line(outcome.output), fix};
  }
  return {Verdict::kOk, what, first_line(program::run_program({"arm-none-eabi-g++", "--version"}).output), ""};
}

Finding look_at_qemu() {
  const std::string what = "emulator", fix = "apt-get install -y qemu-system-arm";
  if (program::find_program("qemu-system-arm").empty()) {
    return {Verdict::kNote, what, "no qemu-system-arm: the microcontroller's firmware cannot be run", fix};
  }
  const auto outcome = program::run_program({"qemu-system-arm", "-machine", "help"});
  if (outcome.exit_status != 0 || outcome.output.find(kMachine) == std::string::npos) {
    return {Verdict::kNote, what, std::string("qemu-system-arm knows no machine ") + kMachine, fix};
  }
  return {Verdict::kOk, what, first_line(program::run_program({"qemu-system-arm", "--version"}).output), ""};
}

Finding look_at_display() {
  const char* display = std::getenv("DISPLAY");
  if (display != nullptr && *display != '\0') return {Verdict::kOk, "display", std::string("DISPLAY=") + display, ""};
  return {Verdict::kNote, "display", "DISPLAY is not set: lcm-spy has nowhere to open its window", "ballast watch"};
}

}  // namespace ballast::doctor
