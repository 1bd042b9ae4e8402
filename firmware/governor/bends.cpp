#include "firmware/governor/bends.h"

#include <cmath>

namespace ballast::firmware {

namespace {

std::size_t index(int k) { return static_cast<std::size_t>(k); }

}  // namespace

void Bends::clear(std::int64_t tick, const PerMass<Real>& tolerance) {
  count_ = 0;
  free_ = false;
  start_tick_ = tick;
  tolerance_ = tolerance;
}

bool Bends::passes(Wide time_s, const PerMass<Real>& bend) const {
  const auto h = static_cast<Real>(time_s - time_s_[index(count_ - 2)]);
  for (std::size_t i = 0; i < bend.size(); ++i) {
    const Real slope = (bend[i] - Real{bend_[index(count_ - 2)][i]}) / h;
    if (!(slope >= slopes_[i].least && slope <= slopes_[i].most)) return false;
  }
  return true;
}

bool Bends::add(Wide time_s, const PerMass<Real>& bend) {
  const bool replaces = free_ && time_s > time_s_[index(count_ - 1)] && passes(time_s, bend);
  if (!replaces) {
    if (count_ == kMost) return false;
    ++count_;
  }
  const std::size_t last = index(count_ - 1);
  time_s_[last] = time_s;
  for (std::size_t i = 0; i < bend.size(); ++i) bend_[last][i] = static_cast<float>(bend[i]);
  const Wide length_s = count_ > 1 ? time_s - time_s_[last - 1] : 0;
  free_ = length_s > 0;
  for (std::size_t i = 0; i < bend.size() && free_; ++i) {
    const auto h = static_cast<Real>(length_s);
    const Real rise = bend[i] - Real{bend_[last - 1][i]};
    const Slopes near{(rise - tolerance_[i]) / h, (rise + tolerance_[i]) / h};
    slopes_[i].least = replaces ? std::fmax(slopes_[i].least, near.least) : near.least;
    slopes_[i].most = replaces ? std::fmin(slopes_[i].most, near.most) : near.most;
  }
  return true;
}

PerMass<Real> Bends::at(Wide time_s, Wide period_s) const {
  PerMass<Real> out{};
  // The first point that is not before the time.
  int low = 0, high = count_;
  while (low < high) {
    const int middle = (low + high) / 2;
    if (time_s_[static_cast<std::size_t>(middle)] < time_s - period_s / 4) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  if (low == 0 || low == count_) return out;
  const auto right = static_cast<std::size_t>(low);
  const Wide length_s = time_s_[right] - time_s_[right - 1];
  const Wide share = length_s > 0 ? (time_s - time_s_[right - 1]) / length_s : 1;
  const Real part = share < 1 ? static_cast<Real>(share) : 1;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Real before = bend_[right - 1][i], after = bend_[right][i];
    out[i] = before + part * (after - before);
    if (std::fabs(out[i]) <= tolerance_[i]) out[i] = 0;
  }
  return out;
}

}  // namespace ballast::firmware
