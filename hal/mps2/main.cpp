// The firmware on an MPS2 board, over its link.
#include "hal/mps2/machine.h"
#include "hal/mps2/startup.h"
#include "hal/target/build_id.h"
#include "hal/target/serve.h"

using namespace ballast::hal;

int main() {
  using mps2::Exit;
  if (!mps2::the_machine.open_link()) return static_cast<int>(Exit::kNoLink);
  return mps2::exit_of(target::serve(mps2::the_machine, {.sources = target::kSourcesId}));
}
