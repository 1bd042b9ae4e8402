// A rail coordinate as a function of time, in pieces of linear acceleration. Positions are cubics, evaluated exactly.
#pragma once

#include <array>
#include <cstddef>

#include "firmware/model/types.h"

namespace ballast::firmware {

inline constexpr int kMaxPieces = 128;
inline constexpr int kMaxPlannedPieces = 7;  // of a stop or a move

// Limits of one motor's motion. Rail unit per s, s^2, s^3; each finite and > 0.
struct MotionLimits {
  Wide max_velocity = 0;
  Wide max_acceleration = 0;
  Wide max_jerk = 0;
};

struct ProfilePiece {
  Wide duration_s = 0;          // > 0
  Wide acceleration_start = 0;  // theta'' at the piece's start, rail unit / s^2
  Wide acceleration_end = 0;    // at its end; linear between
};

struct ProfilePoint {
  Wide position = 0;
  Wide velocity = 0;
  Wide acceleration = 0;  // where two pieces meet: that of the later piece
};

// Cubic p(s) = position + velocity s + acceleration s^2/2 + jerk s^3/6 on 0 <= s <= duration_s.
struct Cubic {
  Wide duration_s = 0;  // infinite for what follows the last piece
  Wide position = 0;
  Wide velocity = 0;
  Wide acceleration = 0;
  Wide jerk = 0;
};

// Built once, then read only. Every piece keeps its own start values, so errors do not accumulate with time. After the
// last piece the velocity stays constant. Before t = 0, at() gives the initial position and velocity. A border velocity
// within the rounding of the sums before it is set to zero, so that a mass that brakes comes to rest.
class Profile {
 public:
  Profile() = default;

  // False (and *this unchanged) if piece_count is outside 0..kMaxPieces, a duration is not positive and finite, or any
  // number is not finite.
  [[nodiscard]] bool set(Wide initial_position, Wide initial_velocity, const ProfilePiece* pieces, int piece_count);

  // The same pieces from another start. False (and *this unchanged) if that does not stay finite.
  [[nodiscard]] bool rebase(Wide initial_position, Wide initial_velocity);

  [[nodiscard]] ProfilePoint at(Wide time_s) const;

  // The cubic in force at time_s >= 0 (at a border: the later one), and where in it time_s lies.
  struct Location {
    int index;      // 0..piece_count()
    Wide offset_s;  // time since the cubic began
  };
  [[nodiscard]] Location locate(Wide time_s) const;
  [[nodiscard]] const Cubic& cubic(int index) const { return cubics_[static_cast<std::size_t>(index)]; }
  [[nodiscard]] Wide cubic_start_s(int index) const { return starts_s_[static_cast<std::size_t>(index)]; }
  [[nodiscard]] int piece_count() const { return piece_count_; }
  [[nodiscard]] Wide end_s() const {
    return starts_s_[static_cast<std::size_t>(piece_count_)];
  }  // end of the last piece
  [[nodiscard]] Wide final_position() const { return cubics_[static_cast<std::size_t>(piece_count_)].position; }
  [[nodiscard]] Wide final_velocity() const { return cubics_[static_cast<std::size_t>(piece_count_)].velocity; }

  // From time_s on the velocity is zero and stays so.
  [[nodiscard]] bool at_rest_from(Wide time_s) const;

 private:
  // Sets the start of every cubic. Their sums are finite.
  void lay(Wide initial_position, Wide initial_velocity);

  int piece_count_ = 0;
  std::array<Cubic, kMaxPieces + 1> cubics_{};   // [piece_count_] is the constant-velocity tail
  std::array<Wide, kMaxPieces + 1> starts_s_{};  // start time of each cubic
};

}  // namespace ballast::firmware
