// What the tick takes that finds more to step than there are bursts, and those of the stop after it.
#include "hal/mps2/machine.h"
#include "hal/mps2/startup.h"
#include "tests/target/overload_load.h"

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
  static std::array<test::OverloadLoad, test::kOverloadRobots.size()> loads;
  for (std::size_t i = 0; i < loads.size(); ++i) {
    if (!test::measure_overloads(
            test::kOverloadRobots[i], [] { return the_machine.counter(); }, params, state, inputs, outputs, loads[i])) {
      return static_cast<int>(mps2::Exit::kRefused);
    }
  }
  static std::array<std::uint8_t, test::kOverloadBytes> bytes;
  target::Writer writer(bytes);
  test::overload_fields(writer, loads);
  return the_machine.write(bytes) == Status::kOk ? 0 : static_cast<int>(mps2::Exit::kLinkCut);
}
