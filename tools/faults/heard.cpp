#include "tools/faults/heard.h"

namespace ballast::sil {
namespace {

// The message of this tick, or the newest.
template <class M>
const M* best(const std::vector<M>& messages, std::int64_t tick) {
  const M* newest = nullptr;
  for (const M& message : messages) {
    if (message.tick == tick) return &message;
    if (newest == nullptr || message.tick > newest->tick) newest = &message;
  }
  return newest;
}

template <class M>
bool repeated(const std::vector<M>& messages) {
  for (std::size_t i = 1; i < messages.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (messages[i].tick == messages[j].tick) return true;
    }
  }
  return false;
}

}  // namespace

trip_t judge(monitor::Monitor& monitor, const Heard& heard) {
  constexpr std::int64_t kNoneYet = -3;
  const bool first = monitor.verdict().tick == kNoneYet;
  const std::int64_t tick = first && !heard.contact.empty() ? heard.contact.front().tick : monitor.verdict().tick + 1;
  const monitor::Samples samples{best(heard.contact, tick), best(heard.state, tick), best(heard.sensors, tick),
                                 heard.status ? &*heard.status : nullptr};
  trip_t verdict = monitor.judge(samples);
  if (repeated(heard.contact) || repeated(heard.state) || repeated(heard.sensors)) verdict = monitor.judge(samples);
  return verdict;
}

}  // namespace ballast::sil
