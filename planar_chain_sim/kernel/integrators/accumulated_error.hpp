// Estimates the accumulated error of a run of fixed steps. The estimate changes no bit of the run.
//
// Ticks are checked in groups. The same time is integrated again by steps `ratio` times as long (Richardson): the two
// ends differ by (ratio^order - 1) times the error of the group. The error from before the group is propagated by the
// tangent map: chaos makes it grow, damping makes it fade.
//
// If ticks are short, one RK4 step of the tangent map is as long as a whole group (a quick check). It uses the run's
// own accelerations, and while the error is small only some of the checks do the Richardson part. If that step or the
// ticks are too long, the error is propagated by a second integration that starts from a state with this error.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "../arithmetic/rough_powers.hpp"
#include "../model/joint_state.hpp"

namespace planar_chain {

class AccumulatedError {
 public:
  AccumulatedError(int joints, int order, double tick_length)
      : order_(order), tick_length_(tick_length), joints_(joints), first_(first_ticks(tick_length)), from_(joints),
        end_(joints), beside_(joints), work_(joints), off_(joints), carried_(joints), finer_(joints), fresh_(joints),
        beside_from_(joints), effort_(joints), present_(joints), here_(4 * joints), half_way_(here_), there_(here_),
        slopes_(10 * joints) {
    restart();
  }

  // s after a start in which the error is estimated: later, chaos makes even the smallest error unpredictable.
  static constexpr double horizon = 10.0;
  // Error, rad or m, that is too large.
  static constexpr double most = 0.03;

  // Starts again from the next state, which is taken as exact.
  void restart() {
    left_ = horizon / tick_length_ + 0.5, ticks_ = first_, wait(1);
    off_ = JointState(joints_), trusted_for_ = caution_left_ = looks_ = 0, closed_ = false, fresh_size_ = 0.0;
    debt_ = gap_ = growth_ = 0.0;
    skip();
  }

  // Stops the estimate until restart().
  void stop() { left_ = 0.0, wait(std::numeric_limits<std::int64_t>::max()); }

  // Whether there is an estimate at present.
  bool followed() const { return closed_ && left_ > 0.0; }

  // Sets the effort of the next ticks.
  void effort(const double* actuator) {
    if (std::memcmp(present_.data(), actuator, present_.size() * sizeof(double)) == 0) return;
    add_effort();
    std::copy(actuator, actuator + joints_, present_.begin());
  }

  // Ticks until the next check.
  std::int64_t to_go() const { return to_go_; }

  // Counts ticks that have been made; whether it is time for a check.
  bool due(std::int64_t ticks) { return (to_go_ -= ticks) == 0; }

  // The check after the tick from `state` to `next`, when due() says so. The run's `method` has
  //   acceleration()                         the accelerations at `state`
  //   accelerate(state, actuator, out)       accelerations at another state; false if there are none
  //   walk(state, actuator, length, next)    a step of another length; false if it fails
  // Returns whether there is a new estimate.
  template <class Method>
  bool check(const JointState& state, const JointState& next, Method& method) {
    add_effort();
    left_ -= static_cast<double>(wait_);
    if (left_ <= 0.0) return stop(), false;
    if (done_ < 0) {
      leave_out();
      done_ = 0, effort_ = present_;
      if (!quick_) return from_ = state, close_after(1, next, method);
      return keep(here_, state, method), wait(ticks_ / 2), false;
    }
    if (!quick_) return close_after(wait_, next, method);
    done_ += wait_;
    if (done_ < ticks_) return keep(half_way_, state, method), wait(ticks_ / 2), false;
    keep(there_, state, method);
    quick_close(state, method);
    std::swap(here_, there_);
    done_ = 0, effort_ = present_;
    quick_ = quick_fits(least_quick_);
    if (pause()) return true;
    if (quick_) wait(ticks_ / 2);
    else from_ = state, close_after(1, next, method);
    return true;
  }

  // After a part of a tick, whose error is not estimated: starts a new group from there.
  void skip() {
    left_ -= static_cast<double>(wait_ - to_go_);
    done_ = -1, gap_ = 0.0, quick_ = quick_fits(least_quick_), wait(1);
  }

  // Largest error of a position, rad or m, and the joint.
  double largest(int& joint) const {
    double error = 0.0;
    for (int i = 0; i < joints_; ++i)
      if (std::fabs(off_.position[i]) > error) error = std::fabs(off_.position[i]), joint = i;
    return error;
  }

 private:
  // Two integrations whose ends differ by less than this, rad or m, follow the same motion.
  static constexpr double near = 0.001, quick_near = 0.02;
  // Number of ticks in a group, and the longest step of the tangent map, s.
  static constexpr std::int64_t most_ticks_ = 256, least_quick_ = 4, most_quick_ = 64;
  static constexpr double longest_quick = 0.07;
  // Ratio of the last term to the whole in a step of the tangent map: above these the step is wrong, or should be
  // halved; below the last one it may be doubled.
  static constexpr double wrong_part = 0.5, large_part = 0.15, small_part = 0.012;
  // One check in `seldom` does the Richardson part while the error is below this part of what is too large.
  static constexpr int seldom = 4;
  static constexpr double little = 0.1, little_of_first_order = 0.03;
  // With more joints than few_joints, checks may cost one tick in `share`, while the error is below very_little of what
  // is too large and ticks are short.
  static constexpr int few_joints = 8;
  static constexpr double share = 32.0, very_little = 0.01;

  // Ticks in 16 ms, as a power of two.
  static std::int64_t first_ticks(double tick_length) {
    std::int64_t ticks = 1;
    while (ticks < 16 && 2.0 * static_cast<double>(ticks) * tick_length <= 0.0165) ticks *= 2;
    return ticks;
  }

  void wait(std::int64_t ticks) { wait_ = to_go_ = marked_ = ticks; }

  bool quick_fits(std::int64_t least) const {
    return ticks_ >= least && static_cast<double>(ticks_) * tick_length_ <= longest_quick;
  }

  // Adds the effort of the ticks since the last call.
  void add_effort() {
    const double ticks = static_cast<double>(marked_ - to_go_);
    for (int i = 0; i < joints_; ++i) effort_[i] += ticks * present_[i];
    marked_ = to_go_;
  }

  // Whether to skip some ticks, to make up for the cost of the checks; leave_out() extrapolates their error.
  bool pause() {
    int joint = 0;
    if (joints_ <= few_joints || first_ < least_quick_ || debt_ < 1.0) return false;
    if (largest(joint) > very_little * most) return false;
    gap_ = std::floor(debt_), debt_ -= gap_, done_ = -1;
    wait(static_cast<std::int64_t>(gap_));
    return true;
  }

  static constexpr double natural = 0.6931471805599453;  // ln 2

  // Counts the cost of `work` additional ticks in `ticks` ticks of the run.
  void pay(double work, double ticks) { debt_ = std::fmax(debt_ + share * work - ticks, -share); }

  void leave_out() {
    if (gap_ == 0.0) return;
    const double times = rough_exponential(std::fmin(gap_ * std::fmax(growth_, -0.02), 100.0));
    for (int i = 0; i < joints_; ++i) off_.position[i] *= times, off_.velocity[i] *= times;
    add(times_ * gap_ / static_cast<double>(fresh_ticks_));
    gap_ = 0.0;
  }

  // Updates the mean rate of growth of the error over the last checks.
  void grown(double before, double after) {
    if (!(before > 1e-200 && after > 1e-200)) return;
    growth_ += (rough_log2(after / before) * natural / static_cast<double>(ticks_) - growth_) / 8.0;
  }

  // Stores (position, velocity, acceleration, effort) of the run at `state`.
  template <class Method>
  void keep(std::vector<double>& point, const JointState& state, Method& method) {
    const double* acceleration = method.acceleration();
    double *position = point.data(), *velocity = position + joints_;
    double *rate = velocity + joints_, *effort = rate + joints_;
    for (int i = 0; i < joints_; ++i) {
      position[i] = state.position[i], velocity[i] = state.velocity[i];
      rate[i] = acceleration[i], effort[i] = present_[i];
    }
  }

  // After `ticks` more ticks: checks the group if it is complete, and starts the next one from `next`.
  template <class Method>
  bool close_after(std::int64_t ticks, const JointState& next, Method& method) {
    done_ += ticks;
    if (done_ < ticks_) return wait(ticks_ - done_), false;
    close(next, method);
    quick_ = quick_fits(2 * least_quick_);
    if (pause()) return true;
    from_ = next, done_ = 0;
    std::fill(effort_.begin(), effort_.end(), 0.0);
    if (quick_) done_ = -1;
    wait(quick_ ? 1 : ticks_);
    return true;
  }

  // Error of the ticks that end at `next`, and the distance `apart` between the two ends; returns the ratio.
  template <class Method>
  double richardson(const JointState& next, double near, Method& method, double& apart) {
    double ratio = static_cast<double>(ticks_);
    for (;; ratio = shorter(ratio)) {
      if (ratio == 1.0) ratio = 0.5;
      apart = go(from_, ratio, end_, method) ? distance(next, end_) : HUGE_VAL;
      if (apart <= near || ratio < 1.0) break;
    }
    closed_ = apart < HUGE_VAL;
    const double part = 1.0 / (power(ratio, order_) - 1.0);
    for (int i = 0; i < joints_ && closed_; ++i) {
      fresh_.position[i] = part * (end_.position[i] - next.position[i]);
      fresh_.velocity[i] = part * (end_.velocity[i] - next.velocity[i]);
    }
    return ratio;
  }

  template <class Method>
  void close(const JointState& next, Method& method) {
    for (double& effort : effort_) effort /= static_cast<double>(ticks_);
    const double all = static_cast<double>(ticks_), before = largest_of(off_);
    double apart = 0.0;
    walked_ = 0;
    const double ratio = richardson(next, near, method, apart);
    if (!closed_) return pay(walked_, all);
    fresh_size_ = largest_of(fresh_), fresh_ticks_ = ticks_, times_ = 1.0, looks_ = 0;
    const double good = carry(ratio, method);  // largest ratio at which both can be trusted
    grown(before, largest_of(off_)), pay(walked_, all);
    add(1.0);
    --caution_left_;
    // Larger groups, if their ends will still be near and groups have not been too large recently.
    if (good < all) ticks_ = good < 1.0 ? 1 : static_cast<std::int64_t>(good), caution_left_ = caution;
    else if (apart <= near / power(2.0, order_ + 1) && ticks_ < most_ticks_ && caution_left_ <= 0) ticks_ *= 2;
  }

  void add(double times) {
    for (int i = 0; i < joints_; ++i) {
      off_.position[i] += times * fresh_.position[i];
      off_.velocity[i] += times * fresh_.velocity[i];
    }
  }

  // A quick check of the group from here_ through half_way_ to there_, which is at `state`.
  template <class Method>
  void quick_close(const JointState& state, Method& method) {
    const double all = static_cast<double>(ticks_);
    for (int i = 0; i < joints_; ++i) effort_[i] -= present_[i];  // the tick that begins there is not in the group
    const double part = tangent_step(method);
    const bool wrong = !(part <= wrong_part);
    int joint = 0;
    const double error = largest(joint) / most;
    const bool again = !closed_ || error > (order_ == 1 ? little_of_first_order : little) || looks_ % seldom == 0;
    if (wrong || again)
      for (int i = 0; i < joints_; ++i) {
        from_.position[i] = here_[i], from_.velocity[i] = here_[joints_ + i];
        from_.position_remainder[i] = from_.velocity_remainder[i] = 0.0;
      }
    if (wrong) {
      const std::int64_t half = ticks_ / 2;
      close(state, method);
      ticks_ = std::min(ticks_, half), caution_left_ = caution;
      return;
    }
    walked_ = 0;
    if (again) {
      for (double& effort : effort_) effort /= all;
      double apart = 0.0;
      richardson(state, quick_near, method, apart);
      if (!closed_) return pay(walked_ + 1, all);
      // It is estimated seldom and may have been larger in between.
      const double size = largest_of(fresh_);
      fresh_size_ = std::fmax(size, 0.5 * fresh_size_), fresh_ticks_ = ticks_;
      times_ = size > 0.0 ? fresh_size_ / size : 1.0;
    }
    ++looks_, --caution_left_;
    grown(largest_of(off_), largest_of(carried_)), pay(walked_ + 1, all);
    std::swap(off_, carried_);
    add(times_ * all / static_cast<double>(fresh_ticks_));
    if (part > large_part) ticks_ /= 2, caution_left_ = caution;
    else if (part < small_part && ticks_ < most_quick_ && caution_left_ <= 0 &&
             2.0 * all * tick_length_ <= longest_quick)
      ticks_ *= 2;
  }

  // Propagates the error by one RK4 step of the tangent map; returns the ratio of its last term to the whole.
  template <class Method>
  double tangent_step(Method& method) {
    const double length = static_cast<double>(ticks_) * tick_length_, before = largest_of(off_);
    if (!(before > 1e-200)) return carried_ = off_, 0.0;
    const int all = 2 * joints_;
    double *start = slopes_.data(), *one = start + all, *two = one + all, *three = two + all, *four = three + all;
    for (int i = 0; i < joints_; ++i) start[i] = off_.position[i], start[joints_ + i] = off_.velocity[i];
    if (!tangent(here_, start, start, 0.0, one, method) || !tangent(half_way_, start, one, 0.5 * length, two, method) ||
        !tangent(half_way_, start, two, 0.5 * length, three, method) ||
        !tangent(there_, start, three, length, four, method))
      return HUGE_VAL;
    double last = 0.0, after = 0.0;
    for (int i = 0; i < joints_; ++i) {
      double left_over = 0.0, size = 0.0;
      for (int k : {i, joints_ + i}) {
        left_over += std::fabs(one[k] - two[k] - three[k] + four[k]);
        start[k] += length / 6.0 * (one[k] + 2.0 * (two[k] + three[k]) + four[k]);
        size += std::fabs(start[k]);
      }
      last = std::fmax(last, length / 6.0 * left_over);
      if (!(size <= after)) after = size;
      carried_.position[i] = start[i], carried_.velocity[i] = start[joints_ + i];
    }
    return std::isfinite(after) ? last / std::fmax(before, after) : HUGE_VAL;
  }

  // Rate of change of the error start + length * slope at a point of the run.
  template <class Method>
  bool tangent(const std::vector<double>& point, const double* start, const double* slope, double length, double* out,
               Method& method) {
    const double *position = point.data(), *velocity = position + joints_, *rate = velocity + joints_;
    double largest = 0.0;
    for (int i = 0; i < joints_; ++i) {
      out[i] = start[joints_ + i] + length * slope[joints_ + i];
      beside_.position[i] = start[i] + length * slope[i];
      const double size = std::fabs(beside_.position[i]) + std::fabs(out[i]);
      if (!(size <= largest)) largest = size;
    }
    if (!std::isfinite(largest)) return false;
    const double scale = largest > 0.0 ? 1e-6 / largest : 1.0;
    for (int i = 0; i < joints_; ++i) {
      beside_.position[i] = position[i] + scale * beside_.position[i];
      beside_.velocity[i] = velocity[i] + scale * out[i];
      beside_.position_remainder[i] = beside_.velocity_remainder[i] = 0.0;
    }
    if (!method.accelerate(beside_, rate + joints_, out + joints_)) return false;
    for (int i = 0; i < joints_; ++i) out[joints_ + i] = (out[joints_ + i] - rate[i]) / scale;
    return true;
  }

  static double shorter(double ratio) { return ratio > 2.0 ? 0.5 * ratio : 0.5; }

  // Integrates ticks_ ticks from `state` by steps of ratio * tick_length_.
  template <class Method>
  bool go(const JointState& state, double ratio, JointState& end, Method& method) {
    const std::int64_t steps = static_cast<std::int64_t>(static_cast<double>(ticks_) / ratio);
    end = state;
    for (std::int64_t k = 0; k < steps; ++k) {
      ++walked_;
      if (!method.walk(end, effort_.data(), ratio * tick_length_, work_)) return false;
      std::swap(end, work_);
    }
    return true;
  }

  // Propagates the error over the group by a second integration; end_ is the end of the first one, by steps of the same
  // ratio. Returns the ratio at which the result can be trusted. A step too long for a stiff joint makes differences
  // grow although the motion does not: if they grow, steps half as long must give the same result.
  template <class Method>
  double carry(double ratio, Method& method) {
    const double size = largest_of(off_);
    if (!(size > 1e-200)) return ratio;
    const double scale = 1e-6 / size;
    beside_from_ = from_;
    for (int i = 0; i < joints_; ++i) {
      beside_from_.position[i] += scale * off_.position[i];
      beside_from_.velocity[i] += scale * off_.velocity[i];
    }
    if (!spread(ratio, scale, carried_, method)) return ratio;
    --trusted_for_;
    const double grown = largest_of(carried_) / size;
    const bool trusted = ratio <= trusted_ && trusted_for_ > 0 && grown < 4.0;
    if (grown > 1.2 && !trusted) {
      double wrong = 0.0;
      while (ratio > 0.5) {
        const double finer = 0.5 * ratio;
        if (!go(from_, finer, end_, method) || !spread(finer, scale, finer_, method)) break;
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

  // The error at the end, from the difference of the two integrations.
  template <class Method>
  bool spread(double ratio, double scale, JointState& carried, Method& method) {
    if (!go(beside_from_, ratio, beside_, method)) return false;
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

  // Number of checks for which growth is trusted, and for which groups stay small after one was too large.
  static constexpr int trust = 16, caution = 16;

  const int order_;
  const double tick_length_;
  const int joints_;
  const std::int64_t first_;
  double left_ = 0.0;                   // ticks for which the error is still estimated
  std::int64_t wait_ = 1, to_go_ = 1;   // ticks from the last check to the next, and how many of them are left
  std::int64_t marked_ = 1;             // to_go_ when the effort was last added
  std::int64_t ticks_ = 1, done_ = -1;  // ticks in a group, and how many of them are done; -1: no group has begun
  bool quick_ = false;                  // whether the next check is a quick one
  bool closed_ = false;                 // whether there is an estimate
  int looks_ = 0;
  JointState from_, end_, beside_, work_;  // start of the group; ends by longer steps, from there and with the error
  JointState off_, carried_, finer_;       // the error; the same after the group, and by finer steps
  JointState fresh_, beside_from_;         // error of the last checked fresh_ticks_ ticks; start with the error
  std::int64_t fresh_ticks_ = 1;
  double fresh_size_ = 0.0, times_ = 1.0;        // size of fresh_, which fades; the factor by which fresh_ is used
  std::vector<double> effort_, present_;         // sum, then mean, of the group's efforts; the present effort
  std::vector<double> here_, half_way_, there_;  // points of the run, see keep()
  std::vector<double> slopes_;                   // the error and the slopes of the tangent map
  double walked_ = 0.0, debt_ = 0.0;             // additional steps; ticks to skip for their cost
  double gap_ = 0.0, growth_ = 0.0;              // skipped ticks; the error grows by exp(growth_) in a tick
  double trusted_ = 0.0;                         // ratio up to which growth is trusted
  int trusted_for_ = 0, caution_left_ = 0;
};

}  // namespace planar_chain
