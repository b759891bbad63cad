// Velocities first, positions with the new velocities: one evaluation a step.
#pragma once

#include <vector>

#include "../arithmetic/compensated_sum.hpp"
#include "../forms/outcome.hpp"
#include "../forms/right_hand_side.hpp"
#include "fixed_step.hpp"

namespace planar_chain {

class SemiImplicitEuler final : public FixedStep {
 public:
  SemiImplicitEuler(const Chain& chain, Form& form, const JointForces& forces, double step)
      : FixedStep(forces, chain.joint_count, 1, step,
                  0.3),  // its positions are half a step ahead, an error that does not accumulate
        form_(form), right_hand_side_(chain, forces), acceleration_(chain.joint_count), position_(acceleration_) {}

  // A shorter step costs one evaluation, and no polynomial between the ends knows where it leads.
  bool interpolates() const override { return true; }

 protected:
  // v_1 = v_0 + h f(q_0, v_0),  q_1 = q_0 + h v_1
  Outcome step(const JointState& state, const double* actuator, double length, JointState& next, int& joint) override {
    ++counts.evaluations;
    joint = accelerate(state, actuator, acceleration_.data());
    if (joint >= 0) return outcome_of(joint, state.position.data(), static_cast<int>(position_.size()));
    for (std::size_t i = 0; i < position_.size(); ++i) {
      add_compensated(state.velocity[i], state.velocity_remainder[i], length * acceleration_[i], next.velocity[i],
                      next.velocity_remainder[i]);
      double coasted, lost;
      add_compensated(state.position[i], state.position_remainder[i], length * next.velocity[i], coasted, lost);
      add_compensated(coasted, lost, length * next.velocity_remainder[i], next.position[i], next.position_remainder[i]);
    }
    return Outcome::good;
  }

  int accelerate(const JointState& state, const double* actuator, double* acceleration) override {
    position_ = state.position;
    right_hand_side_.start(state.position.data());
    return right_hand_side_.accelerate(form_, state.position.data(), state.position_remainder.data(), position_.data(),
                                       state.velocity.data(), actuator, acceleration);
  }

  const double* first_acceleration() const override { return acceleration_.data(); }

 private:
  Form& form_;
  RightHandSide right_hand_side_;
  std::vector<double> acceleration_, position_;
};

}  // namespace planar_chain
