#include "tools/doctor/machine.h"

#include <arpa/inet.h>
#include <fmt/core.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <lcm/lcm-cpp.hpp>

#include "hal/lcm/bus.h"
#include "hal/lcm/channels.h"
#include "tools/program/descriptor.h"
#include "tools/program/program.h"
#include "tools/program/subprocess.h"

namespace ballast::doctor {

namespace {

using program::Finding;
using Verdict = Finding::Verdict;

// A quarter of a second of a run at 1 kHz: 6 messages per tick, each 1.3 KiB on average with the kernel's bookkeeping.
constexpr int kReceiveBufferBytes = 2 << 20;
constexpr char kMachine[] = "mps2-an500";

program::Descriptor open_socket() { return program::Descriptor(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)); }

// GROUP of udpm://GROUP:PORT?..., or LCM's default if it is empty.
std::string group_of(const std::string& url) {
  const auto start = url.find("://") + 3;
  const std::string group = url.substr(start, url.find_first_of(":?/", start) - start);
  return group.empty() ? "239.255.76.67" : group;
}

// A port that no program uses, so that the test does not disturb a run on the URL's own port. 0: there is none, and the
// test will fail.
int free_port() {
  const program::Descriptor socket = open_socket();
  sockaddr_in here{};
  here.sin_family = AF_INET;
  socklen_t size = sizeof here;
  if (bind(socket.get(), reinterpret_cast<const sockaddr*>(&here), sizeof here) != 0 ||
      getsockname(socket.get(), reinterpret_cast<sockaddr*>(&here), &size) != 0) {
    return 0;
  }
  return ntohs(here.sin_port);
}

// Whether a message of `size` bytes that is sent to this URL comes back within a second.
bool comes_back(const std::string& url, std::size_t size) {
  lcm::LCM lcm(url);
  if (!hal::usable(lcm, url)) return false;
  std::size_t received = 0;
  const auto receive = [](const lcm::ReceiveBuffer* buffer, const std::string&, std::size_t* out) {
    *out = buffer->data_size;
  };
  lcm.subscribeFunction("BALLAST_DOCTOR", +receive, &received);
  const std::string message(size, 'x');
  if (lcm.publish("BALLAST_DOCTOR", message.data(), static_cast<unsigned>(size)) != 0) return false;
  return lcm.handleTimeout(1000) > 0 && received == size;
}

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

}  // namespace

Finding check_multicast(const std::string& url) {
  const std::string what = "multicast";
  if (!url.starts_with("udpm://")) {
    lcm::LCM lcm(url);
    if (hal::usable(lcm, url)) return {Verdict::kOk, what, "not used by " + url, ""};
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
  const program::Descriptor socket = open_socket();
  if (connect(socket.get(), reinterpret_cast<const sockaddr*>(&there), sizeof there) != 0) {
    return {Verdict::kFail, what, fmt::format("no route to {}: {}", group, std::strerror(errno)),
            "ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo"};
  }
  const std::string own = fmt::format("udpm://{}:{}?ttl=0", group, free_port());
  // The second message is larger than a datagram, so LCM sends it in fragments.
  for (const std::size_t bytes : {std::size_t{1000}, std::size_t{100000}}) {
    if (comes_back(own, bytes)) continue;
    return {Verdict::kFail, what, fmt::format("{} bytes sent to {} do not come back", bytes, group),
            "ip link set lo multicast on && ip route replace 224.0.0.0/4 dev lo"};
  }
  return {Verdict::kOk, what, fmt::format("messages sent to {} come back", group), ""};
}

Finding check_receive_buffer() {
  const program::Descriptor socket = open_socket();
  int got = 0;
  socklen_t size = sizeof got;
  setsockopt(socket.get(), SOL_SOCKET, SO_RCVBUF, &kReceiveBufferBytes, sizeof kReceiveBufferBytes);
  getsockopt(socket.get(), SOL_SOCKET, SO_RCVBUF, &got, &size);
  got /= 2;  // Linux allocates, and reports, twice the requested size
  if (got >= kReceiveBufferBytes) return {Verdict::kOk, "receive buffer", fmt::format("{} bytes", got), ""};
  return {Verdict::kFail, "receive buffer",
          fmt::format("at most {} bytes, so programs that watch a run may lose messages; needed: {}", got,
                      kReceiveBufferBytes),
          fmt::format("sysctl -w net.core.rmem_max={}", kReceiveBufferBytes)};
}

Finding check_cross_compiler() {
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

Finding check_qemu() {
  const std::string what = "emulator", fix = "apt-get install -y qemu-system-arm";
  if (program::find_program("qemu-system-arm").empty()) {
    return {Verdict::kNote, what, "no qemu-system-arm: the microcontroller's firmware cannot be run", fix};
  }
  const auto outcome = program::run_program({"qemu-system-arm", "-machine", "help"});
  if (outcome.exit_status != 0 || outcome.output.find(kMachine) == std::string::npos) {
    return {Verdict::kNote, what, fmt::format("qemu-system-arm has no machine {}", kMachine), fix};
  }
  return {Verdict::kOk, what, first_line(program::run_program({"qemu-system-arm", "--version"}).output), ""};
}

Finding check_display() {
  const char* display = std::getenv("DISPLAY");
  if (display != nullptr && *display != '\0') return {Verdict::kOk, "display", std::string("DISPLAY=") + display, ""};
  return {Verdict::kNote, "display", "DISPLAY is not set: lcm-spy cannot open its window", "ballast watch"};
}

}  // namespace ballast::doctor
