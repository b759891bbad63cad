// Steps of a fixed size, one a tick, and estimates of their errors.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "../model/joint_forces.hpp"
#include "accumulated_error.hpp"
#include "integrator.hpp"

namespace planar_chain {

// A step that changes a velocity by more than suspect_jump rad or m per step may be checked; one by more than
// violent_jump always is.
constexpr double suspect_jump = 0.03, violent_jump = 0.5;

// One step a tick. step() changes the state only if the outcome is good; else `joint` is the joint to blame.
//
// Nothing controls the error of such steps. For the first seconds the accumulated error is estimated
// (accumulated_error.hpp). Where velocities jump, and later now and then, one step is compared with two half steps. The
// first step that is far off is kept for a warning. A violent step that is off by a whole rad or m ends the run. That
// depends on this step alone and not on earlier checks, so a restored run or a batch ends in the same way.
class FixedStep : public Motion {
 public:
  // `most_error_rate`: rad or m a second by which two half steps may differ; 0: the method itself finds steps that are
  // too long.
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

  double ensure_step(std::int64_t tick, double offset, double limit, const JointState& state, const double* actuator,
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

  Outcome state_at(double into, JointState& out, int& joint) override {
    if (into == ahead_) return out = next_, joint = joint_ahead_, outcome_ahead_;
    if (into == 0.0) return out = from_, Outcome::good;
    ++counts.rejected_steps;  // one of these takes the place of the whole step
    return step(from_, actuator_.data(), into, out, joint);
  }

  bool interpolates() const override { return false; }

 protected:
  // One step of `length` s.
  virtual Outcome step(const JointState& state, const double* actuator, double length, JointState& next,
                       int& joint) = 0;

  // Accelerations at a state; -1, or the joint whose pivot vanished. Nothing is counted.
  virtual int accelerate(const JointState& state, const double* actuator, double* acceleration) = 0;

  // Accelerations at the start of the last step, or null if it has not computed them.
  virtual const double* first_acceleration() const { return nullptr; }

  // What a step leaves for the next one; steps that only check must not change it.
  virtual int kept_stages() const { return 0; }
  virtual void keep_stages(int) {}

  const JointForces& forces_;
  const double tick_length_;

 private:
  std::int64_t work() const { return 16 * static_cast<std::int64_t>(actuator_.size()); }

  // The run's method as AccumulatedError takes it.
  struct Followed {
    FixedStep& run;
    const double* first;

    const double* acceleration() const { return first; }

    bool accelerate(const JointState& state, const double* actuator, double* acceleration) {
      return run.accelerate(state, actuator, acceleration) < 0;
    }

    bool walk(const JointState& from, const double* actuator, double length, JointState& to) {
      const Counts kept = run.counts;
      const int kept_stages = run.kept_stages();
      int joint = -1;
      const bool good = run.step(from, actuator, length, to, joint) == Outcome::good;
      run.counts = kept, run.keep_stages(kept_stages);
      return good;
    }
  };

  // Estimates the error of the steps up to the one from `state` to `next`; keeps the tick at which it is too large.
  void follow(std::int64_t tick, const JointState& state, const JointState& next, const double* actuator) {
    if (!asked || coarse.joint >= 0) return accumulated_.stop();
    const double* first = compared_ == tick ? nullptr : first_acceleration();
    if (first == nullptr) {
      first_.resize(state.position.size());
      accelerate(state, actuator, first_.data()), first = first_.data();
    }
    Followed followed{*this, first};
    int joint = -1;
    if (!accumulated_.check(state, next, followed)) return;
    const double error = accumulated_.largest(joint);
    if (error > AccumulatedError::most) coarse = {tick, error, joint, true}, accumulated_.stop();
  }

  // Checks the step from `state` to next_ that begins at tick `tick`.
  Outcome judge(std::int64_t tick, double length, const JointState& state, const double* actuator, int& joint) {
    if (most_error_rate_ == 0.0) return Outcome::good;
    int suspect = 0, violent = 0;  // of either sign, counted without branches
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

  // Whether the jump of a suspected step is larger by half than the one checked within the last eight ticks.
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
  std::int64_t suspected_ = -8;  // tick at which a jump was last checked
  double suspected_jump_ = 0.0;  // rad/s or m/s
  double offset_ = 0.0, ahead_ = 0.0;
  Outcome outcome_ahead_ = Outcome::good;
  int joint_ahead_ = -1;
  AccumulatedError accumulated_;
  std::vector<double> first_;   // accelerations, if the step has not computed them
  std::int64_t compared_ = -1;  // tick of the last half steps
};

}  // namespace planar_chain
