// Runs rows of a sweep: several at once where batch_rows.h can, otherwise one by one; and searches limits.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "tools/sweep/batch_rows.h"

namespace ballast::sweep {

// Takes a finished row. False: no more rows are wanted.
using TakeRow = std::function<bool(RowResult&&)>;

class RowRunner {
 public:
  // Both must outlive the object.
  RowRunner(const Spec& spec, const RowScenarios& scenarios);

  // Called before rows are run, with the first one and their count.
  void set_beginning(std::function<void(std::uint64_t first, std::uint64_t count)> beginning) {
    beginning_ = std::move(beginning);
  }

  // Gives `take` each row from `first` on, in order.
  void run(std::uint64_t first, std::uint64_t count, const TakeRow& take);

  // The step of the batch kernel, in s; 0: the rows are run one by one.
  [[nodiscard]] double step_s() const { return batch_.usable() ? batch_.step_s() : 0; }

  // Runs rows whose values were chosen by the caller. Limits are not searched.
  [[nodiscard]] std::vector<RowResult> run_rows(const std::vector<Row>& rows);

 private:
  const Spec& spec_;
  const RowScenarios& scenarios_;
  BatchRows batch_;
  std::function<void(std::uint64_t first, std::uint64_t count)> beginning_;
};

}  // namespace ballast::sweep
