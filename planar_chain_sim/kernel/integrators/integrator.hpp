// Moves a state from tick to tick, by steps of a fixed size (fixed_step.hpp) or of an adaptive size (adaptive.hpp).
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "../forms/outcome.hpp"
#include "../model/joint_state.hpp"
#include "kept_numbers.hpp"
#include "lookout.hpp"

namespace planar_chain {

// Ticks that a double can count.
constexpr std::int64_t most_ticks = std::int64_t(1) << 53;

struct Progress {
  std::int64_t ticks = 0;
  Outcome outcome = Outcome::good;
  int joint = -1;
};

// Steps of fixed size that are far off: the tick of the check, the error, rad or m, and the joint, or -1.
struct CoarseStep {
  std::int64_t tick = 0;
  double error = 0.0;
  int joint = -1;
  bool summed = false;  // over all steps up to that tick; else of that step alone
};

struct Counts {
  std::int64_t evaluations = 0, steps = 0, rejected_steps = 0, events = 0;

  void add(const Counts& more) {
    evaluations += more.evaluations, steps += more.steps, rejected_steps += more.rejected_steps, events += more.events;
  }
};

// First joint whose position or velocity is not finite, -1 if none.
inline int first_not_finite(const JointState& state) {
  for (std::size_t i = 0; i < state.position.size(); ++i)
    if (!std::isfinite(state.position[i]) || !std::isfinite(state.velocity[i])) return static_cast<int>(i);
  return -1;
}

class EventDriven;

class Integrator {
 public:
  Counts counts;
  CoarseStep coarse;  // the first one
  bool asked = true;  // whether errors are estimated at all

  virtual ~Integrator() = default;

  // Set the lookout by which advance() and advance_to() can be interrupted; null: they cannot.
  virtual void set_lookout(Lookout* lookout) { lookout_ = lookout; }

  // Moves `state` to tick + ticks under the clamped actuator effort. It is at `now` s: at tick `tick` or between that
  // and the next. Stops before a tick that fails, at the last good state. Calls may be cut anywhere: the bits are the
  // same. If it is interrupted, it is as if it had not gone beyond the last whole tick.
  virtual Progress advance(double now, std::int64_t tick, std::int64_t ticks, JointState& state,
                           const double* actuator) = 0;

  // Moves `state` on to `time`, which may lie between ticks; false if the method cannot.
  virtual bool advance_to(double /*now*/, std::int64_t /*tick*/, double /*time*/, JointState&,
                          const double* /*actuator*/, Progress&) {
    return false;
  }

  // To be called after the state was changed from outside: discards all that was computed ahead.
  virtual void forget() {}

  // To be called after forces other than the actuators' were changed.
  virtual void forces_changed() { forget(); }

  // This integrator as that of a scene with stops or friction (events/events.hpp); null: it is another one.
  virtual EventDriven* event_driven() { return nullptr; }

  // Appends all numbers except the state that decide how the motion goes on, for a checkpoint.
  virtual void save(std::vector<double>& all) const { all.push_back(static_cast<double>(Kept::nothing)); }

  // Restores what save() gave; false if it cannot have been saved in this state, at `now` s behind tick `tick`, or if,
  // without a state, the numbers are impossible. The integrator must then not be used before a load() that succeeds.
  virtual bool load(KeptNumbers& kept, std::int64_t /*tick*/, double /*now*/, const JointState* /*state*/) {
    forget();
    return kept.is(Kept::nothing) && kept.left() == 0;
  }

 protected:
  bool stopped(std::int64_t work) { return lookout_ != nullptr && lookout_->stop(work); }

  Lookout* lookout_ = nullptr;
};

// An integrator of smooth motion, which events may cut short (events.hpp).
class Motion : public Integrator {
 public:
  // Ensures that there is a step from `offset` s behind `tick`, where `state` is: the one under way, or the next one if
  // that has been `passed`. Returns its length, s; progress.outcome says why there is none.
  virtual double ensure_step(std::int64_t tick, double offset, double limit, const JointState& state,
                             const double* actuator, bool passed, Progress& progress) = 0;

  // Conversion between s behind that tick and s into that step.
  virtual double into_step(double offset) const = 0;
  virtual double behind_tick(double into) const = 0;

  // The state `into` s into that step.
  virtual Outcome state_at(double into, JointState& out, int& joint) = 0;

  // The same where only joint `wanted` of `out` is needed.
  virtual Outcome joint_at(int /*wanted*/, double into, JointState& out, int& joint) {
    return state_at(into, out, joint);
  }

  // Whether the step under way covers `from` to `to` s behind `tick`; then `to` is `into` s into it.
  virtual bool spans(std::int64_t /*tick*/, double /*from*/, double /*to*/, double& /*into*/) { return false; }

  // Whether state_at() reads interpolation; else it makes another step.
  virtual bool interpolates() const = 0;

  std::int64_t number = 0;  // number of steps that ensure_step() has made
};

}  // namespace planar_chain
