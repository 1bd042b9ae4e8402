#include "tools/sweep/block.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>
#include <type_traits>

#include "tools/sweep/crc32.h"

namespace ballast::sweep {
namespace {

constexpr std::string_view kMagic = "BALLAST SWEEP 1\n";

// Appends values to a text of bytes.
class Encoder {
 public:
  template <class T>
  void number(T value) {
    static_assert(std::is_arithmetic_v<T>);
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    bytes_.append(bytes, sizeof value);
  }
  void text(std::string_view text) {
    number(static_cast<std::uint32_t>(text.size()));
    bytes_.append(text);
  }
  void cell(const Cell& cell) {
    number(static_cast<std::uint8_t>(cell.index()));
    if (const auto* value = std::get_if<double>(&cell)) number(*value);
    if (const auto* value = std::get_if<std::string>(&cell)) text(*value);
    if (const auto* values = std::get_if<std::vector<double>>(&cell)) {
      number(static_cast<std::uint32_t>(values->size()));
      for (const double value : *values) number(value);
    }
  }
  void cells(const std::vector<Cell>& cells) {
    number(static_cast<std::uint32_t>(cells.size()));
    for (const Cell& c : cells) cell(c);
  }
  void raw(std::string_view bytes) { bytes_.append(bytes); }
  [[nodiscard]] std::string& bytes() { return bytes_; }

 private:
  std::string bytes_;
};

// Takes values from bytes. After the end every value is 0, and good() is false.
class Decoder {
 public:
  explicit Decoder(std::string_view bytes) : rest_(bytes) {}
  template <class T>
  T number() {
    T value{};
    const std::string_view bytes = raw(sizeof value);
    if (good_) std::memcpy(&value, bytes.data(), sizeof value);
    return value;
  }
  std::string text() { return std::string(raw(number<std::uint32_t>())); }
  Cell cell() {
    switch (number<std::uint8_t>()) {
      case 0:
        return {};
      case 1:
        return number<double>();
      case 2:
        return text();
      case 3:
        break;
      default:
        good_ = false;
        return {};
    }
    std::vector<double> values;
    for (auto left = number<std::uint32_t>(); left > 0 && good_; --left) values.push_back(number<double>());
    return values;
  }
  std::vector<Cell> cells() {
    std::vector<Cell> out;
    for (auto left = number<std::uint32_t>(); left > 0 && good_; --left) out.push_back(cell());
    return out;
  }
  std::string_view raw(std::size_t size) {
    if (size > rest_.size()) {
      good_ = false;
      return {};
    }
    const std::string_view bytes = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return bytes;
  }
  [[nodiscard]] bool good() const { return good_; }
  [[nodiscard]] bool at_end() const { return good_ && rest_.empty(); }

 private:
  std::string_view rest_;
  bool good_ = true;
};

}  // namespace

std::string encoded(const Block& block) {
  Encoder out;
  out.raw(kMagic);
  out.number(block.sweep);
  out.number(block.first_row);
  out.number(static_cast<std::uint64_t>(block.rows.size()));
  for (const RowResult& row : block.rows) {
    out.number(row.seed);
    out.number(static_cast<std::int32_t>(row.exit_status));
    out.cells(row.varied);
    out.cells(row.kept);
  }
  out.number(crc32(out.bytes()));
  return std::move(out.bytes());
}

std::optional<Block> decoded(const std::string& bytes) {
  if (bytes.size() < kMagic.size() + sizeof(std::uint32_t)) return std::nullopt;
  const std::string_view body = std::string_view(bytes).substr(0, bytes.size() - sizeof(std::uint32_t));
  Decoder end(std::string_view(bytes).substr(body.size()));
  if (end.number<std::uint32_t>() != crc32(body)) return std::nullopt;
  Decoder in(body);
  if (in.raw(kMagic.size()) != kMagic) return std::nullopt;
  Block block;
  block.sweep = in.number<std::uint64_t>();
  block.first_row = in.number<std::uint64_t>();
  for (auto left = in.number<std::uint64_t>(); left > 0 && in.good(); --left) {
    RowResult row;
    row.number = block.first_row + block.rows.size();
    row.seed = in.number<std::uint64_t>();
    row.exit_status = in.number<std::int32_t>();
    row.varied = in.cells();
    row.kept = in.cells();
    block.rows.push_back(std::move(row));
  }
  return in.at_end() ? std::optional(std::move(block)) : std::nullopt;
}

std::string write_block(const std::filesystem::path& file, const Block& block) {
  const std::filesystem::path draft = file.string() + ".part";
  const std::string bytes = encoded(block);
  const auto failed = [&](const std::string& why) {
    std::error_code code;
    std::filesystem::remove(draft, code);
    return file.string() + ": cannot be written: " + why;
  };
  std::FILE* stream = std::fopen(draft.c_str(), "w");
  if (stream == nullptr) return failed(std::strerror(errno));
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), stream) == bytes.size();
  const int error = errno;
  const bool closed = std::fclose(stream) == 0;
  if (!written) return failed(std::strerror(error));
  if (!closed) return failed(std::strerror(errno));
  std::error_code code;
  std::filesystem::rename(draft, file, code);
  return code ? failed(code.message()) : "";
}

std::optional<Block> read_block(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return std::nullopt;
  std::ostringstream text;
  text << stream.rdbuf();
  return stream ? decoded(text.str()) : std::nullopt;
}

}  // namespace ballast::sweep
