// Laws of joint effort, each on the relative coordinate (equations.md 4): twin of joint_forces.py; and wrenches from
// outside. A law nobody uses has an empty list and costs nothing.
#pragma once

#include <vector>

#include "chain.hpp"
#include "lanes.hpp"
#include "wrench.hpp"

namespace planar_chain {

// `numbers`: what may differ between chains of one make-up.
template <class Real>
struct DamperOf {
  int joint;
  Real damping;
  static constexpr Real DamperOf::* numbers[] = {&DamperOf::damping};
};

template <class Real>
struct SpringOf {
  int joint;
  Real stiffness, rest;
  static constexpr Real SpringOf::* numbers[] = {&SpringOf::stiffness, &SpringOf::rest};
};

template <class Real>
struct PreloadOf {
  int joint;
  Real preload;
  static constexpr Real PreloadOf::* numbers[] = {&PreloadOf::preload};
};

template <class Real>
struct FrictionOf {
  int joint;
  Real friction;
  static constexpr Real FrictionOf::* numbers[] = {&FrictionOf::friction};
};

template <class Real>
struct LimitOf {
  int joint;
  Real limit;
  static constexpr Real LimitOf::* numbers[] = {&LimitOf::limit};
};

template <class Real>
struct StopOf {
  int joint;
  Real lower, upper, restitution;
  static constexpr Real StopOf::* numbers[] = {&StopOf::lower, &StopOf::upper, &StopOf::restitution};
};

template <class Real>
struct JointForcesOf {
  std::vector<DamperOf<Real>> dampers;
  std::vector<SpringOf<Real>> springs;
  std::vector<PreloadOf<Real>> preloads;
  std::vector<FrictionOf<Real>> frictions;
  std::vector<LimitOf<Real>> limits;
  std::vector<StopOf<Real>> stops;
  std::vector<Wrench> wrenches;             // on `chain`; a simulation has them, a batch none
  const ChainOf<Real>* chain = nullptr;

  // Whether any of them acts besides the actuators.
  bool passive() const {
    return !bare && !(dampers.empty() && springs.empty() && preloads.empty() && frictions.empty());
  }

  // tau += -d theta' - k (theta - theta_0) + tau_p - tau_c sgn(theta')   (equations.md 4)
  void add_passive(const Real* position, const Real* velocity, Real* effort) const {
    if constexpr (bare) return;
    for (const auto& law : dampers) effort[law.joint] -= law.damping * velocity[law.joint];
    for (const auto& law : springs) effort[law.joint] -= law.stiffness * (position[law.joint] - law.rest);
    for (const auto& law : preloads) effort[law.joint] += law.preload;
    for (const auto& law : frictions) {
      const Real rate = velocity[law.joint], one = 1.0, zero = 0.0;
      effort[law.joint] -= law.friction * select(rate > zero, one, select(rate < zero, -one, zero));
    }
  }

  // Whole turns may be left out of positions. `remainder`: what they are beyond double precision, or null.
  void add_wrenches(const double* position, const double* remainder, double* effort) const {
    for (const Wrench& wrench : wrenches) add_wrench(*chain, wrench, position, remainder, effort);
  }

  // The actuator gives at most its limit, to either side.
  void clamp(Real* effort) const {
    if constexpr (bare) return;
    for (const auto& law : limits) {
      Real& u = effort[law.joint];
      const Real upper = law.limit, lower = -law.limit;
      u = select(u > upper, upper, u);
      u = select(u < lower, lower, u);
    }
  }

  // Energy in springs, and of preloads, J.
  Real stored_energy(const Real* position) const {
    Real energy = 0.0;
    for (const auto& law : springs) {
      const Real stretch = position[law.joint] - law.rest;
      energy += 0.5 * law.stiffness * stretch * stretch;
    }
    for (const auto& law : preloads) energy -= law.preload * position[law.joint];
    return energy;
  }

  // Laws that do not act smoothly: events.hpp.
  bool have_events() const { return !bare && !(stops.empty() && frictions.empty()); }
};

using JointForces = JointForcesOf<double>;

}  // namespace planar_chain
