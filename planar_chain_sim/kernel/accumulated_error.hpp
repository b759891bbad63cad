// How far a run of fixed steps has come from the true motion: an estimate beside it, which changes no bit of it.
//
// Ticks are looked at some at a time. The same way is gone once more by steps `ratio` times as long (Richardson): both
// ends differ by (ratio^order - 1) times what the ticks are off. What was off before is carried on by going that way
// from a state that is off in the same direction, as the tangent map would: chaos makes it grow, damping makes it fade.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "joint_state.hpp"

namespace planar_chain {

class AccumulatedError {
 public:
  AccumulatedError(int joints, int order, double tick_length)
      : order_(order), tick_length_(tick_length), joints_(joints), first_(first_ticks(tick_length)), from_(joints),
        end_(joints), beside_(joints), work_(joints), off_(joints),
        carried_(joints), finer_(joints), fresh_(joints), beside_from_(joints), effort_(joints) {
    restart();
  }

  // s from a start in which errors are followed: chaos makes much more of the smallest one later than anybody can tell.
  static constexpr double horizon = 10.0;
  // rad or m that is too much.
  static constexpr double most = 0.03;

  // From the next state on, which is taken for right.
  void restart() {
    left_ = horizon / tick_length_ + 0.5, ticks_ = first_, done_ = -1;
    off_ = JointState(joints_), trusted_for_ = caution_left_ = 0, closed_ = false;
  }

  bool over() const { return left_ <= 0.0; }

  // Whether there is an estimate already and still.
  bool followed() const { return closed_ && !over(); }

  // After a tick from `state` to `next`. `walk(state, actuator, length, next)` takes a step of another length; false
  // where it cannot. True where the estimate has been made anew.
  template <class Walk>
  bool follow(const JointState& state, const JointState& next, const double* actuator, Walk&& walk) {
    if (done_ < 0) begin(state);
    for (int i = 0; i < joints_; ++i) effort_[i] += actuator[i];
    left_ -= 1.0;
    if (++done_ < ticks_) return false;
    for (double& effort : effort_) effort /= static_cast<double>(ticks_);
    close(next, walk);
    begin(next);
    return true;
  }

  // After a part of a tick, of which nothing is known: goes on from there.
  void skip() { done_ = -1; }

  // Largest error of a position, rad or m, and the joint.
  double largest(int& joint) const {
    double error = 0.0;
    for (int i = 0; i < joints_; ++i)
      if (std::fabs(off_.position[i]) > error) error = std::fabs(off_.position[i]), joint = i;
    return error;
  }

 private:
  // Two ways that end so near to each other, rad or m, are the same motion.
  static constexpr double near = 0.001;
  static constexpr std::int64_t most_ticks_ = 256;

  // As many as are 16 ms, a power of two.
  static std::int64_t first_ticks(double tick_length) {
    std::int64_t ticks = 1;
    while (ticks < 16 && 2.0 * static_cast<double>(ticks) * tick_length <= 0.0165) ticks *= 2;
    return ticks;
  }

  void begin(const JointState& state) {
    from_ = state, done_ = 0;
    std::fill(effort_.begin(), effort_.end(), 0.0);
  }

  template <class Walk>
  void close(const JointState& next, Walk& walk) {
    const double all = static_cast<double>(ticks_);
    double ratio = all, apart = 0.0;
    for (;; ratio = shorter(ratio)) {
      if (ratio == 1.0) ratio = 0.5;
      apart = go(from_, ratio, end_, walk) ? distance(next, end_) : HUGE_VAL;
      if (apart <= near || ratio < 1.0) break;
    }
    closed_ = apart < HUGE_VAL;
    if (!closed_) return;
    // Of these ticks, before carry() goes another way.
    const double part = 1.0 / (std::pow(ratio, order_) - 1.0);
    for (int i = 0; i < joints_; ++i) {
      fresh_.position[i] = part * (end_.position[i] - next.position[i]);
      fresh_.velocity[i] = part * (end_.velocity[i] - next.velocity[i]);
    }
    const double good = carry(ratio, walk);  // up to which both can be trusted
    for (int i = 0; i < joints_; ++i) {
      off_.position[i] += fresh_.position[i];
      off_.velocity[i] += fresh_.velocity[i];
    }
    --caution_left_;
    // Longer ones, if they are going to be near still, and if it is not long ago that they were too long.
    if (good < all) ticks_ = good < 1.0 ? 1 : static_cast<std::int64_t>(good), caution_left_ = caution;
    else if (apart <= near / std::pow(2.0, order_ + 1) && ticks_ < most_ticks_ && caution_left_ <= 0) ticks_ *= 2;
  }

  static double shorter(double ratio) { return ratio > 2.0 ? 0.5 * ratio : 0.5; }

  // The way of ticks_ ticks from `state` by steps of ratio * tick_length_.
  template <class Walk>
  bool go(const JointState& state, double ratio, JointState& end, Walk& walk) {
    const std::int64_t steps = static_cast<std::int64_t>(static_cast<double>(ticks_) / ratio);
    end = state;
    for (std::int64_t k = 0; k < steps; ++k) {
      if (!walk(end, effort_.data(), ratio * tick_length_, work_)) return false;
      std::swap(end, work_);
    }
    return true;
  }

  // Carries what is off along the way, of which end_ is the end by steps of that ratio; returns the ratio at which that
  // can be trusted. A step too long for a stiff joint makes differences grow that the motion does not show: where they
  // grow, steps half as long must tell the same.
  template <class Walk>
  double carry(double ratio, Walk& walk) {
    const double size = largest_of(off_);
    if (!(size > 1e-200)) return ratio;
    const double scale = 1e-6 / size;
    beside_from_ = from_;
    for (int i = 0; i < joints_; ++i) {
      beside_from_.position[i] += scale * off_.position[i];
      beside_from_.velocity[i] += scale * off_.velocity[i];
    }
    if (!spread(ratio, scale, carried_, walk)) return ratio;
    --trusted_for_;
    const double grown = largest_of(carried_) / size;
    const bool trusted = ratio <= trusted_ && trusted_for_ > 0 && grown < 4.0;
    if (grown > 1.2 && !trusted) {
      double wrong = 0.0;
      while (ratio > 0.5) {
        const double finer = 0.5 * ratio;
        if (!go(from_, finer, end_, walk) || !spread(finer, scale, finer_, walk)) break;
        double apart = 0.0;
        for (int i = 0; i < joints_; ++i) {
          apart = std::fmax(apart, std::fabs(finer_.position[i] - carried_.position[i]));
          apart = std::fmax(apart, std::fabs(finer_.velocity[i] - carried_.velocity[i]));
        }
        const bool same = apart <= 0.3 * largest_of(carried_);
        std::swap(carried_, finer_);
        if (same) break;
        wrong = ratio, ratio = finer;
      }
      trusted_ = ratio, trusted_for_ = trust;
      if (wrong > 0.0) ratio = std::fmax(0.5, 0.5 * ratio);
    }
    std::swap(off_, carried_);
    return ratio;
  }

  // What is off at the end.
  template <class Walk>
  bool spread(double ratio, double scale, JointState& carried, Walk& walk) {
    if (!go(beside_from_, ratio, beside_, walk)) return false;
    for (int i = 0; i < joints_; ++i) {
      carried.position[i] = (beside_.position[i] - end_.position[i]) / scale;
      carried.velocity[i] = (beside_.velocity[i] - end_.velocity[i]) / scale;
    }
    return std::isfinite(largest_of(carried));
  }

  static double largest_of(const JointState& off) {
    double size = 0.0;
    for (std::size_t i = 0; i < off.position.size(); ++i) {
      const double both = std::fabs(off.position[i]) + std::fabs(off.velocity[i]);
      if (!(both <= size)) size = both;
    }
    return size;
  }

  static double distance(const JointState& a, const JointState& b) {
    double most = 0.0;
    for (std::size_t i = 0; i < a.position.size(); ++i) {
      const double apart = std::fabs(a.position[i] - b.position[i]);
      if (!std::isfinite(apart) || !std::isfinite(a.velocity[i] - b.velocity[i])) return HUGE_VAL;
      most = std::fmax(most, apart);
    }
    return most;
  }

  // How long growth is trusted, and how long no more ticks are taken together after too many were: times of looking.
  static constexpr int trust = 16, caution = 16;

  const int order_;
  const double tick_length_;
  const int joints_;
  const std::int64_t first_;
  double left_ = 0.0;                      // ticks that are still followed
  std::int64_t ticks_ = 1, done_ = -1;     // how many are looked at together, how many are done; -1: none has begun
  bool closed_ = false;                    // whether any have been looked at
  JointState from_, end_, beside_, work_;  // where they began, where longer steps lead from there, and from beside it
  JointState off_, carried_, finer_;       // what the state is off; what of it is left a way later, and by finer steps
  JointState fresh_, beside_from_;
  std::vector<double> effort_;             // the sum, then the mean
  double trusted_ = 0.0;                   // ratio up to which growth is trusted
  int trusted_for_ = 0, caution_left_ = 0;
};

}  // namespace planar_chain
