// The searches of tools/docs/governor.md:
//   governor_study [--without PART,PART...] [--friction-use PART] KIND FIRST LAST
// A robot per seed, with the governor and without it. A robot that leaves the cone with the governor on is printed as
// the call that repeats it, with all parts left out that it does not need. A range of seeds can be run in pieces.
#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <string_view>

#include "tests/governor/judged_run.h"

namespace ballast::governor_test {
namespace {

struct Kind {
  const char* name;
  bool steppers = false;
  double mass_error = 0, center_error = 0;
  bool declared = false;  // the governor knows these bounds
};

const Kind kKinds[] = {
    {"ideal"},
    {"steppers", true},
    // Bounds of a belief that control.belief_error declares.
    {"belief", false, 0.05, 0.005, true},
    {"belief_steppers", true, 0.05, 0.005, true},
    // The same undeclared: control.friction_use has to keep free what it may be off.
    {"undeclared", false, 0.05, 0.005},
    {"instants"},  // plans forked and run to their end
};
constexpr int kInstants = 5;  // per robot

struct Request {
  Kind kind;
  std::uint64_t first = 0, last = 0;
  double friction_use = 1;
  unsigned without = 0;
};

Draw draw_of(const Request& request, std::uint64_t seed) {
  const Kind& kind = request.kind;
  return {seed,          kind.steppers,        kind.mass_error, kind.center_error,
          kind.declared, request.friction_use, request.without};
}

Judged run(const Draw& draw, bool governed) {
  return draw.steppers ? run_plant(draw, governed) : run_ideal(draw, governed);
}

// Leaves out what the violation does not need.
Draw shrunk(Draw draw) {
  for (const Part& part : kParts) {
    Draw smaller = draw;
    smaller.without |= part.bit;
    const Judged judged = run(smaller, true);
    if (judged.started && judged.broken) draw = smaller;
  }
  return draw;
}

void print_violation(const Kind& kind, const Draw& found, const Judged& judged, const Judged& without) {
  const Draw small = shrunk(found);
  std::string option = small.without == 0 ? "" : "--without " + to_string(small.without) + " ";
  if (small.friction_use != 1) option += fmt::format("--friction-use {} ", small.friction_use);
  const Judged again = run(small, true);
  fmt::print("  seed {}: {:.6f} of the friction at {:.4f} s, bent by {:.3f}; without the governor {:.4f}\n", found.seed,
             judged.most_use, judged.time_s, judged.largest_bend, without.most_use);
  fmt::print("    governor_study {}{} {} {}: {:.6f}", option, kind.name, small.seed, small.seed, again.most_use);
  if (kind.steppers) fmt::print(", {:.4f} by the motors, {:.4f} allowed", again.motors_added, again.allowed);
  fmt::print("\n");
  std::fflush(stdout);
}

int search(const Request& request) {
  int started = 0, refused = 0, broken = 0, broken_without = 0, other = 0;
  double worst = 0;
  for (std::uint64_t seed = request.first; seed <= request.last; ++seed) {
    const Draw draw = draw_of(request, seed);
    const Judged governed = run(draw, true);
    if (!governed.started) {
      ++refused;
      continue;
    }
    ++started;
    const Judged without = run(draw, false);
    broken_without += without.broken ? 1 : 0;
    worst = std::max(worst, governed.most_use);
    if (governed.broken) {
      ++broken;
      print_violation(request.kind, draw, governed, without);
    } else if (!governed.other.empty()) {
      ++other;
      fmt::print("  seed {}: {}; without the governor {}\n", seed, governed.other,
                 without.other.empty() ? "nothing" : without.other);
    }
  }
  fmt::print("| {} | {} to {} | {} | {} | {} | {} | {} | {:.4f} |\n", request.kind.name, request.first, request.last,
             started, refused, broken, broken_without, other, worst);
  return broken > 0 ? 1 : 0;
}

void add(const Instants::Margins& from, Instants::Margins& to) {
  to.count += from.count;
  to.off += from.off;
  to.worst = std::max(to.worst, from.worst);
}

int instants(const Request& request) {
  Instants all;
  int robots = 0;
  for (std::uint64_t seed = request.first; seed <= request.last; ++seed) {
    const Instants found = fork_at_instants(draw_of(request, seed), kInstants);
    robots += found.forks > 0 ? 1 : 0;
    all.forks += found.forks;
    all.broken += found.broken;
    all.worst_use = std::max(all.worst_use, found.worst_use);
    add(found.near, all.near);
    add(found.far, all.far);
    add(found.for_ever, all.for_ever);
    if (found.broken + found.near.off + found.for_ever.off == 0) continue;
    fmt::print("  governor_study instants {} {}: {} broken, {:.6f} of the friction; {} margins off, by {:.4f}\n", seed,
               seed, found.broken, found.worst_use, found.near.off + found.for_ever.off,
               std::max(found.near.worst, found.for_ever.worst));
    std::fflush(stdout);
  }
  const auto text = [](const Instants::Margins& margins) {
    return fmt::format("{}, {}, {:.4f}", margins.count, margins.off, margins.worst);
  };
  fmt::print("| instants | {} to {} | {} | {} | {} | {:.4f} | {} | {} | {} |\n", request.first, request.last, robots,
             all.forks, all.broken, all.worst_use, text(all.near), text(all.far), text(all.for_ever));
  std::fflush(stdout);
  return all.broken > 0 ? 1 : 0;
}

unsigned parts_of(const std::string& names) {
  unsigned out = 0;
  for (std::size_t from = 0; from < names.size();) {
    const std::size_t comma = std::min(names.find(',', from), names.size());
    const std::string name = names.substr(from, comma - from);
    const Part* part =
        std::find_if(std::begin(kParts), std::end(kParts), [&](const Part& p) { return name == p.name; });
    if (part == std::end(kParts)) throw std::invalid_argument(name);
    out |= part->bit;
    from = comma + 1;
  }
  return out;
}

// Throws std::invalid_argument where the words make no sense.
Request requested(int count, char** words) {
  Request out;
  int next = 1;
  for (; next + 1 < count && std::string_view(words[next]).starts_with("--"); next += 2) {
    const std::string_view option = words[next];
    if (option == "--without") {
      out.without = parts_of(words[next + 1]);
    } else if (option == "--friction-use") {
      out.friction_use = std::stod(words[next + 1]);
    } else {
      throw std::invalid_argument(words[next]);
    }
  }
  if (count != next + 3) throw std::invalid_argument("KIND FIRST LAST");
  const std::string name = words[next];
  const Kind* kind = std::find_if(std::begin(kKinds), std::end(kKinds), [&](const Kind& k) { return name == k.name; });
  if (kind == std::end(kKinds)) throw std::invalid_argument(name);
  out.kind = *kind;
  out.first = std::stoull(words[next + 1]);
  out.last = std::stoull(words[next + 2]);
  return out;
}

}  // namespace
}  // namespace ballast::governor_test

int main(int count, char** words) {
  using namespace ballast::governor_test;
  Request request;
  try {
    request = requested(count, words);
  } catch (const std::exception& error) {
    fmt::print(stderr,
               "governor_study: {}\nusage: governor_study [--without PART,PART...] [--friction-use PART] KIND FIRST "
               "LAST\nKIND:",
               error.what());
    for (const Kind& kind : kKinds) fmt::print(stderr, " {}", kind.name);
    fmt::print(stderr, "\nPART:");
    for (const Part& part : kParts) fmt::print(stderr, " {}", part.name);
    fmt::print(stderr, "\n");
    return 2;
  }
  try {
    return std::string_view(request.kind.name) == "instants" ? instants(request) : search(request);
  } catch (const std::exception& error) {
    fmt::print(stderr, "governor_study: {}\n", error.what());
    return 2;
  }
}
