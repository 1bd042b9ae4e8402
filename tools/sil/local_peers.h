// The monitor in the plant's own process, with a controller that may be anywhere and operators on a bus.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "firmware/control/params.h"
#include "tools/monitor/monitor.h"
#include "tools/sil/operator_ear.h"
#include "tools/sil/peer.h"

namespace ballast::sil {

// Judges each lap, and hears the controller's answer one tick later, as a monitor on a bus does.
class LapMonitor {
 public:
  virtual ~LapMonitor() = default;
  // Fills in the verdict.
  virtual void judge(Lap& lap) = 0;
  virtual void hear(const Lap& lap) = 0;
  [[nodiscard]] virtual hal::LinkCounters refused() const { return {}; }
};

class LocalMonitor final : public LapMonitor {
 public:
  explicit LocalMonitor(const monitor::MonitorLimits& limits) : monitor_(limits) {}
  void judge(Lap& lap) override {
    lap.verdict =
        monitor_.judge({&lap.plant.contact, &lap.plant.state, &lap.plant.sensors, status_ ? &*status_ : nullptr});
  }
  void hear(const Lap& lap) override {
    if (lap.answer) status_ = lap.answer->status;
  }

 private:
  monitor::Monitor monitor_;
  std::optional<controller_status_t> status_;  // the newest
};

class LocalPeers : public Peer {
 public:
  // `controller`: null in prescribed runs. `operator_bus`: must outlive the peers; null: no operators are heard.
  LocalPeers(std::unique_ptr<LapMonitor> monitor, std::unique_ptr<Peer> controller, hal::Bus* operator_bus);
  LocalPeers(const monitor::MonitorLimits& limits, std::unique_ptr<Peer> controller, hal::Bus* operator_bus = nullptr)
      : LocalPeers(std::make_unique<LocalMonitor>(limits), std::move(controller), operator_bus) {}

  hal::Status connect() override { return controller_ ? controller_->connect() : hal::Status::kOk; }
  hal::Status send(Lap& lap) override;
  hal::Status receive(Lap& lap) override;
  [[nodiscard]] bool computes_in_parallel() const override {
    return controller_ != nullptr && controller_->computes_in_parallel();
  }
  [[nodiscard]] std::string trouble() const override {
    if (bus_failed_) return "the LCM bus failed";
    return controller_ ? controller_->trouble() : "";
  }
  [[nodiscard]] PeerFailure failure() const override {
    return bus_failed_ || !controller_ ? PeerFailure::kLost : controller_->failure();
  }
  [[nodiscard]] RefusedMessages refused() const override;

 private:
  std::unique_ptr<LapMonitor> monitor_;
  std::unique_ptr<Peer> controller_;
  OperatorEar ear_;
  bool bus_failed_ = false;
};

// Monitor and controller both in this process.
class InProcessPeers : public LocalPeers {
 public:
  // `params` (accepted by firmware::validate()) must outlive the peers; null in prescribed runs.
  InProcessPeers(const firmware::ControllerParams* params, const monitor::MonitorLimits& limits,
                 double control_period_s, hal::Bus* operator_bus = nullptr);
};

}  // namespace ballast::sil
