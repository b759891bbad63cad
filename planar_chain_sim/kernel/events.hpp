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
// Each is the first time at which a watch, a smooth function, becomes negative (event_search.hpp). They are looked for
// step by step of the method, not tick by tick. What happens then is decided for all joints together (holding.hpp), by
// the numbers that the watches are made of: a joint stands where lambda is within its bounds but for twice what
// rounding may do to it, and breaks away beyond four times that. So neither can call for the other at the same place.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <memory>
#include <vector>

#include "event_search.hpp"
#include "hermite_step.hpp"
#include "holding.hpp"
#include "methods.hpp"
#include "moving_part.hpp"

namespace planar_chain {

enum class EventKind { touched, left, stuck, slipped };

struct JointEvent {
  std::int64_t tick;  // the last one before it
  double offset;      // s behind that tick
  EventKind kind;
  int joint;
  double speed;       // with which a stop was touched
};

class EventDriven final : public Integrator {
 public:
  EventDriven(const Chain& chain, const JointForces& forces, const MethodData& method, double step, bool dense)
      : chain_(chain), forces_(forces), method_(method), step_(step), dense_(dense), joints_(chain.joint_count),
        holding_(chain, forces), part_(chain, forces), held_(joints_), lambda_(joints_), rounding_(joints_),
        margin_(joints_), excess_(joints_), acceleration_(joints_), kept_(joints_), full_(joints_),
        standing_at_(joints_) {}

  std::deque<JointEvent> events;  // the newest most_kept, for whoever takes them

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

  bool reach(double now, std::int64_t tick, double time, JointState& state, const double* actuator,
             Progress& progress) override {
    if (!method_.adaptive) return false;
    const double start = static_cast<double>(tick) * step_;
    go(tick, now - start, time - start, state, actuator, progress);
    return true;
  }

  void look_out(Lookout* lookout) override {
    lookout_ = lookout;
    if (motion_) motion_->look_out(lookout);
  }

  void forget() override { under_way_ = changed_ = false; }

  // The moving part has forces of its own, made from these.
  void forces_changed() override { changed_ = under_way_, built_ = false; }

  // Goes on from what stands and slides in `other`, whose chain has the same joints.
  void adopt(const EventDriven& other) {
    holding_.standing = other.holding_.standing, holding_.sign = other.holding_.sign;
    holding_.places = other.holding_.places, held_ = other.held_;
    standing_at_ = other.standing_at_;
    under_way_ = changed_ = other.under_way_;
  }

  // Whether anything goes on; then the actuators' efforts, of each joint whether it stands, which way it slides, by how
  // much lambda may exceed its bounds and where it stands, and the motion's own.
  void save(std::vector<double>& all) const override {
    all.push_back(static_cast<double>(Kept::events)), all.push_back(!under_way_ ? 0.0 : changed_ ? 2.0 : 1.0);
    if (!under_way_) return;
    all.insert(all.end(), held_.begin(), held_.end());
    for (int j = 0; j < joints_; ++j) all.push_back(holding_.standing[j] ? 1.0 : 0.0), all.push_back(holding_.sign[j]);
    for (const auto* part : {&excess_, &standing_at_.position, &standing_at_.position_remainder})
      all.insert(all.end(), part->begin(), part->end());
    if (motion_ && !changed_) motion_->save(all);
  }

  bool load(KeptNumbers& kept, std::int64_t tick, double now, const JointState* state) override {
    int status;
    if (!kept.is(Kept::events) || !kept.whole(status, 0, 2)) return false;
    under_way_ = status != 0, changed_ = status == 2;
    if (!under_way_) return kept.left() == 0;
    if (!kept.numbers(held_)) return false;
    for (int j = 0; j < joints_; ++j) {
      bool stands;
      if (!kept.whole(stands, 0, 1) || !kept.whole(holding_.sign[j], -1, 1)) return false;
      holding_.standing[j] = stands;
    }
    for (auto* part : {&excess_, &standing_at_.position, &standing_at_.position_remainder})
      if (!kept.numbers(*part)) return false;
    for (int j = 0; j < joints_; ++j)
      if (excess_[j] < 0.0 || (state != nullptr && holding_.standing[j] &&
                               (state->position[j] != standing_at_.position[j] || state->velocity[j] != 0.0)))
        return false;
    holding_.places = standing_at_.position;
    if (changed_) return kept.left() == 0;
    make_part();
    make_motion();
    if (!motion_) return kept.left() == 0;
    if (state != nullptr) part_.gather(*state, moved_);
    kept.cut = true;
    return motion_->load(kept, tick, now, state != nullptr ? &moved_ : nullptr);
  }

  // Accelerations at a state under the actuators that acted last, of joints that stand zero; -1, or the joint whose
  // pivot vanished.
  int accelerate(const JointState& state, const double* actuator, double* acceleration) {
    if (!under_way_ || changed_) {               // what stands in this state is not decided yet
      EventDriven decided(chain_, forces_, method_, step_, dense_);
      JointState start = state;
      Progress progress;
      if (!decided.begin(0, 0.0, start, actuator, progress)) return progress.joint;
      return decided.accelerate(start, actuator, acceleration);
    }
    part_.gather(state, moved_);
    const int joint = part_.accelerate(moved_);
    part_.spread(acceleration, joints_);
    return joint < 0 ? -1 : part_.joint_of(joint);
  }

 private:
  static constexpr std::size_t most_kept = 4096;

  // So many events in so short a time, s, are no motion.
  static constexpr int most_events = 1000;
  static constexpr double least_time = 1e-9;

  // What must not become negative.
  struct Watch {
    enum Kind { above_lower, below_upper, sliding, held_up, held_down } kind;
    int joint, index;  // of the chain, of the moving part
  };

  // To the next tick where nothing changes and nothing happens, in a step that has been looked through that far.
  bool coast(std::int64_t tick, double from, JointState& state, const double* actuator) {
    if (!under_way_ || changed_ || std::memcmp(held_.data(), actuator, held_.size() * sizeof(double)) != 0) return false;
    if (!motion_) return true;                 // everything stands
    double into;
    if (number_ != motion_->number || !motion_->spans(tick, from, step_, into)) return false;
    if ((!watches_.empty() && searched_ < into) || (!violated_.empty() && event_at_ <= into)) return false;
    Progress progress;
    if (!show(into, located_, progress)) return false;
    part_.scatter(located_, state), shown_ = none;
    return true;
  }

  // From `from` to `to` s behind `tick`; false, with the state as it was, where it fails.
  bool go(std::int64_t tick, double from, double to, JointState& state, const double* actuator, Progress& progress) {
    kept_ = state, saved_.clear(), save(saved_);
    const std::int64_t events_before = counts.events;
    if (begin(tick, from, state, actuator, progress) && run(tick, from, to, state, progress)) return true;
    state = kept_, under_way_ = changed_ = false;
    if (progress.outcome != Outcome::interrupted) return false;
    for (std::int64_t k = counts.events - events_before; k > 0 && !events.empty(); --k) events.pop_back();
    before_.events -= counts.events - events_before, counts.events = events_before;
    KeptNumbers saved(saved_.data(), saved_.data() + saved_.size());
    if (!load(saved, tick, static_cast<double>(tick) * step_ + from, nullptr)) under_way_ = false;
    return false;
  }

  // Where efforts or the state have changed, all that stands and slides is decided anew.
  bool begin(std::int64_t tick, double offset, JointState& state, const double* actuator, Progress& progress) {
    const bool same = std::memcmp(held_.data(), actuator, held_.size() * sizeof(double)) == 0;
    if (under_way_ && !changed_ && same) return true;
    if (!under_way_) std::fill(holding_.standing.begin(), holding_.standing.end(), false);
    std::memcpy(held_.data(), actuator, held_.size() * sizeof(double));
    const bool known = under_way_;
    under_way_ = true, changed_ = false;
    violated_.clear();
    return settle(tick, offset, state, known, progress);
  }

  bool run(std::int64_t tick, double from, double to, JointState& state, Progress& progress) {
    double at = from, since = from;
    bool passed = false;
    for (int happened = 0; at < to;) {
      if (!motion_) return true;               // everything stands, under efforts that do not change
      part_.gather(state, moved_);
      if (!look(tick, at, to, passed, progress)) return failed(progress);
      const double wanted = motion_->into_step(to);
      passed = wanted > length_;
      const double asked = passed ? length_ : wanted;
      double into = asked;
      const Found found = watches_.empty() ? Found::nothing : watch(into, progress);
      if (found == Found::failed || !(shown_ == into || show(into, located_, progress))) return failed(progress);
      counts = before_;
      counts.add(motion_->counts);
      if (coarse.joint < 0 && motion_->coarse.joint >= 0)
        coarse = motion_->coarse, coarse.joint = part_.joint_of(coarse.joint);
      part_.scatter(located_, state);
      shown_ = none;
      if (found == Found::nothing && into == asked && !passed) return true;
      at = std::fmin(to, std::fmax(at, motion_->behind_tick(into)));
      if (found == Found::nothing) continue;
      passed = false;
      if (++happened % most_events == 0) {
        if (at - since < least_time)
          return progress.outcome = Outcome::endless_events, progress.joint = watches_[violated_[0]].joint, false;
        since = at;
      }
      if (!happen(tick, at, state, progress)) return false;
    }
    return true;
  }

  // A step from moved_. A fixed one may be too long for what an event would end soon, as strong friction; then a part
  // of it.
  bool look(std::int64_t tick, double at, double to, bool passed, Progress& progress) {
    length_ = motion_->look(tick, at, to, moved_, part_.effort.data(), passed, progress);
    if (method_.adaptive || watches_.empty() || progress.outcome == Outcome::interrupted)
      return progress.outcome == Outcome::good;
    if (progress.outcome == Outcome::good && show(length_, later_, progress)) return true;
    const Progress first = progress;
    for (double part = 0.0625; part > 1e-10; part *= 0.0625) {
      progress.outcome = Outcome::good;
      length_ = motion_->look(tick, at, at + part * (to - at), moved_, part_.effort.data(), passed, progress);
      if (progress.outcome == Outcome::interrupted) return false;
      if (progress.outcome == Outcome::good && show(length_, later_, progress)) return true;
    }
    progress.outcome = first.outcome, progress.joint = first.joint;
    return false;
  }

  bool failed(Progress& progress) {
    if (progress.joint >= 0 && progress.joint < part_.moving()) progress.joint = part_.joint_of(progress.joint);
    return false;
  }

  // Looks for the first event within `into` s of the step; if there is one, `into` is where, and violated_ says what.
  Found watch(double& into, Progress& progress) {
    if (number_ != motion_->number) {
      number_ = motion_->number, searched_ = 0.0, violated_.clear();
      if (!prepare_search(progress)) return Found::failed;
    }
    while (violated_.empty() && searched_ < into) {
      const double end = end_of_panel();
      const auto evaluate = [&](double time, double* values) { return find_values(time, values, progress); };
      Found found = search_.find(evaluate, searched_, end);
      searched_ = found == Found::crossing ? search_.high : end;
      if (found == Found::crossing) found = locate(progress);
      if (found == Found::crossing && !motion_->reads_densely()) found = locate_by_steps(progress);
      if (found == Found::poor) found = end_step_there(progress);
      if (found == Found::failed) return found;
      into = std::fmin(into, length_);
    }
    if (violated_.empty() || event_at_ > into) return Found::nothing;
    into = event_at_;
    return Found::crossing;
  }

  // A step is looked through in panels, each as long as all before, no farther ahead than needed. The first is short,
  // for what has just begun; a step can be long beyond measure, as where nothing but gravity acts on a slide.
  double end_of_panel() const {
    if (!motion_->reads_densely()) return length_;
    double end = std::fmin(0.0625 * length_, 4.0 * step_);
    while (end <= searched_) end *= 2.0;
    return std::fmin(end, length_);
  }

  // What a step needs to be looked through: the margin of lambda for rounding, and the ends to read between.
  bool prepare_search(Progress& progress) {
    if (!motion_->reads_densely() || holds_) {
      if (!show(0.0, located_, progress) || !accelerate(located_, progress)) return false;
      if (holds_) {
        part_.scatter(located_, full_);
        if (!holding_.factorise(full_, held_.data(), progress)) return false;
        find_lambda(located_);
        find_margin();
      }
      if (motion_->reads_densely()) return true;
      between_.begin(located_, part_.acceleration);
      if (!show(length_, later_, progress) || !accelerate(later_, progress)) return false;
      between_.end(later_, part_.acceleration, length_);
    }
    return true;
  }

  // later_ <- `time` s into the step: as it is read, or where that costs a step, between its ends.
  bool read(double time, Progress& progress) {
    if (motion_->reads_densely()) return show(time, later_, progress);
    between_.read(time, later_);
    return true;
  }

  bool find_values(double time, double* values, Progress& progress) {
    return read(time, progress) && find_values_at(later_, values, progress);
  }

  bool find_value(int w, double time, double& found, Progress& progress) {
    if (!read(time, progress)) return false;
    if (watches_[w].index < 0) {   // of lambda
      if (!accelerate(later_, progress)) return false;
      find_lambda(later_);
    }
    found = value(watches_[w], later_);
    return true;
  }

  bool find_values_at(const JointState& moved, double* values, Progress& progress) {
    if (holds_) {
      if (!accelerate(moved, progress)) return false;
      find_lambda(moved);
    }
    for (std::size_t w = 0; w < watches_.size(); ++w) values[w] = value(watches_[w], moved);
    return true;
  }

  // From an interval in which some watches cross zero to the first crossing.
  Found locate(Progress& progress) {
    double low = search_.low, high = search_.high;
    values_.assign(search_.high_values(), search_.high_values() + watches_.size());
    violated_.clear();
    std::vector<int> others = search_.crossing;
    for (int w = others.back(); !others.empty();) {
      others.erase(std::find(others.begin(), others.end(), w));
      violated_.assign(1, w);
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
      if (values_[other] < 0.0) violated_.push_back(other);
    event_at_ = high;
    return Found::crossing;
  }

  // Where a step of its own tells more than reading between the ends did, the step ends there, and the way to there is
  // looked through once more.
  Found end_step_there(Progress& progress) {
    if (!accelerate(located_, progress)) return Found::failed;
    between_.end(located_, part_.acceleration, event_at_);
    length_ = shown_ = event_at_, searched_ = 0.0, violated_.clear();
    return Found::nothing;
  }

  // The same by steps that end there: the crossing between the ends is a first guess, secants do the rest.
  Found locate_by_steps(Progress& progress) {
    const int w = violated_[0];
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
    // Not that easily found: between a step that has not crossed and one that has.
    double low = search_.low, high = search_.high;
    if (!take_step(low, progress)) return Found::failed;
    const double f_low = values_[w];
    if (f_low < 0.0) return can_end_at(low) ? Found::poor : settle_on(low);
    if (!take_step(high, progress)) return Found::failed;
    if (!(values_[w] < 0.0)) return can_end_at(high) ? Found::poor : (violated_.clear(), Found::nothing);
    const auto value = [&](double at, double& there) {
      if (!take_step(at, progress)) return false;
      return there = values_[w], true;
    };
    if (!EventSearch::close_in(value, low, f_low, high, values_[w])) return Found::failed;
    return take_step(high, progress) ? settle_on(high) : Found::failed;
  }

  // Whether the step can end where located_ is, `time` s into it, rather than all along.
  bool can_end_at(double time) {
    if (!(time > 1e-6 * length_ && time < length_)) return false;
    event_at_ = time;
    return true;
  }

  // A step of `time` s to located_, and the watches there.
  bool take_step(double time, Progress& progress) {
    return show(time, located_, progress) && find_values_at(located_, values_.data(), progress);
  }

  Found settle_on(double time) {
    const int w = violated_[0];
    violated_.assign(1, w);
    for (int other : search_.crossing)
      if (other != w && values_[other] < 0.0) violated_.push_back(other);
    event_at_ = shown_ = time;
    return Found::crossing;
  }

  bool show(double into, JointState& out, Progress& progress) {
    progress.outcome = motion_->show(into, out, progress.joint);
    if (progress.outcome != Outcome::good) return false;
    if ((progress.joint = first_not_finite(out)) < 0) return true;
    progress.outcome = Outcome::not_finite;
    return false;
  }

  // A gap and a rate to all the digits that there are, for what has just begun.
  double value(const Watch& watch, const JointState& state) const {
    const int j = watch.joint, k = watch.index;
    switch (watch.kind) {
      case Watch::above_lower: return (state.position[k] - holding_.lower[j]) + state.position_remainder[k];
      case Watch::below_upper: return (holding_.upper[j] - state.position[k]) - state.position_remainder[k];
      case Watch::sliding: return holding_.sign[j] * (state.velocity[k] + state.velocity_remainder[k]);
      case Watch::held_up: return (holding_.most(j) - lambda_[j]) + margin_[j];
      default: return (lambda_[j] - holding_.least(j)) + margin_[j];
    }
  }

  bool accelerate(const JointState& moved, Progress& progress) {
    const int joint = part_.accelerate(moved);
    progress.outcome = outcome_of(joint, moved.position.data(), part_.moving()), progress.joint = joint;
    return joint < 0;
  }

  // After accelerate(): what holds the standing joints.
  void find_lambda(const JointState& moved) {
    part_.scatter(moved, full_);
    part_.spread(acceleration_.data(), joints_);
    holding_.find_lambda(full_, acceleration_.data(), held_.data(), lambda_.data());
  }

  // After find_lambda(): by how much lambda has to exceed its bounds to break away.
  void find_margin() {
    holding_.find_rounding(full_, acceleration_.data(), lambda_.data(), rounding_.data());
    for (int j = 0; j < joints_; ++j) margin_[j] = std::fmax(4.0 * rounding_[j], excess_[j]);
  }

  // The state is where something was violated: puts it right, and decides how it goes on.
  bool happen(std::int64_t tick, double offset, JointState& state, Progress& progress) {
    for (int w : violated_) {
      const Watch& watch = watches_[w];
      const int j = watch.joint;
      if (watch.kind == Watch::above_lower) state.position[j] = holding_.lower[j], state.position_remainder[j] = 0.0;
      if (watch.kind == Watch::below_upper) state.position[j] = holding_.upper[j], state.position_remainder[j] = 0.0;
      if (watch.kind == Watch::sliding) Holding::put_rate(state, j, 0.0);
    }
    return settle(tick, offset, state, true, progress);
  }

  // Impacts, then what stands, and the motion from there on. `known`: what stood before it was found out, too.
  bool settle(std::int64_t tick, double offset, JointState& state, bool known, Progress& progress) {
    std::vector<std::pair<int, double>> touched;
    const bool good = holding_.collide(state, held_.data(), touched, progress);
    for (const auto& [joint, speed] : touched) note({tick, offset, EventKind::touched, joint, speed});
    const std::vector<bool> stood = holding_.standing;
    if (!good || !decide(state, progress)) return false;
    for (int j = 0; j < joints_ && known; ++j) {
      const bool on_stop = holding_.on_stop(j, state.position[j]), stands = holding_.standing[j];
      if (stands && !stood[j] && !on_stop) note({tick, offset, EventKind::stuck, j, 0.0});
      if (!stands && stood[j]) note({tick, offset, on_stop ? EventKind::left : EventKind::slipped, j, 0.0});
    }
    make_motion();
    return true;
  }

  // Which joints stand, and which way the others begin to slide. The box problem knows but for rounding; here its
  // answer is held against the numbers that the watches will see. A joint that broke away does slide.
  bool decide(JointState& state, Progress& progress) {
    const std::vector<Watch> was = watches_;
    if (!holding_.decide(state, held_.data(), progress)) return false;
    enum Choice : char { open, slides, stands };
    std::vector<Choice> choice(static_cast<std::size_t>(joints_), open);
    std::fill(excess_.begin(), excess_.end(), 0.0);
    const auto let_slide = [&](int j, double sign) {
      holding_.standing[j] = false, holding_.sign[j] = sign, choice[j] = slides;
    };
    for (int w : violated_)
      if ((was[w].kind == Watch::held_up || was[w].kind == Watch::held_down) && state.velocity[was[w].joint] == 0.0)
        let_slide(was[w].joint, was[w].kind == Watch::held_up ? -1.0 : 1.0);
    standing_at_ = state;
    for (bool changed = true; changed;) {
      make_part();
      if (holding_.still.empty()) return true;
      part_.gather(state, moved_);
      if (!accelerate(moved_, progress)) return failed(progress);
      full_ = state;
      find_lambda(moved_);
      holding_.find_rounding(full_, acceleration_.data(), lambda_.data(), rounding_.data());
      changed = false;
      for (int j : holding_.still) {
        if (holding_.standing[j]) {
          const double excess = std::fmax(lambda_[j] - holding_.most(j), holding_.least(j) - lambda_[j]);
          if (!(excess > 2.0 * rounding_[j])) continue;
          if (choice[j] == stands) excess_[j] = 2.0 * excess;
          else let_slide(j, lambda_[j] > holding_.most(j) ? -1.0 : 1.0), changed = true;
        } else {
          const double along = holding_.sign[j] * acceleration_[j];
          if (along > (choice[j] == slides ? 0.0 : holding_.give[j] * holding_.rounding_of_size(j))) continue;
          if (choice[j] == stands) continue;
          holding_.standing[j] = true, holding_.sign[j] = 0.0, choice[j] = stands, changed = true;
        }
        if (changed) break;
      }
    }
    return true;
  }

  // The moving part for what stands, which may be the one that there is.
  void make_part() {
    bool same = built_;
    for (int j = 0; j < joints_ && same; ++j)
      same = holding_.standing[j] == built_for_[j] &&
             (!built_for_[j] || (built_at_.position[j] == standing_at_.position[j] &&
                                 built_at_.position_remainder[j] == standing_at_.position_remainder[j]));
    if (!same) {
      drop_motion();
      part_.build(holding_.standing, standing_at_, method_.family == Family::taylor, dense_);
      built_ = true, built_for_ = holding_.standing, built_at_ = standing_at_;
      for (JointState* moved : {&moved_, &later_, &located_}) *moved = JointState(part_.moving());
    }
    for (int k = 0; k < part_.moving(); ++k) {
      const int j = part_.joint_of(k);
      part_.effort[k] = held_[j] - holding_.friction[j] * holding_.sign[j];
    }
  }

  void drop_motion() {
    if (motion_) before_.add(motion_->counts);
    motion_.reset();
  }

  // Its method from the start, and what is watched.
  void make_motion() {
    watches_.clear(), violated_.clear(), holds_ = false, number_ = -1, shown_ = none;
    full_ = standing_at_;
    for (int k = 0; k < part_.moving(); ++k) {
      const int j = part_.joint_of(k);
      if (holding_.lower[j] > -Holding::infinity) watches_.push_back({Watch::above_lower, j, k});
      if (holding_.upper[j] < Holding::infinity) watches_.push_back({Watch::below_upper, j, k});
      if (holding_.friction[j] > 0.0) watches_.push_back({Watch::sliding, j, k});
    }
    if (part_.moving() == 0) return drop_motion();
    for (int j = 0; j < joints_; ++j) {
      if (!holding_.standing[j]) continue;
      full_.velocity[j] = full_.velocity_remainder[j] = 0.0;
      if (holding_.most(j) < Holding::infinity) watches_.push_back({Watch::held_up, j, -1});
      if (holding_.least(j) > -Holding::infinity) watches_.push_back({Watch::held_down, j, -1});
      holds_ = true;
    }
    search_.resize(static_cast<int>(watches_.size()));
    values_.resize(watches_.size());
    if (motion_) motion_->forget();
    else motion_ = planar_chain::make_motion(method_, part_.chain(), part_.form(), part_.forces(), step_, part_.dense());
    motion_->look_out(lookout_);
  }

  void note(const JointEvent& event) {
    ++before_.events, ++counts.events;
    if (events.size() == most_kept) events.pop_front();
    events.push_back(event);
  }

  static constexpr double none = -1.0;

  const Chain& chain_;
  const JointForces& forces_;
  const MethodData method_;
  const double step_;
  const bool dense_;
  const int joints_;
  Holding holding_;
  MovingPart part_;
  std::unique_ptr<Motion> motion_;                            // null where nothing moves
  std::vector<double> held_;                                  // the actuators' efforts
  bool under_way_ = false, changed_ = false;                  // the latter: forces other than the actuators'
  Counts before_;                                             // of motions that ended

  std::vector<Watch> watches_;
  bool holds_ = false;                                        // whether any of them is of lambda
  EventSearch search_;
  HermiteStep between_;
  std::int64_t number_ = -1;                                  // of the step that is looked through
  double length_ = 0.0, searched_ = 0.0, event_at_ = 0.0;     // s: of the step; into it, so far; of the event
  double shown_ = none;                                       // s into the step where located_ is, if it is anywhere
  std::vector<int> violated_;                                 // watches
  std::vector<double> lambda_, rounding_, margin_, excess_;   // of the joints; see decide() for the last
  std::vector<double> acceleration_, values_;
  JointState moved_{0}, later_{0}, located_{0};               // of the moving part
  JointState kept_, full_, standing_at_;                      // of all joints; the last: when that was decided
  bool built_ = false;
  std::vector<bool> built_for_;                               // what stood where the moving part was made
  JointState built_at_{0};
  std::vector<double> saved_;                                 // what save() says before a tick
};

inline std::unique_ptr<Integrator> make_integrator(const MethodData& method, const Chain& chain, Form& form,
                                                   const JointForces& forces, double step, bool dense) {
  if (forces.have_events()) return std::make_unique<EventDriven>(chain, forces, method, step, dense);
  return make_motion(method, chain, form, forces, step, dense);
}

}  // namespace planar_chain
