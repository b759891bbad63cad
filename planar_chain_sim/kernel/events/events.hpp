// Stops and dry friction: motion that is smooth between events, and the events, located to the method's accuracy.
//
// A joint with friction that does not turn, or one that rests on a stop, stands: it is built into the chain
// (standing_joints.hpp) and what holds it is a constraint effort lambda with bounds. Between events the moving joints
// are a plain chain under efforts, friction being -tau_c sgn(theta') with a constant sign. Events end such a stretch:
//
//   a moving joint reaches a stop         impact
//   a rate with friction falls to zero    it sticks, or goes on, or turns back
//   lambda leaves its bounds              it slips, or leaves the stop
//
// Each is the first time at which a watch, a smooth function, becomes negative (watched_motion.hpp). The search goes
// through the steps of the method, not through ticks. What happens then is decided for all joints together
// (holding.hpp), by the same numbers as the watches (holding_effort.hpp). A joint stands if lambda exceeds its bounds
// by at most twice its rounding error, and breaks away beyond four times that. So neither can cause the other at the
// same place.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <memory>
#include <vector>

#include "../integrators/methods.hpp"
#include "holding.hpp"
#include "holding_effort.hpp"
#include "moving_part.hpp"
#include "watched_motion.hpp"

namespace planar_chain {

enum class EventKind { touched, left, stuck, slipped };

inline const char* name_of(EventKind kind) {
  switch (kind) {
    case EventKind::touched: return "stop_touched";
    case EventKind::left: return "stop_left";
    case EventKind::stuck: return "stuck";
    case EventKind::slipped: return "slipped";
  }
  return nullptr;
}

struct JointEvent {
  std::int64_t tick;  // the last tick before the event
  double offset;      // s behind that tick
  EventKind kind;
  int joint;
  double speed;  // at which a stop was touched
};

class EventDriven final : public Integrator {
 public:
  EventDriven(const Chain& chain, const JointForces& forces, const MethodData& method, double step, bool dense)
      : chain_(chain), forces_(forces), method_(method), step_(step), dense_(dense), joints_(chain.joint_count),
        holding_(chain, forces), part_(chain, forces), effort_(holding_, part_, joints_),
        watched_(method_, step, holding_, part_, effort_), kept_(joints_), standing_at_(joints_) {}

  std::deque<JointEvent> events;  // the newest most_kept events

  EventDriven* event_driven() override { return this; }

  Progress advance(double now, std::int64_t tick, std::int64_t ticks, JointState& state,
                   const double* actuator) override {
    Progress progress;
    double offset = now - static_cast<double>(tick) * step_;
    for (; progress.ticks < ticks; ++progress.ticks, offset = 0.0)
      if (stopped(joints_)) return progress.outcome = Outcome::interrupted, progress;
      else if (!coast(tick + progress.ticks, offset, state, actuator) &&
               !go(tick + progress.ticks, offset, step_, state, actuator, progress))
        break;
    return progress;
  }

  bool advance_to(double now, std::int64_t tick, double time, JointState& state, const double* actuator,
                  Progress& progress) override {
    if (!method_.adaptive) return false;
    const double start = static_cast<double>(tick) * step_;
    go(tick, now - start, time - start, state, actuator, progress);
    return true;
  }

  void set_lookout(Lookout* lookout) override {
    lookout_ = lookout;
    if (watched_.motion()) watched_.motion()->set_lookout(lookout);
  }

  void forget() override { under_way_ = changed_ = false; }

  // The moving part has forces of its own, made from these.
  void forces_changed() override { changed_ = under_way_, built_ = false; }

  // Takes over which joints stand and slide from `other`, whose chain has the same joints.
  void adopt(const EventDriven& other) {
    holding_.standing = other.holding_.standing, holding_.sign = other.holding_.sign;
    holding_.places = other.holding_.places, effort_.actuator = other.effort_.actuator;
    standing_at_ = other.standing_at_;
    under_way_ = changed_ = other.under_way_;
  }

  // Saves whether a motion is under way; then the actuators' efforts; for each joint whether it stands, which way it
  // slides, by how much lambda may exceed its bounds, and where it stands; then the numbers of the motion itself.
  void save(std::vector<double>& all) const override {
    all.push_back(static_cast<double>(Kept::events)), all.push_back(!under_way_ ? 0.0 : changed_ ? 2.0 : 1.0);
    if (!under_way_) return;
    all.insert(all.end(), effort_.actuator.begin(), effort_.actuator.end());
    for (int j = 0; j < joints_; ++j) all.push_back(holding_.standing[j] ? 1.0 : 0.0), all.push_back(holding_.sign[j]);
    for (const auto* part : {&effort_.excess, &standing_at_.position, &standing_at_.position_remainder})
      all.insert(all.end(), part->begin(), part->end());
    if (watched_.motion() && !changed_) watched_.motion()->save(all);
  }

  bool load(KeptNumbers& kept, std::int64_t tick, double now, const JointState* state) override {
    int status;
    if (!kept.is(Kept::events) || !kept.whole(status, 0, 2)) return false;
    under_way_ = status != 0, changed_ = status == 2;
    if (!under_way_) return kept.left() == 0;
    if (!kept.numbers(effort_.actuator)) return false;
    for (int j = 0; j < joints_; ++j) {
      bool stands;
      if (!kept.whole(stands, 0, 1) || !kept.whole(holding_.sign[j], -1, 1)) return false;
      holding_.standing[j] = stands;
    }
    for (auto* part : {&effort_.excess, &standing_at_.position, &standing_at_.position_remainder})
      if (!kept.numbers(*part)) return false;
    for (int j = 0; j < joints_; ++j)
      if (effort_.excess[j] < 0.0 || (state != nullptr && holding_.standing[j] &&
                                      (state->position[j] != standing_at_.position[j] || state->velocity[j] != 0.0)))
        return false;
    holding_.places = standing_at_.position;
    if (changed_) return kept.left() == 0;
    make_part();
    watched_.begin(standing_at_, lookout_);
    if (!watched_.motion()) return kept.left() == 0;
    if (state != nullptr) part_.gather(*state, watched_.moved);
    kept.cut = true;
    return watched_.motion()->load(kept, tick, now, state != nullptr ? &watched_.moved : nullptr);
  }

  // Accelerations at a state under the last actuator efforts, zero for joints that stand; -1, or the joint whose pivot
  // vanished.
  int accelerate(const JointState& state, const double* actuator, double* acceleration) {
    if (!under_way_ || changed_) {  // it is not decided yet which joints stand
      EventDriven decided(chain_, forces_, method_, step_, dense_);
      JointState start = state;
      Progress progress;
      if (!decided.begin(0, 0.0, start, actuator, progress)) return progress.joint;
      return decided.accelerate(start, actuator, acceleration);
    }
    part_.gather(state, watched_.moved);
    const int joint = part_.accelerate(watched_.moved);
    part_.spread(acceleration, joints_);
    return joint < 0 ? -1 : part_.joint_of(joint);
  }

 private:
  static constexpr std::size_t most_kept = 4096;

  // More events than this in so short a time, s, end the motion.
  static constexpr int most_events = 1000;
  static constexpr double least_time = 1e-9;

  // Goes to the next tick, if no effort changes and the step has been searched that far without an event.
  bool coast(std::int64_t tick, double from, JointState& state, const double* actuator) {
    if (!under_way_ || changed_ || !are_unchanged(actuator)) return false;
    if (!watched_.motion()) return true;  // everything stands
    if (!watched_.coast(tick, from)) return false;
    part_.scatter(watched_.located, state);
    return true;
  }

  bool are_unchanged(const double* actuator) const {
    return std::memcmp(effort_.actuator.data(), actuator, effort_.actuator.size() * sizeof(double)) == 0;
  }

  // Goes from `from` to `to` s behind `tick`; false, with the state unchanged, if that fails.
  bool go(std::int64_t tick, double from, double to, JointState& state, const double* actuator, Progress& progress) {
    kept_ = state, saved_.clear(), save(saved_);
    const std::int64_t events_before = counts.events;
    if (begin(tick, from, state, actuator, progress) && run(tick, from, to, state, progress)) return true;
    state = kept_, under_way_ = changed_ = false;
    if (progress.outcome != Outcome::interrupted) return false;
    for (std::int64_t k = counts.events - events_before; k > 0 && !events.empty(); --k) events.pop_back();
    counts.events = events_before;
    KeptNumbers saved(saved_.data(), saved_.data() + saved_.size());
    if (!load(saved, tick, static_cast<double>(tick) * step_ + from, nullptr)) under_way_ = false;
    return false;
  }

  // If efforts or the state have changed, decides again which joints stand and slide.
  bool begin(std::int64_t tick, double offset, JointState& state, const double* actuator, Progress& progress) {
    if (under_way_ && !changed_ && are_unchanged(actuator)) return true;
    if (!under_way_) std::fill(holding_.standing.begin(), holding_.standing.end(), false);
    std::memcpy(effort_.actuator.data(), actuator, effort_.actuator.size() * sizeof(double));
    const bool known = under_way_;
    under_way_ = true, changed_ = false;
    watched_.violated.clear();
    return settle(tick, offset, state, known, progress);
  }

  bool run(std::int64_t tick, double from, double to, JointState& state, Progress& progress) {
    double at = from, since = from;
    bool passed = false;
    for (int happened = 0; at < to;) {
      Motion* const motion = watched_.motion();
      if (motion == nullptr) return true;  // everything stands, under efforts that do not change
      part_.gather(state, watched_.moved);
      if (!watched_.ensure_step(tick, at, to, passed, progress)) return failed(progress);
      const double wanted = motion->into_step(to);
      passed = wanted > watched_.length();
      const double asked = passed ? watched_.length() : wanted;
      double into = asked;
      const Found found = watched_.find(into, progress);
      if (found == Found::failed) return failed(progress);
      count();
      if (coarse.joint < 0 && motion->coarse.joint >= 0)
        coarse = motion->coarse, coarse.joint = part_.joint_of(coarse.joint);
      part_.scatter(watched_.located, state);
      if (found == Found::nothing && into == asked && !passed) return true;
      at = std::fmin(to, std::fmax(at, motion->behind_tick(into)));
      if (found == Found::nothing) continue;
      passed = false;
      if (++happened % most_events == 0) {
        if (at - since < least_time)
          return progress.outcome = Outcome::endless_events, progress.joint = first_violated(), false;
        since = at;
      }
      if (!happen(tick, at, state, progress)) return false;
    }
    return true;
  }

  int first_violated() const { return watched_.watches[watched_.violated[0]].joint; }

  void count() {
    const std::int64_t events_so_far = counts.events;
    counts = watched_.counts(), counts.events = events_so_far;
  }

  bool failed(Progress& progress) {
    if (progress.joint >= 0 && progress.joint < part_.moving()) progress.joint = part_.joint_of(progress.joint);
    return false;
  }

  // At a state where a watch was violated: applies the impact and decides which joints stand.
  bool happen(std::int64_t tick, double offset, JointState& state, Progress& progress) {
    for (int w : watched_.violated) {
      const Watch& watch = watched_.watches[w];
      const int j = watch.joint;
      if (watch.kind == Watch::above_lower) state.position[j] = holding_.lower[j], state.position_remainder[j] = 0.0;
      if (watch.kind == Watch::below_upper) state.position[j] = holding_.upper[j], state.position_remainder[j] = 0.0;
      if (watch.kind == Watch::sliding) Holding::put_rate(state, j, 0.0);
    }
    return settle(tick, offset, state, true, progress);
  }

  // Impacts, then the joints that stand, then the motion from there on. `known`: which joints stood before was decided
  // too.
  bool settle(std::int64_t tick, double offset, JointState& state, bool known, Progress& progress) {
    std::vector<std::pair<int, double>> touched;
    const bool good = holding_.collide(state, effort_.actuator.data(), touched, progress);
    for (const auto& [joint, speed] : touched) note({tick, offset, EventKind::touched, joint, speed});
    const std::vector<bool> stood = holding_.standing;
    if (!good || !decide(state, progress)) return false;
    for (int j = 0; j < joints_ && known; ++j) {
      const bool on_stop = holding_.on_stop(j, state.position[j]), stands = holding_.standing[j];
      if (stands && !stood[j] && !on_stop) note({tick, offset, EventKind::stuck, j, 0.0});
      if (!stands && stood[j]) note({tick, offset, on_stop ? EventKind::left : EventKind::slipped, j, 0.0});
    }
    watched_.begin(standing_at_, lookout_);
    return true;
  }

  // Which joints stand, and which way the others begin to slide. The box problem's answer has rounding errors, so it is
  // compared with the numbers that the watches will use. A joint that broke away does slide.
  bool decide(JointState& state, Progress& progress) {
    const std::vector<Watch> was = watched_.watches;
    if (!holding_.decide(state, effort_.actuator.data(), progress)) return false;
    enum Choice : char { open, slides, stands };
    std::vector<Choice> choice(static_cast<std::size_t>(joints_), open);
    std::fill(effort_.excess.begin(), effort_.excess.end(), 0.0);
    const auto let_slide = [&](int j, double sign) {
      holding_.standing[j] = false, holding_.sign[j] = sign, choice[j] = slides;
    };
    for (int w : watched_.violated)
      if ((was[w].kind == Watch::lambda_below_most || was[w].kind == Watch::lambda_above_least) &&
          state.velocity[was[w].joint] == 0.0)
        let_slide(was[w].joint, was[w].kind == Watch::lambda_below_most ? -1.0 : 1.0);
    standing_at_ = state;
    for (bool changed = true; changed;) {
      make_part();
      if (holding_.still.empty()) return true;
      part_.gather(state, watched_.moved);
      if (!effort_.accelerate(watched_.moved, progress)) return failed(progress);
      effort_.full = state;
      effort_.find(watched_.moved);
      effort_.find_rounding();
      changed = false;
      for (int j : holding_.still) {
        if (holding_.standing[j]) {
          const double excess = std::fmax(effort_.lambda[j] - holding_.most(j), holding_.least(j) - effort_.lambda[j]);
          if (!(excess > 2.0 * effort_.rounding[j])) continue;
          if (choice[j] == stands) effort_.excess[j] = 2.0 * excess;
          else let_slide(j, effort_.lambda[j] > holding_.most(j) ? -1.0 : 1.0), changed = true;
        } else {
          const double along = holding_.sign[j] * effort_.acceleration[j];
          if (along > (choice[j] == slides ? 0.0 : holding_.give[j] * holding_.rounding_of_size(j))) continue;
          if (choice[j] == stands) continue;
          holding_.standing[j] = true, holding_.sign[j] = 0.0, choice[j] = stands, changed = true;
        }
        if (changed) break;
      }
    }
    return true;
  }

  // Makes the moving part for the joints that stand, if it is not the present one.
  void make_part() {
    bool same = built_;
    for (int j = 0; j < joints_ && same; ++j)
      same = holding_.standing[j] == built_for_[j] &&
             (!built_for_[j] || (built_at_.position[j] == standing_at_.position[j] &&
                                 built_at_.position_remainder[j] == standing_at_.position_remainder[j]));
    if (!same) {
      watched_.drop();
      part_.build(holding_.standing, standing_at_, method_.family == Family::taylor, dense_);
      built_ = true, built_for_ = holding_.standing, built_at_ = standing_at_;
      watched_.fit();
    }
    for (int k = 0; k < part_.moving(); ++k) {
      const int j = part_.joint_of(k);
      part_.effort[k] = effort_.actuator[j] - holding_.friction[j] * holding_.sign[j];
    }
  }

  void note(const JointEvent& event) {
    ++counts.events;
    if (events.size() == most_kept) events.pop_front();
    events.push_back(event);
  }

  const Chain& chain_;
  const JointForces& forces_;
  const MethodData method_;
  const double step_;
  const bool dense_;
  const int joints_;
  Holding holding_;
  MovingPart part_;
  HoldingEffort effort_;
  WatchedMotion watched_;
  bool under_way_ = false, changed_ = false;  // changed_: forces other than the actuators'
  JointState kept_, standing_at_;             // of all joints; standing_at_: when it was decided which joints stand
  bool built_ = false;
  std::vector<bool> built_for_;  // joints that stood when the moving part was made
  JointState built_at_{0};
  std::vector<double> saved_;  // result of save() before a tick
};

inline std::unique_ptr<Integrator> make_integrator(const MethodData& method, const Chain& chain, Form& form,
                                                   const JointForces& forces, double step, bool dense) {
  if (forces.have_events()) return std::make_unique<EventDriven>(chain, forces, method, step, dense);
  return make_motion(method, chain, form, forces, step, dense);
}

}  // namespace planar_chain
