// Explicit Runge-Kutta steps of their own size, interpolated: Hairer, Norsett, Wanner, Solving ODEs I, II.5, II.6.
// The derivative at a step's end is the first of the next one.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "error_control.hpp"
#include "runge_kutta.hpp"

namespace planar_chain {

class AdaptiveRungeKutta final : public ErrorControlledStep {
 public:
  AdaptiveRungeKutta(const Chain& chain, Form& form, const JointForces& forces, const Tableau& tableau, int order,
                     double tick_length, double tolerance, double fixed)
      : ErrorControlledStep(chain, form, forces, order, tick_length, tolerance, fixed, width_of(tableau), 0),
        stage_count_(tableau.stages), a_(rows_of(tableau.a, tableau.stages)),
        error_(rows_of(tableau.error, tableau.stages + 1)),
        interpolation_a_(rows_of(tableau.interpolation_a, width_of(tableau))),
        interpolation_(rows_of(tableau.interpolation, width_of(tableau))), b_(tableau.b, tableau.stages, 0),
        terms_(3 + interpolation_.size(), std::vector<double>(2 * static_cast<std::size_t>(joints_))),
        moved_(terms_[0]) {
    for (const Weights& row : error_) end_weighs_ |= !row.stage.empty() && row.stage.back() == stage_count_;
  }

 protected:
  Outcome begin(const JointState& base, bool continued, int& joint) override {
    if (!continued) return evaluate(base, 0.0, nothing_, stages_.row(0), joint);
    std::copy_n(stages_.row(stage_count_), 2 * joints_, stages_.row(0));
    return Outcome::good;
  }

  // The derivative at the end is not computed if the step will be rejected.
  Outcome attempt(const JointState& base, double& error, int& joint) override {
    for (int stage = 1; stage < stage_count_; ++stage) {
      const Outcome outcome = evaluate(base, length_, a_[stage], stages_.row(stage), joint);
      if (outcome != Outcome::good) return outcome;
    }
    stages_.move(base, length_, b_, end_);
    if (!end_weighs_) {
      error = estimate(base);
      if (!judged(error)) return Outcome::good;
    }
    const Outcome outcome = evaluate(end_, 0.0, nothing_, stages_.row(stage_count_), joint);
    if (end_weighs_) error = estimate(base);
    return outcome;
  }

  // Terms t of y = y_0 + x (t_0 + z (t_1 + x (t_2 + z (t_3 + x (...))))), x = offset / length, z = 1 - x: with
  // t_0 = y_1 - y_0, t_1 = h y_0' - t_0, t_2 = t_0 - h y_1' - t_1, and what the row of the method has beyond.
  Outcome prepare_reading(const JointState& base, int& joint) override {
    for (std::size_t extra = 0; extra < interpolation_a_.size(); ++extra) {
      double* derivative = stages_.row(stage_count_ + 1 + static_cast<int>(extra));
      const Outcome outcome = evaluate(base, length_, interpolation_a_[extra], derivative, joint);
      if (outcome != Outcome::good) return outcome;
    }
    const double *whole = stages_.weigh(b_), *first = stages_.row(0), *last = stages_.row(stage_count_);
    for (int i = 0; i < 2 * joints_; ++i) {
      terms_[0][i] = length_ * whole[i];
      terms_[1][i] = length_ * first[i] - terms_[0][i];
      terms_[2][i] = terms_[0][i] - length_ * last[i] - terms_[1][i];
    }
    for (std::size_t k = 0; k < interpolation_.size(); ++k) {
      const double* sum = stages_.weigh(interpolation_[k]);
      for (int i = 0; i < 2 * joints_; ++i) terms_[3 + k][i] = length_ * sum[i];
    }
    return Outcome::good;
  }

  void read(double offset, const JointState& base, JointState& out, int first, int end) const override {
    read(offset, base, out, first, end, nullptr);
  }

  // The second derivative of positions at the start is right to the interpolant's order only: x^2 z^2 e on top, which
  // changes nothing at the end, makes up for what h^2 y'' / 2 = t_2 + t_3 - t_1 lacks at x = 0.
  void read_from_rest(double offset, const JointState& base, JointState& out, int first, int end) const override {
    read(offset, base, out, first, end, stages_.row(0) + joints_);
  }

 private:
  void read(double offset, const JointState& base, JointState& out, int first, int end,
            const double* acceleration) const {
    if (offset == length_) {
      out = end_;
      return;
    }
    const double x = offset / length_, z = 1.0 - x;
    for (int i = first; i < joints_ + end; i = i + 1 == end ? joints_ + first : i + 1) {
      double sum = 0.0;
      for (std::size_t k = terms_.size(); k-- > 0;) sum = (sum + terms_[k][i]) * (k % 2 == 0 ? x : z);
      moved_[i] = sum;
      if (acceleration == nullptr || i >= joints_) continue;
      const double bends = terms_[2][i] + (terms_.size() > 3 ? terms_[3][i] : 0.0) - terms_[1][i];
      moved_[i] += x * x * z * z * (0.5 * length_ * length_ * acceleration[i] - bends);
    }
    move_by(base, moved_.data(), out, first, end);
  }

  // Rows: the method's stages, the end's, those of interpolation.
  static int width_of(const Tableau& tableau) {
    std::size_t width = tableau.stages + 1;  // interpolation_a has width - stages - 1 rows of this width
    while ((width - tableau.stages - 1) * width < tableau.interpolation_a.size()) ++width;
    return static_cast<int>(width);
  }

  // Combines a pair of estimates as in II.10: the result is large only if both are.
  double estimate(const JointState& base) {
    double size[2] = {};
    for (std::size_t row = 0; row < error_.size(); ++row) size[row] = size_of(stages_.weigh(error_[row]), base);
    if (error_.size() < 2 || size[0] == 0.0) return length_ * size[0];
    return length_ * size[0] * size[0] / std::sqrt(size[0] * size[0] + 0.01 * size[1] * size[1]);
  }

  const int stage_count_;
  const std::vector<Weights> a_, error_, interpolation_a_, interpolation_;
  const Weights b_, nothing_;
  bool end_weighs_ = false;  // the derivative at the end enters the error estimate
  std::vector<std::vector<double>> terms_;
  mutable std::vector<double> moved_;
};

}  // namespace planar_chain
