#include "firmware/motion/profile.h"

#include <cmath>
#include <limits>

namespace ballast::firmware {

namespace {

// The values at a border between pieces; step() goes to the next one.
struct Border {
  Wide time_s = 0;
  Wide position = 0;
  Wide velocity = 0;
  Wide velocity_scale = 0;  // largest term added into the velocity so far
  int borders = 0;

  Border(Wide initial_position, Wide initial_velocity)
      : position(initial_position), velocity(initial_velocity), velocity_scale(std::fabs(initial_velocity)) {}

  void step(const Cubic& piece) {
    const Wide d = piece.duration_s;
    const Wide gain = d * (piece.acceleration + d * piece.jerk / 2);
    position += d * (velocity + d * (piece.acceleration / 2 + d * piece.jerk / 6));
    velocity += gain;
    velocity_scale = std::fmax(velocity_scale, std::fmax(std::fabs(velocity), d * std::fabs(piece.acceleration)));
    velocity_scale = std::fmax(velocity_scale, d * d * std::fabs(piece.jerk));
    ++borders;
    // Each border adds a few roundings of the largest term.
    if (std::fabs(velocity) <= 4 * borders * std::numeric_limits<Wide>::epsilon() * velocity_scale) velocity = 0;
    time_s += d;
  }

  [[nodiscard]] bool finite() const {
    return std::isfinite(time_s) && std::isfinite(position) && std::isfinite(velocity) && std::isfinite(velocity_scale);
  }
};

Cubic cubic_of(const ProfilePiece& piece) {
  Cubic c;
  c.duration_s = piece.duration_s;
  c.acceleration = piece.acceleration_start;
  c.jerk = (piece.acceleration_end - piece.acceleration_start) / piece.duration_s;
  return c;
}

}  // namespace

bool Profile::set(Wide initial_position, Wide initial_velocity, const ProfilePiece* pieces, int piece_count) {
  if (piece_count < 0 || piece_count > kMaxPieces) return false;
  // The pieces are walked twice, to check and to write, because a second profile would need 6 kB of stack.
  Border check(initial_position, initial_velocity);
  if (!check.finite()) return false;
  for (int i = 0; i < piece_count; ++i) {
    const Cubic c = cubic_of(pieces[i]);
    if (!(c.duration_s > 0) || !std::isfinite(c.duration_s) || !std::isfinite(c.acceleration) ||
        !std::isfinite(pieces[i].acceleration_end) || !std::isfinite(c.jerk)) {
      return false;
    }
    check.step(c);
    if (!check.finite()) return false;
  }
  piece_count_ = piece_count;
  for (int i = 0; i < piece_count; ++i) cubics_[static_cast<std::size_t>(i)] = cubic_of(pieces[i]);
  cubics_[static_cast<std::size_t>(piece_count)] = Cubic{};
  cubics_[static_cast<std::size_t>(piece_count)].duration_s = std::numeric_limits<Wide>::infinity();
  lay(initial_position, initial_velocity);
  return true;
}

bool Profile::rebase(Wide initial_position, Wide initial_velocity) {
  Border check(initial_position, initial_velocity);
  for (int i = 0; i < piece_count_; ++i) check.step(cubics_[static_cast<std::size_t>(i)]);
  if (!check.finite()) return false;
  lay(initial_position, initial_velocity);
  return true;
}

void Profile::lay(Wide initial_position, Wide initial_velocity) {
  Border border(initial_position, initial_velocity);
  for (int i = 0; i <= piece_count_; ++i) {
    const auto k = static_cast<std::size_t>(i);
    starts_s_[k] = border.time_s;
    cubics_[k].position = border.position;
    cubics_[k].velocity = border.velocity;
    if (i < piece_count_) border.step(cubics_[k]);
  }
}

Profile::Location Profile::locate(Wide time_s) const {
  // Bisection for the largest index with a start not after time_s; NaN gives 0.
  std::size_t low = 0, left = static_cast<std::size_t>(piece_count_) + 1;  // it is one of starts[low .. low + left)
  while (left > 1) {
    const std::size_t half = left / 2;
    if (starts_s_[low + half] <= time_s) low += half;
    left -= half;
  }
  return {static_cast<int>(low), time_s - starts_s_[low]};
}

ProfilePoint Profile::at(Wide time_s) const {
  if (time_s < 0) return {cubics_[0].position, cubics_[0].velocity, 0};
  const Location here = locate(time_s);
  const Cubic& c = cubic(here.index);
  const Wide s = here.offset_s;
  return {c.position + s * (c.velocity + s * (c.acceleration / 2 + s * (c.jerk / 6))),
          c.velocity + s * (c.acceleration + s * (c.jerk / 2)), c.acceleration + s * c.jerk};
}

bool Profile::at_rest_from(Wide time_s) const {
  for (int i = locate(time_s).index; i <= piece_count_; ++i) {
    const Cubic& c = cubic(i);
    if (c.velocity != 0 || c.acceleration != 0 || c.jerk != 0) return false;
  }
  return true;
}

}  // namespace ballast::firmware
