// Between the ends of a step that has no interpolation of its own: Hermite's polynomials through state and derivative,
// quintic for positions, cubic for velocities (Hairer, Norsett, Wanner, Solving ODEs I, II.6). At the ends it is exact.
#pragma once

#include <vector>

#include "../arithmetic/compensated_sum.hpp"
#include "../model/joint_state.hpp"

namespace planar_chain {

class HermiteStep {
 public:
  void begin(const JointState& state, const std::vector<double>& acceleration) {
    from_ = state, slope_from_ = acceleration;
  }
  void end(const JointState& state, const std::vector<double>& acceleration, double length) {
    to_ = state, slope_to_ = acceleration, length_ = length;
  }

  // The joints from `first` to before `end`, and perhaps others.
  void read(double into, JointState& out, int first, int end) const {
    if (into == 0.0 || into == length_) return void(out = into == 0.0 ? from_ : to_);
    const double x = into / length_, h = length_;
    for (int i = first; i < end; ++i) {
      const double v0 = from_.velocity[i], v1 = to_.velocity[i], a0 = slope_from_[i], a1 = slope_to_[i];
      // What is left of the way and of the rise beyond the parabola and the straight line from the start.
      const double way = (to_.position[i] - from_.position[i]) +
                         (to_.position_remainder[i] - from_.position_remainder[i]) - h * (v0 + 0.5 * h * a0);
      const double rise = (v1 - v0) + (to_.velocity_remainder[i] - from_.velocity_remainder[i]) - h * a0;
      const double bend = h * (a1 - a0);
      const double cube = x * x * x;
      const double moved =
          into * (v0 + 0.5 * into * a0) +
          cube * ((10.0 * way - 4.0 * h * rise + 0.5 * h * bend) +
                  x * ((-15.0 * way + 7.0 * h * rise - h * bend) + x * (6.0 * way - 3.0 * h * rise + 0.5 * h * bend)));
      const double risen = into * a0 + x * x * ((3.0 * rise - bend) + x * (bend - 2.0 * rise));
      add_compensated(from_.position[i], from_.position_remainder[i], moved, out.position[i],
                      out.position_remainder[i]);
      add_compensated(from_.velocity[i], from_.velocity_remainder[i], risen, out.velocity[i],
                      out.velocity_remainder[i]);
    }
  }

 private:
  JointState from_{0}, to_{0};
  std::vector<double> slope_from_, slope_to_;
  double length_ = 0.0;
};

}  // namespace planar_chain
