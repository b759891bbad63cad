// Rosenbrock steps for stiff joints: linearly implicit, with the analytic Jacobian, so that no Newton iteration needs
// stopping and no Jacobian needs keeping. Hairer, Wanner, Solving ODEs II, IV.7.
//
// For y = (q, v), y' = (v, f), and the stages u = (p, w) of (7.25):
//
//   (1 / (h gamma) - J) u_i = y'(y_0 + sum a_ij u_j) + sum (c_ij / h) u_j =: (r, s),   y_1 = y_0 + sum b_i u_i
//
// With H f_q = -K and H f_v = -C, where K and C are the derivatives of the inverse dynamics, half of the unknowns go:
//
//   [H + h gamma C + (h gamma)^2 K] w = h gamma H s - (h gamma)^2 K r,   p = h gamma (r + w)
#pragma once

#include <vector>

#include "../arithmetic/lu.hpp"
#include "../forms/jacobian.hpp"
#include "error_control.hpp"

namespace planar_chain {

class Rosenbrock final : public ErrorControlledStep {
 public:
  Rosenbrock(const Chain& chain, Form& form, const JointForces& forces, const Tableau& tableau, int order,
             double tick_length, double tolerance, double fixed)
      : ErrorControlledStep(chain, form, forces, order, tick_length, tolerance, fixed, tableau.stages + 1,
                            tableau.stages),
        stage_count_(tableau.stages), gamma_(tableau.gamma), a_(rows_of(tableau.a, tableau.stages)),
        c_(rows_of(tableau.c, tableau.stages)), error_(rows_of(tableau.error, tableau.stages)),
        interpolation_(rows_of(tableau.interpolation, tableau.stages)), b_(tableau.b, tableau.stages, 0),
        jacobian_(chain, forces), lu_(joints_), right_(2 * static_cast<std::size_t>(joints_)),
        terms_(1 + interpolation_.size(), std::vector<double>(right_.size())), moved_(right_) {}

 protected:
  Outcome begin(const JointState& base, bool /*continued*/, int& joint) override {
    double* slope = stages_.row(stage_count_);
    const Outcome outcome = evaluate(base, 0.0, nothing_, slope, joint);
    if (outcome == Outcome::good) jacobian_.compute(base.position.data(), base.velocity.data(), slope + joints_);
    return outcome;
  }

  Outcome attempt(const JointState& base, double& error, int& joint) override {
    const double h_gamma = length_ * gamma_;
    double* matrix = lu_.matrix();
    for (std::size_t k = 0; k < jacobian_.mass.size(); ++k)
      matrix[k] = jacobian_.mass[k] + h_gamma * (jacobian_.by_velocity[k] + h_gamma * jacobian_.by_position[k]);
    if (!lu_.factorise()) return joint = 0, Outcome::singular;
    for (int stage = 0; stage < stage_count_; ++stage) {
      const double* derivative = stages_.row(stage_count_);
      if (stage > 0) {
        const Outcome outcome = evaluate(base, 1.0, a_[stage], moved_.data(), joint);
        if (outcome != Outcome::good) return outcome;
        derivative = moved_.data();
      }
      const double* sum = stages_.weigh(c_[stage]);
      for (int i = 0; i < 2 * joints_; ++i) right_[i] = derivative[i] + sum[i] / length_;
      solve(h_gamma, stages_.row(stage));
    }
    stages_.move(base, 1.0, b_, end_);
    error = size_of(stages_.weigh(error_[0]), base);
    return Outcome::good;
  }

  // Terms of y = y_0 + x (y_1 - y_0 + z (t_1 + x (t_2 + x (...)))), x = offset / length, z = 1 - x.
  Outcome prepare_reading(const JointState&, int&) override {
    for (std::size_t k = 0; k < terms_.size(); ++k) {
      const double* sum = stages_.weigh(k == 0 ? b_ : interpolation_[k - 1]);
      terms_[k].assign(sum, sum + terms_[k].size());
    }
    const double* slope = stages_.row(stage_count_);
    slope_.assign(slope, slope + terms_[0].size());
    return Outcome::good;
  }

  void read(double offset, const JointState& base, JointState& out, int first, int end) const override {
    read(offset, base, out, first, end, nullptr);
  }

  // The interpolant's own derivative at the start is right to its order only. So it gets x z^2 d on top, and positions
  // x^2 z^2 e, which change nothing at the end: d and e make up for what h y' and h^2 y'' / 2 lack at x = 0.
  void read_from_rest(double offset, const JointState& base, JointState& out, int first, int end) const override {
    read(offset, base, out, first, end, slope_.data());
  }

 private:
  void read(double offset, const JointState& base, JointState& out, int first, int end, const double* slope) const {
    if (offset == length_) {
      out = end_;
      return;
    }
    const double x = offset / length_, z = 1.0 - x;
    for (int i = first; i < joints_ + end; i = i + 1 == end ? joints_ + first : i + 1) {
      double sum = 0.0;
      for (std::size_t k = terms_.size() - 1; k > 0; --k) sum = sum * x + terms_[k][i];
      moved_[i] = x * (terms_[0][i] + z * sum);
      if (slope == nullptr) continue;
      const double lacks = length_ * slope[i] - (terms_[0][i] + terms_[1][i]);
      moved_[i] += x * z * z * lacks;
      if (i >= joints_) continue;  // x^2: (t_2 - t_1) - 2 d
      const double bends = 0.5 * length_ * length_ * slope[joints_ + i] - (terms_[2][i] - terms_[1][i] - 2.0 * lacks);
      moved_[i] += x * x * z * z * bends;
    }
    move_by(base, moved_.data(), out, first, end);
  }

  // u = (p, w) from the right side (r, s), h_gamma = length * gamma.
  void solve(double h_gamma, double* u) {
    const double *r = right_.data(), *s = r + joints_;
    double *p = u, *w = u + joints_;
    for (int i = 0; i < joints_; ++i) {
      const double* mass = &jacobian_.mass[static_cast<std::size_t>(i) * joints_];
      const double* stiffness = &jacobian_.by_position[static_cast<std::size_t>(i) * joints_];
      double sum = 0.0;
      for (int j = 0; j < joints_; ++j) sum += mass[j] * s[j] - h_gamma * (stiffness[j] * r[j]);
      w[i] = h_gamma * sum;
    }
    lu_.solve(w);
    for (int i = 0; i < joints_; ++i) p[i] = h_gamma * (r[i] + w[i]);
  }

  const int stage_count_;
  const double gamma_;
  const std::vector<Weights> a_, c_, error_, interpolation_;
  const Weights b_, nothing_;
  Jacobian jacobian_;
  LU lu_;
  std::vector<double> right_, slope_;
  std::vector<std::vector<double>> terms_;
  mutable std::vector<double> moved_;
};

}  // namespace planar_chain
