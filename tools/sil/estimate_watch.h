// The controller's estimate beside the truth, tick by tick.
#pragma once

#include <optional>

#include "hal/lcm/messages.h"
#include "sim/scenario/scenario.h"
#include "tools/sil/run_result.h"

namespace ballast::sil {

class EstimateWatch {
 public:
  explicit EstimateWatch(const sim::Scenario& scenario);

  // The plant's messages of a tick from 0 on, and the status of the same tick. `gyro_bias_B_radps`: what the gyro truly
  // adds. Ignores a status without a valid estimate.
  void observe(const contact_t& contact, const plant_state_t& truth, const controller_status_t& status,
               const Eigen::Vector3d& gyro_bias_B_radps);

  // None: there was no estimate.
  [[nodiscard]] std::optional<EstimateErrors> result() const;

 private:
  // Root of a mean square.
  struct Rms {
    double sum = 0;
    std::int64_t count = 0;
    void add(double square);
    [[nodiscard]] double value() const;
  };

  void observe_friction(const contact_t& contact, const controller_status_t& status);

  Eigen::Vector3d true_down_W_, believed_down_W_;
  Rms tilt_, position_, friction_;
  EstimateErrors errors_;
};

}  // namespace ballast::sil
