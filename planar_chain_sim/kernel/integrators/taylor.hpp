// The motion as a power series: adaptive steps of high order, each with its series as interpolation (equations.md 11).
// This header uses the coefficients; taylor_recursive.hpp and taylor_short_chain.hpp compute them.
#pragma once

#include <cmath>
#include <vector>

#include "../arithmetic/cache_lines.hpp"
#include "../arithmetic/compensated_sum.hpp"
#include "../arithmetic/rough_powers.hpp"
#include "../forms/outcome.hpp"
#include "../forms/right_hand_side.hpp"
#include "../forms/wide.hpp"
#include "../model/chain.hpp"
#include "adaptive.hpp"

namespace planar_chain {

// Four numbers at a time, with whatever vectors the machine has: the bits do not depend on it.
typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
inline const Four& four(const double* at) { return *reinterpret_cast<const Four*>(at); }
inline Four& four(double* at) { return *reinterpret_cast<Four*>(at); }

class Taylor : public AdaptiveStep {
 public:
  // `order`: of the last coefficient of the velocities; `fixed`: s, length of every step, 0: by tolerance.
  Taylor(const Chain& chain, const JointForces& forces, double tick_length, int order, double tolerance, double fixed)
      : AdaptiveStep(forces, chain, tick_length), order_(order), joints_(chain.joint_count),
        stride_((joints_ + 3) / 4 * 4), velocity_(static_cast<std::size_t>(order + 1) * stride_), effort_(joints_),
        inverse_(order + 3), right_hand_side_(chain, forces), log_tolerance_(rough_log2(tolerance)), fixed_(fixed) {
    for (int k = 1; k < order + 3; ++k) inverse_[k] = 1.0 / k;
  }

 protected:
  // Normalised coefficients: rows 0 .. order_ of velocity_, from the state and the effort of all joint laws in effort_.
  virtual int expand(const JointState& base) = 0;

  Outcome expand(const JointState& base, const double* actuator, double& length, double& /*proposal*/, int& joint,
                 bool again) override {
    const double* effort = right_hand_side_.efforts(base, actuator);
    for (int i = 0; i < joints_; ++i) effort_[i] = effort[i], velocity_[i] = base.velocity[i];
    ++counts.evaluations;
    joint = expand(right_hand_side_.near());
    if (joint >= 0) return outcome_of(joint, base.position.data(), joints_);
    if (!again) length = fixed_ > 0.0 ? fixed_ : step_length(base);
    joint = 0;
    return length > 0.0 ? Outcome::good : Outcome::not_finite;
  }

  // The same code for both widths of vectors; without contraction the wide ones change no bit.
  void read(double offset, const JointState& base, JointState& out, int first, int end) const override {
    if (wide_) read_wide(offset, base, out, first, end);
    else sum_up(offset, base, out, first, end);
  }
  double* velocity(int k) { return &velocity_[static_cast<std::size_t>(k) * stride_]; }

  const int order_, joints_, stride_;
  AlignedVector<double> velocity_;        // joint rates, a row for each order
  std::vector<double> effort_, inverse_;  // inverse_[k] = 1 / k

 private:
  PLANAR_CHAIN_WIDE void read_wide(double offset, const JointState& base, JointState& out, int first, int end) const {
    sum_up(offset, base, out, first, end);
  }

  // The sums of velocity_k h^k and of velocity_(k-1) h^k / k, for four joints at a time; even and odd terms apart: half
  // the waiting of Horner's rule.
  void sum_up(double offset, const JointState& base, JointState& out, int first, int end) const {
    const double square = offset * offset;
    const int pairs = order_ / 2;
    for (int group = first / 4 * 4; group < end; group += 4) {
      const double* v = &velocity_[group];
      Four rate[2] = {}, place[2] = {};
      const auto add = [&](int k, int parity) {
        const Four coefficient = four(v + static_cast<std::size_t>(k) * stride_);
        rate[parity] = rate[parity] * square + coefficient;
        place[parity] = place[parity] * square + coefficient * inverse_[k + 1];
      };
      if (order_ % 2 != 0) add(order_, 1);
      for (int k = 2 * pairs; k >= 2; k -= 2) add(k, 0), add(k - 1, 1);
      const Four rise = (rate[1] + rate[0] * offset) * offset, way = (place[1] + place[0] * offset) * offset;
      for (int i = group; i < joints_ && i < group + 4; ++i) {
        const double low = base.position_remainder[i] + (way[i - group] + base.velocity_remainder[i]) * offset;
        add_compensated(base.position[i], low, base.velocity[i] * offset, out.position[i], out.position_remainder[i]);
        add_compensated(base.velocity[i], base.velocity_remainder[i], rise[i - group], out.velocity[i],
                        out.velocity_remainder[i]);
      }
    }
  }

  const bool wide_ = PLANAR_CHAIN_HAS_WIDE;
  RightHandSide right_hand_side_;
  static double larger(double a, double b) { return a > b ? a : b; }

  // Length at which the last two terms of positions and velocities are within tolerance * max(1, |value|). In a motion
  // from rest, for example, only every second or fourth term is not zero. So some more terms are examined: the length
  // stays within the radius in which the series converges as fast as the tolerance asks for, tolerance^(1/n).
  double step_length(const JointState& base) {
    double size[looked_at] = {}, nothing = 0.0;
    for (int i = 0; i < joints_; ++i) {
      const double rate = 1.0 / larger(1.0, std::fabs(base.velocity[i]));
      const double place = 1.0 / larger(1.0, size_of_position(i, base));
      const double* v = velocity(order_) + i;
      for (int back = 0; back < looked_at; ++back, v -= stride_) {
        const double way = std::fabs(*(v - stride_)) * inverse_[order_ - back] * place;
        size[back] = larger(larger(std::fabs(*v) * rate, way), size[back]);
        nothing += *v - *v;  // a coefficient that is no number
      }
    }
    double total = 0.0, log_length = 1e300;
    for (int back = 0; back < looked_at; ++back) {
      total += size[back];
      const double inverse = inverse_[order_ - back], log_size = rough_log2(larger(size[back], 1e-300)) * inverse;
      const double log_part = log_tolerance_ * (back < 2 ? inverse : inverse_[order_]) - log_size;
      if (log_part < log_length) log_length = log_part;
    }
    return total < 1e300 && nothing == 0.0 ? rough_power_of_2(log_length) : 0.0;
  }

  static constexpr int looked_at = 6;  // terms that are examined
  const double log_tolerance_, fixed_;
};

}  // namespace planar_chain
