// A motion of the moving part. Each step is searched for the first time at which a watch, a smooth function of the
// state, becomes negative (event_search.hpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "../integrators/hermite_step.hpp"
#include "../integrators/methods.hpp"
#include "event_search.hpp"
#include "holding.hpp"
#include "holding_effort.hpp"
#include "moving_part.hpp"

namespace planar_chain {

// A function that must not become negative.
struct Watch {
  enum Kind { above_lower, below_upper, sliding, lambda_below_most, lambda_above_least } kind;
  int joint, index;  // of the chain, of the moving part
};

class WatchedMotion {
 public:
  std::vector<Watch> watches;
  std::vector<int> violated;        // after Found::crossing: which of them
  JointState moved{0}, located{0};  // of the moving part: where a step starts, and where coast() and find() got to

  WatchedMotion(const MethodData& method, double step, Holding& holding, MovingPart& part, HoldingEffort& effort)
      : method_(method), step_(step), holding_(holding), part_(part), effort_(effort) {}

  // Null where nothing moves.
  Motion* motion() const { return motion_.get(); }

  // Sums over all motions so far.
  Counts counts() const {
    Counts all = before_;
    if (motion_) all.add(motion_->counts);
    return all;
  }

  double length() const { return length_; }  // s, of the step

  // To be called before and after the moving part changes.
  void drop() {
    if (motion_) before_.add(motion_->counts);
    motion_.reset();
  }

  void fit() {
    for (JointState* state : {&moved, &later_, &located}) *state = JointState(part_.moving());
  }

  // Starts the method afresh and lists the watches, with joints standing as in `standing_at`.
  void begin(const JointState& standing_at, Lookout* lookout) {
    watches.clear(), violated.clear(), holds_ = false, number_ = -1, shown_ = none;
    effort_.full = standing_at;
    for (int k = 0; k < part_.moving(); ++k) {
      const int j = part_.joint_of(k);
      if (holding_.lower[j] > -Holding::infinity) watches.push_back({Watch::above_lower, j, k});
      if (holding_.upper[j] < Holding::infinity) watches.push_back({Watch::below_upper, j, k});
      if (holding_.friction[j] > 0.0) watches.push_back({Watch::sliding, j, k});
    }
    if (part_.moving() == 0) return drop();
    for (int j = 0; j < static_cast<int>(holding_.standing.size()); ++j) {
      if (!holding_.standing[j]) continue;
      effort_.full.velocity[j] = effort_.full.velocity_remainder[j] = 0.0;
      if (holding_.most(j) < Holding::infinity) watches.push_back({Watch::lambda_below_most, j, -1});
      if (holding_.least(j) > -Holding::infinity) watches.push_back({Watch::lambda_above_least, j, -1});
      holds_ = true;
    }
    search_.resize(static_cast<int>(watches.size()));
    values_.resize(watches.size());
    if (motion_) motion_->forget();
    else motion_ = make_motion(method_, part_.chain(), part_.form(), part_.forces(), step_, part_.dense());
    motion_->set_lookout(lookout);
  }

  // A step from `moved`. A fixed step may fail where an event would end it soon, as with strong friction; then a part
  // of it is taken.
  bool ensure_step(std::int64_t tick, double at, double to, bool passed, Progress& progress) {
    length_ = motion_->ensure_step(tick, at, to, moved, part_.effort.data(), passed, progress);
    if (method_.adaptive || watches.empty() || progress.outcome == Outcome::interrupted)
      return progress.outcome == Outcome::good;
    if (progress.outcome == Outcome::good && state_at(length_, later_, progress)) return true;
    const Progress first = progress;
    for (double part = 0.0625; part > 1e-10; part *= 0.0625) {
      progress.outcome = Outcome::good;
      length_ = motion_->ensure_step(tick, at, at + part * (to - at), moved, part_.effort.data(), passed, progress);
      if (progress.outcome == Outcome::interrupted) return false;
      if (progress.outcome == Outcome::good && state_at(length_, later_, progress)) return true;
    }
    progress.outcome = first.outcome, progress.joint = first.joint;
    return false;
  }

  // Whether the step under way reaches `step` s behind the tick without an event; `located` is then the state there.
  bool coast(std::int64_t tick, double from) {
    double into;
    if (number_ != motion_->number || !motion_->spans(tick, from, step_, into)) return false;
    if ((!watches.empty() && searched_ < into) || (!violated.empty() && event_at_ <= into)) return false;
    Progress progress;
    if (!state_at(into, located, progress)) return false;
    return shown_ = none, true;
  }

  // Looks for the first event within `into` s of the step; if there is one, `into` is where, and `violated` says what.
  // Then `located` is there.
  Found find(double& into, Progress& progress) {
    read_at_ = none;
    Found found = watches.empty() ? Found::nothing : watch(into, progress);
    if (found == Found::failed || shown_ == into) return shown_ = none, found;
    shown_ = none;
    if (motion_->interpolates() && read_at_ == into) return std::swap(located, later_), found;
    return state_at(into, located, progress) ? found : Found::failed;
  }

 private:
  Found watch(double& into, Progress& progress) {
    if (number_ != motion_->number) {
      number_ = motion_->number, searched_ = 0.0, violated.clear(), search_.forget();
      if (!prepare_search(progress)) return Found::failed;
    }
    while (violated.empty() && searched_ < into) {
      const double end = end_of_panel();
      const auto evaluate = [&](double time, double* values) { return find_values(time, values, progress); };
      Found found = search_.find(evaluate, searched_, end);
      searched_ = found == Found::crossing ? search_.high : end;
      if (found == Found::crossing) found = locate(progress);
      if (found == Found::crossing && !motion_->interpolates()) found = locate_by_steps(progress);
      if (found == Found::poor) found = end_step_there(progress);
      if (found == Found::failed) return found;
      into = std::fmin(into, length_);
    }
    if (violated.empty() || event_at_ > into) return Found::nothing;
    into = event_at_;
    return Found::crossing;
  }

  // A step is searched in panels, no farther ahead than needed; each panel is as long as all before it. The first one
  // is short, for motions that have just begun. A step can be extremely long, as when only gravity acts on a slide.
  double end_of_panel() const {
    if (!motion_->interpolates()) return length_;
    double end = std::fmin(0.0625 * length_, 4.0 * step_);
    if (end == 0.0) return length_;  // no number is that small
    while (end <= searched_) end *= 2.0;
    return std::fmin(end, length_);
  }

  // Prepares the search of a step: the margin of lambda for rounding, and the two ends to interpolate between.
  bool prepare_search(Progress& progress) {
    if (!motion_->interpolates() || holds_) {
      if (!state_at(0.0, located, progress) || !effort_.accelerate(located, progress)) return false;
      if (holds_) {
        part_.scatter(located, effort_.full);
        if (!holding_.factorise(effort_.full, effort_.actuator.data(), progress)) return false;
        effort_.find(located);
        effort_.find_margin();
      }
      if (motion_->interpolates()) return find_values_of(located, search_.known_at(0.0)), true;
      between_.begin(located, part_.acceleration);
      if (!state_at(length_, later_, progress) || !effort_.accelerate(later_, progress)) return false;
      between_.end(later_, part_.acceleration, length_);
    }
    return true;
  }

  // later_ <- the state `time` s into the step: by the method's interpolation, or else by that between its ends.
  bool read(double time, Progress& progress) {
    read_at_ = time;
    if (motion_->interpolates()) return state_at(time, later_, progress);
    between_.read(time, later_, 0, part_.moving());
    return true;
  }

  // The same where only joint k of the moving part is needed.
  bool read_joint(int k, double time, Progress& progress) {
    read_at_ = none;
    if (!motion_->interpolates()) return between_.read(time, later_, k, k + 1), true;
    progress.outcome = motion_->joint_at(k, time, later_, progress.joint);
    if (progress.outcome != Outcome::good) return false;
    if (std::isfinite(later_.position[k]) && std::isfinite(later_.velocity[k])) return true;
    progress.outcome = Outcome::not_finite, progress.joint = k;
    return false;
  }

  bool find_values(double time, double* values, Progress& progress) {
    return read(time, progress) && find_values_at(later_, values, progress);
  }

  bool find_value(int w, double time, double& found, Progress& progress) {
    if (watches[w].index >= 0) {
      if (!read_joint(watches[w].index, time, progress)) return false;
    } else {  // of lambda
      if (!read(time, progress) || !effort_.accelerate(later_, progress)) return false;
      effort_.find(later_);
    }
    found = value(watches[w], later_);
    return true;
  }

  bool find_values_at(const JointState& moved, double* values, Progress& progress) {
    if (holds_) {
      if (!effort_.accelerate(moved, progress)) return false;
      effort_.find(moved);
    }
    find_values_of(moved, values);
    return true;
  }

  // The same where lambda is known.
  void find_values_of(const JointState& moved, double* values) const {
    for (std::size_t w = 0; w < watches.size(); ++w) values[w] = value(watches[w], moved);
  }

  // Finds the first crossing in an interval in which some watches cross zero.
  Found locate(Progress& progress) {
    double low = search_.low, high = search_.high;
    values_.assign(search_.high_values(), search_.high_values() + watches.size());
    violated.clear();
    std::vector<int> others = search_.crossing;
    for (int w = others.back(); !others.empty();) {
      others.erase(std::find(others.begin(), others.end(), w));
      violated.assign(1, w);
      const double f_low = search_.low_values()[w];
      if (f_low < 0.0) {
        high = low;
      } else {
        double from = low;
        const auto value_of = [&](double time, double& f) { return find_value(w, time, f, progress); };
        if (!EventSearch::close_in(value_of, from, f_low, high, values_[w])) return Found::failed;
        if (!find_values(high, values_.data(), progress)) return Found::failed;
      }
      w = -1;
      for (int other : others)
        if (values_[other] < 0.0) w = other;
      if (w < 0 || high == low) break;
    }
    for (int other : others)
      if (values_[other] < 0.0) violated.push_back(other);
    event_at_ = high;
    return Found::crossing;
  }

  // If interpolation is not exact enough, the step is made to end there and is searched once more.
  Found end_step_there(Progress& progress) {
    if (!effort_.accelerate(located, progress)) return Found::failed;
    between_.end(located, part_.acceleration, event_at_);
    length_ = shown_ = event_at_, searched_ = 0.0, violated.clear(), search_.forget();
    return Found::nothing;
  }

  // The same by steps that end at the crossing, which the secant method finds from the interpolated one.
  Found locate_by_steps(Progress& progress) {
    const int w = violated[0];
    const double guess = event_at_, reach = 1e-3 * (search_.high - search_.low);
    double other = std::fmin(guess + reach, length_), f_other, time = guess, f;
    if (!find_value(w, other, f_other, progress)) return Found::failed;
    for (int rounds = 0; rounds < 6; ++rounds) {
      if (!take_step(time, progress)) return Found::failed;
      f = values_[w];
      const double next = time - f * (time - other) / (f - f_other);
      if (f == 0.0 || std::fabs(next - time) <= 1e-12 * length_) return settle_on(time);
      if (rounds == 0 && std::fabs(next - time) > 0.01 * time && can_end_at(time)) return Found::poor;
      other = time, f_other = f, time = next;
      if (!(time >= search_.low && time <= search_.high)) break;
    }
    // Without success: bisection between a step that has not crossed and one that has.
    double low = search_.low, high = search_.high;
    if (!take_step(low, progress)) return Found::failed;
    const double f_low = values_[w];
    if (f_low < 0.0) return can_end_at(low) ? Found::poor : settle_on(low);
    if (!take_step(high, progress)) return Found::failed;
    if (!(values_[w] < 0.0)) return can_end_at(high) ? Found::poor : (violated.clear(), Found::nothing);
    const auto value = [&](double at, double& there) {
      if (!take_step(at, progress)) return false;
      return there = values_[w], true;
    };
    if (!EventSearch::close_in(value, low, f_low, high, values_[w])) return Found::failed;
    return take_step(high, progress) ? settle_on(high) : Found::failed;
  }

  // Whether the step can end at `located`, `time` s into it.
  bool can_end_at(double time) {
    if (!(time > 1e-6 * length_ && time < length_)) return false;
    event_at_ = time;
    return true;
  }

  // A step of `time` s to `located`, and the watches there.
  bool take_step(double time, Progress& progress) {
    return state_at(time, located, progress) && find_values_at(located, values_.data(), progress);
  }

  Found settle_on(double time) {
    const int w = violated[0];
    violated.assign(1, w);
    for (int other : search_.crossing)
      if (other != w && values_[other] < 0.0) violated.push_back(other);
    event_at_ = shown_ = time;
    return Found::crossing;
  }

  bool state_at(double into, JointState& out, Progress& progress) {
    progress.outcome = motion_->state_at(into, out, progress.joint);
    if (progress.outcome != Outcome::good) return false;
    if ((progress.joint = first_not_finite(out)) < 0) return true;
    progress.outcome = Outcome::not_finite;
    return false;
  }

  // A gap and a rate in twice double precision, for motions that have just begun.
  double value(const Watch& watch, const JointState& state) const {
    const int j = watch.joint, k = watch.index;
    switch (watch.kind) {
      case Watch::above_lower: return (state.position[k] - holding_.lower[j]) + state.position_remainder[k];
      case Watch::below_upper: return (holding_.upper[j] - state.position[k]) - state.position_remainder[k];
      case Watch::sliding: return holding_.sign[j] * (state.velocity[k] + state.velocity_remainder[k]);
      case Watch::lambda_below_most: return (holding_.most(j) - effort_.lambda[j]) + effort_.margin[j];
      case Watch::lambda_above_least: return (effort_.lambda[j] - holding_.least(j)) + effort_.margin[j];
    }
    return 0.0;
  }

  static constexpr double none = -1.0;

  const MethodData& method_;
  const double step_;
  Holding& holding_;
  MovingPart& part_;
  HoldingEffort& effort_;
  std::unique_ptr<Motion> motion_;
  Counts before_;       // of motions that ended
  bool holds_ = false;  // whether any watch is of lambda
  EventSearch search_;
  HermiteStep between_;
  std::int64_t number_ = -1;                               // of the step that is searched
  double length_ = 0.0, searched_ = 0.0, event_at_ = 0.0;  // s: of the step; into it, so far; of the event
  double shown_ = none;                                    // s into the step where `located` is, if it is anywhere
  double read_at_ = none;                                  // the same of `later_`, with all joints
  std::vector<double> values_;
  JointState later_{0};
};

}  // namespace planar_chain
