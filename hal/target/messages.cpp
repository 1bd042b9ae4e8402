#include "hal/target/messages.h"

namespace ballast::hal::target {
namespace {

// An archive that keeps nothing but the checksum.
class Checksum {
 public:
  explicit Checksum(std::uint8_t real_bytes) : single_(real_bytes == sizeof(float)) {}
  template <class T>
  void operator()(const T& value) {
    std::array<std::uint8_t, 8> bytes{};
    Writer writer(bytes);
    writer(value);
    crc_ = crc32(std::span<const std::uint8_t>(bytes).first(writer.size()), crc_);
  }
  template <class T>
  void real(const T& value) {
    (*this)(single_ ? static_cast<double>(static_cast<float>(value)) : static_cast<double>(value));
  }
  template <class T>
  void bounded(const T& value, std::int64_t, std::int64_t) {
    (*this)(value);
  }
  [[nodiscard]] bool ok() const { return true; }
  [[nodiscard]] std::uint32_t crc() const { return crc_; }

 private:
  bool single_;
  std::uint32_t crc_ = 0;
};

}  // namespace

std::uint32_t fingerprint(const firmware::ControllerParams& params, std::uint8_t real_bytes) {
  Checksum sum(real_bytes);
  ball_fields(sum, params);
  for (std::size_t i = 0; i < static_cast<std::size_t>(params.ball.mass_count); ++i) {
    sum.real(params.ball.mass_kg[i]);
    rail_fields(sum, params.ball.rail[i]);
    motor_fields(sum, params.motor[i]);
    const firmware::Profile& motion = params.motion[i];
    sum(motion.piece_count());
    for (int k = 0; k <= motion.piece_count(); ++k) {
      const firmware::Cubic& cubic = motion.cubic(k);
      sum(motion.cubic_start_s(k));
      sum(cubic.duration_s);
      sum(cubic.position);
      sum(cubic.velocity);
      sum(cubic.acceleration);
      sum(cubic.jerk);
    }
  }
  return sum.crc();
}

bool set_mass(const MassParams& mass, int index, firmware::ControllerParams& params) {
  const auto i = static_cast<std::size_t>(index);
  params.ball.mass_kg[i] = mass.mass_kg;
  params.ball.rail[i] = mass.rail;
  params.motor[i] = mass.motor;
  return params.motion[i].set(mass.initial_position, mass.initial_velocity, mass.pieces.data(), mass.piece_count);
}

}  // namespace ballast::hal::target
