// Dry friction of a joint: tau = -tau_c sgn(theta') while it moves (equations.md 4); at rest see events.hpp.
#pragma once

#include "../../arithmetic/lanes.hpp"

namespace planar_chain {

template <class Real>
struct FrictionOf {
  int joint;
  Real friction;

  static constexpr const char* name = "friction";
  static constexpr Real FrictionOf::* numbers[] = {&FrictionOf::friction};

  Real effort(const Real& rate) const {
    const Real one = 1.0, zero = 0.0;
    return -(friction * select(rate > zero, one, select(rate < zero, -one, zero)));
  }
};

}  // namespace planar_chain
