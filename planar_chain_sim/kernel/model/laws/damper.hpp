// Viscous damping of a joint: tau = -d theta' (equations.md 4).
#pragma once

namespace planar_chain {

template <class Real>
struct DamperOf {
  int joint;
  Real damping;

  static constexpr const char* name = "damping";
  static constexpr Real DamperOf::* numbers[] = {&DamperOf::damping};
  static constexpr bool of_position = false, of_velocity = true, stores = false;

  Real effort(const Real&, const Real& velocity) const { return -(damping * velocity); }
  Real by_velocity() const { return -damping; }  // d tau / d theta'
  double size(double) const { return 0.0; }
  double coefficient(int, double rate, double) const { return -(damping * rate); }
};

}  // namespace planar_chain
