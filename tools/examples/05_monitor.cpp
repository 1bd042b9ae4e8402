// 05: the monitor over a recorded run. It reads the messages from the log of `ballast run` and judges them by limits of
// its own: here only half of the floor's friction may be used.
//   05_monitor runs/paper_ball/run.lcmlog 0.35
// Prints the tick in which it would have tripped, the cause (a constant of trip.lcm), the value and the limit.
#include <cstdio>
#include <cstdlib>
#include <lcm/lcm-cpp.hpp>
#include <optional>
#include <string>

#include "hal/lcm/channels.h"
#include "tools/monitor/monitor.h"

using ballast::contact_t, ballast::controller_status_t, ballast::plant_state_t, ballast::sensors_t, ballast::trip_t;

// Decodes an event of this channel into `message`.
template <class Message>
void take(const lcm::LogEvent& event, const char* channel, std::optional<Message>& message) {
  if (event.channel != channel) return;
  message.emplace();
  if (message->decode(event.data, 0, event.datalen) < 0) message.reset();
}

int main(int argc, char** argv) {
  if (argc < 3) {
    std::printf("usage: 05_monitor LOG STATIC_FRICTION\n");
    return 1;
  }
  lcm::LogFile log(argv[1], "r");
  if (!log.good()) {
    std::printf("%s: cannot be read\n", argv[1]);
    return 1;
  }
  ballast::monitor::MonitorLimits limits;
  limits.static_friction = std::strtod(argv[2], nullptr);
  limits.friction_use = 0.5;
  limits.starts_rolling = true;
  limits.controller_expected = true;
  ballast::monitor::Monitor monitor(limits);

  std::optional<contact_t> contact;
  std::optional<plant_state_t> state;
  std::optional<sensors_t> sensors;
  std::optional<controller_status_t> status;  // of the tick before
  while (const lcm::LogEvent* event = log.readNextEvent()) {
    using namespace ballast::hal;
    take(*event, kChannelContact, contact);
    take(*event, kChannelPlantState, state);
    take(*event, kChannelSensors, sensors);
    if (contact && state && sensors) {  // the plant has sent all of its tick
      const trip_t verdict = monitor.judge(
          {.contact = &*contact, .plant_state = &*state, .sensors = &*sensors, .status = status ? &*status : nullptr});
      if (verdict.tripped != 0) {
        std::printf("tripped at tick %lld, cause %d: f_s/N was %.9g, allowed %.9g\n",
                    static_cast<long long>(verdict.trip_tick), verdict.cause, verdict.value, verdict.limit);
        return 3;
      }
      contact.reset();
      state.reset();
      sensors.reset();
    }
    take(*event, kChannelControllerStatus, status);
  }
  std::printf("not tripped\n");
  return 0;
}
