// A batch of scenes, and how one of them runs alone.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "../integrators/methods.hpp"
#include "../integrators/rollout.hpp"
#include "../integrators/runge_kutta.hpp"
#include "side_by_side.hpp"

namespace planar_chain {

// An integrator that runs one scene alone, with the form of the equations that it uses.
struct SingleRun {
  std::unique_ptr<Form> form;
  std::unique_ptr<Integrator> integrator;
};

// Methods that run in lanes; the others run scene by scene.
enum class LaneMethod { none, runge_kutta, semi_implicit_euler };

inline LaneMethod lane_method(const MethodData& data) {
  switch (data.family) {
    case Family::explicit_runge_kutta: return data.adaptive ? LaneMethod::none : LaneMethod::runge_kutta;
    case Family::semi_implicit: return LaneMethod::semi_implicit_euler;
    case Family::gauss:
    case Family::rosenbrock:
    case Family::taylor: return LaneMethod::none;
  }
  return LaneMethod::none;
}

struct Batch {
  std::vector<Scene> scenes;  // one for all states, or one for each
  std::int64_t count = 0, ticks = 0;
  int joints = 0;
  double step = 0.0;
  const double *position = nullptr, *velocity = nullptr;  // (count, joints)
  const double* effort = nullptr;                         // (1 or count, 1 or ticks, joints); stride 0: the same
  std::size_t effort_scene_stride = 0, effort_tick_stride = 0;
  LaneMethod method = LaneMethod::none;
  Tableau tableau;                                   // Runge-Kutta
  std::function<SingleRun(std::size_t)> single_run;  // of one of `scenes`
  mutable std::atomic<bool> stop{false};             // ends all threads

  // Results: states at all ticks (count, ticks + 1, joints) and efforts (count, ticks, joints), or, where effort_taken
  // is null, the last states alone (count, joints). After a failure the last good state is repeated, at no effort.
  double *position_reached = nullptr, *velocity_reached = nullptr, *effort_taken = nullptr;
  std::int64_t* ticks_done = nullptr;  // (count)
  int *outcome = nullptr, *joint = nullptr;

  std::size_t kind(std::int64_t i) const { return scenes.size() == 1 ? 0 : static_cast<std::size_t>(i); }
  const Scene& scene(std::int64_t i) const { return scenes[kind(i)]; }
  const double* effort_of(std::int64_t i, std::int64_t tick) const {
    return effort + static_cast<std::size_t>(i) * effort_scene_stride +
           static_cast<std::size_t>(tick) * effort_tick_stride;
  }
  void report(std::int64_t i, const Progress& progress) const {
    ticks_done[i] = progress.ticks, outcome[i] = static_cast<int>(progress.outcome), joint[i] = progress.joint;
  }
  // Where the rows of scene i at a tick begin in the results.
  std::size_t state_row(std::int64_t i, std::int64_t tick) const {
    return static_cast<std::size_t>(effort_taken == nullptr ? i : i * (ticks + 1) + tick) *
           static_cast<std::size_t>(joints);
  }
  std::size_t effort_row(std::int64_t i, std::int64_t tick) const {
    return static_cast<std::size_t>(i * ticks + tick) * static_cast<std::size_t>(joints);
  }
};

// Runs scenes alone, from the start or from the tick at which they left the lanes.
class ScenesAlone {
 public:
  explicit ScenesAlone(const Batch& batch)
      : batch_(batch), state_(batch.joints), effort_(batch.joints), latched_(batch.joints),
        lookout_(std::make_unique<Lookout>(batch.stop)) {}

  JointState& state() { return state_; }
  Lookout& lookout() { return *lookout_; }

  void run(std::int64_t i) {
    const std::size_t from = static_cast<std::size_t>(i) * effort_.size();
    std::copy_n(batch_.position + from, batch_.joints, state_.position.data());
    std::copy_n(batch_.velocity + from, batch_.joints, state_.velocity.data());
    std::fill(state_.position_remainder.begin(), state_.position_remainder.end(), 0.0);
    std::fill(state_.velocity_remainder.begin(), state_.velocity_remainder.end(), 0.0);
    finish(i, 0);
  }

  // Scene i is in state() at `tick`: takes it to the end, or to where it fails.
  void finish(std::int64_t i, std::int64_t tick) {
    const Scene& scene = batch_.scene(i);
    if (chain_ != scene.chain) alone_ = batch_.single_run(batch_.kind(i)), chain_ = scene.chain;
    alone_.integrator->set_lookout(lookout_.get());
    alone_.integrator->asked = false;  // a batch has no warnings
    alone_.integrator->forget();
    const bool all = batch_.effort_taken != nullptr;
    Record record;
    if (all) {
      record = {batch_.position_reached + batch_.state_row(i, tick + 1),
                batch_.velocity_reached + batch_.state_row(i, tick + 1),
                batch_.effort_taken + batch_.effort_row(i, tick)};
      keep_state(batch_.state_row(i, tick));
    }
    const Progress progress =
        roll(*alone_.integrator, *scene.forces, state_, batch_.step, static_cast<double>(tick) * batch_.step, tick,
             batch_.ticks - tick, {batch_.effort_of(i, tick), batch_.effort_tick_stride}, record, effort_, latched_);
    const std::int64_t done = tick + progress.ticks;
    batch_.report(i, {done, progress.outcome, progress.joint});
    if (!all) return keep_state(batch_.state_row(i, done));
    // Fills the remaining rows; after a stop nobody reads them.
    for (std::int64_t k = done + 1; k <= batch_.ticks && !lookout_->stop(1); ++k) keep_state(batch_.state_row(i, k));
    for (std::int64_t k = done; k < batch_.ticks && !lookout_->stop(1); ++k)
      std::fill_n(batch_.effort_taken + batch_.effort_row(i, k), batch_.joints, 0.0);
  }

 private:
  void keep_state(std::size_t row) {
    std::copy_n(state_.position.data(), batch_.joints, batch_.position_reached + row);
    std::copy_n(state_.velocity.data(), batch_.joints, batch_.velocity_reached + row);
  }

  const Batch& batch_;
  const Chain* chain_ = nullptr;
  SingleRun alone_;
  JointState state_;
  std::vector<double> effort_, latched_;
  std::unique_ptr<Lookout> lookout_;
};

}  // namespace planar_chain
