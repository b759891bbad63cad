// The efforts that act at a state, in one place: actuators, joint laws, wrenches; and positions without whole turns for
// the forms. Every integrator, the events and the border to Python use this header.
//
//   tau = tau_actuator + laws(theta, theta') + wrenches(theta)      (equations.md 4, 6.5),   H theta'' + h = tau
//
// Laws take the whole angle, as a spring counts turns; trigonometry takes it without whole turns (whole_turns.hpp).
#pragma once

#include <vector>

#include "../arithmetic/cache_lines.hpp"
#include "../model/joint_forces.hpp"
#include "../model/joint_state.hpp"
#include "../model/whole_turns.hpp"
#include "form.hpp"

namespace planar_chain {

template <class Real>
class RightHandSideOf {
 public:
  RightHandSideOf(const ChainOf<Real>& chain, const JointForcesOf<Real>& forces)
      : forces_(forces), turns_(chain), joints_(chain.joint_count), effort_(chain.joint_count), near_(0) {}

  // To be called before the first evaluation at or near `base`.
  PLANAR_CHAIN_INLINE void start(const Real* base) { far_ = turns_.find(base); }

  // Whether any joint at `base` has made many turns: only then is `way` used below.
  bool far() const { return far_; }

  // All efforts at `position`, which is base + way, from which whole turns are left out.
  PLANAR_CHAIN_INLINE Real* efforts(const Real* base, const Real* way, Real* position, const Real* velocity,
                                    const Real* actuator) {
    for (int i = 0; i < joints_; ++i) effort_[i] = actuator[i];
    if (forces_.passive()) forces_.add_passive(position, velocity, effort_.data());
    if (far_) turns_.leave_out(base, way, position);
    if constexpr (lanes_in<Real> == 1) forces_.add_wrenches(position, nullptr, effort_.data());
    return effort_.data();
  }

  // All efforts at `position`; near_position() is then `position` without whole turns.
  const Real* efforts(const Real* position, const Real* velocity, const Real* actuator) {
    for (int i = 0; i < joints_; ++i) effort_[i] = actuator[i];
    if (forces_.passive()) forces_.add_passive(position, velocity, effort_.data());
    near_position_ = without_turns(position);
    if constexpr (lanes_in<Real> == 1) forces_.add_wrenches(near_position_, nullptr, effort_.data());
    return effort_.data();
  }
  const Real* near_position() const { return near_position_; }

  // `position` without whole turns; itself where it has none.
  const Real* without_turns(const Real* position) {
    if (!turns_.find(position)) return position;
    left_.assign(position, position + joints_), nothing_.resize(left_.size());
    turns_.leave_out(position, nothing_.data(), left_.data());
    return left_.data();
  }

  // Joint efforts that do the work of the wrenches at a state.
  void wrench_efforts(const JointState& state, Real* effort) {
    find_near(state);
    forces_.add_wrenches(at_->position.data(), at_->position_remainder.data(), effort);
  }

  // All efforts at a state that is known beyond double precision; near() is then that state without whole turns.
  Real* efforts(const JointState& state, const Real* actuator) {
    for (int i = 0; i < joints_; ++i) effort_[i] = actuator[i];
    forces_.add_passive(state.position.data(), state.velocity.data(), effort_.data());
    find_near(state);
    forces_.add_wrenches(at_->position.data(), at_->position_remainder.data(), effort_.data());
    return effort_.data();
  }
  const JointState& near() const { return *at_; }

  // Accelerations at position = base + way, as above; -1, or the joint whose pivot vanished.
  PLANAR_CHAIN_INLINE int accelerate(FormOf<Real>& form, const Real* base, const Real* way, Real* position,
                                     const Real* velocity, const Real* actuator, Real* acceleration) {
    const Real* effort = efforts(base, way, position, velocity, actuator);
    return form.forward(position, velocity, effort, acceleration);
  }

 private:
  void find_near(const JointState& state) {
    at_ = &state;
    if (!turns_.find(state.position.data())) return;
    near_ = state, at_ = &near_;
    turns_.leave_out(near_.position, near_.position_remainder);
  }

  const JointForcesOf<Real>& forces_;
  WholeTurns<Real> turns_;
  const int joints_;
  bool far_ = false;
  AlignedVector<Real> effort_;
  std::vector<Real> left_, nothing_;
  const Real* near_position_ = nullptr;
  JointState near_;
  const JointState* at_ = nullptr;
};

using RightHandSide = RightHandSideOf<double>;

}  // namespace planar_chain
