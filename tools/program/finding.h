// The result of one check of the machine: a line of `ballast doctor`, or the reason why `ballast spy` does not start.
#pragma once

#include <string>

namespace ballast::program {

struct Finding {
  enum class Verdict {
    kOk,
    kFail,  // something that Ballast needs does not work
    kNote,  // something that only some users need is missing
  };
  Verdict verdict = Verdict::kOk;
  std::string what;  // "java", "types jar", ...
  std::string text;  // what was found, in one line
  std::string fix;   // the command that repairs it; empty if ok
};

}  // namespace ballast::program
