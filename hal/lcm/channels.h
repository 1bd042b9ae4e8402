// Address and channels of the bus. The message types are in lcmtypes/.
#pragma once

#include <cstdint>

namespace ballast::hal {

inline constexpr char kDefaultLcmUrl[] = "udpm://239.255.76.67:7667?ttl=0";  // ttl 0: packets stay on this machine

inline constexpr char kChannelContact[] = "BALLAST_CONTACT";
inline constexpr char kChannelPlantState[] = "BALLAST_PLANT_STATE";
inline constexpr char kChannelSensors[] = "BALLAST_SENSORS";
inline constexpr char kChannelStepCommand[] = "BALLAST_STEP_COMMAND";
inline constexpr char kChannelControllerStatus[] = "BALLAST_CONTROLLER_STATUS";
inline constexpr char kChannelTrip[] = "BALLAST_TRIP";
inline constexpr char kChannelOperator[] = "BALLAST_OPERATOR";
inline constexpr char kChannelCourse[] = "BALLAST_COURSE";  // operator_t: the course in force, for observers

// Tick of a controller_status_t or trip_t whose sender waits for the first tick: earlier than any run begins.
inline constexpr std::int64_t kWaitingTick = -100'000'000'000;

}  // namespace ballast::hal
