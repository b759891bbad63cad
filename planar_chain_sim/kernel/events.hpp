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
// What happens then is decided for all joints together (holding.hpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <memory>
#include <vector>

#include "forms.hpp"
#include "holding.hpp"
#include "methods.hpp"
#include "standing_joints.hpp"

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
        holding_(chain, forces), held_(joints_), acceleration_(joints_), kept_(joints_), full_(joints_) {}

  std::deque<JointEvent> events;  // the newest most_kept, for whoever takes them

  Progress advance(double now, std::int64_t tick, std::int64_t ticks, JointState& state,
                   const double* actuator) override {
    Progress progress;
    double offset = now - static_cast<double>(tick) * step_;
    for (; progress.ticks < ticks; ++progress.ticks, offset = 0.0)
      if (stopped(joints_)) return progress.outcome = Outcome::interrupted, progress;
      else if (!go(tick + progress.ticks, offset, step_, state, actuator, progress)) break;
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

  void forces_changed() override { changed_ = under_way_; }

  // Goes on from what stands and slides in `other`, whose chain has the same joints.
  void adopt(const EventDriven& other) {
    holding_.standing = other.holding_.standing, holding_.sign = other.holding_.sign;
    holding_.places = other.holding_.places, held_ = other.held_;
    under_way_ = changed_ = other.under_way_;
    make_motion();
  }

  void save(std::vector<double>& all) const override {
    all.push_back(static_cast<double>(Kept::events)), all.push_back(!under_way_ ? 0.0 : changed_ ? 2.0 : 1.0);
    if (!under_way_) return;
    all.insert(all.end(), held_.begin(), held_.end());
    for (int j = 0; j < joints_; ++j) all.push_back(holding_.standing[j] ? 1.0 : 0.0), all.push_back(holding_.sign[j]);
    all.insert(all.end(), holding_.places.begin(), holding_.places.end());
    if (motion_) motion_->save(all);
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
    if (!kept.numbers(holding_.places)) return false;
    make_motion();
    if (!motion_) return kept.left() == 0;
    if (state != nullptr) gather(*state, moved_);
    kept.cut = true;
    return motion_->load(kept, tick, now, state != nullptr ? &moved_ : nullptr);
  }

  // Accelerations at a state under the actuators that acted last, of joints that stand zero; -1, or the joint whose pivot
  // vanished.
  int accelerate(const JointState& state, const double* actuator, double* acceleration) {
    if (!under_way_ || changed_) {               // what stands in this state is not decided yet
      EventDriven decided(chain_, forces_, method_, step_, dense_);
      JointState start = state;
      Progress progress;
      if (!decided.begin(0, 0.0, start, actuator, progress)) return progress.joint;
      return decided.accelerate(start, actuator, acceleration);
    }
    std::fill_n(acceleration, joints_, 0.0);
    if (!motion_) return -1;
    gather(state, moved_);
    const int joint = accelerate(moved_);
    for (std::size_t k = 0; k < part_.joints.size(); ++k) acceleration[part_.joints[k]] = of_moved_[k];
    return joint < 0 ? -1 : part_.joints[joint];
  }

 private:
  static constexpr int most_events = 20000;     // in a tick; more are no motion
  static constexpr std::size_t most_kept = 4096;

  // What must not become negative.
  struct Watch {
    enum Kind { above_lower, below_upper, sliding, held_up, held_down } kind;
    int joint, index;  // of the chain, of the moving part
  };

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
    return settle(tick, offset, state, known, progress);
  }

  bool run(std::int64_t tick, double from, double to, JointState& state, Progress& progress) {
    double at = from;
    for (int events_here = 0; at < to;) {
      if (!motion_) return true;               // everything stands, under efforts that do not change
      gather(state, moved_);
      const double end = motion_->look(tick, at, to, moved_, driven_.data(), progress);
      if (progress.outcome != Outcome::good) return failed(progress);
      double happened = at;
      if (!watch(at, end, happened, progress)) return failed(progress);
      counts = before_;
      counts.add(motion_->counts);
      if (coarse.joint < 0 && motion_->coarse.joint >= 0)
        coarse = motion_->coarse, coarse.joint = part_.joints[coarse.joint];
      scatter(moved_, state);
      at = happened;
      if (violated_.empty()) continue;
      if (++events_here > most_events) return progress.outcome = Outcome::stalled, progress.joint = violated_[0].joint, false;
      if (!happen(tick, at, state, progress)) return false;
    }
    return true;
  }

  bool failed(Progress& progress) {
    if (progress.joint >= 0 && progress.joint < static_cast<int>(part_.joints.size()))
      progress.joint = part_.joints[progress.joint];
    return false;
  }

  // Goes on from moved_ at `from` to the first event, else to `to`; moved_ and `happened` are there, violated_ says what.
  bool watch(double from, double to, double& happened, Progress& progress) {
    violated_.clear();
    const double stride = motion_->stride();
    const int samples = to - from > 0.25 * stride ? static_cast<int>(std::ceil(4.0 * (to - from) / stride)) : 1;
    double a = from;
    for (int k = 1; k <= samples; ++k) {
      double b = k == samples ? to : from + (to - from) * k / samples;
      if (!show(b, later_, progress)) return false;
      const bool bad = any_violated(later_, progress);
      if (progress.outcome != Outcome::good) return false;
      if (bad || dips(a, moved_, b, progress)) return locate(a, b, happened, progress);
      if (progress.outcome != Outcome::good) return false;
      std::swap(moved_, later_), a = b;
    }
    happened = to;
    return true;
  }

  // Halves [a, b], violated at b and not at a, down to two neighbouring times.
  bool locate(double a, double b, double& happened, Progress& progress) {
    for (;;) {
      const double middle = a + 0.5 * (b - a);
      if (!(middle > a && middle < b)) break;
      if (!show(middle, later_, progress)) return false;
      (any_violated(later_, progress) ? b : a) = middle;
      if (progress.outcome != Outcome::good) return false;
    }
    if (!show(b, later_, progress)) return false;
    any_violated(later_, progress, &violated_);
    std::swap(moved_, later_);
    happened = b;
    return progress.outcome == Outcome::good;
  }

  bool show(double offset, JointState& out, Progress& progress) {
    progress.outcome = motion_->show(offset, out, progress.joint);
    if (progress.outcome != Outcome::good) return false;
    if ((progress.joint = first_not_finite(out)) < 0) return true;
    progress.outcome = Outcome::not_finite;
    return false;
  }

  // A joint that at a and b is off its stop, but turned round between: b moves to where it is nearest, if beyond.
  bool dips(double a, const JointState& at_a, double& b, Progress& progress) {
    for (const Watch& watch : watches_) {
      if (watch.kind != Watch::above_lower && watch.kind != Watch::below_upper) continue;
      const double way = watch.kind == Watch::above_lower ? 1.0 : -1.0;
      if (!(way * at_a.velocity[watch.index] < 0.0 && way * later_.velocity[watch.index] > 0.0)) continue;
      double low = a, high = b;
      for (int k = 0; k < 60; ++k) {
        const double middle = low + 0.5 * (high - low);
        if (!(middle > low && middle < high)) break;
        if (!show(middle, turning_, progress)) return false;
        if (value(watch, turning_) < 0.0) return b = middle, true;
        (way * turning_.velocity[watch.index] < 0.0 ? low : high) = middle;
      }
    }
    return false;
  }

  double value(const Watch& watch, const JointState& state) const {
    switch (watch.kind) {
      case Watch::above_lower: return state.position[watch.index] - holding_.lower[watch.joint];
      case Watch::below_upper: return holding_.upper[watch.joint] - state.position[watch.index];
      case Watch::sliding: return holding_.sign[watch.joint] * state.velocity[watch.index];
      case Watch::held_up: return holding_.most(watch.joint) - lambda_[watch.joint];
      default: return lambda_[watch.joint] - holding_.least(watch.joint);
    }
  }

  bool any_violated(const JointState& state, Progress& progress, std::vector<Watch>* all = nullptr) {
    if (holds_ && !find_lambda(state, progress)) return false;
    bool found = false;
    for (const Watch& watch : watches_) {
      if (!(value(watch, state) < 0.0)) continue;
      found = true;
      if (all == nullptr) return true;
      all->push_back(watch);
    }
    return found;
  }

  // Accelerations of the moving part into of_moved_.
  int accelerate(const JointState& moved) {
    of_moved_.resize(part_.joints.size()), work_.assign(driven_.begin(), driven_.end());
    part_.forces.add_passive(moved.position.data(), moved.velocity.data(), work_.data());
    part_.forces.add_wrenches(moved.position.data(), moved.position_remainder.data(), work_.data());
    return form_->forward(moved.position.data(), moved.velocity.data(), work_.data(), of_moved_.data());
  }

  // What holds the standing joints.
  bool find_lambda(const JointState& moved, Progress& progress) {
    const int joint = accelerate(moved);
    if (joint >= 0) return progress.outcome = Outcome::singular, progress.joint = joint, false;
    full_.position = holding_.places, std::fill(full_.velocity.begin(), full_.velocity.end(), 0.0);
    scatter(moved, full_);
    std::fill(acceleration_.begin(), acceleration_.end(), 0.0);
    for (std::size_t k = 0; k < part_.joints.size(); ++k) acceleration_[part_.joints[k]] = of_moved_[k];
    holding_.find_lambda(full_, acceleration_.data(), held_.data(), lambda_.data());
    return true;
  }

  // The state is where something was violated: puts it right, and decides how it goes on.
  bool happen(std::int64_t tick, double offset, JointState& state, Progress& progress) {
    for (const Watch& watch : violated_) {
      const int j = watch.joint;
      if (watch.kind == Watch::above_lower) state.position[j] = holding_.lower[j], state.position_remainder[j] = 0.0;
      if (watch.kind == Watch::below_upper) state.position[j] = holding_.upper[j], state.position_remainder[j] = 0.0;
      if (watch.kind == Watch::sliding) state.velocity[j] = state.velocity_remainder[j] = 0.0;
    }
    return settle(tick, offset, state, true, progress);
  }

  // Impacts, then what stands, and the motion from there on. `known`: what stood before it was found out, too.
  bool settle(std::int64_t tick, double offset, JointState& state, bool known, Progress& progress) {
    std::vector<std::pair<int, double>> touched;
    const bool good = holding_.collide(state, held_.data(), touched, progress);
    for (const auto& [joint, speed] : touched) note({tick, offset, EventKind::touched, joint, speed});
    const std::vector<bool> stood = holding_.standing;
    if (!good || !holding_.decide(state, held_.data(), progress)) return false;
    for (int j = 0; j < joints_ && known; ++j) {
      const bool on_stop = holding_.on_stop(j, state.position[j]), stands = holding_.standing[j];
      if (stands && !stood[j] && !on_stop) note({tick, offset, EventKind::stuck, j, 0.0});
      if (!stands && stood[j]) note({tick, offset, on_stop ? EventKind::left : EventKind::slipped, j, 0.0});
    }
    make_motion();
    return true;
  }

  // The moving part, its method from the start, and what is watched.
  void make_motion() {
    if (motion_) before_.add(motion_->counts);
    motion_.reset(), form_.reset();
    part_ = without_standing(chain_, forces_, holding_.standing, holding_.places.data());
    part_.forces.chain = &part_.chain;
    watches_.clear(), driven_.clear(), holds_ = false;
    for (std::size_t k = 0; k < part_.joints.size(); ++k) {
      const int j = part_.joints[k], index = static_cast<int>(k);
      driven_.push_back(held_[j] - holding_.friction[j] * holding_.sign[j]);
      if (holding_.lower[j] > -Holding::infinity) watches_.push_back({Watch::above_lower, j, index});
      if (holding_.upper[j] < Holding::infinity) watches_.push_back({Watch::below_upper, j, index});
      if (holding_.friction[j] > 0.0) watches_.push_back({Watch::sliding, j, index});
    }
    if (part_.joints.empty()) return;
    for (int j = 0; j < joints_; ++j) {
      if (!holding_.standing[j]) continue;
      if (holding_.most(j) < Holding::infinity) watches_.push_back({Watch::held_up, j, -1});
      if (holding_.least(j) > -Holding::infinity) watches_.push_back({Watch::held_down, j, -1});
      holds_ = true;
    }
    const int moving = static_cast<int>(part_.joints.size());
    for (JointState* state : {&moved_, &later_, &turning_}) *state = JointState(moving);
    lambda_.resize(joints_);
    const bool dense = dense_ && (method_.family == Family::taylor || SerialRecursion::holds_for(part_.chain));
    form_ = make_form<double>(part_.chain, dense);
    motion_ = planar_chain::make_motion(method_, part_.chain, *form_, part_.forces, step_, dense);
    motion_->look_out(lookout_);
  }

  void gather(const JointState& state, JointState& moved) const {
    for (std::size_t k = 0; k < part_.joints.size(); ++k) {
      const int j = part_.joints[k];
      moved.position[k] = state.position[j], moved.velocity[k] = state.velocity[j];
      moved.position_remainder[k] = state.position_remainder[j];
      moved.velocity_remainder[k] = state.velocity_remainder[j];
    }
  }

  void scatter(const JointState& moved, JointState& state) const {
    for (std::size_t k = 0; k < part_.joints.size(); ++k) {
      const int j = part_.joints[k];
      state.position[j] = moved.position[k], state.velocity[j] = moved.velocity[k];
      state.position_remainder[j] = moved.position_remainder[k];
      state.velocity_remainder[j] = moved.velocity_remainder[k];
    }
  }

  void note(const JointEvent& event) {
    ++before_.events, ++counts.events;
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
  std::vector<double> held_;                                  // the actuators' efforts
  MovingPart part_;
  std::unique_ptr<Form> form_;
  std::unique_ptr<Motion> motion_;                            // null where nothing moves
  std::vector<double> driven_;                                // efforts on the moving part that do not change
  std::vector<Watch> watches_, violated_;
  bool holds_ = false, under_way_ = false, changed_ = false;  // the last: forces other than the actuators'
  Counts before_;                                             // of motions that ended
  JointState moved_{0}, later_{0}, turning_{0};
  std::vector<double> lambda_, of_moved_, work_, acceleration_;
  JointState kept_, full_;
  std::vector<double> saved_;                                 // what save() says before a tick
};

inline std::unique_ptr<Integrator> make_integrator(const MethodData& method, const Chain& chain, Form& form,
                                                   const JointForces& forces, double step, bool dense) {
  if (forces.have_events()) return std::make_unique<EventDriven>(chain, forces, method, step, dense);
  return make_motion(method, chain, form, forces, step, dense);
}

}  // namespace planar_chain
