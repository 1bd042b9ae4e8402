// A person's end of the bus: hears the controller, tells it commands, and knows its answer to them.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "hal/lcm/bus.h"
#include "hal/lcm/channels.h"

namespace ballast::sil {

class BusOperator {
 public:
  // The bus must outlive the operator. `silence`: after so long without a status the controller is lost.
  BusOperator(hal::Bus& bus, hal::Seconds silence);
  BusOperator(const BusOperator&) = delete;
  BusOperator& operator=(const BusOperator&) = delete;

  // Until a controller's run is under way on this bus.
  hal::Status connect();
  // Says it, and waits until the controller has taken it, obeyed or not: status() then holds the answer. Said again
  // meanwhile, since a bus may lose messages; an exact copy is not obeyed twice.
  hal::Status tell(const firmware::OperatorInput& input);
  // Until a status satisfies `done`, that of the run's last tick included. kEnded: the run ended before that.
  hal::Status follow(const std::function<bool(const controller_status_t&)>& done);

  [[nodiscard]] const controller_status_t& status() const { return *status_; }
  // Of the contact messages heard since the last tell(), as long as the ball was in contact; none: there was none.
  [[nodiscard]] std::optional<double> least_margin() const { return least_margin_; }
  // After a failure, the whole story in one line.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }

 private:
  hal::Status fail(hal::Status status, const std::string& text);

  hal::Bus& bus_;
  hal::Seconds silence_;
  std::int64_t sender_ = hal::draw_bus_number();
  std::optional<controller_status_t> status_;  // the newest of a tick of the run
  bool fresh_ = false;                         // and not looked at yet
  bool waiting_ = false;                       // a controller said that it waits for the first tick
  std::optional<std::int64_t> last_tick_;      // the plant said that this was it
  std::optional<double> least_margin_;
  std::string trouble_;
};

}  // namespace ballast::sil
