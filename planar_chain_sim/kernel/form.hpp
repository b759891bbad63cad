// One form of the equations of motion, chosen once for a chain: all of them give the same accelerations.
#pragma once

namespace planar_chain {

template <class Real>
class FormOf {
 public:
  virtual ~FormOf() = default;

  // Joint accelerations from joint efforts that already contain every joint law. Returns -1, or the joint whose pivot
  // vanished; for several scenes in lanes always -1, and good() of the form tells which of them it holds for.
  virtual int forward(const Real* position, const Real* velocity, const Real* effort, Real* acceleration) = 0;
};

using Form = FormOf<double>;

}  // namespace planar_chain
