// Explicit Runge-Kutta steps of their own size, from an embedded error estimate, with dense output, as in Hairer,
// Norsett, Wanner, Solving ODEs I, II.4 to II.6. The derivative at a step's end is the first of the next one.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "adaptive.hpp"
#include "runge_kutta.hpp"

namespace planar_chain {

class AdaptiveRungeKutta final : public AdaptiveStep {
 public:
  // `order`: of the method; `fixed`: s, length of every step, 0: by tolerance.
  AdaptiveRungeKutta(Form& form, const JointForces& forces, int joints, const Tableau& tableau, int order,
                     double tick_length, double tolerance, double fixed)
      : AdaptiveStep(forces, joints, tick_length), joints_(joints), stage_count_(tableau.stages),
        width_(tableau.stages + 1 + static_cast<int>(dense_stages(tableau))), order_(order), tolerance_(tolerance),
        fixed_(fixed), a_(rows_of(tableau.a, tableau.stages)), error_(rows_of(tableau.error, tableau.stages + 1)),
        dense_a_(rows_of(tableau.dense_a, width_)), dense_(rows_of(tableau.dense, width_)),
        b_(tableau.b, tableau.stages, 0), stages_(form, forces, joints, width_), end_(joints),
        terms_(3 + dense_.size(), std::vector<double>(2 * static_cast<std::size_t>(joints))) {
    for (const Weights& row : error_) end_weighs_ |= !row.stage.empty() && row.stage.back() == stage_count_;
  }

 protected:
  Outcome expand(const JointState& base, const double* actuator, double& length, double& proposal, int& joint,
                 bool again) override {
    if (!again && length > 0.0 && end_known_) {
      std::copy_n(stages_.row(stage_count_), 2 * joints_, stages_.row(0));
    } else {
      const Outcome outcome = evaluate(0, base, 0.0, nothing_, actuator, joint);
      if (outcome != Outcome::good) return outcome;
    }
    end_known_ = false;
    const bool given = again || fixed_ > 0.0;
    if (!again && fixed_ > 0.0) length = fixed_;
    if (!given && !(length > 0.0)) length = first_length(base, actuator);
    double largest_growth = 6.0;
    for (int attempt = 1;; ++attempt) {
      double error = 0.0;
      const Outcome outcome = attempt_step(base, actuator, length, error, joint);
      if (given && outcome != Outcome::good) return outcome;
      if (given || (outcome == Outcome::good && error <= tolerance_)) {
        proposal = std::fmin(length * std::fmin(largest_growth, change(error)), 1e9);
        break;
      }
      ++counts.rejected_steps;
      if (attempt == most_attempts) return outcome == Outcome::good ? (joint = 0, Outcome::stalled) : outcome;
      length *= outcome == Outcome::good ? change(error) : 0.25;
      largest_growth = 1.0;
    }
    end_known_ = true;
    actuator_ = actuator, length_ = length, open_ = false;
    return Outcome::good;
  }

  // Dense output, II.6: y = y_0 + x (t_0 + z (t_1 + x (t_2 + z (t_3 + x (...))))), x = offset / length, z = 1 - x, with
  // t_0 = y_1 - y_0, t_1 = h y_0' - t_0, t_2 = t_0 - h y_1' - t_1 and what the row of the method has beyond.
  Outcome open(const JointState& base, int& joint) override {
    if (open_) return Outcome::good;
    for (std::size_t extra = 0; extra < dense_a_.size(); ++extra) {
      const int stage = stage_count_ + 1 + static_cast<int>(extra);
      const Outcome outcome = evaluate(stage, base, length_, dense_a_[extra], actuator_, joint);
      if (outcome != Outcome::good) return outcome;
    }
    const double *whole = stages_.weigh(b_), *first = stages_.row(0), *last = stages_.row(stage_count_);
    for (int i = 0; i < 2 * joints_; ++i) {
      terms_[0][i] = length_ * whole[i];
      terms_[1][i] = length_ * first[i] - terms_[0][i];
      terms_[2][i] = terms_[0][i] - length_ * last[i] - terms_[1][i];
    }
    for (std::size_t k = 0; k < dense_.size(); ++k) {
      const double* sum = stages_.weigh(dense_[k]);
      for (int i = 0; i < 2 * joints_; ++i) terms_[3 + k][i] = length_ * sum[i];
    }
    open_ = true;
    return Outcome::good;
  }

  void read(double offset, const JointState& base, JointState& out) const override {
    if (offset == length_) {
      out = end_;
      return;
    }
    const double x = offset / length_, z = 1.0 - x;
    for (int i = 0; i < joints_; ++i) {
      double place = 0.0, rate = 0.0;
      for (std::size_t k = terms_.size(); k-- > 0;) {
        const double factor = k % 2 == 0 ? x : z;
        place = (place + terms_[k][i]) * factor;
        rate = (rate + terms_[k][joints_ + i]) * factor;
      }
      add_compensated(base.position[i], base.position_remainder[i], place, out.position[i], out.position_remainder[i]);
      add_compensated(base.velocity[i], base.velocity_remainder[i], rate, out.velocity[i], out.velocity_remainder[i]);
    }
  }

 private:
  static std::size_t dense_stages(const Tableau& tableau) {
    std::size_t extra = 0;  // rows of stages + 1 + extra numbers each
    while (extra * (tableau.stages + 1 + extra) < tableau.dense_a.size()) ++extra;
    return extra;
  }

  Outcome evaluate(int stage, const JointState& base, double step, const Weights& weights, const double* actuator,
                   int& joint) {
    ++counts.evaluations;
    return stages_.evaluate(stage, base, step, weights, actuator, joint);
  }

  // All stages but the first, the state at the end, its derivative where the step is good, and the estimated error.
  Outcome attempt_step(const JointState& base, const double* actuator, double length, double& error, int& joint) {
    for (int stage = 1; stage < stage_count_; ++stage) {
      const Outcome outcome = evaluate(stage, base, length, a_[stage], actuator, joint);
      if (outcome != Outcome::good) return outcome;
    }
    stages_.move(base, length, b_, end_);
    if (!end_weighs_) error = estimate(base, length);
    if (!end_weighs_ && fixed_ == 0.0 && !(error <= tolerance_)) return Outcome::good;
    const Outcome outcome = evaluate(stage_count_, end_, 0.0, nothing_, actuator, joint);
    if (outcome == Outcome::good && end_weighs_) error = estimate(base, length);
    return outcome;
  }

  // Largest over joints of |error| / max(1, |value|), II (10.17) for a pair of estimates.
  double estimate(const JointState& base, double length) {
    double size[2] = {};
    for (std::size_t row = 0; row < error_.size(); ++row) size[row] = norm(base, stages_.weigh(error_[row]));
    if (error_.size() < 2 || !(size[0] > 0.0)) return length * size[0];
    return length * size[0] * size[0] / std::sqrt(size[0] * size[0] + 0.01 * size[1] * size[1]);
  }

  // NaN where one of the values is.
  double norm(const JointState& base, const double* value) const {
    double largest = 0.0;
    for (int i = 0; i < joints_; ++i) {
      const double place = std::fabs(value[i]) / std::fmax(1.0, std::fabs(base.position[i]));
      const double rate = std::fabs(value[joints_ + i]) / std::fmax(1.0, std::fabs(base.velocity[i]));
      if (!(place <= largest)) largest = place;
      if (!(rate <= largest)) largest = rate;
      if (largest != largest) return largest;
    }
    return largest;
  }

  // By which factor the step may change for an error, II (4.13).
  double change(double error) const {
    if (!std::isfinite(error)) return 0.25;
    if (error <= 1e-9 * tolerance_) return 6.0;
    return std::fmin(6.0, std::fmax(1.0 / 3.0, 0.9 * rough_root(tolerance_ / error, order_)));
  }

  // A first length, II.4: one at which an explicit Euler step is small, then one from the second derivative.
  double first_length(const JointState& base, const double* actuator) {
    for (int i = 0; i < joints_; ++i) end_.position[i] = base.position[i], end_.velocity[i] = base.velocity[i];
    std::vector<double>& state = terms_[0];
    for (int i = 0; i < joints_; ++i) state[i] = base.position[i], state[joints_ + i] = base.velocity[i];
    const double value = norm(base, state.data()), slope = norm(base, stages_.row(0));
    const double trial = value < 1e-5 * tolerance_ || !(slope >= 1e-5 * tolerance_) ? 1e-6 : 0.01 * value / slope;
    int joint;
    if (evaluate(1, base, trial, euler_, actuator, joint) != Outcome::good) return trial;
    const double *first = stages_.row(0), *second = stages_.row(1);
    for (int i = 0; i < 2 * joints_; ++i) state[i] = (second[i] - first[i]) / trial;
    const double steepest = std::fmax(slope, norm(base, state.data()));
    if (!(steepest < 1e300)) return trial;
    const double length = steepest > 1e-15 * tolerance_ ? rough_root(0.01 * tolerance_ / steepest, order_)
                                                        : 1e-3 * trial;
    return std::fmin(100.0 * trial, std::fmax(length, 1e-9 * trial));
  }

  static constexpr int most_attempts = 100;

  const int joints_, stage_count_, width_, order_;
  const double tolerance_, fixed_;
  const std::vector<Weights> a_, error_, dense_a_, dense_;
  const Weights b_, nothing_, euler_{{1.0}, 1, 0};
  bool end_weighs_ = false;  // the derivative at the end enters the error estimate
  Stages stages_;            // the method's, the end's, those of dense output
  JointState end_;
  std::vector<std::vector<double>> terms_;
  const double* actuator_ = nullptr;
  double length_ = 0.0;
  bool end_known_ = false, open_ = false;
};

}  // namespace planar_chain
