#include "tools/faults/full_disk.h"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

namespace ballast::sil {

FullDisk::FullDisk(const sim::Scenario& scenario, LapSink& sink) : sink_(sink) {
  for (const sim::Fault& fault : scenario.faults) {
    if (fault.kind != sim::FaultKind::kDiskFull) continue;
    full_utime_ = std::min(full_utime_, static_cast<std::int64_t>(std::llround(fault.time_s * 1e6)));
  }
}

void FullDisk::take(const Lap& lap) {
  if (!error_.empty()) return;
  if (lap.plant.contact.utime < full_utime_) return sink_.take(lap);
  error_ = fmt::format("the log cannot be written: {} (as asked: disk_full at {:.6g} s)", std::strerror(ENOSPC),
                       1e-6 * static_cast<double>(full_utime_));
}

}  // namespace ballast::sil
