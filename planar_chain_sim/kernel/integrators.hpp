// Explicit Runge-Kutta steps of q' = v, v' = f(q, v, u) with compensated sums. Coefficients: METHODS in integrators.py.
#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include "chain.hpp"
#include "joint_forces.hpp"
#include "recursive.hpp"

namespace planar_chain {

struct ButcherTableau {
  int stages = 0;
  std::vector<double> a;  // stages x stages, row by row, strictly lower triangular
  std::vector<double> b;  // stages
};

// Joint coordinates and rates as unevaluated sums: value + remainder holds twice the digits.
struct JointState {
  std::vector<double> position, velocity, position_remainder, velocity_remainder;

  explicit JointState(int joints)
      : position(joints), velocity(joints), position_remainder(joints), velocity_remainder(joints) {}
};

enum class Outcome { good, singular, not_finite, beyond_stop };

class ExplicitRungeKutta {
 public:
  ExplicitRungeKutta(const Chain& chain, const JointForces& forces, const ButcherTableau& tableau, double step)
      : forces_(forces), tableau_(tableau), step_(step), joints_(chain.joint_count), recursion_(chain),
        next_(joints_), stage_position_(joints_), effort_(joints_), position_sum_(joints_), velocity_sum_(joints_),
        rates_(static_cast<std::size_t>(tableau.stages) * joints_),
        accelerations_(static_cast<std::size_t>(tableau.stages) * joints_) {}

  // One step under the clamped actuator effort. The state changes only if the outcome is good; else `joint` is why.
  Outcome step(JointState& state, const double* actuator, int& joint) {
    for (int stage = 0; stage < tableau_.stages; ++stage) {
      double* rate = row_of(rates_, stage);
      double* acceleration = row_of(accelerations_, stage);
      weigh(&tableau_.a[static_cast<std::size_t>(stage) * tableau_.stages], stage);
      for (int i = 0; i < joints_; ++i) {
        stage_position_[i] = state.position[i] + (step_ * position_sum_[i] + state.position_remainder[i]);
        rate[i] = state.velocity[i] + (step_ * velocity_sum_[i] + state.velocity_remainder[i]);
        effort_[i] = actuator[i];
      }
      forces_.add_passive(stage_position_.data(), rate, effort_.data());
      joint = recursion_.forward(stage_position_.data(), rate, effort_.data(), acceleration);
      if (joint >= 0) return has_squares(stage_position_) ? Outcome::singular : Outcome::not_finite;
    }
    weigh(tableau_.b.data(), tableau_.stages);
    for (int i = 0; i < joints_; ++i) {
      add(state.position[i], state.position_remainder[i], step_ * position_sum_[i], next_.position[i],
          next_.position_remainder[i]);
      add(state.velocity[i], state.velocity_remainder[i], step_ * velocity_sum_[i], next_.velocity[i],
          next_.velocity_remainder[i]);
    }
    for (joint = 0; joint < joints_; ++joint)
      if (!std::isfinite(next_.position[joint]) || !std::isfinite(next_.velocity[joint])) return Outcome::not_finite;
    joint = forces_.beyond_stop(next_.position.data());
    if (joint >= 0) return Outcome::beyond_stop;
    std::swap(state, next_);
    return Outcome::good;
  }

  int stages() const { return tableau_.stages; }

 private:
  double* row_of(std::vector<double>& stages, int stage) { return &stages[static_cast<std::size_t>(stage) * joints_]; }

  // Sums over l < count of weight[l] k_l, in the order of the stages.
  void weigh(const double* weight, int count) {
    for (int i = 0; i < joints_; ++i) position_sum_[i] = velocity_sum_[i] = 0.0;
    for (int l = 0; l < count; ++l) {
      if (weight[l] == 0.0) continue;
      const double* rate = row_of(rates_, l);
      const double* acceleration = row_of(accelerations_, l);
      for (int i = 0; i < joints_; ++i) {
        position_sum_[i] += weight[l] * rate[i];
        velocity_sum_[i] += weight[l] * acceleration[i];
      }
    }
  }

  // Two-sum (Knuth, TAOCP 2, 4.2.2): what rounding loses goes into the remainder, so that error grows with steps^(1/2).
  static void add(double value, double remainder, double increment, double& sum, double& lost) {
    const double term = increment + remainder;
    sum = value + term;
    const double back = sum - value;
    lost = (value - (sum - back)) + (term - back);
  }

  // Pivots are made of squares of positions: where these overflow or are no numbers, no pivot can be judged.
  static bool has_squares(const std::vector<double>& values) {
    for (const double value : values)
      if (!std::isfinite(value * value)) return false;
    return true;
  }

  const JointForces& forces_;
  const ButcherTableau tableau_;
  const double step_;
  const int joints_;
  Recursion recursion_;
  JointState next_;
  std::vector<double> stage_position_, effort_, position_sum_, velocity_sum_, rates_, accelerations_;
};

}  // namespace planar_chain
