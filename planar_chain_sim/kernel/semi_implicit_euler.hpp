// Velocities first, positions with the new velocities: one evaluation a step.
#pragma once

#include <vector>

#include "integrators.hpp"
#include "whole_turns.hpp"

namespace planar_chain {

class SemiImplicitEuler final : public FixedStep {
 public:
  SemiImplicitEuler(const Chain& chain, Form& form, const JointForces& forces, double step)
      : FixedStep(forces, chain.joint_count, 1, step, 0.3),  // its positions run half a step ahead, which does not add up
        form_(form), turns_(chain), effort_(chain.joint_count),
        acceleration_(effort_), position_(effort_) {}

 protected:
  // v_1 = v_0 + h f(q_0, v_0),  q_1 = q_0 + h v_1
  Outcome step(const JointState& state, const double* actuator, double length, JointState& next, int& joint) override {
    effort_.assign(actuator, actuator + effort_.size());
    forces_.add_passive(state.position.data(), state.velocity.data(), effort_.data());
    ++counts.evaluations;
    const double* position = state.position.data();
    if (turns_.find(position)) {
      position_ = state.position;
      turns_.leave_out(position, state.position_remainder.data(), position_.data());
      position = position_.data();
    }
    forces_.add_wrenches(position, nullptr, effort_.data());
    joint = form_.forward(position, state.velocity.data(), effort_.data(), acceleration_.data());
    if (joint >= 0) return singular_or_not_finite(state.position.data(), static_cast<int>(effort_.size()));
    for (std::size_t i = 0; i < effort_.size(); ++i) {
      add_compensated(state.velocity[i], state.velocity_remainder[i], length * acceleration_[i], next.velocity[i],
                      next.velocity_remainder[i]);
      double coasted, lost;
      add_compensated(state.position[i], state.position_remainder[i], length * next.velocity[i], coasted, lost);
      add_compensated(coasted, lost, length * next.velocity_remainder[i], next.position[i], next.position_remainder[i]);
    }
    return Outcome::good;
  }

 private:
  Form& form_;
  WholeTurns<double> turns_;
  std::vector<double> effort_, acceleration_, position_;
};

}  // namespace planar_chain
