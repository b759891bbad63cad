// Explicit Runge-Kutta steps of q' = v, v' = f(q, v, u) with compensated sums. Coefficients: METHODS in integrators.py.
#pragma once

#include <vector>

#include "integrators.hpp"

namespace planar_chain {

struct ButcherTableau {
  int stages = 0;
  std::vector<double> a;  // stages x stages, row by row, strictly lower triangular
  std::vector<double> b;  // stages
};

class ExplicitRungeKutta final : public FixedStep {
 public:
  ExplicitRungeKutta(Form& form, const JointForces& forces, int joints, const ButcherTableau& tableau, double step)
      : FixedStep(forces, joints), form_(form), tableau_(tableau), step_(step), joints_(joints),
        stage_position_(joints_), effort_(joints_), position_sum_(joints_), velocity_sum_(joints_),
        rates_(static_cast<std::size_t>(tableau.stages) * joints_),
        accelerations_(static_cast<std::size_t>(tableau.stages) * joints_) {}

 protected:
  Outcome step(const JointState& state, const double* actuator, JointState& next, int& joint) override {
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
      ++counts.evaluations;
      joint = form_.forward(stage_position_.data(), rate, effort_.data(), acceleration);
      if (joint >= 0) return singular_or_not_finite(stage_position_.data(), joints_);
    }
    weigh(tableau_.b.data(), tableau_.stages);
    for (int i = 0; i < joints_; ++i) {
      add_compensated(state.position[i], state.position_remainder[i], step_ * position_sum_[i], next.position[i],
                      next.position_remainder[i]);
      add_compensated(state.velocity[i], state.velocity_remainder[i], step_ * velocity_sum_[i], next.velocity[i],
                      next.velocity_remainder[i]);
    }
    return Outcome::good;
  }

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

  Form& form_;
  const ButcherTableau tableau_;
  const double step_;
  const int joints_;
  std::vector<double> stage_position_, effort_, position_sum_, velocity_sum_, rates_, accelerations_;
};

}  // namespace planar_chain
