// One form of the equations of motion, chosen once for a chain: all of them give the same accelerations.
#pragma once

#include "../arithmetic/lanes.hpp"
#include "../arithmetic/vector_width.hpp"

namespace planar_chain {

template <class Real>
class FormOf {
 public:
  virtual ~FormOf() = default;

  // Joint accelerations from joint efforts that already contain every joint law. Returns -1, or the joint whose pivot
  // vanished; for several scenes in lanes always -1, and good() tells which of them it holds for.
  virtual int forward(const Real* position, const Real* velocity, const Real* effort, Real* acceleration) = 0;

  // After forward() of several scenes: which of them have all their pivots. The numbers of the others mean nothing.
  const Truth<Real>& good() const { return good_; }

 protected:
  // A single scene ends at a pivot that is too small; of several scenes the others go on.
  bool stops_at(const Truth<Real>& pivot_is_one) {
    if constexpr (lanes_in<Real> == 1) return !pivot_is_one;
    good_ = good_ & pivot_is_one;
    return false;
  }

  Truth<Real> good_{};
};

using Form = FormOf<double>;

// form.evaluate(...) of several scenes, compiled for their vectors.
template <class Real, class Body>
int evaluate_in_lanes(Body& form, const Real* position, const Real* velocity, const Real* effort, Real* acceleration) {
  struct Work {
    Body& form;
    const Real *position, *velocity, *effort;
    Real* acceleration;
    void run() { form.evaluate(position, velocity, effort, acceleration); }
  } work{form, position, velocity, effort, acceleration};
  VectorWidth<lanes_in<Real>>::run(work);
  return -1;
}

}  // namespace planar_chain
