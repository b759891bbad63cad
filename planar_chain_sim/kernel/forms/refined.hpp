// The recursion with one step of iterative refinement (equations.md 7), for chains whose pivots lose digits: a heavy
// body at the end of light ones.
#pragma once

#include <cmath>
#include <vector>

#include "recursive.hpp"

namespace planar_chain {

template <class Real>
class RefinedRecursionOf final : public FormOf<Real> {
 public:
  explicit RefinedRecursionOf(const ChainOf<Real>& chain)
      : recursion_(chain), residual_(chain.joint_count), correction_(chain.joint_count) {}

  int forward(const Real* position, const Real* velocity, const Real* effort, Real* acceleration) override {
    if constexpr (lanes_in<Real> > 1) return evaluate_in_lanes(*this, position, velocity, effort, acceleration);
    return evaluate(position, velocity, effort, acceleration);
  }

  int evaluate(const Real* position, const Real* velocity, const Real* effort, Real* acceleration) {
    const int singular = recursion_.evaluate(position, velocity, effort, acceleration);
    this->good_ = recursion_.good();
    if (singular >= 0) return singular;
    recursion_.inverse(position, velocity, acceleration, true, residual_.data());
    for (std::size_t i = 0; i < residual_.size(); ++i) residual_[i] = effort[i] - residual_[i];
    recursion_.respond(residual_.data(), correction_.data());
    for (std::size_t i = 0; i < residual_.size(); ++i) acceleration[i] += correction_[i];
    return -1;
  }

  const std::vector<Real>& correction() const { return correction_; }

 private:
  RecursionOf<Real> recursion_;
  std::vector<Real> residual_, correction_;
};

// A chain needs refinement if it changes an acceleration by more than this, relative to the largest, at one of a few
// fixed states: the straight one at rest under efforts, where the chain is stiffest, and irregular ones.
constexpr double most_correction = 1e-14;

inline bool needs_refinement(const Chain& chain) {
  RefinedRecursionOf<double> form(chain);
  const std::size_t joints = chain.joint_count;
  std::vector<double> position(joints), velocity(joints), effort(joints), acceleration(joints);
  for (int trial = 0; trial < 5; ++trial) {
    for (std::size_t i = 0; i < joints; ++i) {
      const double turn = 0.6180339887498949 * static_cast<double>((i + 1) * (trial + 1)),
                   part = turn - std::floor(turn);
      position[i] = trial == 0 ? 0.0 : 2.0 * part, velocity[i] = trial == 0 ? 0.0 : 1.0 - part;
      effort[i] = trial == 0 ? 1.0 - 2.0 * part : 0.0;  // a straight chain may be in balance without efforts
    }
    if (form.forward(position.data(), velocity.data(), effort.data(), acceleration.data()) >= 0) continue;
    double largest = 0.0, moved = 0.0;
    for (std::size_t i = 0; i < joints; ++i) {
      largest = std::fmax(largest, std::fabs(acceleration[i]));
      moved = std::fmax(moved, std::fabs(form.correction()[i]));
    }
    if (moved > most_correction * largest) return true;
  }
  return false;
}

}  // namespace planar_chain
