// Everything a controller needs from the world. A backend is one class that satisfies Board, chosen at compile time.
// All calls come from the control loop, never from an interrupt.
#pragma once

#include "hal/clock.h"
#include "hal/host_link.h"
#include "hal/sensor_source.h"
#include "hal/status.h"
#include "hal/step_output.h"
#include "hal/watchdog.h"

namespace ballast::hal {

template <class B>
concept Board = Clock<B> && SensorSource<B> && StepOutput<B> && HostLink<B> && Watchdog<B>;

}  // namespace ballast::hal
