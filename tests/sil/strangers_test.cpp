// A run with strangers on its bus ends as without them, with the same log, byte for byte.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <fstream>
#include <random>
#include <thread>

#include "hal/lcm/bus.h"
#include "hal/lcm/channels.h"
#include "tests/random_seed.h"
#include "tests/sil/shell.h"

namespace ballast {
namespace {

using test::bus_url;
using test::Folder;
using test::Outcome;
using test::read_file;

using Bytes = std::vector<std::uint8_t>;

constexpr char kGroup[] = "239.255.76.67";

int port_of(const std::string& url) { return std::stoi(url.substr(url.rfind(':') + 1)); }

void put(Bytes& bytes, std::uint64_t value, int size) {
  for (int i = size - 1; i >= 0; --i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

void put(Bytes& bytes, const std::string& text) { bytes.insert(bytes.end(), text.begin(), text.end()); }

// LCM's UDP packets, as lcm's documentation of its multicast protocol has them.
constexpr std::uint32_t kShortMagic = 0x4c433032, kFragmentMagic = 0x4c433033;

Bytes short_packet(const std::string& channel, const Bytes& payload, std::uint32_t magic = kShortMagic) {
  Bytes bytes;
  put(bytes, magic, 4);
  put(bytes, 7, 4);
  put(bytes, channel);
  bytes.push_back(0);
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  return bytes;
}

Bytes fragment(std::uint32_t message_size, std::uint32_t offset, std::uint16_t number, std::uint16_t count,
               const std::string& data) {
  Bytes bytes;
  put(bytes, kFragmentMagic, 4);
  put(bytes, 11, 4);
  put(bytes, message_size, 4);
  put(bytes, offset, 4);
  put(bytes, number, 2);
  put(bytes, count, 2);
  put(bytes, data);
  return bytes;
}

template <class M>
Bytes encoded(const M& message) {
  Bytes bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

// A word of every kind that moves something, whole and in range, of a run that is not this one (0: of none).
void put_forged(std::int64_t run_id, std::int64_t tick, std::vector<Bytes>& packets) {
  const auto forge = [&](const char* channel, auto message) {
    message.tick = tick;
    message.run_id = run_id;
    packets.push_back(short_packet(channel, encoded(message)));
  };
  contact_t floating{};
  floating.last = 1;
  trip_t tripped{}, untripped{};
  tripped.tripped = 1;
  tripped.cause = trip_t::CAUSE_FRICTION;
  operator_t stop{}, reset{};
  stop.command = operator_t::COMMAND_STOP;
  reset.command = operator_t::COMMAND_RESET;
  stop.sequence = reset.sequence = std::int64_t{1} << 60;
  sensors_t last{};
  last.last = 1;
  forge(hal::kChannelContact, floating);
  forge(hal::kChannelPlantState, plant_state_t{});
  forge(hal::kChannelSensors, last);
  forge(hal::kChannelTrip, tripped);
  forge(hal::kChannelTrip, untripped);
  forge(hal::kChannelOperator, stop);
  forge(hal::kChannelOperator, reset);
  forge(hal::kChannelControllerStatus, controller_status_t{});
  forge(hal::kChannelStepCommand, step_command_t{});
}

std::vector<Bytes> strange_packets(std::mt19937_64& random) {
  std::vector<Bytes> packets;
  const auto noise = [&random](std::size_t size) {
    Bytes bytes(size);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    return bytes;
  };
  for (int i = 0; i < 20; ++i) packets.push_back(noise(random() % 1400));
  const char* const channels[] = {hal::kChannelContact, hal::kChannelPlantState,       hal::kChannelSensors,
                                  hal::kChannelTrip,    hal::kChannelControllerStatus, hal::kChannelStepCommand,
                                  hal::kChannelOperator};
  for (const char* channel : channels) {
    packets.push_back(short_packet(channel, noise(random() % 600)));  // no fingerprint, no length
    packets.push_back(short_packet(channel, {}));
    packets.push_back(short_packet(channel, encoded(trip_t{}), 0x4c433031));  // wrong magic
    Bytes wrong = encoded(operator_t{});
    wrong[5] ^= 1;
    packets.push_back(short_packet(channel, wrong));  // wrong fingerprint
    packets.push_back(fragment(0xffffffff, 0, 0, 65535, std::string(channel) + '\0' + "abc"));
    packets.push_back(fragment(0x7fffffff, 0, 0, 2, std::string(channel) + '\0'));
    packets.push_back(fragment(10, 0xfffffff0, 1, 65535, std::string(900, 'a')));
    packets.push_back(fragment(100000, 99999, 65535, 3, std::string(900, 'a')));
    packets.push_back(fragment(100, 50, 1, 2, std::string(900, 'a')));
    packets.push_back(fragment(0, 0, 0, 0, ""));
    packets.push_back(fragment(5, 0, 0, 1, std::string(channel) + '\0' + "abcdefgh"));
    packets.push_back(fragment(1000, 0, 0, 2, std::string(1000, 'a')));  // a channel that does not end
    Bytes cut = fragment(1000, 0, 0, 2, "");
    cut.resize(4 + random() % 15);
    packets.push_back(cut);
  }
  packets.push_back({});
  packets.push_back(short_packet(std::string(1300, 'c'), {}));
  Bytes no_end;
  put(no_end, kShortMagic, 4);
  put(no_end, 7, 4);
  put(no_end, std::string(63, 'c'));
  packets.push_back(no_end);
  for (const std::int64_t run_id : {std::int64_t{0}, static_cast<std::int64_t>(random() >> 2)}) {
    put_forged(run_id, static_cast<std::int64_t>(random() % 1000), packets);
  }
  return packets;
}

// A socket of its own, that is a sender of its own, for packets to this machine only.
class RawSender {
 public:
  explicit RawSender(int port) {
    const unsigned char ttl = 0;
    setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
    to_.sin_family = AF_INET;
    to_.sin_port = htons(static_cast<std::uint16_t>(port));
    inet_pton(AF_INET, kGroup, &to_.sin_addr);
  }
  ~RawSender() { close(socket_); }
  RawSender(const RawSender&) = delete;
  RawSender& operator=(const RawSender&) = delete;
  bool send(const Bytes& packet) const {
    return sendto(socket_, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to_), sizeof to_) >= 0;
  }

 private:
  int socket_ = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in to_{};
};

// Sends until it goes.
class Stranger {
 public:
  Stranger(int port, std::uint64_t seed) : thread_([this, port, seed] { talk(port, seed); }) {}
  ~Stranger() {
    over_ = true;
    thread_.join();
  }
  [[nodiscard]] int sent() const { return sent_; }

 private:
  void talk(int port, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    const RawSender sender(port);
    while (!over_) {
      for (const Bytes& packet : strange_packets(random)) {
        if (over_) break;
        if (sender.send(packet)) ++sent_;
        // Below what fills a receive buffer while its reader waits for the processor: who floods a bus does end runs.
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
      }
    }
  }

  std::atomic<bool> over_{false};
  std::atomic<int> sent_{0};
  std::thread thread_;
};

// Strangers talk from the moment the countdown is over; before, a run does not begin on a bus that is not its own.
TEST(Strangers, ChangeNothingInARunOfThreeProcesses) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  const Folder folder;
  const std::string url = bus_url(3);
  // The end of a trip, so that a mode hangs on what the controller hears.
  const std::string scenario = "paper_ball --set envelope.friction_use=0.3 --quiet";
  ASSERT_EQ(folder.run("ballast run " + scenario + " --out alone").exit_status, 3);
  Outcome run;
  {
    std::thread runs([&] {
      run = folder.run("ballast run " + scenario + " --speed 1 --processes --lcm '" + url + "' --out crowd");
    });
    hal::Bus bus(url);
    bool under_way = false;
    bus.subscribe<contact_t>(hal::kChannelContact, [&](const contact_t& m) { under_way = m.tick >= 0; });
    EXPECT_EQ(bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(30)), [&] { return under_way; }),
              hal::Status::kOk);
    const Stranger stranger(port_of(url), seed);
    runs.join();
    EXPECT_GT(stranger.sent(), 100);
  }
  EXPECT_EQ(run.exit_status, 3) << run.err;
  EXPECT_TRUE(read_file(folder / "alone/run.lcmlog") == read_file(folder / "crowd/run.lcmlog"));
  auto a = folder.summary("alone"), b = folder.summary("crowd");
  EXPECT_EQ(a["refused_messages"]["malformed"], 0);
  EXPECT_EQ(a["refused_messages"]["foreign"], 0);
  EXPECT_GT(b["refused_messages"]["malformed"], 10) << b["refused_messages"];
  EXPECT_GT(b["refused_messages"]["foreign"], 10) << b["refused_messages"];
  EXPECT_GT(b["refused_messages"]["by_controller"], 10) << b["refused_messages"];
  for (auto* s : {&a, &b}) s->erase("wall_time"), s->erase("speed"), s->erase("refused_messages");
  EXPECT_EQ(a, b);
}

// A log played back to a controller that waits is of no run, and does not move it.
TEST(Strangers, ALogPlayedBackMovesNoController) {
  const Folder folder;
  const std::string url = bus_url(4);
  folder.run("ballast run paper_ball --set duration=0.2 --quiet --out r");
  hal::Bus bus(url);
  int steps = 0;
  bus.subscribe<step_command_t>(hal::kChannelStepCommand, [&](const step_command_t&) { ++steps; });
  bool waiting = false;
  bus.subscribe<controller_status_t>(hal::kChannelControllerStatus, [&](const controller_status_t& m) {
    waiting = waiting || (m.tick == hal::kWaitingTick && m.run_id == 0);
  });
  Outcome controller;
  std::thread runs([&] {
    controller = folder.run("ballast-controller paper_ball --set duration=0.2 --start-timeout 3 --lcm '" + url + "'");
  });
  EXPECT_EQ(bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(30)), [&] { return waiting; }),
            hal::Status::kOk);
  lcm::LCM player(url);
  lcm::LogFile log((folder / "r/run.lcmlog").string(), "r");
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    // The messages that a controller hears; its own would be taken for this one's here.
    if (event->channel == hal::kChannelStepCommand || event->channel == hal::kChannelControllerStatus) continue;
    player.publish(event->channel, event->data, static_cast<unsigned>(event->datalen));
  }
  runs.join();
  EXPECT_EQ(controller.exit_status, 2);
  EXPECT_NE(controller.err.find("lost plant"), std::string::npos) << controller.err;
  EXPECT_EQ(bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(0.2)), [] { return false; }),
            hal::Status::kEmpty);
  EXPECT_EQ(steps, 0);
}

std::int64_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  std::int64_t size = 0, resident = 0;
  file >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

// Fragments, put together inside LCM: of messages that claim to be huge and are never finished, and of one as small as
// they can be, whose message is whole and of no length of ours.
TEST(Strangers, FragmentsFillNoMemoryAndHoldUpNobody) {
  const std::string url = bus_url(6);
  hal::Bus bus(url), peer(url);
  ASSERT_TRUE(bus.good() && peer.good());
  std::int64_t heard = -1;
  bus.subscribe<trip_t>(hal::kChannelTrip, [&](const trip_t& m) { heard = m.tick; });
  const auto expect_heard = [&](std::int64_t tick) {
    trip_t message{};
    message.tick = tick;
    ASSERT_EQ(peer.publish(hal::kChannelTrip, message), hal::Status::kOk);
    EXPECT_EQ(bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(30)), [&] { return heard == tick; }),
              hal::Status::kOk);
  };
  expect_heard(0);
  const std::int64_t before = resident_bytes();
  const std::string start = std::string(hal::kChannelTrip) + '\0' + std::string(1200, 'a');
  constexpr std::uint32_t kClaimed = 200'000'000;
  for (int sender = 0; sender < 200; ++sender) {
    const RawSender raw(port_of(url));
    EXPECT_TRUE(raw.send(fragment(kClaimed, 0, 0, 65535, start)));
    EXPECT_TRUE(raw.send(fragment(kClaimed, kClaimed - 5000, 65534, 65535, std::string(1200, 'b'))));
    if (sender % 20 == 0) expect_heard(1 + sender);
  }
  expect_heard(1000);
  // LCM bounds unfinished messages at 16 MB of claimed size and one message more, and of that only
  // what has come is ever written. All 200 would be 40 GB claimed, and with pages for what has come 2 MB.
  EXPECT_LT(resident_bytes() - before, 64 << 20);

  const RawSender raw(port_of(url));
  constexpr std::uint16_t kSize = 200;
  EXPECT_TRUE(raw.send(fragment(kSize, 0, 0, kSize, std::string(hal::kChannelTrip) + '\0' + "a")));
  for (std::uint16_t i = 1; i < kSize; ++i) EXPECT_TRUE(raw.send(fragment(kSize, i, i, kSize, "a")));
  EXPECT_EQ(bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(30)), [&] { return bus.malformed() > 0; }),
            hal::Status::kOk);
  EXPECT_EQ(bus.malformed(), 1);
  expect_heard(1001);
}

// The time to live of a run's packets, as a receiver sees it.
int time_to_live(const Folder& folder, const std::string& url) {
  const int socket_fd = socket(AF_INET, SOCK_DGRAM, 0);
  const int on = 1;
  setsockopt(socket_fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  setsockopt(socket_fd, SOL_SOCKET, SO_REUSEPORT, &on, sizeof on);
  setsockopt(socket_fd, IPPROTO_IP, IP_RECVTTL, &on, sizeof on);
  sockaddr_in here{};
  here.sin_family = AF_INET;
  here.sin_port = htons(static_cast<std::uint16_t>(port_of(url)));
  here.sin_addr.s_addr = INADDR_ANY;
  EXPECT_EQ(bind(socket_fd, reinterpret_cast<sockaddr*>(&here), sizeof here), 0) << std::strerror(errno);
  ip_mreq group{};
  inet_pton(AF_INET, kGroup, &group.imr_multiaddr);
  EXPECT_EQ(setsockopt(socket_fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group), 0) << std::strerror(errno);
  EXPECT_EQ(folder.run("ballast run paper_ball --set duration=0.01 --quiet --out r --lcm '" + url + "'").exit_status,
            0);
  int ttl = -1;
  pollfd ready{socket_fd, POLLIN, 0};
  if (poll(&ready, 1, 5000) == 1) {
    char data[2048], control[256];
    iovec part{data, sizeof data};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control;
    message.msg_controllen = sizeof control;
    EXPECT_GT(recvmsg(socket_fd, &message, 0), 0);
    for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
      if (c->cmsg_level == IPPROTO_IP && c->cmsg_type == IP_TTL) std::memcpy(&ttl, CMSG_DATA(c), sizeof ttl);
    }
  }
  close(socket_fd);
  return ttl;
}

// Nothing leaves the machine, unless the URL asks for it: by default, and where it says nothing.
TEST(Strangers, AreOnThisMachineOnly) {
  EXPECT_NE(std::string(hal::kDefaultLcmUrl).find("?ttl=0"), std::string::npos);
  const Folder folder;
  const std::string url = bus_url(5);
  EXPECT_EQ(time_to_live(folder, url), 0);
  EXPECT_EQ(time_to_live(folder, url.substr(0, url.find('?'))), 0);
}

}  // namespace
}  // namespace ballast
