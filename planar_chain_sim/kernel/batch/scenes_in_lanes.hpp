// Scenes that run side by side in the lanes of vectors: a block of a batch, and evaluations alone for timing.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "../arithmetic/compensated_sum.hpp"
#include "../forms/forms.hpp"
#include "../forms/right_hand_side.hpp"
#include "../integrators/fixed_step.hpp"
#include "batch.hpp"
#include "side_by_side.hpp"

namespace planar_chain {

// Runs a block of scenes, as many as Real has lanes. A scene with an event or a failure leaves and runs on alone.
template <class Real>
class ScenesInLanes {
  static constexpr int lanes = lanes_in<Real>;
  using Row = std::vector<Real>;

 public:
  explicit ScenesInLanes(const Batch& batch)
      : batch_(batch), joints_(static_cast<std::size_t>(batch.joints)), alone_(batch), state_(joints_), next_(joints_),
        step_(batch.step), actuator_(joints_), stage_(joints_), way_(joints_),
        rates_(joints_ * std::max<std::size_t>(1, batch.tableau.stages)), accelerations_(rates_.size()) {
    for (const Weights& row : rows_of(batch.tableau.a, std::max(1, batch.tableau.stages))) a_.push_back(terms(row));
    if (batch.tableau.stages > 0) b_ = terms(Weights(batch.tableau.b, batch.tableau.stages, 0));
  }

  Lookout& lookout() { return alone_.lookout(); }

  // Sets up block `block`; false if its scenes cannot share lanes and have been run one by one.
  bool prepare(std::int64_t block) {
    first_ = block * lanes;
    here_.resize(static_cast<std::size_t>(std::min<std::int64_t>(lanes, batch_.count - first_)));
    for (std::size_t k = 0; k < here_.size(); ++k) here_[k] = static_cast<int>(k);
    if (batch_.scenes.size() > 1 || !form_) {
      for (int i : here_)
        if (!same_make(batch_.scene(first_), batch_.scene(first_ + i))) return run_one_by_one();
      for (int i = 0; i < lanes; ++i) constants_.set(i, batch_.scene(scene_of(i)));
      form_ = make_form<Real>(constants_.chain, batch_.scene(first_).dense);
      right_hand_side_.emplace(constants_.chain, constants_.forces);
    }
    if (!form_) return run_one_by_one();
    state_ = State(joints_);
    for (int i = 0; i < lanes; ++i)
      for (std::size_t j = 0; j < joints_; ++j) {
        set_lane(state_.position[j], i, batch_.position[static_cast<std::size_t>(scene_of(i)) * joints_ + j]);
        set_lane(state_.velocity[j], i, batch_.velocity[static_cast<std::size_t>(scene_of(i)) * joints_ + j]);
      }
    return true;
  }

  void run() {
    const bool all = batch_.effort_taken != nullptr;
    if (all) keep_states(0);
    Lookout& lookout = alone_.lookout();
    for (std::int64_t tick = 0; tick < batch_.ticks && !here_.empty(); ++tick) {
      if (lookout.stop(16 * static_cast<std::int64_t>(joints_))) return;
      if (tick == 0 || batch_.effort_tick_stride != 0) latch(tick);
      const Truth<Real> stopped = step();
      if (any(stopped)) dismiss(stopped, tick);
      std::swap(state_, next_);
      if (!all) continue;
      keep_states(tick + 1);
      for (int i : here_) keep(actuator_, i, batch_.effort_taken + batch_.effort_row(first_ + i, tick));
    }
    if (!all) keep_states(batch_.ticks);
    for (int i : here_) batch_.report(first_ + i, {batch_.ticks, Outcome::good, -1});
  }

 private:
  struct State {
    Row position, velocity, position_remainder, velocity_remainder;
    explicit State(std::size_t joints)
        : position(joints), velocity(joints), position_remainder(joints), velocity_remainder(joints) {}
  };

  // Lanes to spare repeat the last scene.
  std::int64_t scene_of(int lane) const { return std::min(first_ + lane, batch_.count - 1); }

  bool run_one_by_one() {
    for (int i : here_) alone_.run(first_ + i);
    return false;
  }

  void latch(std::int64_t tick) {
    for (int i = 0; i < lanes; ++i) {
      const double* effort = batch_.effort_of(scene_of(i), tick);
      for (std::size_t j = 0; j < joints_; ++j) set_lane(actuator_[j], i, effort[j]);
    }
    constants_.forces.clamp(actuator_.data());
  }

  // weight k_l, of which a stage and the step are sums.
  struct Term {
    std::size_t row;
    Real weight;
  };

  std::vector<Term> terms(const Weights& weights) const {
    std::vector<Term> terms;
    for (std::size_t l = 0; l < weights.stage.size(); ++l)
      terms.push_back({static_cast<std::size_t>(weights.stage[l]) * joints_, weights.weight[l]});
    return terms;
  }

  // Of joint j, in the order of the stages.
  static Real sum(const std::vector<Term>& terms, const Row& k, std::size_t j) {
    Real sum = 0.0;
    for (const Term& term : terms) sum += term.weight * k[term.row + j];
    return sum;
  }

  // From state_ to next_; returns which scenes must not take this step.
  Truth<Real> step() {
    Truth<Real> singular = 0;
    switch (batch_.method) {
      case LaneMethod::runge_kutta: singular = runge_kutta(); break;
      case LaneMethod::semi_implicit_euler: singular = semi_implicit_euler(); break;
      case LaneMethod::none: break;  // runs alone
    }
    Real nothing = 0.0;       // becomes NaN if a number is not finite
    Truth<Real> violent = 0;  // scenes whose step is to be checked, alone
    for (std::size_t j = 0; j < joints_; ++j) {
      nothing += (next_.position[j] - next_.position[j]) + (next_.velocity[j] - next_.velocity[j]);
      const Real jump = (next_.velocity[j] - state_.velocity[j]) * step_;
      violent |= jump * jump > Real(violent_jump * violent_jump);
    }
    return singular | (nothing != 0.0) | violent;
  }

  // Accelerations under the actuators at stage_, `way_` from the state; returns which scenes have none.
  Truth<Real> evaluate(const Real* velocity, Real* acceleration) {
    right_hand_side_->accelerate(*form_, state_.position.data(), way_.data(), stage_.data(), velocity, actuator_.data(),
                                 acceleration);
    return form_->good() ^ -1;
  }

  // As in runge_kutta.hpp.
  Truth<Real> runge_kutta() {
    Truth<Real> singular = 0;
    right_hand_side_->start(state_.position.data());
    for (std::size_t l = 0; l < a_.size(); ++l) {
      Real *rate = &rates_[l * joints_], *acceleration = &accelerations_[l * joints_];
      for (std::size_t j = 0; j < joints_; ++j) {
        way_[j] = step_ * sum(a_[l], rates_, j) + state_.position_remainder[j];
        stage_[j] = state_.position[j] + way_[j];
        rate[j] = state_.velocity[j] + (step_ * sum(a_[l], accelerations_, j) + state_.velocity_remainder[j]);
      }
      singular |= evaluate(rate, acceleration);
    }
    for (std::size_t j = 0; j < joints_; ++j) {
      move_position(j, step_ * sum(b_, rates_, j));
      move_velocity(j, step_ * sum(b_, accelerations_, j));
    }
    return singular;
  }

  // As in semi_implicit_euler.hpp.
  Truth<Real> semi_implicit_euler() {
    right_hand_side_->start(state_.position.data());
    stage_ = state_.position, way_ = state_.position_remainder;
    const Truth<Real> singular = evaluate(state_.velocity.data(), accelerations_.data());
    for (std::size_t j = 0; j < joints_; ++j) {
      move_velocity(j, step_ * accelerations_[j]);
      Real coasted, lost;
      add_compensated<Real>(state_.position[j], state_.position_remainder[j], step_ * next_.velocity[j], coasted, lost);
      add_compensated<Real>(coasted, lost, step_ * next_.velocity_remainder[j], next_.position[j],
                            next_.position_remainder[j]);
    }
    return singular;
  }

  void move_position(std::size_t j, const Real& way) {
    add_compensated<Real>(state_.position[j], state_.position_remainder[j], way, next_.position[j],
                          next_.position_remainder[j]);
  }
  void move_velocity(std::size_t j, const Real& change) {
    add_compensated<Real>(state_.velocity[j], state_.velocity_remainder[j], change, next_.velocity[j],
                          next_.velocity_remainder[j]);
  }

  // Scenes that stop run on alone, which gives the reason; their lanes go on from zero, and their results are not used.
  __attribute__((noinline)) void dismiss(const Truth<Real>& stopped, std::int64_t tick) {
    std::vector<int> stay;
    for (int i : here_) {
      if (stopped.at[i] == 0) {
        stay.push_back(i);
        continue;
      }
      JointState& state = alone_.state();
      for (std::size_t j = 0; j < joints_; ++j) {
        state.position[j] = lane(state_.position[j], i), state.velocity[j] = lane(state_.velocity[j], i);
        state.position_remainder[j] = lane(state_.position_remainder[j], i);
        state.velocity_remainder[j] = lane(state_.velocity_remainder[j], i);
      }
      alone_.finish(first_ + i, tick);
    }
    for (int i = 0; i < lanes; ++i)
      if (stopped.at[i] != 0)
        for (Row* row : {&next_.position, &next_.velocity, &next_.position_remainder, &next_.velocity_remainder})
          for (Real& number : *row) set_lane(number, i, 0.0);
    here_ = stay;
  }

  void keep_states(std::int64_t tick) const {
    for (int i : here_) {
      const std::size_t row = batch_.state_row(first_ + i, tick);
      keep(state_.position, i, batch_.position_reached + row);
      keep(state_.velocity, i, batch_.velocity_reached + row);
    }
  }

  void keep(const Row& numbers, int i, double* out) const {
    for (std::size_t j = 0; j < joints_; ++j) out[j] = lane(numbers[j], i);
  }

  const Batch& batch_;
  const std::size_t joints_;
  ScenesAlone alone_;
  SideBySide<Real> constants_;
  std::unique_ptr<FormOf<Real>> form_;
  std::int64_t first_ = 0;
  std::vector<int> here_;  // lanes whose scenes have not left
  State state_, next_;
  const Real step_;
  std::vector<std::vector<Term>> a_;
  std::vector<Term> b_;
  std::optional<RightHandSideOf<Real>> right_hand_side_;
  Row actuator_, stage_, way_, rates_, accelerations_;
};

// Accelerations of many states of one chain, all arrays (count, joints), which are put side by side once: run()
// computes them `repeats` times over. All that belongs to one block of lanes lies together: arrays of their own, each
// of a whole number of pages, would meet in the same lines of the cache.
template <class Real>
class StatesInLanes {
 public:
  StatesInLanes(const Scene& scene, const double* position, const double* velocity, const double* effort,
                std::size_t count)
      : joints_(static_cast<std::size_t>(scene.chain->joint_count)), count_(count), constants_(in_all_lanes(scene)),
        form_(make_form<Real>(constants_.chain, scene.dense)), right_hand_side_(constants_.chain, constants_.forces),
        blocks_((count + lanes - 1) / lanes * quantities * joints_) {
    const double* given[] = {position, velocity, effort};
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t part = 0; part < 3; ++part)
        for (std::size_t j = 0; j < joints_; ++j)
          set_lane(block(i / lanes)[part * joints_ + j], static_cast<int>(i % lanes), given[part][i * joints_ + j]);
  }

  std::int64_t repeats = 1;

  bool possible() const { return form_ != nullptr; }

  void run() {
    for (std::int64_t k = 0; k < repeats; ++k)
      for (std::size_t at = 0; at < blocks_.size(); at += quantities * joints_) {
        const Real *position = &blocks_[at], *velocity = position + joints_;
        const Real* const effort = right_hand_side_.efforts(position, velocity, velocity + joints_);
        form_->forward(right_hand_side_.near_position(), velocity, effort, &blocks_[at + 3 * joints_]);
      }
  }

  void read(double* acceleration) {
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t j = 0; j < joints_; ++j)
        acceleration[i * joints_ + j] = lane(block(i / lanes)[3 * joints_ + j], static_cast<int>(i % lanes));
  }

 private:
  static constexpr std::size_t lanes = lanes_in<Real>, quantities = 4;  // position, velocity, effort, acceleration

  static SideBySide<Real> in_all_lanes(const Scene& scene) {
    SideBySide<Real> constants;
    for (int i = 0; i < lanes_in<Real>; ++i) constants.set(i, scene);
    return constants;
  }

  Real* block(std::size_t k) { return &blocks_[k * quantities * joints_]; }

  const std::size_t joints_, count_;
  SideBySide<Real> constants_;
  std::unique_ptr<FormOf<Real>> form_;
  RightHandSideOf<Real> right_hand_side_;
  AlignedVector<Real> blocks_;
};

}  // namespace planar_chain
