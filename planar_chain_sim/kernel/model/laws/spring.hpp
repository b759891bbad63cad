// A linear spring at a joint: tau = -k (theta - theta_0), V = k (theta - theta_0)^2 / 2 (equations.md 4).
//
// This header is all that the kernel has of the law. A smooth law has `effort`; `by_position` if it depends on the
// position and `by_velocity` if it depends on the velocity, constant since the law is linear; `energy` if it stores
// any; `size`, for rounding; and `coefficient`, of its series.
#pragma once

#include <cmath>

namespace planar_chain {

template <class Real>
struct SpringOf {
  int joint;
  Real stiffness, rest;

  static constexpr const char* name = "spring";
  static constexpr Real SpringOf::* numbers[] = {&SpringOf::stiffness, &SpringOf::rest};
  static constexpr bool of_position = true, of_velocity = false, stores = true;

  Real effort(const Real& position, const Real&) const { return -(stiffness * (position - rest)); }
  Real by_position() const { return -stiffness; }  // d tau / d theta

  Real energy(const Real& position) const {
    const Real stretch = position - rest;
    return 0.5 * stiffness * stretch * stretch;
  }

  // Size of the numbers whose difference is the effort: its rounding error is proportional to it.
  double size(double position) const {
    return stiffness * (position - rest) == 0.0 ? 0.0 : stiffness * (std::fabs(position) + std::fabs(rest));
  }

  // Coefficient k > 0 of the effort's series from coefficients k and k - 1 of the rate's.
  double coefficient(int k, double, double rate_before) const { return -(stiffness * rate_before / k); }
};

}  // namespace planar_chain
