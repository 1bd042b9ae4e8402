#include "tools/faults/faulty_link.h"

#include <algorithm>

#include "hal/lcm/encode.h"

namespace ballast::sil {

using sim::Fault;
using sim::FaultKind;
using sim::FaultLayer;
using sim::FaultPeer;

template <class M>
FaultyLink<M>::FaultyLink(const sim::Scenario& scenario, const char* channel, std::optional<FaultPeer> to)
    : random_(scenario.seed) {
  for (const char* c = channel; *c != '\0'; ++c) random_ = random_ * 31 + static_cast<unsigned char>(*c);
  random_ = 3 * random_ + (to ? static_cast<std::uint64_t>(*to) : 2);  // each link has its own random numbers
  for (const Fault& fault : scenario.faults) {
    if (fault.of(FaultLayer::kMessage) && fault.channel == channel && (!fault.peer || fault.peer == to)) {
      faults_.push_back(fault);
    }
  }
}

template <class M>
bool FaultyLink<M>::strikes(const Fault& fault) {
  return fault.value >= 1 || sim::uniform(random_) < fault.value;
}

template <class M>
void FaultyLink<M>::send(const M& message, std::int64_t tick, double time_s) {
  InTransit one{tick, static_cast<double>(sent_++), std::vector<char>(hal::encoded_size(message))};
  hal::encode(message, one.bytes.data());
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
        // Arrives after the next message, and not before it.
        if (strikes(fault)) {
          one.due_tick += 1;
          one.order += 1.5;
        }
        break;
      case FaultKind::kMessagesCorrupted:
        for (int bit = 0; bit < static_cast<int>(fault.value) && !one.bytes.empty(); ++bit) {
          const std::uint64_t at = sim::random_bits(random_) % (8 * one.bytes.size());
          one.bytes[at / 8] ^= static_cast<char>(1u << (at % 8));
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
  if (doubled) in_transit_.push_back(one);
  in_transit_.push_back(std::move(one));
}

template <class M>
std::vector<M> FaultyLink<M>::arrive(std::int64_t tick) {
  std::stable_sort(in_transit_.begin(), in_transit_.end(),
                   [](const InTransit& a, const InTransit& b) { return a.order < b.order; });
  std::vector<M> arrived;
  for (const InTransit& one : in_transit_) {
    if (one.due_tick > tick) continue;
    M message{};
    if (hal::decode(one.bytes.data(), one.bytes.size(), message)) {
      arrived.push_back(message);
    } else {
      ++malformed_;
    }
  }
  std::erase_if(in_transit_, [tick](const InTransit& one) { return one.due_tick <= tick; });
  return arrived;
}

template class FaultyLink<contact_t>;
template class FaultyLink<plant_state_t>;
template class FaultyLink<sensors_t>;
template class FaultyLink<step_command_t>;
template class FaultyLink<controller_status_t>;
template class FaultyLink<trip_t>;

}  // namespace ballast::sil
