// Measures the longest control ticks: usual ones, those of a stop, and those of a move.
#include "hal/mps2/machine.h"
#include "hal/mps2/startup.h"
#include "hal/target/wire.h"
#include "tests/target/worst_tick.h"

using namespace ballast;
using namespace ballast::hal;
using mps2::the_machine;

namespace {

firmware::ControllerParams params;
firmware::ControllerState state;
firmware::Inputs inputs;
firmware::Outputs outputs;

}  // namespace

int main() {
  if (!the_machine.open_link()) return static_cast<int>(mps2::Exit::kNoLink);
  static std::array<test::WorstTicks, test::kWorstTickMasses.size()> worst;
  for (std::size_t i = 0; i < worst.size(); ++i) {
    if (!test::measure_worst_ticks(
            test::kWorstTickMasses[i], [] { return the_machine.counter(); }, params, state, inputs, outputs,
            worst[i])) {
      return static_cast<int>(mps2::Exit::kRefused);
    }
  }
  static std::array<std::uint8_t, test::kWorstTickBytes> bytes;
  target::Writer writer(bytes);
  test::worst_tick_fields(writer, worst);
  return the_machine.write(bytes) == Status::kOk ? 0 : static_cast<int>(mps2::Exit::kLinkCut);
}
