// Stops of a joint (equations.md 6.4): what they do is in events.hpp.
#pragma once

namespace planar_chain {

template <class Real>
struct StopOf {
  int joint;
  Real lower, upper, restitution;

  static constexpr const char* name = "stop";
  static constexpr Real StopOf::* numbers[] = {&StopOf::lower, &StopOf::upper, &StopOf::restitution};
};

}  // namespace planar_chain
