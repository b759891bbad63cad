// The effort lambda that holds the standing joints while the others move, and its rounding error. Events are found and
// decided by the same numbers.
#pragma once

#include <cmath>
#include <vector>

#include "../forms/outcome.hpp"
#include "holding.hpp"
#include "moving_part.hpp"

namespace planar_chain {

class HoldingEffort {
 public:
  std::vector<double> actuator;                  // the actuators' efforts, while they do not change
  std::vector<double> lambda, rounding, margin;  // of all joints; margin: by which lambda may exceed its bounds
  std::vector<double> excess;                    // by which it did exceed them when the joint was decided to stand
  std::vector<double> acceleration;              // where it was last found
  JointState full;                               // the state there; the user sets the standing joints

  HoldingEffort(Holding& holding, MovingPart& part, int joints)
      : actuator(joints), lambda(joints), rounding(joints), margin(joints), excess(joints), acceleration(joints),
        full(joints), holding_(holding), part_(part) {}

  // Accelerations of the moving part in one of its states.
  bool accelerate(const JointState& moved, Progress& progress) {
    const int joint = part_.accelerate(moved);
    progress.outcome = outcome_of(joint, moved.position.data(), part_.moving()), progress.joint = joint;
    return joint < 0;
  }

  // After accelerate(): lambda there.
  void find(const JointState& moved) {
    part_.scatter(moved, full);
    part_.spread(acceleration.data(), static_cast<int>(lambda.size()));
    holding_.find_lambda(full, acceleration.data(), actuator.data(), lambda.data());
  }

  // After find().
  void find_rounding() { holding_.find_rounding(full, acceleration.data(), lambda.data(), rounding.data()); }

  void find_margin() {
    find_rounding();
    for (std::size_t j = 0; j < margin.size(); ++j) margin[j] = std::fmax(4.0 * rounding[j], excess[j]);
  }

 private:
  Holding& holding_;
  MovingPart& part_;
};

}  // namespace planar_chain
