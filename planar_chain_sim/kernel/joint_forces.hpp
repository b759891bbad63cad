// Laws of joint effort, each on the relative coordinate (equations.md 4): twin of joint_forces.py. A law nobody uses
// has an empty list and costs nothing.
#pragma once

#include <vector>

#include "lanes.hpp"

namespace planar_chain {

struct DampedJoint { int joint; double damping; };
struct SpringJoint { int joint; double stiffness, rest; };
struct FrictionJoint { int joint; double friction; };
struct LimitedJoint { int joint; double limit; };
struct StoppedJoint { int joint; double lower, upper; };

struct JointForces {
  std::vector<DampedJoint> dampers;
  std::vector<SpringJoint> springs;
  std::vector<FrictionJoint> frictions;
  std::vector<LimitedJoint> limits;
  std::vector<StoppedJoint> stops;

  // tau += -d theta' - k (theta - theta_0) - tau_c sgn(theta')   (equations.md 4)
  template <class Real>
  void add_passive(const Real* position, const Real* velocity, Real* effort) const {
    for (const auto& law : dampers) effort[law.joint] -= law.damping * velocity[law.joint];
    for (const auto& law : springs) effort[law.joint] -= law.stiffness * (position[law.joint] - law.rest);
    for (const auto& law : frictions) {
      const Real rate = velocity[law.joint], one = 1.0, zero = 0.0;
      effort[law.joint] -= law.friction * select(rate > zero, one, select(rate < zero, -one, zero));
    }
  }

  // The actuator gives at most its limit, to either side.
  template <class Real>
  void clamp(Real* effort) const {
    for (const auto& law : limits) {
      Real& u = effort[law.joint];
      const Real upper = law.limit, lower = -law.limit;
      u = select(u > upper, upper, u);
      u = select(u < lower, lower, u);
    }
  }

  double spring_energy(const double* position) const {
    double energy = 0.0;
    for (const auto& law : springs) {
      const double stretch = position[law.joint] - law.rest;
      energy += 0.5 * law.stiffness * stretch * stretch;
    }
    return energy;
  }

  // First joint beyond one of its stops, -1 if none.
  int beyond_stop(const double* position) const {
    for (const auto& law : stops)
      if (position[law.joint] < law.lower || position[law.joint] > law.upper) return law.joint;
    return -1;
  }
};

}  // namespace planar_chain
