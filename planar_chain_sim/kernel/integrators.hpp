// What moves a state from tick to tick: steps of a fixed size here, steps of their own size in adaptive.hpp.
#pragma once

#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "form.hpp"
#include "joint_forces.hpp"

namespace planar_chain {

// Joint coordinates and rates as unevaluated sums: value + remainder holds twice the digits.
struct JointState {
  std::vector<double> position, velocity, position_remainder, velocity_remainder;

  explicit JointState(int joints)
      : position(joints), velocity(joints), position_remainder(joints), velocity_remainder(joints) {}
};

// Two-sum (Knuth, TAOCP 2, 4.2.2): what rounding loses goes into the remainder, so that error grows with steps^(1/2).
template <class Real>
inline void add_compensated(const Real& value, const Real& remainder, const Real& increment, Real& sum, Real& lost) {
  const Real term = increment + remainder, whole = value + term, back = whole - value;
  lost = (value - (whole - back)) + (term - back);
  sum = whole;
}

enum class Outcome { good, singular, not_finite, stalled, too_long };

struct Progress {
  std::int64_t ticks = 0;
  Outcome outcome = Outcome::good;
  int joint = -1;
};

struct Counts {
  std::int64_t evaluations = 0, steps = 0, rejected_steps = 0, events = 0;

  void add(const Counts& more) {
    evaluations += more.evaluations, steps += more.steps, rejected_steps += more.rejected_steps, events += more.events;
  }
};

// Pivots are made of squares of positions: where these overflow or are no numbers, no pivot can be judged.
inline Outcome singular_or_not_finite(const double* position, int joints) {
  for (int i = 0; i < joints; ++i)
    if (!std::isfinite(position[i] * position[i])) return Outcome::not_finite;
  return Outcome::singular;
}

// First joint whose position or velocity is not finite, -1 if none.
inline int first_not_finite(const JointState& state) {
  for (std::size_t i = 0; i < state.position.size(); ++i)
    if (!std::isfinite(state.position[i]) || !std::isfinite(state.velocity[i])) return static_cast<int>(i);
  return -1;
}

class Integrator {
 public:
  Counts counts;

  virtual ~Integrator() = default;

  // Moves `state`, which is at `now` s, that is at tick `tick` or not yet at the next, on to tick + ticks under the
  // clamped actuator effort. Stops before a tick that fails: the state is then that of the last good one. Calls may be
  // cut anywhere: the bits are the same.
  virtual Progress advance(double now, std::int64_t tick, std::int64_t ticks, JointState& state,
                           const double* actuator) = 0;

  // Moves `state` on to `time`, which may lie between ticks; false if the method cannot.
  virtual bool reach(double /*now*/, std::int64_t /*tick*/, double /*time*/, JointState&, const double* /*actuator*/,
                     Progress&) {
    return false;
  }

  // The state was changed by somebody else: nothing that was computed ahead holds.
  virtual void forget() {}

  // Forces other than the actuators' were changed.
  virtual void forces_changed() { forget(); }

  // What decides how to go on besides the state: for a checkpoint.
  virtual std::vector<double> save() const { return {}; }
  virtual void load(const std::vector<double>&) { forget(); }
};

// An integrator of smooth motion, which events may cut short (events.hpp).
class Motion : public Integrator {
 public:
  // The motion from `state`, `offset` s behind `tick`: up to which offset, at most `limit`, show() can tell where it is.
  virtual double look(std::int64_t tick, double offset, double limit, const JointState& state, const double* actuator,
                      Progress& progress) = 0;
  virtual Outcome show(double offset, JointState& out, int& joint) = 0;

  // s, of which the motion is much the same polynomial.
  virtual double stride() const = 0;
};

// One step a tick. step() changes the state only if the outcome is good; else `joint` is why.
class FixedStep : public Motion {
 public:
  FixedStep(const JointForces& forces, int joints, double tick_length)
      : forces_(forces), tick_length_(tick_length), next_(joints), from_(joints), actuator_(joints) {}

  Progress advance(double, std::int64_t, std::int64_t ticks, JointState& state, const double* actuator) override {
    Progress progress;
    for (; progress.ticks < ticks; ++progress.ticks) {
      progress.outcome = step(state, actuator, tick_length_, next_, progress.joint);
      if (progress.outcome == Outcome::good && (progress.joint = first_not_finite(next_)) >= 0)
        progress.outcome = Outcome::not_finite;
      if (progress.outcome != Outcome::good) break;
      std::swap(state, next_);
      ++counts.steps;
    }
    return progress;
  }

  double look(std::int64_t /*tick*/, double offset, double limit, const JointState& state, const double* actuator,
              Progress&) override {
    from_ = state, offset_ = offset;
    actuator_.assign(actuator, actuator + actuator_.size());
    return limit;
  }

  Outcome show(double offset, JointState& out, int& joint) override {
    ++counts.steps;
    return step(from_, actuator_.data(), offset - offset_, out, joint);
  }

  double stride() const override { return tick_length_; }

 protected:
  // One step of `length` s.
  virtual Outcome step(const JointState& state, const double* actuator, double length, JointState& next, int& joint) = 0;

  const JointForces& forces_;
  const double tick_length_;

 private:
  JointState next_, from_;
  std::vector<double> actuator_;
  double offset_ = 0.0;
};

}  // namespace planar_chain
