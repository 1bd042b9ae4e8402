// What a look at the machine has found: one line of `ballast doctor`, or why `ballast spy` does not start.
#pragma once

#include <string>

namespace ballast::program {

struct Finding {
  enum class Verdict {
    kOk,
    kFail,  // something Ballast needs does not work
    kNote,  // something not everybody needs is not there
  };
  Verdict verdict = Verdict::kOk;
  std::string what;  // "java", "types jar", ...
  std::string text;  // what was found, in one line
  std::string fix;   // the command that mends it, ready to be run; empty if ok
};

}  // namespace ballast::program
