// Steps as long as an embedded error estimate allows: Hairer, Norsett, Wanner, Solving ODEs I, II.4.
#pragma once

#include <cmath>
#include <vector>

#include "../arithmetic/compensated_sum.hpp"
#include "../arithmetic/rough_powers.hpp"
#include "adaptive.hpp"
#include "runge_kutta.hpp"

namespace planar_chain {

class ErrorControlledStep : public AdaptiveStep {
 public:
  // `order` of the method; `rows` of derivatives that it keeps, row `slope` being the one at the start of a step;
  // `fixed`: s, length of every step, 0: by tolerance.
  ErrorControlledStep(const Chain& chain, Form& form, const JointForces& forces, int order, double tick_length,
                      double tolerance, double fixed, int rows, int slope)
      : AdaptiveStep(forces, chain, tick_length), joints_(chain.joint_count), tolerance_(tolerance), fixed_(fixed),
        stages_(chain, form, forces, rows), end_(joints_), order_(order), slope_(slope), towards_slope_({1.0}, 1, 0),
        trial_(2 * static_cast<std::size_t>(joints_)) {
    towards_slope_.stage[0] = slope;
  }

 protected:
  // Derivative at `base`; `continued`: that is where the last step ended, under the same effort.
  virtual Outcome begin(const JointState& base, bool continued, int& joint) = 0;

  // A step of length_ from base to end_, and its estimated error, scaled as by size_of. Not good: the equations cannot
  // be evaluated at its end.
  virtual Outcome attempt(const JointState& base, double& error, int& joint) = 0;

  // Computes the terms of interpolation, before the last step is first read.
  virtual Outcome prepare_reading(const JointState& base, int& joint) = 0;

  Outcome evaluate(const JointState& base, double step, const Weights& weights, double* derivative, int& joint) {
    ++counts.evaluations;
    return stages_.evaluate(base, step, weights, actuator_, derivative, joint);
  }

  // Largest of |value| / max(1, |base|) over joint positions, then velocities; NaN where one of them is.
  double size_of(const double* value, const JointState& base) const {
    double largest = 0.0;
    for (int i = 0; i < joints_; ++i) {
      const double place = std::fabs(value[i]) / std::fmax(1.0, size_of_position(i, base));
      const double rate = std::fabs(value[joints_ + i]) / std::fmax(1.0, std::fabs(base.velocity[i]));
      if (!(place <= largest)) largest = place;
      if (!(rate <= largest)) largest = rate;
      if (largest != largest) return largest;
    }
    return largest;
  }

  bool judged(double error) const { return fixed_ > 0.0 || again_ || error <= tolerance_; }

  const int joints_;
  const double tolerance_, fixed_;
  Stages stages_;
  JointState end_;       // where the step leads
  double length_ = 0.0;  // of the step

 private:
  Outcome expand(const JointState& base, const double* actuator, double& length, double& proposal, int& joint,
                 bool again) final {
    actuator_ = actuator, again_ = again;
    const bool continued = !again && length > 0.0 && whole_;
    whole_ = open_ = false;
    stages_.start(base);
    Outcome outcome = begin(base, continued, joint);
    if (outcome != Outcome::good) return outcome;
    const bool given = again || fixed_ > 0.0;
    length_ = again ? length : given ? fixed_ : length > 0.0 ? length : first_length(base);
    double largest_growth = most_growth;
    for (int attempts = 1;; ++attempts) {
      double error = 0.0;
      outcome = attempt(base, error, joint);
      if (given && outcome != Outcome::good) return outcome;
      if (outcome == Outcome::good && judged(error)) {
        length = length_;
        proposal = std::fmin(length * std::fmin(largest_growth, change(error)), longest);
        whole_ = true;
        return outcome;
      }
      ++counts.rejected_steps;
      if (attempts == most_attempts) return outcome == Outcome::good ? (joint = 0, Outcome::stalled) : outcome;
      length_ *= outcome == Outcome::good ? change(error) : 0.25;
      largest_growth = 1.0;
    }
  }

  Outcome open(const JointState& base, int& joint) final {
    if (open_) return Outcome::good;
    const Outcome outcome = prepare_reading(base, joint);
    open_ = outcome == Outcome::good;
    return outcome;
  }

  // The factor by which a step may change for this error, II (4.13).
  double change(double error) const {
    if (!std::isfinite(error)) return 0.25;
    if (error <= 1e-9 * tolerance_) return most_growth;
    return std::fmin(most_growth, std::fmax(1.0 / 3.0, 0.9 * rough_root(tolerance_ / error, order_)));
  }

  // A first length, II.4: one at which an explicit Euler step is small, then one from the second derivative.
  double first_length(const JointState& base) {
    const double* slope = stages_.row(slope_);
    for (int i = 0; i < joints_; ++i) trial_[i] = size_of_position(i, base), trial_[joints_ + i] = base.velocity[i];
    const double value = size_of(trial_.data(), base), first = size_of(slope, base);
    const double length = value < 1e-5 * tolerance_ || !(first >= 1e-5 * tolerance_) ? 1e-6 : 0.01 * value / first;
    int joint;
    if (evaluate(base, length, towards_slope_, trial_.data(), joint) != Outcome::good) return length;
    for (int i = 0; i < 2 * joints_; ++i) trial_[i] = (trial_[i] - slope[i]) / length;
    const double steepest = std::fmax(first, size_of(trial_.data(), base));
    if (!(steepest > 1e-15 * tolerance_) || !(steepest < 1e300)) return 1e-3 * length;
    return std::fmin(100.0 * length, rough_root(0.01 * tolerance_ / steepest, order_));
  }

  static constexpr int most_attempts = 100;
  static constexpr double most_growth = 6.0, longest = 1e9;

  const int order_, slope_;
  Weights towards_slope_;
  std::vector<double> trial_;
  const double* actuator_ = nullptr;
  bool again_ = false, whole_ = false, open_ = false;
};

// base + change of the joints from `first` to before `end`, positions and then velocities in `change`.
inline void move_by(const JointState& base, const double* change, JointState& out, int first, int end) {
  const std::size_t joints = base.position.size();
  for (int i = first; i < end; ++i) {
    add_compensated(base.position[i], base.position_remainder[i], change[i], out.position[i],
                    out.position_remainder[i]);
    add_compensated(base.velocity[i], base.velocity_remainder[i], change[joints + i], out.velocity[i],
                    out.velocity_remainder[i]);
  }
}

}  // namespace planar_chain
