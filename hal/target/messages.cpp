#include "hal/target/messages.h"

#include <bit>

namespace ballast::hal::target {
namespace {

// Visits fields and keeps only their checksum.
class Checksum : public Visitor<Checksum> {
 public:
  explicit Checksum(std::uint8_t real_bytes) : single_(real_bytes == sizeof(float)) {}

  template <class Name, class T, class Rule>
  void leaf(const Name&, const T& value, const Rule&) {
    if constexpr (std::is_same_v<Rule, Real>) {
      add(single_ ? static_cast<double>(static_cast<float>(value)) : static_cast<double>(value));
    } else {
      add(value);
    }
  }
  [[nodiscard]] std::uint32_t crc() const { return crc_; }

 private:
  template <class T>
  void add(const T& value) {
    std::array<std::uint8_t, 8> bytes{};
    Writer writer(bytes);
    writer(value);
    crc_ = crc32(std::span<const std::uint8_t>(bytes).first(writer.size()), crc_);
  }

  bool single_;
  std::uint32_t crc_ = 0;
};

}  // namespace

std::uint32_t fingerprint(const firmware::ControllerParams& params, std::uint8_t real_bytes) {
  Checksum sum(real_bytes);
  visit(sum, params);
  for (std::size_t i = 0; i < static_cast<std::size_t>(params.ball.mass_count); ++i) {
    sum.field(params.ball.mass_kg[i], Real()).field(params.ball.rail[i]).field(params.motor[i]);
    const firmware::Profile& motion = params.motion[i];
    const int pieces = motion.piece_count();
    sum.field(pieces);
    for (int k = 0; k <= pieces; ++k) {
      const firmware::Wide start_s = motion.cubic_start_s(k);
      sum.field(start_s).field(motion.cubic(k));
    }
  }
  const int values = reference_values(params);
  for (int k = 0; k < values; ++k) {
    const auto bits = std::bit_cast<std::uint32_t>(params.tracking.values[static_cast<std::size_t>(k)]);
    sum.field(bits);
  }
  return sum.crc();
}

int reference_values(const firmware::ControllerParams& params) {
  const int values = params.tracking.samples * firmware::reference_row(params.ball.mass_count);
  return std::min(values, firmware::kMostReferenceFloats);
}

void get_reference(const firmware::ReferenceTable& table, int first, int end, ReferencePart& part) {
  part.count = std::min(end - first, kReferencePart);
  for (int k = 0; k < part.count; ++k) {
    part.bits[static_cast<std::size_t>(k)] =
        std::bit_cast<std::uint32_t>(table.values[static_cast<std::size_t>(first + k)]);
  }
}

bool set_reference(const ReferencePart& part, int first, int end, firmware::ReferenceTable& table) {
  if (part.count > end - first) return false;
  for (int k = 0; k < part.count; ++k) {
    table.values[static_cast<std::size_t>(first + k)] = std::bit_cast<float>(part.bits[static_cast<std::size_t>(k)]);
  }
  return true;
}

bool set_mass(const MassParams& mass, int index, firmware::ControllerParams& params) {
  const auto i = static_cast<std::size_t>(index);
  params.ball.mass_kg[i] = mass.mass_kg;
  params.ball.rail[i] = mass.rail;
  params.motor[i] = mass.motor;
  return params.motion[i].set(mass.initial_position, mass.initial_velocity, mass.pieces.data(), mass.piece_count);
}

}  // namespace ballast::hal::target
