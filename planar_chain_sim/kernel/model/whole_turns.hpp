// Angles of many turns, less whole turns: positions are kept as sums of two numbers, but the equations take one, which
// at a million turns would be off by 5e-10 rad.
#pragma once

#include <cstdint>
#include <type_traits>
#include <vector>

#include "../arithmetic/trigonometry.hpp"
#include "chain.hpp"

namespace planar_chain {

// Beyond this, rad, which is more than a turn, whole turns are left out.
constexpr double far_angle = 8.0;

// angle + low less whole turns, and the rounding error of that; for |angle| > far_angle, finite.
inline void leave_out_whole_turns(double angle, double low, double& near, double& lost) {
  using namespace trigonometry;
  const double shifted = angle * (0.25 * quarters_per_radian) + to_nearest, k = shifted - to_nearest;
  double sum, rest;
  if (k * k <= most_quarters * most_quarters / 16.0) {
    const double first = angle - k * (4.0 * quarter_1), second = k * (4.0 * quarter_2);  // all products exact
    sum = first - second;
    const double back = first - sum;
    rest = (((first - (sum + back)) + (back - second)) - k * (4.0 * quarter_3)) + low;
  } else {
    double r, tail;
    std::uint64_t quarter;
    reduce_far(angle, r, tail, quarter);
    const double turned = static_cast<double>(static_cast<std::int64_t>(quarter << 62) >> 62);  // -2 .. 1 quarter turns
    const double whole = turned * quarter_1;
    sum = whole + r;
    const double back = sum - whole;
    rest = ((whole - (sum - back)) + (r - back)) + (turned * quarter_2 + (tail + low));
  }
  near = sum + rest;
  lost = (sum - near) + rest;
}

template <class Real>
class WholeTurns {
 public:
  explicit WholeTurns(const ChainOf<Real>& chain) : count_(chain.joint_count) {
    for (int i = 1; i <= chain.link_count(); ++i)
      if (chain.links[i].turns()) joints_.push_back(chain.links[i].rotation);
  }

  // Whether any joint at `base` has an angle beyond far_angle.
  PLANAR_CHAIN_INLINE bool find(const Real* base) {
    std::conditional_t<lanes_in<Real> == 1, int, Truth<Real>> far = 0;
    for (int i = 0; i < count_; ++i) far |= base[i] * base[i] > Real(far_angle * far_angle);
    return any(Truth<Real>(far)) && find_far(base);
  }

  // Those found, in position + remainder.
  void leave_out(std::vector<double>& position, std::vector<double>& remainder) const {
    for (int j : far_) leave_out(position[j], remainder[j], position[j], &remainder[j]);
  }

  // Those found, in `position`, which was base + way.
  void leave_out(const Real* base, const Real* way, Real* position) const {
    for (int j : far_) {
      if constexpr (lanes_in<Real> == 1) {
        leave_out(base[j], way[j], position[j], nullptr);
      } else {
        for (int i = 0; i < lanes_in<Real>; ++i) {
          double one = lane(position[j], i);
          leave_out(lane(base[j], i), lane(way[j], i), one, nullptr);
          set_lane(position[j], i, one);
        }
      }
    }
  }

 private:
  __attribute__((noinline)) bool find_far(const Real* base) {
    far_.clear();
    for (int j : joints_)
      if (any(base[j] * base[j] > Real(far_angle * far_angle))) far_.push_back(j);
    return !far_.empty();
  }

  static void leave_out(double base, double way, double& position, double* lost) {
    double rest;
    if (base * base > far_angle * far_angle && base - base == 0.0)
      leave_out_whole_turns(base, way, position, lost != nullptr ? *lost : rest);
  }

  const int count_;
  std::vector<int> joints_, far_;  // joints that turn; those beyond far_angle
};

}  // namespace planar_chain
