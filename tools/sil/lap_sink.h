// The place where a run's laps go, each once and in order: a recorder, or nowhere.
#pragma once

#include <cstdint>
#include <string>

#include "tools/sil/lap.h"

namespace ballast::sil {

class LapSink {
 public:
  virtual ~LapSink() = default;
  virtual void take(const Lap& lap) = 0;
  // False once a lap could not be taken; error() says why, and the run ends.
  [[nodiscard]] virtual bool good() const = 0;
  [[nodiscard]] virtual const std::string& error() const = 0;
  // Bytes written so far.
  [[nodiscard]] virtual std::int64_t bytes() const = 0;
};

// Keeps nothing.
class NoRecord final : public LapSink {
 public:
  void take(const Lap&) override {}
  [[nodiscard]] bool good() const override { return true; }
  [[nodiscard]] const std::string& error() const override { return error_; }
  [[nodiscard]] std::int64_t bytes() const override { return 0; }

 private:
  std::string error_;
};

}  // namespace ballast::sil
