// Explicit Runge-Kutta steps of q' = v, v' = f(q, v, u) with compensated sums. Coefficients: METHODS in integrators.py.
#pragma once

#include <algorithm>
#include <vector>

#include "../arithmetic/cache_lines.hpp"
#include "../arithmetic/compensated_sum.hpp"
#include "../forms/outcome.hpp"
#include "../forms/right_hand_side.hpp"
#include "fixed_step.hpp"

namespace planar_chain {

// A method's row of METHODS in integrators.py, which says what these are.
struct Tableau {
  int stages = 0;
  std::vector<double> a, b, error, interpolation_a, interpolation, c;  // matrices row by row
  double gamma = 0.0;
};

// Row `row` of a matrix of `width` columns, without its zeros.
struct Weights {
  std::vector<int> stage;
  std::vector<double> weight;

  Weights() = default;
  Weights(const std::vector<double>& matrix, int width, int row) {
    for (int l = 0; l < width; ++l) {
      const double value = matrix[static_cast<std::size_t>(row) * width + l];
      if (value != 0.0) stage.push_back(l), weight.push_back(value);
    }
  }
};

inline std::vector<Weights> rows_of(const std::vector<double>& matrix, int width) {
  std::vector<Weights> rows;
  for (int row = 0; row < static_cast<int>(matrix.size()) / width; ++row) rows.emplace_back(matrix, width, row);
  return rows;
}

// Derivatives (q', v') at the stages of a step, a row of 2 x joints each, padded to whole fours.
class Stages {
 public:
  Stages(const Chain& chain, Form& form, const JointForces& forces, int rows)
      : form_(form), right_hand_side_(chain, forces), joints_(chain.joint_count), stride_((2 * joints_ + 3) / 4 * 4),
        rows_(static_cast<std::size_t>(rows) * stride_), sum_(stride_), position_(joints_), way_(joints_) {}

  // Before the first evaluation of a step from `base`.
  void start(const JointState& base) { right_hand_side_.start(base.position.data()); }

  double* row(int stage) { return &rows_[static_cast<std::size_t>(stage) * stride_]; }
  const double* row(int stage) const { return &rows_[static_cast<std::size_t>(stage) * stride_]; }

  // Sum of weight_l (q', v')_l, in the order of the stages; good until the next call.
  const double* weigh(const Weights& weights) {
    for (int i = 0; i < stride_; i += 4) {
      double sum[4] = {};
      for (std::size_t l = 0; l < weights.stage.size(); ++l) {
        const double* k = row(weights.stage[l]) + i;
        for (int lane = 0; lane < 4; ++lane) sum[lane] += weights.weight[l] * k[lane];
      }
      for (int lane = 0; lane < 4; ++lane) sum_[i + lane] = sum[lane];
    }
    return sum_.data();
  }

  // Derivative (q', v') at base + step * (sum of weights). `joint` is why the outcome is not good.
  Outcome evaluate(const JointState& base, double step, const Weights& weights, const double* actuator,
                   double* derivative, int& joint) {
    const double* sum = weigh(weights);
    double *rate = derivative, *acceleration = derivative + joints_;
    for (int i = 0; i < joints_; ++i) {
      position_[i] = base.position[i] + (step * sum[i] + base.position_remainder[i]);
      rate[i] = base.velocity[i] + (step * sum[joints_ + i] + base.velocity_remainder[i]);
    }
    if (right_hand_side_.far())
      for (int i = 0; i < joints_; ++i) way_[i] = step * sum[i] + base.position_remainder[i];
    joint = right_hand_side_.accelerate(form_, base.position.data(), way_.data(), position_.data(), rate, actuator,
                                        acceleration);
    return outcome_of(joint, position_.data(), joints_);
  }

  // Accelerations at a state; the rows stay. -1, or the joint whose pivot vanished.
  int accelerate(const JointState& state, const double* actuator, double* acceleration) {
    start(state);
    std::copy(state.position.begin(), state.position.end(), position_.begin());
    return right_hand_side_.accelerate(form_, state.position.data(), state.position_remainder.data(), position_.data(),
                                       state.velocity.data(), actuator, acceleration);
  }

  // next <- base + step * (sum of weights)
  void move(const JointState& base, double step, const Weights& weights, JointState& next) {
    const double* sum = weigh(weights);
    for (int i = 0; i < joints_; ++i) {
      add_compensated(base.position[i], base.position_remainder[i], step * sum[i], next.position[i],
                      next.position_remainder[i]);
      add_compensated(base.velocity[i], base.velocity_remainder[i], step * sum[joints_ + i], next.velocity[i],
                      next.velocity_remainder[i]);
    }
  }

 private:
  Form& form_;
  RightHandSide right_hand_side_;
  const int joints_, stride_;
  AlignedVector<double> rows_, sum_, position_, way_;
};

class ExplicitRungeKutta final : public FixedStep {
 public:
  ExplicitRungeKutta(const Chain& chain, Form& form, const JointForces& forces, const Tableau& tableau, int order,
                     double step)
      : FixedStep(forces, chain.joint_count, order, step, 0.03), a_(rows_of(tableau.a, tableau.stages)),
        b_(tableau.b, tableau.stages, 0), joints_(chain.joint_count), stages_(chain, form, forces, tableau.stages) {}

 protected:
  Outcome step(const JointState& state, const double* actuator, double length, JointState& next, int& joint) override {
    stages_.start(state);
    for (int stage = 0; stage < static_cast<int>(a_.size()); ++stage) {
      ++counts.evaluations;
      const Outcome outcome = stages_.evaluate(state, length, a_[stage], actuator, stages_.row(stage), joint);
      if (outcome != Outcome::good) return outcome;
    }
    stages_.move(state, length, b_, next);
    return Outcome::good;
  }

  int accelerate(const JointState& state, const double* actuator, double* acceleration) override {
    return stages_.accelerate(state, actuator, acceleration);
  }

  const double* first_acceleration() const override { return stages_.row(0) + joints_; }

 private:
  const std::vector<Weights> a_;
  const Weights b_;
  const int joints_;
  Stages stages_;
};

}  // namespace planar_chain
