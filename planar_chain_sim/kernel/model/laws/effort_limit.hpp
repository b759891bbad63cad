// The actuator of a joint gives at most its limit, to either side.
#pragma once

#include "../../arithmetic/lanes.hpp"

namespace planar_chain {

template <class Real>
struct EffortLimitOf {
  int joint;
  Real limit;

  static constexpr const char* name = "effort_limit";
  static constexpr Real EffortLimitOf::* numbers[] = {&EffortLimitOf::limit};

  Real clamped(const Real& effort) const {
    const Real upper = limit, lower = -limit, below = select(effort > upper, upper, effort);
    return select(below < lower, lower, below);
  }
};

}  // namespace planar_chain
