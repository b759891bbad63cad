// Python's view of a simulation.
#pragma once

#include <cmath>
#include <complex>
#include <cstdint>
#include <memory>
#include <tuple>
#include <vector>

#include "events.hpp"
#include "integrators.hpp"
#include "methods.hpp"
#include "py_model.hpp"
#include "rollout.hpp"

// State, method and workspace of one simulation. Ticks are counted by Python.
class Stepper {
 public:
  Stepper(const Model& model, const pc::MethodData& method, double step, bool dense)
      : forces_(model.forces), state_(model.chain().joint_count), effort_(state_.position.size()),
        latched_(state_.position.size()), zero_(state_.position.size()), step_(step),
        right_hand_side_(model.chain(), forces_),
        form_(pc::make_form<double>(model.chain(), dense)),
        integrator_(pc::make_integrator(method, model.chain(), *form_, forces_, step, dense)) {
    forces_.chain = &model.chain();
  }
  Stepper(const Stepper&) = delete;

  // Goes on from `now` s, at tick `tick` or behind it, where the arguments are whole: an int >= 0; None or a finite array
  // of (joints,) or (ticks, joints); None or a tuple of arrays (ticks, joints) that take position, velocity and effort.
  // Returns None when done, (ticks done, outcome, joint) where it stopped before or a coarse step is to be told, and
  // False, with nothing moved, where Python is to check or convert an argument first: a controlled run comes here at
  // every tick.
  py::object advance(double now, std::int64_t tick, const py::handle& ticks_given, const py::handle& effort_given,
                     const py::handle& record_given) {
    const py::ssize_t joints = static_cast<py::ssize_t>(effort_.size());
    if (!PyLong_CheckExact(ticks_given.ptr())) return py::bool_(false);
    int overflow = 0;
    const std::int64_t ticks = PyLong_AsLongLongAndOverflow(ticks_given.ptr(), &overflow);
    if (ticks < 0 || overflow != 0) return py::bool_(false);

    pc::Efforts efforts{zero_.data(), 0};
    if (!effort_given.is_none()) {
      if (!py::isinstance<Array>(effort_given)) return py::bool_(false);
      const Array effort = py::reinterpret_borrow<Array>(effort_given);
      const bool rows = effort.ndim() == 2;
      if (effort.ndim() == 0 || effort.shape(effort.ndim() - 1) != joints || effort.ndim() > 2) return py::bool_(false);
      if (rows && effort.shape(0) != ticks) return py::bool_(false);
      for (py::ssize_t i = 0; i < effort.size(); ++i)
        if (!std::isfinite(effort.data()[i])) return py::bool_(false);
      efforts = {effort.data(), rows ? effort_.size() : 0};
    }
    pc::Record record;
    if (!record_given.is_none()) {
      if (!PyTuple_CheckExact(record_given.ptr()) || PyTuple_GET_SIZE(record_given.ptr()) != 3) return py::bool_(false);
      double** const fields[] = {&record.position, &record.velocity, &record.effort};
      for (py::ssize_t i = 0; i < 3; ++i) {
        const py::handle given(PyTuple_GET_ITEM(record_given.ptr(), i));
        if (!py::isinstance<Array>(given)) return py::bool_(false);
        Array rows = py::reinterpret_borrow<Array>(given);
        if (rows.ndim() != 2 || rows.shape(0) != ticks || rows.shape(1) != joints || !rows.writeable())
          return py::bool_(false);
        *fields[i] = rows.mutable_data();
      }
    }

    pc::Progress progress;
    if (ticks * joints < few_joint_ticks) {
      progress = pc::roll(*integrator_, forces_, state_, step_, now, tick, ticks, efforts, record, effort_, latched_);
    } else {
      py::gil_scoped_release release;
      progress = pc::roll(*integrator_, forces_, state_, step_, now, tick, ticks, efforts, record, effort_, latched_);
    }
    if (progress.outcome == pc::Outcome::good && (told_ || integrator_->coarse.joint < 0)) return py::none();
    return py::make_tuple(progress.ticks, static_cast<int>(progress.outcome), progress.joint);
  }

  // Once, the first step that was seen to be far from right: (tick, error, rad or m, joint, whether of all steps up to it); else None.
  py::object take_coarse_step() {
    const pc::CoarseStep& coarse = integrator_->coarse;
    if (told_ || coarse.joint < 0) return py::none();
    told_ = true;
    return py::make_tuple(coarse.tick, coarse.error, coarse.joint, coarse.summed);
  }

  // Goes on from `now`, at `tick` or behind it, to `time`, s, under the effort held; None when done, (outcome, joint) where it stopped before.
  py::object reach(double now, std::int64_t tick, double time, const Array& effort) {
    std::copy(effort.data(), effort.data() + effort.size(), latched_.begin());
    forces_.clamp(latched_.data());
    pc::Progress progress;
    integrator_->reach(now, tick, time, state_, latched_.data(), progress);
    if (progress.outcome != pc::Outcome::good)
      return py::make_tuple(static_cast<int>(progress.outcome), progress.joint);
    effort_ = latched_;
    return py::none();
  }

  // -1; or, with nothing changed, the joint whose position lies beyond a stop.
  int put_state(const py::handle& position, const py::handle& velocity) {
    const py::ssize_t joints = static_cast<py::ssize_t>(effort_.size());
    const Numbers q("position", position, {joints}), v("velocity", velocity, {joints});
    for (const auto& stop : forces_.stops)
      if (q.data()[stop.joint] < stop.lower || q.data()[stop.joint] > stop.upper) return stop.joint;
    set_state(q.data(), v.data());
    return -1;
  }

  void set_state(const double* position, const double* velocity) {
    integrator_->forget();
    std::copy(position, position + effort_.size(), state_.position.begin());
    std::copy(velocity, velocity + effort_.size(), state_.velocity.begin());
    std::fill(state_.position_remainder.begin(), state_.position_remainder.end(), 0.0);
    std::fill(state_.velocity_remainder.begin(), state_.velocity_remainder.end(), 0.0);
  }

  py::tuple save() const {
    return py::make_tuple(make_array(state_.position), make_array(state_.velocity),
                          make_array(state_.position_remainder), make_array(state_.velocity_remainder),
                          make_array(effort_), make_array(integrator_->save()));
  }

  void load(const Array& position, const Array& velocity, const Array& position_remainder,
            const Array& velocity_remainder, const Array& effort, const Array& ahead) {
    set_state(position.data(), velocity.data());
    std::copy(position_remainder.data(), position_remainder.data() + position_remainder.size(),
              state_.position_remainder.begin());
    std::copy(velocity_remainder.data(), velocity_remainder.data() + velocity_remainder.size(),
              state_.velocity_remainder.begin());
    std::copy(effort.data(), effort.data() + effort.size(), effort_.begin());
    integrator_->load(std::vector<double>(ahead.data(), ahead.data() + ahead.size()));
  }

  // In place of those that act: (slot of the link, whether the force turns with it, point, force, each as a complex number
  // of the link's axes or the plane's, moment).
  void set_wrenches(const std::vector<std::tuple<int, bool, std::complex<double>, std::complex<double>, double>>& given) {
    forces_.wrenches.clear();
    for (const auto& [link, turns, point, force, moment] : given)
      forces_.wrenches.push_back({link, turns, point.real(), point.imag(), force.real(), force.imag(), moment});
    integrator_->forces_changed();
  }

  // Joint efforts that do the work of the wrenches in this state.
  Array wrench_effort() const {
    std::vector<double> effort(effort_.size());
    forces_.add_wrenches(state_.position.data(), state_.position_remainder.data(), effort.data());
    return make_array(effort);
  }

  // Goes on from the state of `other`, whose chain has the same joints but may differ in all else.
  void take_over(const Stepper& other) {
    state_ = other.state_, effort_ = other.effort_, told_ = other.told_;
    const auto* before = dynamic_cast<const pc::EventDriven*>(other.integrator_.get());
    if (auto* driven = dynamic_cast<pc::EventDriven*>(integrator_.get()); driven && before) driven->adopt(*before);
  }

  Array position() const { return make_array(state_.position); }
  Array velocity() const { return make_array(state_.velocity); }
  Array effort() const { return make_array(effort_); }
  py::tuple counts() const {
    const pc::Counts& counts = integrator_->counts;
    return py::make_tuple(counts.evaluations, counts.steps, counts.rejected_steps, counts.events);
  }

  // Accelerations under the efforts that acted last, with what stands standing; -1, or the joint whose pivot vanished.
  py::tuple acceleration() {
    Array out(static_cast<py::ssize_t>(effort_.size()));
    int joint;
    if (auto* driven = dynamic_cast<pc::EventDriven*>(integrator_.get())) {
      joint = driven->accelerate(state_, effort_.data(), out.mutable_data());
    } else {
      std::vector<double> position = state_.position;
      right_hand_side_.start(position.data());
      joint = right_hand_side_.accelerate(*form_, state_.position.data(), state_.position_remainder.data(),
                                          position.data(), state_.velocity.data(), effort_.data(), out.mutable_data());
    }
    return py::make_tuple(out, joint);
  }

  // (tick, s behind it, kind, joint, speed) of each event since the last call, the newest few thousand.
  py::list take_events() {
    py::list taken;
    if (auto* driven = dynamic_cast<pc::EventDriven*>(integrator_.get())) {
      for (const pc::JointEvent& event : driven->events)
        taken.append(py::make_tuple(event.tick, event.offset, static_cast<int>(event.kind), event.joint, event.speed));
      driven->events.clear();
    }
    return taken;
  }

 private:
  // Below this, some microseconds, letting the interpreter go and taking it back would cost more than it gives.
  static constexpr std::int64_t few_joint_ticks = 32;

  pc::JointForces forces_;  // the model's, and wrenches
  pc::JointState state_;
  std::vector<double> effort_, latched_, zero_;
  const double step_;
  bool told_ = false;  // of a coarse step
  pc::RightHandSide right_hand_side_;
  std::unique_ptr<pc::Form> form_;
  std::unique_ptr<pc::Integrator> integrator_;
};
