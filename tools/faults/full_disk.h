// The fault disk_full, around the record of a run: from its time on the disk takes nothing.
#pragma once

#include <cstdint>
#include <limits>
#include <string>

#include "sim/scenario/scenario.h"
#include "tools/sil/lap_sink.h"

namespace ballast::sil {

class FullDisk final : public LapSink {
 public:
  // The sink must outlive the disk.
  FullDisk(const sim::Scenario& scenario, LapSink& sink);

  void take(const Lap& lap) override;
  [[nodiscard]] bool good() const override { return error_.empty() && sink_.good(); }
  [[nodiscard]] const std::string& error() const override { return error_.empty() ? sink_.error() : error_; }
  [[nodiscard]] std::int64_t bytes() const override { return sink_.bytes(); }

 private:
  LapSink& sink_;
  std::int64_t full_utime_ = std::numeric_limits<std::int64_t>::max();
  std::string error_;
};

}  // namespace ballast::sil
