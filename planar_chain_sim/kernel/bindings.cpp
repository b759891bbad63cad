// The border between Python and the kernel: NumPy arrays that Python has checked in, status codes out, no GIL held.
#include <pybind11/complex.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <complex>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>

#include "chain.hpp"
#include "events.hpp"
#include "forms.hpp"
#include "integrators.hpp"
#include "jacobian.hpp"
#include "joint_forces.hpp"
#include "methods.hpp"
#include "recursive.hpp"
#include "roll_batch.hpp"
#include "rollout.hpp"
#include "trigonometry.hpp"
#include "whole_turns.hpp"

namespace py = pybind11;
namespace pc = planar_chain;

using Array = py::array_t<double, py::array::c_style>;
using Ints = py::array_t<int, py::array::c_style>;

namespace {

Array make_array(const std::vector<double>& values) {
  return Array(static_cast<py::ssize_t>(values.size()), values.data());
}

// Finite numbers as a JSON list, each with the fewest digits that give it back: what `str(values.tolist())` says.
std::string json_list(const Array& values) {
#ifdef __cpp_lib_to_chars
  std::string text = "[";
  char digits[32];
  for (py::ssize_t k = 0; k < values.size(); ++k) {
    const std::string_view number(digits, std::to_chars(digits, digits + sizeof digits, values.data()[k]).ptr - digits);
    text.append(k ? ", " : "").append(number);
    if (number.find_first_of(".e") == number.npos) text += ".0";
  }
  return text + "]";
#else
  return py::str(values.attr("tolist")());
#endif
}

// The command that comes at nearly every tick, a std_msgs/msg/Float64MultiArray (CDR) without dimensions: where it has a
// finite effort for each joint, they are put into `effort`, and the event that tells so is returned, a
// std_msgs/msg/String. None for any other message, which is Python's to judge; it would take ten times as long for this.
py::object plain_command(const py::bytes& data, Array& effort, long long tick, const char* topic) {
  const std::string_view message = data;
  const auto joints = static_cast<std::uint32_t>(effort.size());
  const std::uint32_t head[] = {256, 0, 0, joints};   // encapsulation, no dimensions, data_offset, count; then a gap
  if (!joints || message.size() < 20 + 8 * std::size_t(joints) || std::memcmp(message.data(), head, sizeof head))
    return py::none();
  std::vector<double> values(joints);
  std::memcpy(values.data(), message.data() + 20, 8 * std::size_t(joints));
  if (!std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); }))
    return py::none();
  std::copy(values.begin(), values.end(), effort.mutable_data());
  std::string told(8, '\0');
  told += "{\"tick\": " + std::to_string(tick) + ", \"kind\": \"command\", \"data\": {\"topic\": \"" + topic
          + "\", \"effort\": " + json_list(effort) + "}}";
  told += '\0';
  const std::uint32_t start[] = {256, static_cast<std::uint32_t>(told.size() - 8)};
  std::memcpy(&told[0], start, sizeof start);
  return py::bytes(told);
}

// Const data of one chain plus a workspace for single evaluations (used under the GIL only).
class Model {
 public:
  Model(const Ints& topology, const Array& constants, std::tuple<double, double> gravity, int joint_count) {
    const auto t = topology.unchecked<2>();   // carrier slot, slide joint, rotation joint
    const auto c = constants.unchecked<2>();  // in the order of Link::numbers
    chain_.joint_count = joint_count;
    chain_.gravity_x = std::get<0>(gravity);
    chain_.gravity_y = std::get<1>(gravity);
    chain_.links.resize(static_cast<std::size_t>(t.shape(0)) + 1);
    for (py::ssize_t i = 0; i < t.shape(0); ++i) {
      pc::Link& link = chain_.links[static_cast<std::size_t>(i) + 1];
      link.carrier = t(i, 0), link.slide = t(i, 1), link.rotation = t(i, 2);
      py::ssize_t column = 0;
      for (double pc::Link::* number : pc::Link::numbers) link.*number = c(i, column++);
    }
    chain_.find_features();
    recursion_.emplace(chain_), turns_.emplace(chain_);
    chain_.refined = pc::needs_refinement(chain_);
    recursive_ = pc::make_form<double>(chain_, false);
    effort_.resize(static_cast<std::size_t>(joint_count));
  }
  Model(const Model&) = delete;

  const pc::Chain& chain() const { return chain_; }
  pc::JointForces forces;

  std::pair<Array, int> forward_dynamics(const Array& position, const Array& velocity, const Array& effort,
                                         bool dense) {
    Array acceleration(chain_.joint_count);
    std::copy(effort.data(), effort.data() + chain_.joint_count, effort_.begin());
    forces.add_passive(position.data(), velocity.data(), effort_.data());
    const int joint =
        form(dense).forward(near(position), velocity.data(), effort_.data(), acceleration.mutable_data());
    return {acceleration, joint};
  }

  // The same evaluation in a compiled loop, each from a slightly different angle, for timing alone.
  double evaluate_repeatedly(const Array& position, const Array& velocity, const Array& effort, std::int64_t count,
                             bool dense) {
    std::vector<double> q(position.data(), position.data() + chain_.joint_count), acceleration(effort_.size());
    std::copy(effort.data(), effort.data() + chain_.joint_count, effort_.begin());
    double sum = 0.0;
    pc::Form& chosen = form(dense);
    py::gil_scoped_release release;
    for (std::int64_t k = 0; k < count; ++k) {
      q[0] += 1e-9;
      chosen.forward(q.data(), velocity.data(), effort_.data(), acceleration.data());
      sum += acceleration[0];
    }
    return sum;
  }

  Array inverse_dynamics(const Array& position, const Array& velocity, const Array& acceleration) {
    Array effort(chain_.joint_count);
    recursion_->inverse(near(position), velocity.data(), acceleration.data(), true, effort.mutable_data());
    std::fill(effort_.begin(), effort_.end(), 0.0);
    forces.add_passive(position.data(), velocity.data(), effort_.data());
    for (int i = 0; i < chain_.joint_count; ++i) effort.mutable_data()[i] -= effort_[static_cast<std::size_t>(i)];
    return effort;
  }

  // Column j is the effort of a unit acceleration of joint j, at rest and without gravity.
  Array mass_matrix(const Array& position) {
    const int n = chain_.joint_count;
    Array matrix({n, n});
    std::vector<double> zero(effort_.size()), unit(effort_.size());
    for (int j = 0; j < n; ++j) {
      unit[static_cast<std::size_t>(j)] = 1.0;
      recursion_->inverse(near(position), zero.data(), unit.data(), false, effort_.data());
      unit[static_cast<std::size_t>(j)] = 0.0;
      for (int i = 0; i < n; ++i) matrix.mutable_at(i, j) = effort_[static_cast<std::size_t>(i)];
    }
    for (int j = 0; j < n; ++j)  // equal up to rounding: make it exactly symmetric
      for (int i = 0; i < j; ++i) matrix.mutable_at(j, i) = matrix.at(i, j);
    return matrix;
  }

  // Mass matrix, and derivatives by position and velocity of the effort that inverse_dynamics gives; joints x joints.
  std::tuple<Array, Array, Array> derivatives(const Array& position, const Array& velocity, const Array& acceleration) {
    pc::Jacobian jacobian(chain_, forces);
    jacobian.compute(near(position), velocity.data(), acceleration.data());
    const int n = chain_.joint_count;
    const auto square = [n](const std::vector<double>& rows) { return Array({n, n}, rows.data()); };
    return {square(jacobian.mass), square(jacobian.by_position), square(jacobian.by_velocity)};
  }

  std::pair<double, double> energy(const Array& position, const Array& velocity) {
    double kinetic, potential;
    recursion_->energy(near(position), velocity.data(), kinetic, potential);
    return {kinetic, potential + forces.spring_energy(position.data())};
  }

 private:
  // Positions without whole turns.
  const double* near(const Array& position) {
    if (!turns_->find(position.data())) return position.data();
    position_.assign(position.data(), position.data() + position.size());
    turns_->leave_out(position.data(), std::vector<double>(position_.size()).data(), position_.data());
    return position_.data();
  }

  pc::Form& form(bool dense) {
    if (dense && !dense_) dense_ = pc::make_form<double>(chain_, true);  // its matrix is made for those who ask for it
    return dense ? *dense_ : *recursive_;
  }

  pc::Chain chain_;
  std::optional<pc::Recursion> recursion_;
  std::unique_ptr<pc::Form> recursive_, dense_;
  std::optional<pc::WholeTurns<double>> turns_;
  std::vector<double> effort_, position_;
};

// Accelerations of many states, (states, joints) each, in the lanes of the widest vectors, by one thread.
class StateBatch {
 public:
  StateBatch(const Model& model, const Array& position, const Array& velocity, const Array& effort, bool dense)
      : states_(position.shape(0)), joints_(position.shape(1)) {
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
    py::gil_scoped_release release;
    run_(repeats);
  }

  Array accelerations() const {
    Array out({states_, joints_});
    read_(out.mutable_data());
    return out;
  }

 private:
  const py::ssize_t states_, joints_;
  std::function<void(std::int64_t)> run_;
  std::function<void(double*)> read_;
};

// State, method and workspace of one simulation. Ticks are counted by Python.
class Stepper {
 public:
  Stepper(const Model& model, const pc::MethodData& method, double step, bool dense)
      : forces_(model.forces), state_(model.chain().joint_count), effort_(state_.position.size()),
        latched_(state_.position.size()), zero_(state_.position.size()), step_(step), turns_(model.chain()),
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

  // Once, the first step that was seen to be far from right: (tick, error, rad or m a second, joint); else None.
  py::object take_coarse_step() {
    const pc::CoarseStep& coarse = integrator_->coarse;
    if (told_ || coarse.joint < 0) return py::none();
    told_ = true;
    return py::make_tuple(coarse.tick, coarse.error_rate, coarse.joint);
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

  // False, with nothing changed, where Python is to check or convert an argument first.
  bool put_state(const py::handle& position, const py::handle& velocity) {
    for (const py::handle& given : {position, velocity}) {
      if (!py::isinstance<Array>(given)) return false;
      const Array array = py::reinterpret_borrow<Array>(given);
      if (array.ndim() != 1 || array.size() != static_cast<py::ssize_t>(effort_.size())) return false;
      for (py::ssize_t i = 0; i < array.size(); ++i)
        if (!std::isfinite(array.data()[i])) return false;
    }
    const double* at = py::reinterpret_borrow<Array>(position).data();
    for (const auto& stop : forces_.stops)
      if (at[stop.joint] < stop.lower || at[stop.joint] > stop.upper) return false;
    set_state(py::reinterpret_borrow<Array>(position), py::reinterpret_borrow<Array>(velocity));
    return true;
  }

  void set_state(const Array& position, const Array& velocity) {
    integrator_->forget();
    std::copy(position.data(), position.data() + position.size(), state_.position.begin());
    std::copy(velocity.data(), velocity.data() + velocity.size(), state_.velocity.begin());
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
    set_state(position, velocity);
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
      latched_ = effort_;
      forces_.add_passive(state_.position.data(), state_.velocity.data(), latched_.data());
      std::vector<double> position = state_.position;
      if (turns_.find(position.data()))
        turns_.leave_out(state_.position.data(), state_.position_remainder.data(), position.data());
      forces_.add_wrenches(position.data(), nullptr, latched_.data());
      joint = form_->forward(position.data(), state_.velocity.data(), latched_.data(), out.mutable_data());
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
  pc::WholeTurns<double> turns_;
  std::unique_ptr<pc::Form> form_;
  std::unique_ptr<pc::Integrator> integrator_;
};

// Runs scenes of one model, or of a model each, with whether its form is dense and its method, which is one for all but
// for adaptive ones, from states (scenes, joints) under efforts (1 or scenes, 1 or ticks, joints). Returns positions, velocities (scenes, ticks + 1, joints) and efforts
// (scenes, ticks, joints), or, if not `every_tick`, with 1 and no rows; then ticks done, outcome, joint of each scene.
py::tuple roll_batch(const std::vector<std::tuple<Model*, bool, pc::MethodData*>>& models, double step, std::int64_t ticks,
                     const Array& position, const Array& velocity, const Array& effort,
                     bool every_tick, int threads, int width) {
  pc::Batch batch;
  for (const auto& [model, dense, method] : models) batch.scenes.push_back({&model->chain(), &model->forces, dense});
  batch.count = position.shape(0), batch.joints = static_cast<int>(position.shape(1));
  batch.ticks = ticks, batch.step = step;
  batch.position = position.data(), batch.velocity = velocity.data(), batch.effort = effort.data();
  if (effort.shape(1) > 1) batch.effort_tick_stride = static_cast<std::size_t>(batch.joints);
  if (effort.shape(0) > 1) batch.effort_scene_stride = static_cast<std::size_t>(effort.shape(1) * effort.shape(2));
  const pc::MethodData& first = *std::get<pc::MethodData*>(models.front());
  const bool smooth = std::none_of(batch.scenes.begin(), batch.scenes.end(),
                                   [](const pc::Scene& scene) { return scene.forces->have_events(); });
  if (smooth && first.family == "explicit Runge-Kutta" && !first.adaptive)
    batch.method = pc::LaneMethod::runge_kutta, batch.tableau = first.tableau;
  if (smooth && first.family == "semi-implicit") batch.method = pc::LaneMethod::semi_implicit_euler;
  batch.single_run = [&](std::size_t i) {
    const pc::Scene& scene = batch.scenes[i];
    const pc::MethodData& method = *std::get<pc::MethodData*>(models[i]);
    pc::SingleRun run{pc::make_form<double>(*scene.chain, scene.dense), nullptr};
    run.integrator = make_integrator(method, *scene.chain, *run.form, *scene.forces, step, scene.dense);
    return run;
  };

  const py::ssize_t n = position.shape(0), m = position.shape(1), rows = every_tick ? ticks : 0;
  Array reached({n, rows + 1, m}), rate({n, rows + 1, m}), acted({n, rows, m});
  py::array_t<std::int64_t> done(n);
  Ints outcome(n), joint(n);
  batch.position_reached = reached.mutable_data(), batch.velocity_reached = rate.mutable_data();
  if (every_tick) batch.effort_taken = acted.mutable_data();
  batch.ticks_done = done.mutable_data(), batch.outcome = outcome.mutable_data(), batch.joint = joint.mutable_data();
  {
    py::gil_scoped_release release;
    pc::roll_batch(batch, threads, width > 0 ? width : pc::vector_widths().back());
  }
  return py::make_tuple(reached, rate, acted, done, outcome, joint);
}

}  // namespace

PYBIND11_MODULE(_kernel, module) {
  module.doc() = "Compiled twin of equations_of_motion.py and joint_forces.py; arrays must be checked by the caller.";
  module.def("unit_vector", [](double angle) {
    double sine, cosine;
    pc::sine_cosine(angle, sine, cosine);
    return std::complex<double>(cosine, sine);
  });
#ifdef __VERSION__
  module.attr("compiler") = __VERSION__;
#else
  module.attr("compiler") = "unknown compiler";
#endif

  py::class_<Model>(module, "Model")
      .def(py::init<const Ints&, const Array&, std::tuple<double, double>, int>())
      .def("add_damper", [](Model& m, int joint, double damping) { m.forces.dampers.push_back({joint, damping}); })
      .def("add_spring", [](Model& m, int joint, double stiffness, double rest) {
        m.forces.springs.push_back({joint, stiffness, rest});
      })
      .def("add_friction", [](Model& m, int joint, double friction) {
        m.forces.frictions.push_back({joint, friction});
      })
      .def("add_limit", [](Model& m, int joint, double limit) { m.forces.limits.push_back({joint, limit}); })
      .def("add_stop", [](Model& m, int joint, double lower, double upper, double restitution) {
        m.forces.stops.push_back({joint, lower, upper, restitution});
      })
      .def("forward_dynamics", &Model::forward_dynamics, py::arg("position"), py::arg("velocity"), py::arg("effort"),
           py::arg("dense") = false)
      .def("evaluate_repeatedly", &Model::evaluate_repeatedly, py::arg("position"), py::arg("velocity"),
           py::arg("effort"), py::arg("count"), py::arg("dense") = false)
      .def_property_readonly("refined", [](const Model& m) { return m.chain().refined; })
      .def("inverse_dynamics", &Model::inverse_dynamics)
      .def("mass_matrix", &Model::mass_matrix)
      .def("derivatives", &Model::derivatives)
      .def("energy", &Model::energy);

  py::class_<StateBatch>(module, "StateBatch")
      .def(py::init<const Model&, const Array&, const Array&, const Array&, bool>(), py::keep_alive<1, 2>())
      .def("evaluate", &StateBatch::evaluate)
      .def("accelerations", &StateBatch::accelerations);

  py::class_<pc::MethodData>(module, "MethodData")
      .def(py::init([](std::string family, int order, bool adaptive, double tolerance, double fixed) {
        return pc::MethodData{family, order, adaptive, {}, tolerance, fixed};
      }), py::arg("family"), py::arg("order"), py::arg("adaptive"), py::arg("tolerance"), py::arg("fixed") = 0.0)
      .def("set_tableau", [](pc::MethodData& data, int stages, std::vector<double> a, std::vector<double> b,
                             std::vector<double> error, std::vector<double> dense_a, std::vector<double> dense,
                             std::vector<double> c, double gamma) {
        data.tableau = {stages, a, b, error, dense_a, dense, c, gamma};
      });

  py::class_<Stepper>(module, "Stepper")
      .def(py::init<const Model&, const pc::MethodData&, double, bool>(), py::keep_alive<1, 2>())
      .def("advance", &Stepper::advance)
      .def("reach", &Stepper::reach)
      .def("put_state", &Stepper::put_state)
      .def("set_wrenches", &Stepper::set_wrenches)
      .def("wrench_effort", &Stepper::wrench_effort)
      .def("take_over", &Stepper::take_over)
      .def("take_coarse_step", &Stepper::take_coarse_step)
      .def("save", &Stepper::save)
      .def("load", &Stepper::load)
      .def_property_readonly("position", &Stepper::position)
      .def_property_readonly("velocity", &Stepper::velocity)
      .def_property_readonly("effort", &Stepper::effort)
      .def_property_readonly("counts", &Stepper::counts)
      .def("acceleration", &Stepper::acceleration)
      .def("take_events", &Stepper::take_events);

  module.def("roll_batch", &roll_batch);
  module.def("json_list", &json_list);
  module.def("plain_command", &plain_command);
  module.def("vector_widths", &pc::vector_widths);
}
