// One form of the equations of motion, chosen once for a chain: all of them give the same accelerations.
#pragma once

namespace planar_chain {

class Form {
 public:
  virtual ~Form() = default;

  // Joint accelerations from joint efforts that already contain every joint law. Returns -1, or the joint whose pivot
  // vanished.
  virtual int forward(const double* position, const double* velocity, const double* effort, double* acceleration) = 0;
};

}  // namespace planar_chain
