// Python's view of many states and many simulations at once.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "../batch/roll_batch.hpp"
#include "../events/events.hpp"
#include "../integrators/methods.hpp"
#include "model.hpp"
#include "turn.hpp"

// Accelerations of many states, (states, joints) each, in the lanes of the widest vectors, by one thread.
class StateBatch {
 public:
  StateBatch(const Model& model, const Array& position, const Array& velocity, const Array& effort, bool dense)
      : states_(position.ndim() == 2 ? position.shape(0) : 0), joints_(model.chain().joint_count) {
    if (states_ < 1) throw py::value_error("the kernel got no states");
    for (const Array* array : {&position, &velocity, &effort}) numbers_of(*array, states_ * joints_);
    pc::with_width(pc::vector_widths().back(), [&](auto width) {
      using Width = decltype(width);
      auto lanes = std::make_shared<pc::StatesInLanes<typename Width::Real>>(
          pc::Scene{&model.chain(), &model.forces, dense}, position.data(), velocity.data(), effort.data(), states_);
      if (!lanes->possible()) throw py::value_error("this form of the chain is not made for lanes");
      run_ = [lanes](std::int64_t repeats) { lanes->repeats = repeats, Width::Vectors::run(*lanes); };
      read_ = [lanes](double* out) { lanes->read(out); };
    });
  }

  void evaluate(std::int64_t repeats) {
    turn_.await();
    LongCall call(&turn_);
    call.let_go();
    run_(repeats);
  }

  Array accelerations() {
    turn_.await();
    Array out({states_, joints_});
    read_(out.mutable_data());
    return out;
  }

 private:
  const py::ssize_t states_, joints_;
  std::function<void(std::int64_t)> run_;
  std::function<void(double*)> read_;
  Turn turn_;
};

using SceneModels = std::vector<std::tuple<Model*, bool, pc::MethodData*>>;

inline void check_batch(const SceneModels& models, double step, std::int64_t ticks, const Array& position,
                        const Array& velocity, const Array& effort, int threads, int width) {
  const auto refuse = [](bool bad, const char* what) {
    if (bad) throw py::value_error(std::string("the kernel got a batch with bad ") + what);
  };
  const std::vector<int> widths = pc::vector_widths();
  refuse(!std::isfinite(step) || !(step > 0.0), "step");
  refuse(ticks < 0 || ticks > pc::most_ticks, "ticks");
  refuse(threads < 1 || threads >= 1 << 16, "threads");
  refuse(width != 0 && width != 1 && std::find(widths.begin(), widths.end(), width) == widths.end(), "width");
  refuse(position.ndim() != 2 || position.shape(0) < 1, "position");
  const py::ssize_t scenes = position.shape(0), joints = position.shape(1);
  refuse(models.size() != 1 && models.size() != static_cast<std::size_t>(scenes), "models");
  for (const auto& [model, dense, method] : models) {
    refuse(model == nullptr || model->chain().joint_count != joints, "models");
    refuse(method == nullptr || pc::misfit(*method) != nullptr, "methods");
    refuse(method->family != std::get<2>(models.front())->family, "methods");
  }
  refuse(!aligned(position), "position");
  refuse(velocity.ndim() != 2 || velocity.shape(0) != scenes || velocity.shape(1) != joints || !aligned(velocity),
         "velocity");
  refuse(effort.ndim() != 3 || (effort.shape(0) != 1 && effort.shape(0) != scenes) ||
             (effort.shape(1) != 1 && effort.shape(1) != ticks) || effort.shape(2) != joints || !aligned(effort),
         "effort");
}

// Runs scenes of one model, or of a model each, with whether its form is dense and its method, which is one for all but
// for adaptive ones, from states (scenes, joints) under efforts (1 or scenes, 1 or ticks, joints). Returns positions,
// velocities (scenes, ticks + 1, joints) and efforts (scenes, ticks, joints), or, if not `every_tick`, with 1 and no
// rows; then ticks done, outcome, joint of each scene.
inline py::tuple roll_batch(const SceneModels& models, double step, std::int64_t ticks, const Array& position,
                            const Array& velocity, const Array& effort, bool every_tick, int threads, int width) {
  check_batch(models, step, ticks, position, velocity, effort, threads, width);
  pc::Batch batch;
  // Other threads have the interpreter meanwhile: they may drop a model, or add to its forces.
  std::vector<py::object> kept;
  std::deque<pc::JointForces> forces;
  for (const auto& [model, dense, method] : models) {
    kept.push_back(py::cast(model)), kept.push_back(py::cast(method));
    batch.scenes.push_back({&model->chain(), &forces.emplace_back(model->forces), dense});
  }
  batch.count = position.shape(0), batch.joints = static_cast<int>(position.shape(1));
  batch.ticks = ticks, batch.step = step;
  batch.position = position.data(), batch.velocity = velocity.data(), batch.effort = effort.data();
  if (effort.shape(1) > 1) batch.effort_tick_stride = static_cast<std::size_t>(batch.joints);
  if (effort.shape(0) > 1) batch.effort_scene_stride = static_cast<std::size_t>(effort.shape(1) * effort.shape(2));
  const pc::MethodData& first = *std::get<pc::MethodData*>(models.front());
  const bool smooth = std::none_of(batch.scenes.begin(), batch.scenes.end(),
                                   [](const pc::Scene& scene) { return scene.forces->have_events(); });
  if (smooth) batch.method = pc::lane_method(first), batch.tableau = first.tableau;
  batch.single_run = [&](std::size_t i) {
    const pc::Scene& scene = batch.scenes[i];
    const pc::MethodData& method = *std::get<pc::MethodData*>(models[i]);
    pc::SingleRun run{pc::make_form<double>(*scene.chain, scene.dense), nullptr};
    run.integrator = pc::make_integrator(method, *scene.chain, *run.form, *scene.forces, step, scene.dense);
    return run;
  };

  const py::ssize_t n = position.shape(0), m = position.shape(1), rows = every_tick ? ticks : 0;
  Array reached({n, rows + 1, m}), rate({n, rows + 1, m}), acted({n, rows, m});
  py::array_t<std::int64_t> done(n);
  Ints outcome(n), joint(n);
  batch.position_reached = reached.mutable_data(), batch.velocity_reached = rate.mutable_data();
  if (every_tick) batch.effort_taken = acted.mutable_data();
  batch.ticks_done = done.mutable_data(), batch.outcome = outcome.mutable_data(), batch.joint = joint.mutable_data();
  LongCall call;
  call.let_go();
  pc::roll_batch(batch, threads, width > 0 ? width : pc::vector_widths().back(), [&call] { return call.ask(); });
  call.take_back();
  call.raise();
  return py::make_tuple(reached, rate, acted, done, outcome, joint);
}
