// Stops and dry friction: motion that is smooth between events, and the events, located to the method's accuracy.
//
// A joint with friction that does not turn, or one that rests on a stop, stands: it is built into the chain
// (standing_joints.hpp) and what holds it is a constraint effort lambda with bounds. Between events the moving joints
// are a plain chain under efforts, friction being -tau_c sgn(theta') with a constant sign. Events end such a stretch:
//
//   a moving joint reaches a stop         impact: v+ = v- + H^-1 n Lambda, 0 <= Lambda _|_ (n.v+ + e n.v-) >= 0 (Newton)
//   a rate with friction falls to zero    it sticks, or goes on, or turns back
//   lambda leaves its bounds              |lambda| <= tau_c of friction, lambda n >= 0 of a stop: it slips, or leaves
//
// After each, what stands is decided for all joints without rate together: theta'' = a_0 + H^-1 lambda, each lambda
// inside its bounds with theta'' = 0, or at a bound with theta'' away from it (box_problem.hpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <deque>
#include <limits>
#include <memory>
#include <vector>

#include "box_problem.hpp"
#include "forms.hpp"
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

// A rebound slower than this, rad/s or m/s, is none: infinitely many bounces end in rest.
constexpr double rest_speed = 1e-5;

class EventDriven final : public Integrator {
 public:
  EventDriven(const Chain& chain, const JointForces& forces, const MethodData& method, double step, bool dense)
      : chain_(chain), forces_(forces), method_(method), step_(step), dense_(dense), joints_(chain.joint_count),
        recursion_(chain), friction_(joints_), lower_(joints_, -infinity), upper_(joints_, infinity),
        restitution_(joints_), standing_(joints_), sign_(joints_), held_(joints_), acceleration_(joints_),
        effort_(joints_), answer_(joints_), unit_(joints_), kept_(joints_), full_(joints_) {
    for (const auto& law : forces.frictions) friction_[law.joint] = law.friction;
    for (const auto& law : forces.stops)
      lower_[law.joint] = law.lower, upper_[law.joint] = law.upper, restitution_[law.joint] = law.restitution;
  }

  std::deque<JointEvent> events;  // the newest most_kept, for whoever takes them

  Progress advance(double now, std::int64_t tick, std::int64_t ticks, JointState& state,
                   const double* actuator) override {
    Progress progress;
    double offset = now - static_cast<double>(tick) * step_;
    for (; progress.ticks < ticks; ++progress.ticks, offset = 0.0)
      if (!go(tick + progress.ticks, offset, step_, state, actuator, progress)) break;
    return progress;
  }

  bool reach(double now, std::int64_t tick, double time, JointState& state, const double* actuator,
             Progress& progress) override {
    if (!method_.adaptive) return false;
    const double start = static_cast<double>(tick) * step_;
    go(tick, now - start, time - start, state, actuator, progress);
    return true;
  }

  void forget() override { under_way_ = changed_ = false; }

  void forces_changed() override { changed_ = under_way_; }

  // Goes on from what stands and slides in `other`, whose chain has the same joints.
  void adopt(const EventDriven& other) {
    standing_ = other.standing_, sign_ = other.sign_, held_ = other.held_, places_ = other.places_;
    under_way_ = changed_ = other.under_way_;
    make_motion();
  }

  std::vector<double> save() const override {
    std::vector<double> all = {!under_way_ ? 0.0 : changed_ ? 2.0 : 1.0};
    if (!under_way_) return all;
    all.insert(all.end(), held_.begin(), held_.end());
    for (int j = 0; j < joints_; ++j) all.push_back(standing_[j] ? 1.0 : 0.0), all.push_back(sign_[j]);
    all.insert(all.end(), places_.begin(), places_.end());
    if (motion_) {
      const std::vector<double> ahead = motion_->save();
      all.insert(all.end(), ahead.begin(), ahead.end());
    }
    return all;
  }

  void load(const std::vector<double>& all) override {
    under_way_ = all[0] != 0.0, changed_ = all[0] == 2.0;
    if (!under_way_) return;
    const double* at = all.data() + 1;
    for (double& value : held_) value = *at++;
    for (int j = 0; j < joints_; ++j) standing_[j] = *at++ != 0.0, sign_[j] = *at++;
    places_.assign(at, at + joints_), at += joints_;
    make_motion();
    if (motion_) motion_->load(std::vector<double>(at, all.data() + all.size()));
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
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  static constexpr int most_events = 20000;     // in a tick; more are no motion
  static constexpr std::size_t most_kept = 4096;

  // What must not become negative.
  struct Watch {
    enum Kind { above_lower, below_upper, sliding, held_up, held_down } kind;
    int joint, index;  // of the chain, of the moving part
  };

  // From `from` to `to` s behind `tick`; false, with the state as it was, where it fails.
  bool go(std::int64_t tick, double from, double to, JointState& state, const double* actuator, Progress& progress) {
    kept_ = state;
    if (begin(tick, from, state, actuator, progress) && run(tick, from, to, state, progress)) return true;
    state = kept_, under_way_ = changed_ = false;
    return false;
  }

  // Where efforts or the state have changed, all that stands and slides is decided anew.
  bool begin(std::int64_t tick, double offset, JointState& state, const double* actuator, Progress& progress) {
    const bool same = std::memcmp(held_.data(), actuator, held_.size() * sizeof(double)) == 0;
    if (under_way_ && !changed_ && same) return true;
    if (!under_way_) std::fill(standing_.begin(), standing_.end(), false);
    std::memcpy(held_.data(), actuator, held_.size() * sizeof(double));
    const bool known = under_way_;
    under_way_ = true, changed_ = false;
    return collide(tick, offset, state, progress) && decide(tick, offset, state, known, progress);
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
      case Watch::above_lower: return state.position[watch.index] - lower_[watch.joint];
      case Watch::below_upper: return upper_[watch.joint] - state.position[watch.index];
      case Watch::sliding: return sign_[watch.joint] * state.velocity[watch.index];
      case Watch::held_up: return most(watch.joint) - lambda_[watch.joint];
      default: return lambda_[watch.joint] - least(watch.joint);
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
    return form_->forward(moved.position.data(), moved.velocity.data(), work_.data(), of_moved_.data());
  }

  // What holds the standing joints: inverse dynamics less the efforts that are there.
  bool find_lambda(const JointState& moved, Progress& progress) {
    const int joint = accelerate(moved);
    if (joint >= 0) return progress.outcome = Outcome::singular, progress.joint = joint, false;
    full_.position = places_, std::fill(full_.velocity.begin(), full_.velocity.end(), 0.0);
    scatter(moved, full_);
    std::fill(acceleration_.begin(), acceleration_.end(), 0.0);
    for (std::size_t k = 0; k < part_.joints.size(); ++k) acceleration_[part_.joints[k]] = of_moved_[k];
    recursion_.inverse(full_.position.data(), full_.velocity.data(), acceleration_.data(), true, lambda_.data());
    std::copy(held_.begin(), held_.end(), effort_.begin());
    for (const auto& law : forces_.springs) effort_[law.joint] -= law.stiffness * (full_.position[law.joint] - law.rest);
    forces_.add_wrenches(full_.position.data(), nullptr, effort_.data());
    for (int j = 0; j < joints_; ++j) lambda_[j] -= effort_[j];
    return true;
  }

  // Bounds of what may hold joint j where it stands.
  bool on_lower(int j, double position) const { return position <= lower_[j]; }
  bool on_upper(int j, double position) const { return position >= upper_[j]; }
  double least(int j) const { return on_upper(j, places_[j]) ? -infinity : -friction_[j]; }
  double most(int j) const { return on_lower(j, places_[j]) ? infinity : friction_[j]; }

  // The state is where something was violated: puts it right, and decides how it goes on.
  bool happen(std::int64_t tick, double offset, JointState& state, Progress& progress) {
    for (const Watch& watch : violated_) {
      const int j = watch.joint;
      if (watch.kind == Watch::above_lower) state.position[j] = lower_[j], state.position_remainder[j] = 0.0;
      if (watch.kind == Watch::below_upper) state.position[j] = upper_[j], state.position_remainder[j] = 0.0;
      if (watch.kind == Watch::sliding) state.velocity[j] = state.velocity_remainder[j] = 0.0;
    }
    return collide(tick, offset, state, progress) && decide(tick, offset, state, true, progress);
  }

  // Impacts of all joints that are on a stop and move into it, together.
  bool collide(std::int64_t tick, double offset, JointState& state, Progress& progress) {
    std::vector<int> touching;
    std::vector<double> way;
    bool hit = false, gently = true;
    for (int j = 0; j < joints_; ++j) {
      const double n = on_lower(j, state.position[j]) ? 1.0 : on_upper(j, state.position[j]) ? -1.0 : 0.0;
      if (n == 0.0 || n * state.velocity[j] > 0.0) continue;
      touching.push_back(j), way.push_back(n);
      if (state.velocity[j] == 0.0) continue;
      hit = true, gently = gently && std::fabs(state.velocity[j]) < rest_speed;
      note({tick, offset, EventKind::touched, j, std::fabs(state.velocity[j])});
    }
    if (!hit) return true;
    if (!factorise(state, progress)) return false;
    // An impact slower than rest_speed ends at once, and moves nothing that stands: else two joints on their stops might
    // push each other off, weaker and weaker, for ever. It only takes energy, as a projection does.
    if (gently)
      for (int j = 0; j < joints_; ++j)
        if (standing_[j] && state.velocity[j] == 0.0 && std::find(touching.begin(), touching.end(), j) == touching.end())
          touching.push_back(j), way.push_back(1.0);
    const std::size_t count = touching.size();
    BoxProblem impact(count);
    std::vector<double> target(count);
    for (std::size_t i = 0; i < count; ++i) {
      const int j = touching[i];
      const double speed = way[i] * state.velocity[j], rebound = -restitution_[j] * speed;
      target[i] = rebound > rest_speed ? rebound : 0.0;
      impact.b[i] = speed - target[i], impact.upper[i] = infinity, impact.lower[i] = gently ? -infinity : 0.0;
      respond(j);
      for (std::size_t k = 0; k < count; ++k) impact.W[k * count + i] = way[i] * way[k] * answer_[touching[k]];
    }
    impact.solve();
    for (std::size_t i = 0; i < count; ++i) {
      if (impact.x[i] == 0.0) continue;
      respond(touching[i]);
      for (int j = 0; j < joints_; ++j)
        add_compensated(state.velocity[j], state.velocity_remainder[j], way[i] * impact.x[i] * answer_[j],
                        state.velocity[j], state.velocity_remainder[j]);
    }
    for (std::size_t i = 0; i < count; ++i)
      if (impact.at[i] == BoxProblem::At::inside)
        state.velocity[touching[i]] = way[i] * target[i], state.velocity_remainder[touching[i]] = 0.0;
    return true;
  }

  // Which of the joints without rate stand, and which way the others with friction slide.
  bool decide(std::int64_t tick, double offset, JointState& state, bool known, Progress& progress) {
    std::vector<int> still;
    for (int j = 0; j < joints_; ++j) {
      sign_[j] = state.velocity[j] > 0.0 ? 1.0 : state.velocity[j] < 0.0 ? -1.0 : 0.0;
      const bool on_stop = on_lower(j, state.position[j]) || on_upper(j, state.position[j]);
      if (sign_[j] == 0.0 && (friction_[j] > 0.0 || on_stop)) still.push_back(j);
    }
    places_ = state.position;
    const std::vector<bool> stood = standing_;
    std::fill(standing_.begin(), standing_.end(), false);
    if (!still.empty()) {
      if (!factorise(state, progress)) return false;
      const std::size_t count = still.size();
      BoxProblem hold(count);
      for (std::size_t i = 0; i < count; ++i)
        hold.b[i] = acceleration_[still[i]], hold.lower[i] = least(still[i]), hold.upper[i] = most(still[i]);
      for (std::size_t i = 0; i < count; ++i) {
        respond(still[i]);
        for (std::size_t k = 0; k < count; ++k) hold.W[k * count + i] = answer_[still[k]];
      }
      hold.solve();
      for (std::size_t i = 0; i < count; ++i) {
        standing_[still[i]] = hold.at[i] == BoxProblem::At::inside || hold.y[i] == 0.0;
        if (!standing_[still[i]]) sign_[still[i]] = hold.at[i] == BoxProblem::At::lower ? 1.0 : -1.0;
      }
    }
    for (int j = 0; j < joints_; ++j) {
      const bool on_stop = on_lower(j, places_[j]) || on_upper(j, places_[j]);
      if (known && standing_[j] && !stood[j] && !on_stop) note({tick, offset, EventKind::stuck, j, 0.0});
      if (known && !standing_[j] && stood[j])
        note({tick, offset, on_stop ? EventKind::left : EventKind::slipped, j, 0.0});
    }
    make_motion();
    return true;
  }

  // Factors of the mass matrix of all joints, and the accelerations that they would have with nothing held.
  bool factorise(const JointState& state, Progress& progress) {
    std::copy(held_.begin(), held_.end(), effort_.begin());
    forces_.add_passive(state.position.data(), state.velocity.data(), effort_.data());
    const int joint = recursion_.evaluate(state.position.data(), state.velocity.data(), effort_.data(),
                                          acceleration_.data());
    if (joint < 0) return true;
    progress.outcome = singular_or_not_finite(state.position.data(), joints_), progress.joint = joint;
    return false;
  }

  // answer_ <- column j of the inverse mass matrix.
  void respond(int j) {
    unit_[j] = 1.0;
    recursion_.respond(unit_.data(), answer_.data());
    unit_[j] = 0.0;
  }

  // The moving part, its method from the start, and what is watched.
  void make_motion() {
    if (motion_) before_.add(motion_->counts);
    motion_.reset(), form_.reset();
    part_ = without_standing(chain_, forces_, standing_, places_.data());
    part_.forces.chain = &part_.chain;
    watches_.clear(), driven_.clear(), holds_ = false;
    for (std::size_t k = 0; k < part_.joints.size(); ++k) {
      const int j = part_.joints[k], index = static_cast<int>(k);
      driven_.push_back(held_[j] - friction_[j] * sign_[j]);
      if (lower_[j] > -infinity) watches_.push_back({Watch::above_lower, j, index});
      if (upper_[j] < infinity) watches_.push_back({Watch::below_upper, j, index});
      if (friction_[j] > 0.0) watches_.push_back({Watch::sliding, j, index});
    }
    if (part_.joints.empty()) return;
    for (int j = 0; j < joints_; ++j) {
      if (!standing_[j]) continue;
      if (most(j) < infinity) watches_.push_back({Watch::held_up, j, -1});
      if (least(j) > -infinity) watches_.push_back({Watch::held_down, j, -1});
      holds_ = true;
    }
    const int moving = static_cast<int>(part_.joints.size());
    for (JointState* state : {&moved_, &later_, &turning_}) *state = JointState(moving);
    lambda_.resize(joints_);
    const bool dense = dense_ && (method_.family == "taylor" || SerialRecursion::holds_for(part_.chain));
    form_ = make_form<double>(part_.chain, dense);
    motion_ = planar_chain::make_motion(method_, part_.chain, *form_, part_.forces, step_, dense);
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
  Recursion recursion_;                                       // of all joints
  std::vector<double> friction_, lower_, upper_, restitution_;
  std::vector<bool> standing_;
  std::vector<double> sign_, places_;                         // of friction's rates; where joints stood at the last event
  std::vector<double> held_;                                  // the actuators' efforts
  MovingPart part_;
  std::unique_ptr<Form> form_;
  std::unique_ptr<Motion> motion_;                            // null where nothing moves
  std::vector<double> driven_;                                // efforts on the moving part that do not change
  std::vector<Watch> watches_, violated_;
  bool holds_ = false, under_way_ = false, changed_ = false;  // the last: forces other than the actuators'
  Counts before_;                                             // of motions that ended
  JointState moved_{0}, later_{0}, turning_{0};
  std::vector<double> lambda_, of_moved_, work_, acceleration_, effort_, answer_, unit_;
  JointState kept_, full_;
};

inline std::unique_ptr<Integrator> make_integrator(const MethodData& method, const Chain& chain, Form& form,
                                                   const JointForces& forces, double step, bool dense) {
  if (forces.have_events()) return std::make_unique<EventDriven>(chain, forces, method, step, dense);
  return make_motion(method, chain, form, forces, step, dense);
}

}  // namespace planar_chain
