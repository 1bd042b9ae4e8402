#include "tools/sil/local_peers.h"

#include "tools/sil/host_firmware.h"

namespace ballast::sil {

using hal::Status;

LocalPeers::LocalPeers(std::unique_ptr<LapMonitor> monitor, std::unique_ptr<Peer> controller, hal::Bus* operator_bus)
    : monitor_(std::move(monitor)), controller_(std::move(controller)), ear_(operator_bus) {}

Status LocalPeers::send(Lap& lap) {
  monitor_->judge(lap);
  if (!controller_) return Status::kOk;
  const Status heard = ear_.listen(lap);
  bus_failed_ = heard != Status::kOk;
  return bus_failed_ ? heard : controller_->send(lap);
}

Status LocalPeers::receive(Lap& lap) {
  if (!controller_) return Status::kOk;
  const Status status = controller_->receive(lap);
  monitor_->hear(lap);
  return status;
}

RefusedMessages LocalPeers::refused() const {
  RefusedMessages all = ear_.refused();
  if (controller_) all += controller_->refused();
  all.here += monitor_->refused();
  return all;
}

InProcessPeers::InProcessPeers(const firmware::ControllerParams* params, const monitor::MonitorLimits& limits,
                               double control_period_s, hal::Bus* operator_bus)
    : LocalPeers(limits, params == nullptr ? nullptr : std::make_unique<HostFirmware>(*params, control_period_s),
                 operator_bus) {}

}  // namespace ballast::sil
