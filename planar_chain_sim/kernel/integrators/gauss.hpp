// Gauss collocation, implicit and symmetric, as a method for q'' = f(q, q', u): fixed-point iteration on the stages'
// accelerations down to round-off. Hairer, Lubich, Wanner, Geometric Numerical Integration, II.1.3 and VIII.6.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "../arithmetic/compensated_sum.hpp"
#include "../forms/outcome.hpp"
#include "../forms/right_hand_side.hpp"
#include "fixed_step.hpp"
#include "runge_kutta.hpp"

namespace planar_chain {

class Gauss final : public FixedStep {
 public:
  Gauss(const Chain& chain, Form& form, const JointForces& forces, const Tableau& tableau, int order, double step)
      : FixedStep(forces, chain.joint_count, order, step, 0.0), form_(form), right_hand_side_(chain, forces),
        length_(step), joints_(chain.joint_count), stages_(tableau.stages), a_(tableau.a), b_(tableau.b),
        a_position_(a_.size()), b_position_(b_.size()), node_(b_.size()),
        accelerations_(static_cast<std::size_t>(stages_) * joints_), last_effort_(joints_),
        past_(2 * accelerations_.size()), position_(joints_), way_(joints_), velocity_(joints_),
        acceleration_(joints_) {
    for (int i = 0; i < stages_; ++i)
      for (int l = 0; l < stages_; ++l) {
        node_[i] += a_[i * stages_ + l];
        b_position_[l] += b_[i] * a_[i * stages_ + l];
        for (int j = 0; j < stages_; ++j) a_position_[i * stages_ + l] += a_[i * stages_ + j] * a_[j * stages_ + l];
      }
    for (int steps = 1; steps <= most_past; ++steps) ahead_.push_back(extrapolation(steps));
  }

  void forget() override { FixedStep::forget(), known_ = 0; }

  void forces_changed() override { known_ = 0; }

  // The last steps' stages, from which the next one's iteration starts.
  void save(std::vector<double>& all) const override {
    all.push_back(static_cast<double>(Kept::gauss)), all.push_back(known_);
    if (known_ == 0) return;
    all.insert(all.end(), last_effort_.begin(), last_effort_.end());
    all.insert(all.end(), past_.begin(), past_.begin() + known_ * static_cast<std::ptrdiff_t>(accelerations_.size()));
  }

  bool load(KeptNumbers& kept, std::int64_t, double, const JointState*) override {
    if (!kept.is(Kept::gauss) || !kept.whole(known_, 0, most_past)) return false;
    if (known_ == 0) return kept.left() == 0;
    const std::size_t stages = static_cast<std::size_t>(known_) * accelerations_.size();
    if (kept.left() != last_effort_.size() + stages || !kept.numbers(last_effort_)) return false;
    for (std::size_t i = 0; i < stages; ++i)
      if (!kept.number(past_[i])) return false;
    return true;
  }

 protected:
  Outcome step(const JointState& state, const double* actuator, double length, JointState& next, int& joint) override {
    if (length != tick_length_) known_ = 0;  // stages of whole steps are of no use for a part
    length_ = length, right_hand_side_.start(state.position.data());
    Outcome outcome = guess(state, actuator, joint);
    if (outcome != Outcome::good) return outcome;
    double before = 0.0;
    for (int round = 1;; ++round) {
      double change = 0.0, increment = 0.0, size = 0.0;
      outcome = iterate(state, actuator, change, increment, size, joint);
      if (round > 1 && (outcome != Outcome::good || round == most_rounds || !(change < 1e300)))
        return joint = worst_, Outcome::too_long;
      if (outcome != Outcome::good) return outcome;
      // Done if the next round would change less than the rounding of an acceleration, or if the rounding of angles and
      // velocities keeps changes from shrinking further.
      constexpr double rounding = std::numeric_limits<double>::epsilon();
      if (change == 0.0 || (round > 1 && change * change <= before * rounding * increment)) break;
      if (round > 1 && change >= before && change <= 1e4 * rounding * size) break;
      before = change;
    }
    finish(state, next);
    if (length == tick_length_) keep(actuator);
    return Outcome::good;
  }

  int accelerate(const JointState& state, const double* actuator, double* acceleration) override {
    position_ = state.position;
    right_hand_side_.start(state.position.data());
    return right_hand_side_.accelerate(form_, state.position.data(), state.position_remainder.data(), position_.data(),
                                       state.velocity.data(), actuator, acceleration);
  }

  int kept_stages() const override { return known_; }
  void keep_stages(int steps) override { known_ = steps; }

 private:
  double* row(std::vector<double>& rows, int stage) { return &rows[static_cast<std::size_t>(stage) * joints_]; }

  // Weights of the stages of the last `steps` steps, the last first, in the polynomial through them at the stages of
  // the next step (Lagrange).
  std::vector<double> extrapolation(int steps) const {
    std::vector<double> weights;
    const int count = steps * stages_;
    const auto place = [this](int l) { return node_[l % stages_] - l / stages_; };
    for (int i = 0; i < stages_; ++i)
      for (int l = 0; l < count; ++l) {
        double weight = 1.0;
        for (int j = 0; j < count; ++j)
          if (j != l) weight *= (1.0 + node_[i] - place(j)) / (place(l) - place(j));
        weights.push_back(weight);
      }
    return weights;
  }

  // First guess of the accelerations: the last steps' polynomial if the effort is the same, else those of the state.
  Outcome guess(const JointState& state, const double* actuator, int& joint) {
    if (std::memcmp(last_effort_.data(), actuator, last_effort_.size() * sizeof(double)) != 0) known_ = 0;
    if (known_ > 0) {
      const std::vector<double>& ahead = ahead_[known_ - 1];
      const int count = known_ * stages_;
      for (int i = 0; i < stages_; ++i)
        for (int k = 0; k < joints_; ++k) {
          double sum = 0.0;
          for (int l = 0; l < count; ++l) sum += ahead[i * count + l] * row(past_, l)[k];
          row(accelerations_, i)[k] = sum;
        }
      return Outcome::good;
    }
    position_ = state.position, way_ = state.position_remainder, velocity_ = state.velocity;
    const Outcome outcome = evaluate(state, actuator, joint);
    for (int i = 0; i < stages_; ++i)
      std::memcpy(row(accelerations_, i), acceleration_.data(), joints_ * sizeof(double));
    return outcome;
  }

  void keep(const double* actuator) {
    const std::size_t one = accelerations_.size();
    std::memcpy(past_.data() + one, past_.data(), one * sizeof(double));
    std::memcpy(past_.data(), accelerations_.data(), one * sizeof(double));
    std::memcpy(last_effort_.data(), actuator, last_effort_.size() * sizeof(double));
    known_ = std::min(known_ + 1, most_past);
  }

  // Iterates every stage once, each with the newest accelerations. Gives the largest change of an increment step *
  // acceleration, the largest increment, and the `size` of all numbers that are rounded.
  Outcome iterate(const JointState& state, const double* actuator, double& change, double& increment, double& size,
                  int& joint) {
    for (int i = 0; i < stages_; ++i) {
      for (int k = 0; k < joints_; ++k) {
        double place = 0.0, rate = 0.0;
        for (int l = 0; l < stages_; ++l) {
          place += a_position_[i * stages_ + l] * row(accelerations_, l)[k];
          rate += a_[i * stages_ + l] * row(accelerations_, l)[k];
        }
        const double turned = length_ * (node_[i] * state.velocity[k] + length_ * place);
        way_[k] = turned + state.position_remainder[k];
        position_[k] = state.position[k] + way_[k];
        velocity_[k] = state.velocity[k] + (length_ * rate + state.velocity_remainder[k]);
      }
      const Outcome outcome = evaluate(state, actuator, joint);
      if (outcome != Outcome::good) return outcome;
      for (int k = 0; k < joints_; ++k) {
        double& kept = row(accelerations_, i)[k];
        const double moved = length_ * std::fabs(acceleration_[k] - kept);
        if (!(moved <= change)) change = moved, worst_ = k;
        increment = std::fmax(increment, length_ * std::fabs(acceleration_[k]));
        size = std::fmax(size, std::fmax(increment, std::fmax(std::fabs(position_[k]), std::fabs(velocity_[k]))));
        kept = acceleration_[k];
      }
    }
    return Outcome::good;
  }

  // At position_, `way_` from that of the state, and velocity_.
  Outcome evaluate(const JointState& state, const double* actuator, int& joint) {
    ++counts.evaluations;
    joint = right_hand_side_.accelerate(form_, state.position.data(), way_.data(), position_.data(), velocity_.data(),
                                        actuator, acceleration_.data());
    return outcome_of(joint, position_.data(), joints_);
  }

  // q_1 = q_0 + h v_0 + h^2 b^T A f,  v_1 = v_0 + h b^T f
  void finish(const JointState& state, JointState& next) {
    for (int k = 0; k < joints_; ++k) {
      double place = 0.0, rate = 0.0;
      for (int l = 0; l < stages_; ++l) {
        place += b_position_[l] * row(accelerations_, l)[k];
        rate += b_[l] * row(accelerations_, l)[k];
      }
      double coasted, lost;
      add_compensated(state.position[k], state.position_remainder[k], length_ * state.velocity[k], coasted, lost);
      add_compensated(coasted, lost, length_ * (length_ * place + state.velocity_remainder[k]), next.position[k],
                      next.position_remainder[k]);
      add_compensated(state.velocity[k], state.velocity_remainder[k], length_ * rate, next.velocity[k],
                      next.velocity_remainder[k]);
    }
  }

  static constexpr int most_rounds = 100, most_past = 2;

  Form& form_;
  RightHandSide right_hand_side_;
  double length_;
  const int joints_, stages_;
  const std::vector<double> a_, b_;
  std::vector<double> a_position_, b_position_, node_;
  std::vector<std::vector<double>> ahead_;
  std::vector<double> accelerations_, last_effort_, past_;  // stages; the effort of the last steps; their stages
  std::vector<double> position_, way_, velocity_, acceleration_;
  int known_ = 0;  // how many steps past_ holds
  int worst_ = 0;
};

}  // namespace planar_chain
