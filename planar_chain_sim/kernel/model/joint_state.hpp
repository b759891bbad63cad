// The state that is integrated.
#pragma once

#include <vector>

namespace planar_chain {

// Joint coordinates and rates as unevaluated sums: value + remainder holds twice the digits.
struct JointState {
  std::vector<double> position, velocity, position_remainder, velocity_remainder;

  explicit JointState(int joints)
      : position(joints), velocity(joints), position_remainder(joints), velocity_remainder(joints) {}
};

}  // namespace planar_chain
