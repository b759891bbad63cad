// Steps of the method's own size, across ticks: the state at a tick is read from the step that covers it. Steps start
// anew only where the effort's bits or the state changed, so that the motion does not depend on how calls are cut.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "../arithmetic/compensated_sum.hpp"
#include "../arithmetic/rough_powers.hpp"
#include "../model/joint_forces.hpp"
#include "../model/whole_turns.hpp"
#include "integrator.hpp"

namespace planar_chain {

class AdaptiveStep : public Motion {
 public:
  AdaptiveStep(const JointForces& forces, const Chain& chain, double tick_length)
      : forces_(forces), most_(chain.joint_count, std::numeric_limits<double>::infinity()), tick_length_(tick_length),
        steps_(chain.joint_count), kept_(chain.joint_count), next_(chain.joint_count) {
    for (int i = 1; i <= chain.link_count(); ++i)
      if (chain.links[i].turns()) most_[chain.links[i].rotation] = far_angle;
  }

  Progress advance(double now, std::int64_t tick, std::int64_t ticks, JointState& state,
                   const double* actuator) override {
    Progress progress;
    if (stopped(joints())) progress.outcome = Outcome::interrupted;
    else prepare(now, tick, state, actuator);
    while (progress.outcome == Outcome::good && progress.ticks < ticks) {
      // If there is no step yet, the next tick may be at the present time.
      if (steps_.length == 0.0 || !covers(since_origin(tick + progress.ticks + 1))) {
        progress.outcome = extend(progress.joint);
        continue;
      }
      progress.outcome = open(steps_.base, progress.joint);
      if (progress.outcome != Outcome::good) break;
      progress.ticks = last_covered(tick, ticks);
      read_at(since_origin(tick + progress.ticks), next_);
      std::swap(state, next_);
      keeping_ = false;
    }
    if (progress.outcome != Outcome::good) go_back();
    return progress;
  }

  bool advance_to(double now, std::int64_t tick, double time, JointState& state, const double* actuator,
                  Progress& progress) override {
    prepare(now, tick, state, actuator);
    const double wanted = since_origin_at(time);
    while (progress.outcome == Outcome::good && (steps_.length == 0.0 || !covers(wanted)))
      progress.outcome = extend(progress.joint);
    if (progress.outcome == Outcome::good) progress.outcome = open(steps_.base, progress.joint);
    if (progress.outcome != Outcome::good) return go_back(), true;
    read_at(wanted, next_);
    std::swap(state, next_);
    keeping_ = false;
    return true;
  }

  double ensure_step(std::int64_t tick, double offset, double /*limit*/, const JointState& state,
                     const double* actuator, bool passed, Progress& progress) override {
    prepare(static_cast<double>(tick) * tick_length_ + offset, tick, state, actuator);
    if (steps_.length == 0.0) steps_.origin_offset = offset;  // exactly, and not as the sum has rounded it
    shown_from_ = since_origin(tick);
    if (steps_.length == 0.0 || passed || into_step(offset) >= steps_.length) {
      progress.outcome = extend(progress.joint);
      if (progress.outcome != Outcome::good) return 0.0;
      ++number;
    }
    progress.outcome = open(steps_.base, progress.joint);
    return steps_.length;
  }

  double into_step(double offset) const override { return ((shown_from_ + offset) - steps_.from) - steps_.from_low; }
  double behind_tick(double into) const override { return (steps_.from + into) - shown_from_; }

  Outcome state_at(double into, JointState& out, int&) override {
    read_from_rest(into, steps_.base, out, 0, joints());
    return Outcome::good;
  }

  Outcome joint_at(int wanted, double into, JointState& out, int&) override {
    read_from_rest(into, steps_.base, out, wanted, wanted + 1);
    return Outcome::good;
  }

  bool spans(std::int64_t tick, double from, double to, double& into) override {
    if (!steps_.under_way || steps_.length == 0.0) return false;
    shown_from_ = since_origin(tick), into = into_step(to);
    return into_step(from) < steps_.length && into <= steps_.length;
  }

  bool interpolates() const override { return true; }

  void forget() override { steps_.under_way = keeping_ = false; }

  void save(std::vector<double>& all) const override {
    all.push_back(static_cast<double>(Kept::adaptive)), all.push_back(steps_.under_way ? 1.0 : 0.0);
    if (!steps_.under_way) return;
    for (const double number : {static_cast<double>(steps_.origin), steps_.origin_offset, steps_.from, steps_.from_low,
                                steps_.length, steps_.proposal})
      all.push_back(number);
    const JointState& base = steps_.base;
    for (const auto* part :
         {&base.position, &base.velocity, &base.position_remainder, &base.velocity_remainder, &steps_.running})
      all.insert(all.end(), part->begin(), part->end());
  }

  bool load(KeptNumbers& kept, std::int64_t tick, double now, const JointState* state) override {
    forget();
    bool under_way = false;
    constexpr double most = static_cast<double>(most_ticks);
    if (!kept.is(Kept::adaptive) || !kept.whole(under_way, 0, 1)) return false;
    if (!under_way) return kept.left() == 0;
    if (!kept.whole(steps_.origin, -most, most) || !kept.at_least_zero(steps_.origin_offset) ||
        !kept.at_least_zero(steps_.from) || !kept.number(steps_.from_low) || !kept.at_least_zero(steps_.length) ||
        !kept.number(steps_.proposal) || steps_.length == 0.0 || steps_.from + steps_.from_low != steps_.from ||
        kept.left() != 5 * steps_.running.size())
      return false;
    JointState& base = steps_.base;
    for (auto* part :
         {&base.position, &base.velocity, &base.position_remainder, &base.velocity_remainder, &steps_.running})
      if (!kept.numbers(*part)) return false;
    steps_.under_way = true, ++number;
    const Counts counted = counts;
    bool good = resume() && covers_present(tick, now);
    if (good && state != nullptr) good = kept.cut ? leads_near(tick, now, *state) : leads_to(tick, now, *state);
    counts = counted;
    return good;
  }

 protected:
  // Prepares the step that starts at `base`. `length` comes in as what the last step proposed (0: none) and goes out as
  // the length taken, `proposal` as what the next may try. `again`: take exactly `length`, which was accepted before.
  virtual Outcome expand(const JointState& base, const double* actuator, double& length, double& proposal, int& joint,
                         bool again) = 0;

  // Prepares interpolation; called before the step that starts at `base` is read anywhere but at its end.
  virtual Outcome open(const JointState& /*base*/, int& /*joint*/) { return Outcome::good; }

  // State of the joints from `first` to before `end`, and perhaps others, at `offset` into the step that starts at
  // `base`, as an unevaluated sum.
  virtual void read(double offset, const JointState& base, JointState& out, int first, int end) const = 0;

  // The same with exact derivatives at the start, so that a joint at rest begins in the direction of its acceleration.
  virtual void read_from_rest(double offset, const JointState& base, JointState& out, int first, int end) const {
    read(offset, base, out, first, end);
  }

  // |position| for a relative tolerance: whole turns do not make it wider.
  double size_of_position(int joint, const JointState& state) const {
    const double size = std::fabs(state.position[joint]);
    return size > most_[joint] ? most_[joint] : size;
  }

  const JointForces& forces_;

 private:
  // Steps that go on under one effort, up to the present one.
  struct Steps {
    std::vector<double> running;                      // the effort
    JointState base;                                  // the state at `from`
    std::int64_t origin = 0;                          // tick at or behind which they began
    double origin_offset = 0.0;                       // s, how far behind
    double from = 0.0, from_low = 0.0, length = 0.0;  // s from there to the start of the present step; its length
    double proposal = 0.0;                            // s, length of the next one
    bool under_way = false;

    explicit Steps(int joints) : running(joints), base(joints) {}
  };

  int joints() const { return static_cast<int>(steps_.running.size()); }

  void prepare(double now, std::int64_t tick, const JointState& state, const double* actuator) {
    if (steps_.under_way && std::memcmp(steps_.running.data(), actuator, joints() * sizeof(double)) == 0) return;
    if (!keeping_) std::swap(steps_, kept_), keeping_ = true;
    std::memcpy(steps_.running.data(), actuator, joints() * sizeof(double));
    steps_.base = state;
    steps_.origin = tick, steps_.origin_offset = now - static_cast<double>(tick) * tick_length_;
    steps_.from = steps_.from_low = steps_.length = steps_.proposal = 0.0;
    steps_.under_way = true;
  }

  // Keeps the steps that have led to the present state, except `base`, which the caller is about to replace.
  void keep() {
    if (keeping_) return;
    kept_.running = steps_.running;
    std::swap(kept_.base, steps_.base);
    kept_.origin = steps_.origin, kept_.origin_offset = steps_.origin_offset, kept_.from = steps_.from;
    kept_.from_low = steps_.from_low, kept_.length = steps_.length, kept_.proposal = steps_.proposal;
    kept_.under_way = steps_.under_way, keeping_ = true;
  }

  // Back to the steps that have led to the present state.
  void go_back() {
    if (!keeping_) return;
    std::swap(steps_, kept_), keeping_ = false;
    if (steps_.under_way && steps_.length > 0.0) resume();
  }

  // Repeats the present step; false if that fails.
  bool resume() {
    const Counts counted = counts;
    double length = steps_.length, proposal = steps_.proposal;
    int joint;
    const bool good = expand(steps_.base, steps_.running.data(), length, proposal, joint, true) == Outcome::good;
    counts = counted;
    return good;
  }

  // Whether these steps give that state at that time, bit for bit.
  bool leads_to(std::int64_t tick, double now, const JointState& state) {
    const bool whole = now == static_cast<double>(tick) * tick_length_;
    const double time = whole ? since_origin(tick) : since_origin_at(now);
    int joint;
    if (!covers(time) || open(steps_.base, joint) != Outcome::good) return false;
    read_at(time, next_);
    const auto same = [](const std::vector<double>& some, const std::vector<double>& others) {
      return std::memcmp(some.data(), others.data(), some.size() * sizeof(double)) == 0;
    };
    return same(next_.position, state.position) && same(next_.velocity, state.velocity) &&
           same(next_.position_remainder, state.position_remainder) &&
           same(next_.velocity_remainder, state.velocity_remainder);
  }

  // Whether these steps give approximately that state at that time.
  bool leads_near(std::int64_t tick, double now, const JointState& state) {
    int joint;
    if (open(steps_.base, joint) != Outcome::good) return false;
    shown_from_ = since_origin(tick);
    read_from_rest(into_step(now - static_cast<double>(tick) * tick_length_), steps_.base, next_, 0, joints());
    const auto near = [](double one, double other) {
      return std::fabs(one - other) <= 1e-9 * (1.0 + std::fabs(other));
    };
    for (int i = 0; i < joints(); ++i)
      if (!near(next_.position[i], state.position[i]) || !near(next_.velocity[i], state.velocity[i])) return false;
    return true;
  }

  // Whether that time is in the present step, up to rounding, and the step is longer than rounding.
  bool covers_present(std::int64_t tick, double now) const {
    const double time = since_origin(tick) + (now - static_cast<double>(tick) * tick_length_);
    const double slack =
        16.0 * std::numeric_limits<double>::epsilon() * (std::fabs(time) + tick_length_ + steps_.origin_offset);
    return time >= steps_.from - slack && time <= steps_.from + steps_.length + slack && 1e4 * steps_.length >= slack;
  }

  // Times are counted in whole ticks from where steps began, so that a motion does not depend on its starting time.
  double since_origin(std::int64_t tick) const {
    return static_cast<double>(tick - steps_.origin) * tick_length_ - steps_.origin_offset;
  }
  double since_origin_at(double time) const { return time - steps_.origin * tick_length_ - steps_.origin_offset; }

  bool covers(double time) const { return time <= steps_.from + steps_.length; }

  // Largest k <= ticks with tick + k covered.
  std::int64_t last_covered(std::int64_t tick, std::int64_t ticks) const {
    if (covers(since_origin(tick + ticks))) return ticks;
    const double reached = (steps_.origin_offset + steps_.from + steps_.length) / tick_length_;
    std::int64_t k = static_cast<std::int64_t>(reached) + steps_.origin - tick + 1;
    while (!covers(since_origin(tick + k))) --k;
    return k;
  }

  void read_at(double time, JointState& out) const {
    read((time - steps_.from) - steps_.from_low, steps_.base, out, 0, joints());
  }

  // Makes one more step.
  Outcome extend(int& joint) {
    if (stopped(64 * joints())) return Outcome::interrupted;
    if (steps_.length > 0.0) {
      read(steps_.length, steps_.base, next_, 0, joints());
      joint = first_not_finite(next_);
      if (joint >= 0) return Outcome::not_finite;
      keep();
      std::swap(steps_.base, next_);
      double sum, lost;
      add_compensated(steps_.from, steps_.from_low, steps_.length, sum, lost);
      steps_.from = sum, steps_.from_low = lost;
    }
    double length = steps_.proposal;
    const Outcome outcome = expand(steps_.base, steps_.running.data(), length, steps_.proposal, joint, false);
    steps_.length = 0.0;
    if (outcome != Outcome::good) return outcome;
    if (!(steps_.from + length > steps_.from)) return joint = 0, Outcome::stalled;
    steps_.length = length;
    ++counts.steps;
    return Outcome::good;
  }

  std::vector<double> most_;
  const double tick_length_;
  Steps steps_, kept_;  // those under way; those that led to the last whole tick, where `keeping_`
  bool keeping_ = false;
  JointState next_;
  double shown_from_ = 0.0;
};

}  // namespace planar_chain
