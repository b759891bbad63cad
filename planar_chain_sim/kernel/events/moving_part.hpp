// The part of a chain that moves while some joints stand: a chain of its own with the efforts that act on it, and the
// way there and back.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "../forms/forms.hpp"
#include "../forms/right_hand_side.hpp"
#include "standing_joints.hpp"

namespace planar_chain {

class MovingPart {
 public:
  std::vector<double> effort;        // constant efforts on its joints: actuators and dry friction
  std::vector<double> acceleration;  // result of accelerate()

  MovingPart(const Chain& whole, const JointForces& forces) : whole_(whole), forces_(forces), turns_(whole) {}

  // Makes the part for these joints standing in `state`; `dense`: the form of its equations. Whatever was computed from
  // the old part is no longer valid.
  void build(const std::vector<bool>& standing, const JointState& state, bool unrolled_series, bool dense) {
    JointState at = state;
    if (turns_.find(state.position.data())) turns_.leave_out(at.position, at.position_remainder);
    right_hand_side_.reset(), form_.reset();
    part_ = without_standing(whole_, forces_, standing, at.position.data(), at.position_remainder.data());
    part_.forces.chain = &part_.chain;
    effort.assign(part_.joints.size(), 0.0), acceleration.assign(part_.joints.size(), 0.0);
    if (part_.joints.empty()) return;
    dense_ = dense && (unrolled_series || SerialRecursion::holds_for(part_.chain));
    form_ = make_form<double>(part_.chain, dense_);
    right_hand_side_.emplace(part_.chain, part_.forces);
  }

  int moving() const { return static_cast<int>(part_.joints.size()); }
  int joint_of(int index) const { return part_.joints[static_cast<std::size_t>(index)]; }
  const Chain& chain() const { return part_.chain; }
  const JointForces& forces() const { return part_.forces; }
  Form& form() { return *form_; }
  bool dense() const { return dense_; }

  // Accelerations in one of its states; -1, or the index of the joint whose pivot vanished.
  int accelerate(const JointState& moved) {
    if (part_.joints.empty()) return -1;
    const double* all = right_hand_side_->efforts(moved, effort.data());
    const JointState& near = right_hand_side_->near();
    return form_->forward(near.position.data(), near.velocity.data(), all, acceleration.data());
  }

  void gather(const JointState& state, JointState& moved) const {
    for (std::size_t k = 0; k < part_.joints.size(); ++k) {
      const int j = part_.joints[k];
      moved.position[k] = state.position[j], moved.velocity[k] = state.velocity[j];
      moved.position_remainder[k] = state.position_remainder[j];
      moved.velocity_remainder[k] = state.velocity_remainder[j];
    }
  }

  void scatter(const JointState& moved, JointState& state) const {
    for (std::size_t k = 0; k < part_.joints.size(); ++k) {
      const int j = part_.joints[k];
      state.position[j] = moved.position[k], state.velocity[j] = moved.velocity[k];
      state.position_remainder[j] = moved.position_remainder[k];
      state.velocity_remainder[j] = moved.velocity_remainder[k];
    }
  }

  // Its accelerations among those of all joints, which are zero where one stands.
  void spread(double* all, int joints) const {
    std::fill_n(all, joints, 0.0);
    for (std::size_t k = 0; k < part_.joints.size(); ++k) all[part_.joints[k]] = acceleration[k];
  }

 private:
  const Chain& whole_;
  const JointForces& forces_;
  WholeTurns<double> turns_;
  ReducedChain part_;
  std::unique_ptr<Form> form_;
  std::optional<RightHandSide> right_hand_side_;
  bool dense_ = false;
};

}  // namespace planar_chain
