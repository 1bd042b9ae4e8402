// Changes one thing in TOML text: mostly a number, by little; else a number to one that hurts, a word, or a line.
#pragma once

#include <cctype>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>

#include "tests/fuzz/fuzz_target.h"

namespace ballast::fuzz {

struct Token {
  std::size_t at, size;
};

// Number literals outside strings and comments, as far as one can tell without a parser.
inline std::vector<Token> numbers_of(std::string_view text) {
  std::vector<Token> numbers;
  char quote = 0;
  bool comment = false;
  const auto in_word = [&](std::size_t i) {
    const auto c = static_cast<unsigned char>(text[i]);
    return std::isalnum(c) != 0 || c == '_' || c == '.' || c == '+' || c == '-';
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '\n') quote = 0, comment = false;
    if (comment) continue;
    if (quote != 0) {
      if (c == quote) quote = 0;
      continue;
    }
    if (c == '"' || c == '\'') quote = c;
    if (c == '#') comment = true;
    if (!in_word(i)) continue;
    std::size_t end = i;
    while (end < text.size() && in_word(end)) ++end;
    const bool digit = std::isdigit(static_cast<unsigned char>(text[i])) != 0;
    const bool signed_digit =
        (c == '-' || c == '+') && end > i + 1 && std::isdigit(static_cast<unsigned char>(text[i + 1])) != 0;
    if (digit || signed_digit) numbers.push_back({i, end - i});
    i = end - 1;
  }
  return numbers;
}

inline std::string changed_number(std::string_view literal, std::mt19937_64& random) {
  static constexpr std::string_view kHurt[] = {"0",    "-1",    "1e308",    "1e-308",    "nan",
                                               "-inf", "1e999", "\"text\"", "[1, 2, 3]", "9223372036854775807"};
  const std::string text(literal);
  if (below(10, random) < 3) return std::string(kHurt[below(std::size(kHurt), random)]);
  const std::string_view unsigned_text = text.starts_with('+') ? std::string_view(text).substr(1) : text;
  long integer = 0;
  const auto [end, error] = std::from_chars(unsigned_text.data(), unsigned_text.data() + unsigned_text.size(), integer);
  if (error == std::errc() && end == unsigned_text.data() + unsigned_text.size() && std::abs(integer) < 1'000'000) {
    return std::to_string(integer + static_cast<long>(below(3, random)) - (integer > 0 ? 1 : 0));
  }
  const double value = std::strtod(text.c_str(), nullptr);
  const double part = static_cast<double>(random() >> 11) / 9007199254740992.0;
  char out[40];
  const auto written =
      std::to_chars(out, out + sizeof out, value * (0.98 + 0.04 * part), std::chars_format::scientific);
  return {out, written.ptr};
}

inline Bytes change_toml(Bytes input, std::mt19937_64& random) {
  std::string text(input.begin(), input.end());
  const std::vector<Token> numbers = numbers_of(text);
  const auto line_at = [&](std::size_t at) {
    const std::size_t begin = at == 0 ? 0 : text.rfind('\n', at - 1) + 1;
    const std::size_t end = std::min(text.find('\n', at), text.size() - 1) + 1;
    return Token{begin, end - begin};
  };
  const std::size_t choice = below(16, random);
  if (text.empty()) return input;
  if (choice >= 2 && !numbers.empty()) {
    const Token number = numbers[below(numbers.size(), random)];
    text.replace(number.at, number.size, changed_number(std::string_view(text).substr(number.at, number.size), random));
  } else if (choice == 0) {
    const Token line = line_at(below(text.size(), random));
    text.erase(line.at, line.size);
  } else {
    const Token line = line_at(below(text.size(), random)), before = line_at(below(text.size(), random));
    text.insert(before.at, text.substr(line.at, line.size));
  }
  return {text.begin(), text.end()};
}

}  // namespace ballast::fuzz
