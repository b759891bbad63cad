// What moves a state from tick to tick: steps of a fixed size here, steps of their own size in adaptive.hpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "../forms/form.hpp"
#include "../model/joint_forces.hpp"
#include "../model/joint_state.hpp"
#include "accumulated_error.hpp"
#include "lookout.hpp"

namespace planar_chain {

// Two-sum (Knuth, TAOCP 2, 4.2.2): what rounding loses goes into the remainder, so that error grows with steps^(1/2).
template <class Real>
inline void add_compensated(const Real& value, const Real& remainder, const Real& increment, Real& sum, Real& lost) {
  const Real term = increment + remainder, whole = value + term, back = whole - value;
  lost = (value - (whole - back)) + (term - back);
  sum = whole;
}

enum class Outcome { good, singular, not_finite, stalled, too_long, coarse, endless_events, interrupted };

struct Progress {
  std::int64_t ticks = 0;
  Outcome outcome = Outcome::good;
  int joint = -1;
};

// Steps of fixed size that are far from right: at which tick that was seen, how far, rad or m, at which joint, or -1.
struct CoarseStep {
  std::int64_t tick = 0;
  double error = 0.0;
  int joint = -1;
  bool summed = false;  // over all steps up to that tick; else of that step alone
};

// A step that moves a velocity by more than this part of a rad or m per step is looked at; by more than that, any step.
constexpr double suspect_jump = 0.03, violent_jump = 0.5;

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

// What an integrator keeps, as numbers; the first says of which kind of integrator they are.
enum class Kept { nothing = 1, gauss, adaptive, events };

// Reads such numbers one by one, and knows whether each was there and could be.
class KeptNumbers {
 public:
  KeptNumbers(const double* begin, const double* end) : at_(begin), end_(end) {}

  bool cut = false;  // of a motion that events cut short: a time in it is known up to rounding

  std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }
  const double* at() const { return at_; }

  bool is(Kept kind) {
    double value;
    return number(value) && value == static_cast<double>(kind);
  }
  bool number(double& value) {
    if (at_ == end_ || !std::isfinite(*at_)) return false;
    value = *at_++;
    return true;
  }
  bool at_least_zero(double& value) { return number(value) && value >= 0.0; }

  // A whole number from `least` to `most`, both exact as a double.
  template <class Whole>
  bool whole(Whole& value, double least, double most) {
    double given;
    if (!number(given) || given < least || given > most || given != std::floor(given)) return false;
    value = static_cast<Whole>(given);
    return true;
  }
  bool numbers(std::vector<double>& values) {
    for (double& value : values)
      if (!number(value)) return false;
    return true;
  }

 private:
  const double *at_, *end_;
};

// Ticks that a double can count.
constexpr std::int64_t most_ticks = std::int64_t(1) << 53;

class Integrator {
 public:
  Counts counts;
  CoarseStep coarse;           // the first one
  bool asked = true;           // whether anybody asks for it

  virtual ~Integrator() = default;

  // Where it looks for a stop while advance() or reach() goes on; null: there can be none.
  virtual void look_out(Lookout* lookout) { lookout_ = lookout; }

  // Moves `state`, which is at `now` s, that is at tick `tick` or not yet at the next, on to tick + ticks under the
  // clamped actuator effort. Stops before a tick that fails: the state is then that of the last good one. Calls may be
  // cut anywhere: the bits are the same. Where it is interrupted it is as if it had not gone beyond the last whole
  // tick.
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

  // Appends what decides how to go on besides the state: for a checkpoint.
  virtual void save(std::vector<double>& all) const { all.push_back(static_cast<double>(Kept::nothing)); }

  // Takes it back; false where it cannot be what was saved in this state, at `now` s behind tick `tick`, or where,
  // without a state, the numbers alone cannot be. Then the integrator is not to be used before it has loaded something
  // good.
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
  // Makes sure of a step that goes on from `offset` s behind `tick`, where `state` is: the one under way, or, where
  // that has been `passed`, the next. Returns its length, s; progress.outcome tells why there is none.
  virtual double look(std::int64_t tick, double offset, double limit, const JointState& state, const double* actuator,
                      bool passed, Progress& progress) = 0;

  // Between s behind that tick and s into that step.
  virtual double into_step(double offset) const = 0;
  virtual double behind_tick(double into) const = 0;

  // Where the motion is `into` s into that step.
  virtual Outcome show(double into, JointState& out, int& joint) = 0;

  // Whether the step under way goes from `from` to `to` s behind `tick`; then `into` is how far into it that ends.
  virtual bool spans(std::int64_t /*tick*/, double /*from*/, double /*to*/, double& /*into*/) { return false; }

  // Whether show() costs little; else it is another step.
  virtual bool reads_densely() const = 0;

  std::int64_t number = 0;  // of steps that look() has gone on to
};

// One step a tick. step() changes the state only if the outcome is good; else `joint` is why.
//
// Nothing controls the error of such steps. For the first seconds it is followed as it adds up (accumulated_error.hpp);
// where velocities jump, and later now and then, one is compared with two half ones. The first that is far off is kept
// to be warned of. Whether one ends the run, being violent and off by a whole rad or m, depends on that step alone: not
// on what was looked at before, so that a restored run or a batch ends alike.
class FixedStep : public Motion {
 public:
  // `most_error_rate`: rad or m a second by which two half steps may differ; 0: the method finds by itself what
  // is too long.
  FixedStep(const JointForces& forces, int joints, int order, double tick_length, double most_error_rate)
      : forces_(forces), tick_length_(tick_length), most_error_rate_(most_error_rate), next_(joints), half_(joints),
        halves_(joints), from_(joints), actuator_(joints), accumulated_(joints, order, tick_length) {}

  Progress advance(double, std::int64_t tick, std::int64_t ticks, JointState& state, const double* actuator) override {
    Progress progress;
    accumulated_.effort(actuator);
    while (progress.ticks < ticks && progress.outcome == Outcome::good) {
      const std::int64_t begun = progress.ticks, end = begun + std::min(ticks - begun, accumulated_.to_go());
      for (; progress.ticks < end; ++progress.ticks) {
        if (stopped(work())) {
          progress.outcome = Outcome::interrupted;
          break;
        }
        progress.outcome = step(state, actuator, tick_length_, next_, progress.joint);
        if (progress.outcome == Outcome::good && (progress.joint = first_not_finite(next_)) >= 0)
          progress.outcome = Outcome::not_finite;
        if (progress.outcome == Outcome::good)
          progress.outcome = judge(tick + progress.ticks, tick_length_, state, actuator, progress.joint);
        if (progress.outcome != Outcome::good) break;
        std::swap(state, next_);
        ++counts.steps;
      }
      if (accumulated_.due(progress.ticks - begun)) follow(tick + progress.ticks - 1, next_, state, actuator);
    }
    return progress;
  }

  void forget() override { accumulated_.restart(); }
  void forces_changed() override {}

  double look(std::int64_t tick, double offset, double limit, const JointState& state, const double* actuator,
              bool /*passed*/, Progress& progress) override {
    if (stopped(work())) return progress.outcome = Outcome::interrupted, 0.0;
    from_ = state, offset_ = offset, ahead_ = limit - offset;
    actuator_.assign(actuator, actuator + actuator_.size());
    ++number, ++counts.steps;
    outcome_ahead_ = step(from_, actuator, ahead_, next_, joint_ahead_);
    if (outcome_ahead_ != Outcome::good || first_not_finite(next_) >= 0) return ahead_;
    progress.outcome = judge(offset == 0.0 ? tick : 3, ahead_, from_, actuator, progress.joint);
    accumulated_.effort(actuator);
    if (offset != 0.0 || limit != tick_length_) accumulated_.skip();
    else if (progress.outcome == Outcome::good && accumulated_.due(1)) follow(tick, from_, next_, actuator);
    return ahead_;
  }

  double into_step(double offset) const override { return offset - offset_; }
  double behind_tick(double into) const override { return offset_ + into; }

  Outcome show(double into, JointState& out, int& joint) override {
    if (into == ahead_) return out = next_, joint = joint_ahead_, outcome_ahead_;
    if (into == 0.0) return out = from_, Outcome::good;
    ++counts.rejected_steps;   // one of these takes the place of the whole step
    return step(from_, actuator_.data(), into, out, joint);
  }

  bool reads_densely() const override { return false; }

 protected:
  // One step of `length` s.
  virtual Outcome step(const JointState& state, const double* actuator, double length, JointState& next, int& joint) = 0;

  // Accelerations at a state; -1, or the joint whose pivot vanished. Nothing is counted.
  virtual int accelerate(const JointState& state, const double* actuator, double* acceleration) = 0;

  // Those that the last step set out with, or null where it has not computed them.
  virtual const double* first_acceleration() const { return nullptr; }

  // What a step leaves for the next one: not to be lost to steps that are only looked at.
  virtual int known() const { return 0; }
  virtual void know(int) {}

  const JointForces& forces_;
  const double tick_length_;

 private:
  std::int64_t work() const { return 16 * static_cast<std::int64_t>(actuator_.size()); }

  // What following asks of the run's method.
  struct Followed {
    FixedStep& run;
    const double* first;

    const double* acceleration() const { return first; }

    bool accelerate(const JointState& state, const double* actuator, double* acceleration) {
      return run.accelerate(state, actuator, acceleration) < 0;
    }

    bool walk(const JointState& from, const double* actuator, double length, JointState& to) {
      const Counts kept = run.counts;
      const int known = run.known();
      int joint = -1;
      const bool good = run.step(from, actuator, length, to, joint) == Outcome::good;
      run.counts = kept, run.know(known);
      return good;
    }
  };

  // Looks what the steps up to that from `state` to `next` are off; the tick where that is too much is kept.
  void follow(std::int64_t tick, const JointState& state, const JointState& next, const double* actuator) {
    if (!asked || coarse.joint >= 0) return accumulated_.stop();
    const double* first = compared_ == tick ? nullptr : first_acceleration();
    if (first == nullptr) {
      first_.resize(state.position.size());
      accelerate(state, actuator, first_.data()), first = first_.data();
    }
    Followed followed{*this, first};
    int joint = -1;
    if (!accumulated_.look(state, next, followed)) return;
    const double error = accumulated_.largest(joint);
    if (error > AccumulatedError::most) coarse = {tick, error, joint, true}, accumulated_.stop();
  }

  // Of the step from `state` to next_ that tick `tick` begins with.
  Outcome judge(std::int64_t tick, double length, const JointState& state, const double* actuator, int& joint) {
    if (most_error_rate_ == 0.0) return Outcome::good;
    int suspect = 0, violent = 0;   // of either sign, counted without branches
    for (std::size_t i = 0; i < state.velocity.size(); ++i) {
      const double jump = (next_.velocity[i] - state.velocity[i]) * length;
      suspect |= jump * jump > suspect_jump * suspect_jump;
      violent |= jump * jump > violent_jump * violent_jump;
    }
    const bool now_and_then = !accumulated_.followed() && ((tick & (tick - 1)) == 0 || tick % 256 == 0);
    const bool due = asked && coarse.joint < 0 && (now_and_then || (suspect != 0 && grows(tick, state)));
    if (!due && violent == 0) return Outcome::good;
    const Outcome outcome = compare(tick, length, state, actuator, joint);
    return violent != 0 ? outcome : Outcome::good;
  }

  // Whether the jump of a suspected step is larger by half than the one that was looked at within the last eight ticks.
  bool grows(std::int64_t tick, const JointState& state) {
    double jump = 0.0;
    for (std::size_t i = 0; i < state.velocity.size(); ++i)
      jump = std::fmax(jump, std::fabs(next_.velocity[i] - state.velocity[i]));
    if (tick >= suspected_ && tick - suspected_ < 8 && jump <= 1.5 * suspected_jump_) return false;
    suspected_ = tick, suspected_jump_ = jump;
    return true;
  }

  Outcome compare(std::int64_t tick, double length, const JointState& state, const double* actuator, int& joint) {
    const Counts kept = counts;
    compared_ = tick;
    Outcome outcome = step(state, actuator, 0.5 * length, half_, joint);
    if (outcome == Outcome::good) outcome = step(half_, actuator, 0.5 * length, halves_, joint);
    counts = kept;
    if (outcome != Outcome::good) return outcome;
    for (std::size_t i = 0; i < state.position.size(); ++i) {
      const double error = std::fmax(std::fabs(next_.position[i] - halves_.position[i]),
                                     length * std::fabs(next_.velocity[i] - halves_.velocity[i]));
      const double way = std::fabs(next_.position[i] - state.position[i]);
      if (!(error <= 1.0 + 0.1 * way)) return joint = static_cast<int>(i), Outcome::coarse;
      if (coarse.joint < 0 && error > most_error_rate_ * length) coarse = {tick, error, static_cast<int>(i), false};
    }
    return Outcome::good;
  }

  const double most_error_rate_;
  JointState next_, half_, halves_, from_;
  std::vector<double> actuator_;
  std::int64_t suspected_ = -8;    // tick at which a jump was last looked at
  double suspected_jump_ = 0.0;    // rad/s or m/s
  double offset_ = 0.0, ahead_ = 0.0;
  Outcome outcome_ahead_ = Outcome::good;
  int joint_ahead_ = -1;
  AccumulatedError accumulated_;
  std::vector<double> first_;      // accelerations, where the step has not left them
  std::int64_t compared_ = -1;     // tick at which half steps were taken last
};

}  // namespace planar_chain
