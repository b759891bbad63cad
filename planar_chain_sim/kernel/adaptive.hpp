// Steps of the method's own size, across ticks: the state at a tick is read from the step that covers it. Steps start
// anew only where the effort's bits or the state changed, so that the motion does not depend on how calls are cut.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "integrators.hpp"
#include "whole_turns.hpp"

namespace planar_chain {

// log2 x within 0.01 for positive normal x, and 2^x within 0.3 %: enough to choose a step by, and unlike libm's the same
// bits on every machine.
inline double rough_log2(double x) {
  std::uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  const int exponent = static_cast<int>(bits >> 52) - 1023;
  bits = (bits & 0xFFFFFFFFFFFFFu) | 0x3FF0000000000000u;
  double m;                                                // x = m 2^e, 1 <= m < 2
  std::memcpy(&m, &bits, sizeof m);
  return exponent + (m - 1.0) * (1.34 - 0.34 * (m - 1.0));
}
inline double rough_power_of_2(double x) {
  if (!(x > -1000.0)) return 0.0;
  if (x > 1000.0) x = 1000.0;
  const int whole = static_cast<int>(x + 1024.0) - 1024;   // rounds down
  const double part = x - whole;
  const std::uint64_t bits = static_cast<std::uint64_t>(whole + 1023) << 52;
  double power;
  std::memcpy(&power, &bits, sizeof power);
  return power * (1.0 + part * (0.6565 + 0.3435 * part));
}

// x^(1/n) for x >= 0, within 1 %.
inline double rough_root(double x, int n) { return x > 0.0 ? rough_power_of_2(rough_log2(x) / n) : 0.0; }

class AdaptiveStep : public Motion {
 public:
  AdaptiveStep(const JointForces& forces, const Chain& chain, double tick_length)
      : forces_(forces), most_(chain.joint_count, std::numeric_limits<double>::infinity()), tick_length_(tick_length),
        running_(chain.joint_count), base_(chain.joint_count), next_(chain.joint_count) {
    for (int i = 1; i <= chain.link_count(); ++i)
      if (chain.links[i].turns()) most_[chain.links[i].rotation] = far_angle;
  }

  Progress advance(double now, std::int64_t tick, std::int64_t ticks, JointState& state,
                   const double* actuator) override {
    prepare(now, tick, state, actuator);
    Progress progress;
    while (progress.ticks < ticks) {
      std::int64_t covered = progress.ticks + 1;
      if (covers(since_origin(tick + covered))) {
        covered = last_covered(tick, ticks);
        progress.outcome = open(base_, progress.joint);
        if (progress.outcome != Outcome::good) break;
        read_at(since_origin(tick + covered), next_);
        std::swap(state, next_);
        progress.ticks = covered;
        continue;
      }
      progress.outcome = extend(progress.joint);
      if (progress.outcome != Outcome::good) break;
    }
    return progress;
  }

  bool reach(double now, std::int64_t tick, double time, JointState& state, const double* actuator,
             Progress& progress) override {
    prepare(now, tick, state, actuator);
    const double wanted = time - origin_ * tick_length_ - origin_offset_;
    while (progress.outcome == Outcome::good && !covers(wanted)) progress.outcome = extend(progress.joint);
    if (progress.outcome == Outcome::good) progress.outcome = open(base_, progress.joint);
    if (progress.outcome != Outcome::good) return true;
    read_at(wanted, next_);
    std::swap(state, next_);
    return true;
  }

  double look(std::int64_t tick, double offset, double /*limit*/, const JointState& state, const double* actuator,
              bool passed, Progress& progress) override {
    prepare(static_cast<double>(tick) * tick_length_ + offset, tick, state, actuator);
    if (length_ == 0.0) origin_offset_ = offset;   // not what is left of it in the sum
    shown_from_ = since_origin(tick);
    if (length_ == 0.0 || passed || into_step(offset) >= length_) {
      progress.outcome = extend(progress.joint);
      if (progress.outcome != Outcome::good) return 0.0;
      ++number;
    }
    progress.outcome = open(base_, progress.joint);
    return length_;
  }

  double into_step(double offset) const override { return ((shown_from_ + offset) - from_) - from_low_; }
  double behind_tick(double into) const override { return (from_ + into) - shown_from_; }

  Outcome show(double into, JointState& out, int&) override {
    read_from_rest(into, base_, out);
    return Outcome::good;
  }

  bool reads_densely() const override { return true; }

  void forget() override { under_way_ = false; }

  std::vector<double> save() const override {
    std::vector<double> all = {
        under_way_ ? 1.0 : 0.0, static_cast<double>(origin_), origin_offset_, from_, from_low_, length_, proposal_};
    for (const auto* part : {&base_.position, &base_.velocity, &base_.position_remainder, &base_.velocity_remainder,
                             &running_})
      all.insert(all.end(), part->begin(), part->end());
    return all;
  }

  void load(const std::vector<double>& all) override {
    under_way_ = all[0] != 0.0, origin_ = static_cast<std::int64_t>(all[1]), origin_offset_ = all[2];
    from_ = all[3], from_low_ = all[4], length_ = all[5], proposal_ = all[6];
    ++number;
    const double* at = all.data() + 7;
    for (auto* part : {&base_.position, &base_.velocity, &base_.position_remainder, &base_.velocity_remainder,
                       &running_})
      for (double& value : *part) value = *at++;
    int joint;
    if (under_way_ && length_ > 0.0) {
      const Counts kept = counts;
      const double length = length_, proposal = proposal_;
      expand(base_, running_.data(), length_, proposal_, joint, true);
      length_ = length, proposal_ = proposal, counts = kept;
    }
  }

 protected:
  // Prepares the step that starts at `base`. `length` comes in as what the last step proposed (0: none) and goes out as
  // the length taken, `proposal` as what the next may try. `again`: take exactly `length`, which was accepted before.
  virtual Outcome expand(const JointState& base, const double* actuator, double& length, double& proposal, int& joint,
                         bool again) = 0;

  // Called before the step that starts at `base` is read anywhere but at its end: what only that needs.
  virtual Outcome open(const JointState& /*base*/, int& /*joint*/) { return Outcome::good; }

  // State at `offset` into the step that starts at `base`, as an unevaluated sum.
  virtual void read(double offset, const JointState& base, JointState& out) const = 0;

  // The same with the right derivatives at the start, so that what sets out from rest goes where it is accelerated.
  virtual void read_from_rest(double offset, const JointState& base, JointState& out) const { read(offset, base, out); }

  // |position| that a tolerance is relative to: whole turns do not make an angle less exact.
  double size_of_position(int joint, const JointState& state) const {
    const double size = std::fabs(state.position[joint]);
    return size > most_[joint] ? most_[joint] : size;
  }

  const JointForces& forces_;

 private:
  void prepare(double now, std::int64_t tick, const JointState& state, const double* actuator) {
    if (under_way_ && std::memcmp(running_.data(), actuator, running_.size() * sizeof(double)) == 0) return;
    std::memcpy(running_.data(), actuator, running_.size() * sizeof(double));
    base_ = state;
    origin_ = tick, origin_offset_ = now - static_cast<double>(tick) * tick_length_;
    from_ = from_low_ = length_ = proposal_ = 0.0;
    under_way_ = true;
  }

  // Times are counted from where steps began, in whole ticks: a motion does not depend on when it happens.
  double since_origin(std::int64_t tick) const {
    return static_cast<double>(tick - origin_) * tick_length_ - origin_offset_;
  }

  bool covers(double time) const { return time <= from_ + length_; }

  // Largest k <= ticks with tick + k covered.
  std::int64_t last_covered(std::int64_t tick, std::int64_t ticks) const {
    if (covers(since_origin(tick + ticks))) return ticks;
    std::int64_t k = static_cast<std::int64_t>((origin_offset_ + from_ + length_) / tick_length_) + origin_ - tick + 1;
    while (!covers(since_origin(tick + k))) --k;
    return k;
  }

  void read_at(double time, JointState& out) const { read((time - from_) - from_low_, base_, out); }

  // Goes on by one more step.
  Outcome extend(int& joint) {
    if (length_ > 0.0) {
      read(length_, base_, next_);
      joint = first_not_finite(next_);
      if (joint >= 0) return Outcome::not_finite;
      std::swap(base_, next_);
      double sum, lost;
      add_compensated(from_, from_low_, length_, sum, lost);
      from_ = sum, from_low_ = lost;
    }
    double length = proposal_;
    const Outcome outcome = expand(base_, running_.data(), length, proposal_, joint, false);
    length_ = 0.0;
    if (outcome != Outcome::good) return outcome;
    if (!(from_ + length > from_)) return joint = 0, Outcome::stalled;
    length_ = length;
    ++counts.steps;
    return Outcome::good;
  }

  std::vector<double> most_;
  const double tick_length_;
  std::vector<double> running_;  // the effort of the steps under way
  JointState base_, next_;       // the state at from_
  std::int64_t origin_ = 0;      // tick at or behind which steps began
  double origin_offset_ = 0.0;   // s, how far behind
  double from_ = 0.0, from_low_ = 0.0, length_ = 0.0;  // s from there, where the present step starts; its length
  double proposal_ = 0.0, shown_from_ = 0.0;
  bool under_way_ = false;
};

}  // namespace planar_chain
