#include "tools/faults/injured_link.h"

#include <algorithm>

namespace ballast::sil {

using sim::Fault;
using sim::FaultKind;
using sim::FaultLayer;
using sim::FaultPeer;

template <class M>
InjuredLink<M>::InjuredLink(const sim::Scenario& scenario, const char* channel, std::optional<FaultPeer> to)
    : random_(scenario.seed) {
  for (const char* c = channel; *c != '\0'; ++c) random_ = random_ * 31 + static_cast<unsigned char>(*c);
  random_ = 3 * random_ + (to ? static_cast<std::uint64_t>(*to) : 2);  // each link draws for itself
  for (const Fault& fault : scenario.faults) {
    if (fault.of(FaultLayer::kMessage) && fault.channel == channel && (!fault.peer || fault.peer == to)) {
      faults_.push_back(fault);
    }
  }
}

template <class M>
bool InjuredLink<M>::strikes(const Fault& fault) {
  return fault.value >= 1 || sim::uniform(random_) < fault.value;
}

template <class M>
void InjuredLink<M>::send(const M& message, std::int64_t tick, double time_s) {
  const int size = message.getEncodedSize();
  OnItsWay one{tick, static_cast<double>(sent_++), std::vector<std::uint8_t>(static_cast<std::size_t>(size))};
  message.encode(one.bytes.data(), 0, size);
  bool dropped = false, doubled = false;
  for (const Fault& fault : faults_) {
    if (tick < 0 || !fault.active(time_s)) continue;
    switch (fault.kind) {
      case FaultKind::kMessagesDropped:
        dropped = strikes(fault) || dropped;
        break;
      case FaultKind::kMessagesDoubled:
        doubled = strikes(fault) || doubled;
        break;
      case FaultKind::kMessagesDelayed:
        one.due_tick += static_cast<std::int64_t>(fault.value);
        break;
      case FaultKind::kMessagesReordered:
        // After the next one, and not before that comes.
        if (strikes(fault)) {
          one.due_tick += 1;
          one.order += 1.5;
        }
        break;
      case FaultKind::kMessagesCorrupted:
        for (int bit = 0; bit < static_cast<int>(fault.value) && !one.bytes.empty(); ++bit) {
          const std::uint64_t at = sim::random_bits(random_) % (8 * one.bytes.size());
          one.bytes[at / 8] ^= static_cast<std::uint8_t>(1u << (at % 8));
        }
        break;
      case FaultKind::kMessagesTruncated:
        one.bytes.resize(one.bytes.size() - std::min(one.bytes.size(), static_cast<std::size_t>(fault.value)));
        break;
      default:
        break;
    }
  }
  if (dropped) return;
  if (doubled) on_its_way_.push_back(one);
  on_its_way_.push_back(std::move(one));
}

template <class M>
std::vector<M> InjuredLink<M>::arrive(std::int64_t tick) {
  std::stable_sort(on_its_way_.begin(), on_its_way_.end(),
                   [](const OnItsWay& a, const OnItsWay& b) { return a.order < b.order; });
  std::vector<M> arrived;
  for (const OnItsWay& one : on_its_way_) {
    if (one.due_tick > tick) continue;
    M message{};
    if (hal::decode(one.bytes.data(), one.bytes.size(), message)) {
      arrived.push_back(message);
    } else {
      ++malformed_;
    }
  }
  std::erase_if(on_its_way_, [tick](const OnItsWay& one) { return one.due_tick <= tick; });
  return arrived;
}

template class InjuredLink<contact_t>;
template class InjuredLink<plant_state_t>;
template class InjuredLink<sensors_t>;
template class InjuredLink<step_command_t>;
template class InjuredLink<controller_status_t>;
template class InjuredLink<trip_t>;

}  // namespace ballast::sil
