// An operator's end of the bus: sends commands to the controller and hears its status.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "hal/lcm/bus.h"
#include "hal/lcm/channels.h"

namespace ballast::sil {

// An operator's command to the controller whose newest status this is, newer than the sender's earlier ones. Without
// the run's number, which the bus adds.
operator_t operator_message(const firmware::OperatorInput& input, const controller_status_t& status,
                            std::int64_t sender);

class BusOperator {
 public:
  // The bus must outlive the operator. `silence`: after so long without a status the controller is lost.
  BusOperator(hal::Bus& bus, hal::Seconds silence);
  BusOperator(const BusOperator&) = delete;
  BusOperator& operator=(const BusOperator&) = delete;

  // Waits until a controller's run is under way on this bus.
  hal::Status connect();
  // Sends a command and waits until the controller has taken it, obeyed or not: status() then holds the answer. Repeats
  // the message meanwhile, since a bus may lose some; an exact copy is not obeyed twice.
  hal::Status tell(const firmware::OperatorInput& input);
  // Waits until a status satisfies `done`, the one of the run's last tick included. kEnded: the run ended before that.
  hal::Status follow(const std::function<bool(const controller_status_t&)>& done);

  [[nodiscard]] const controller_status_t& status() const { return *status_; }
  // The least margin of the contact messages since the last tell(); none: the ball has not been on the ground.
  [[nodiscard]] std::optional<double> least_margin() const { return least_margin_; }
  // After a failure, why; one line.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }

 private:
  hal::Status fail(hal::Status status, const std::string& text);

  hal::Bus& bus_;
  hal::Seconds silence_;
  std::int64_t sender_ = hal::draw_bus_number();
  std::optional<controller_status_t> status_;  // the newest of a tick of the run
  bool fresh_ = false;                         // it came after follow() last looked
  bool waiting_ = false;                       // a controller waits for the first tick
  std::optional<std::int64_t> last_tick_;      // of the run, by the plant
  std::optional<double> least_margin_;
  std::string trouble_;
};

}  // namespace ballast::sil
