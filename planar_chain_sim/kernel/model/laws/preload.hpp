// An effort that always acts at a joint: tau = tau_p, V = -tau_p theta (equations.md 4).
#pragma once

#include <cmath>

namespace planar_chain {

template <class Real>
struct PreloadOf {
  int joint;
  Real preload;

  static constexpr const char* name = "preload";
  static constexpr Real PreloadOf::* numbers[] = {&PreloadOf::preload};
  static constexpr bool of_position = false, of_velocity = false, stores = true;

  Real effort(const Real&, const Real&) const { return preload; }
  Real energy(const Real& position) const { return -(preload * position); }
  double size(double) const { return std::fabs(preload); }
  double coefficient(int, double, double) const { return 0.0; }
};

}  // namespace planar_chain
