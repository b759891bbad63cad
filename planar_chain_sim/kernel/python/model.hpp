// Python's view of a chain: single evaluations of its equations.
#pragma once

#include <pybind11/complex.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "../forms/forms.hpp"
#include "../forms/jacobian.hpp"
#include "../forms/outcome.hpp"
#include "../forms/recursive.hpp"
#include "../forms/response.hpp"
#include "../forms/right_hand_side.hpp"
#include "../model/chain.hpp"
#include "../model/joint_forces.hpp"
#include "../model/wrench.hpp"
#include "arrays.hpp"

namespace pc = planar_chain;
using Complex = std::complex<double>;

// An array of so many numbers; Python, which has checked it, says what was wanted.
inline const double* numbers_of(const Array& array, py::ssize_t count) {
  if (array.size() != count || !aligned(array))
    throw py::value_error("the kernel got an array of " + std::to_string(array.size()) + " numbers, must be " +
                          std::to_string(count) + ", aligned");
  return array.data();
}

// A text as a plain str, whose comparison runs no code of others; anything else as it is.
inline py::object plain_text(const py::handle& given) {
  if (!PyUnicode_Check(given.ptr()) || PyUnicode_CheckExact(given.ptr()))
    return py::reinterpret_borrow<py::object>(given);
  return py::reinterpret_steal<py::object>(PyUnicode_FromObject(given.ptr()));
}

// Const data of one chain plus a workspace for single evaluations (used under the GIL only).
class Model {
 public:
  Model(const Ints& topology, const Array& constants, std::tuple<double, double> gravity, int joint_count) {
    check(topology, constants, joint_count);
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
    recursion_.emplace(chain_), right_hand_side_.emplace(chain_, forces);
    chain_.refined = pc::needs_refinement(chain_);
    recursive_ = pc::make_form<double>(chain_, false);
    effort_.resize(static_cast<std::size_t>(joint_count));
  }
  Model(const Model&) = delete;

  const pc::Chain& chain() const { return chain_; }
  pc::JointForces forces;

  // Names of the bodies, and where they are: (slot of the link, joint point, angle, e^(j angle)) in its frame.
  void place_bodies(const py::list& names, const std::vector<std::tuple<int, Complex, double, Complex>>& places) {
    if (names.size() != places.size() || !places_.empty()) throw py::value_error("the kernel got no names of bodies");
    py::list kept;
    py::dict numbers;
    std::vector<pc::BodyPlace> placed;
    for (const auto& [link, at, angle, turn] : places) {
      if (link < 0 || link > chain_.link_count()) throw py::value_error("the kernel got a body on no link");
      const py::object name = plain_text(names[placed.size()]);
      if (!PyUnicode_CheckExact(name.ptr())) throw py::type_error("the kernel got a name that is no text");
      kept.append(name);
      numbers[kept[placed.size()]] = py::int_(placed.size());
      placed.push_back({link, at.real(), at.imag(), turn.real(), turn.imag()});
    }
    if (numbers.size() != placed.size()) throw py::value_error("the kernel got two bodies of one name");
    names_ = kept, numbers_ = numbers, places_ = placed;
  }

  // The number of the body of this name, as plain_text() gives it; ValueError has the names of all bodies.
  std::size_t body(const py::handle& name) const {
    PyObject* const number = PyUnicode_CheckExact(name.ptr()) ? PyDict_GetItem(numbers_.ptr(), name.ptr()) : nullptr;
    if (number != nullptr) return PyLong_AsSize_t(number);
    const py::object names = py::str(", ").attr("join")(names_[py::slice(0, 32, 1)]);
    throw py::value_error(py::cast<std::string>(py::str("body is {!r:.80}, must be one of {}").format(name, names)));
  }
  py::object name_of(std::size_t body) const { return names_[body]; }
  const pc::BodyPlace& place_of(std::size_t body) const { return places_[body]; }

  // Adds a law of that name at a joint, with its numbers in the order of its header (laws/).
  void add_law(const std::string& name, int index, const std::vector<double>& numbers) {
    bool known = false;
    forces.each_list([&](auto& laws) {
      using Law = typename std::decay_t<decltype(laws)>::value_type;
      if (name != Law::name) return;
      if (numbers.size() != std::size(Law::numbers)) throw py::value_error("the kernel got a bad law " + name);
      Law law{};
      law.joint = joint(index);
      for (std::size_t k = 0; k < numbers.size(); ++k) law.*Law::numbers[k] = numbers[k];
      laws.push_back(law), known = true;
    });
    if (!known) throw py::value_error("the kernel knows no law " + name);
  }

  int joint(int index) const {
    if (index < 0 || index >= chain_.joint_count)
      throw py::value_error("the kernel got joint " + std::to_string(index));
    return index;
  }

  // (acceleration, outcome, joint): good, -1; or the joint whose pivot vanished, or whose acceleration is not finite.
  py::tuple forward_dynamics(const py::handle& position, const py::handle& velocity, const py::handle& effort,
                             bool dense) {
    const Numbers q = state("position", position), v = state("velocity", velocity), u = state("effort", effort);
    Array acceleration = new_array(chain_.joint_count);
    const auto [outcome, joint] = forward(q.data(), v.data(), u.data(), dense, acceleration.mutable_data());
    const py::tuple answer(3);  // by hand: half of the time that make_tuple takes
    PyTuple_SET_ITEM(answer.ptr(), 0, acceleration.release().ptr());
    PyTuple_SET_ITEM(answer.ptr(), 1, PyLong_FromLong(static_cast<int>(outcome)));
    PyTuple_SET_ITEM(answer.ptr(), 2, PyLong_FromLong(joint));
    return answer;
  }

  Array inverse_dynamics(const py::handle& position, const py::handle& velocity, const py::handle& acceleration) {
    const Numbers q = state("position", position), v = state("velocity", velocity),
                  a = state("acceleration", acceleration);
    Array effort = new_array(chain_.joint_count);
    inverse(q.data(), v.data(), a.data(), effort.mutable_data());
    return effort;
  }

  Array mass_matrix(const py::handle& position) {
    const Numbers q = state("position", position);
    Array matrix({chain_.joint_count, chain_.joint_count});
    mass(q.data(), matrix.mutable_data());
    return matrix;
  }

  std::pair<double, double> energy(const py::handle& position, const py::handle& velocity) {
    const Numbers q = state("position", position), v = state("velocity", velocity);
    return energy(q.data(), v.data());
  }

  // Mass matrix, and derivatives by position and velocity of the effort that inverse_dynamics gives; joints x joints.
  std::tuple<Array, Array, Array> derivatives(const py::handle& position, const py::handle& velocity,
                                              const py::handle& acceleration) {
    const Numbers q = joints("position", position), v = joints("velocity", velocity),
                  a = joints("acceleration", acceleration);
    jacobian().compute(right_hand_side_->without_turns(q.data()), v.data(), a.data());
    const int n = chain_.joint_count;
    const auto square = [n](const std::vector<double>& rows) { return Array({n, n}, rows.data()); };
    return {square(jacobian_->mass), square(jacobian_->by_position), square(jacobian_->by_velocity)};
  }

  // Why a state has no linearization.
  enum class Refusal { none, singular, no_acceleration, no_derivative, standing };

  friend const char* name_of(Refusal refusal) {
    switch (refusal) {
      case Refusal::none: return "none";
      case Refusal::singular: return "singular";
      case Refusal::no_acceleration: return "no_acceleration";
      case Refusal::no_derivative: return "no_derivative";
      case Refusal::standing: return "standing";
    }
    return nullptr;
  }

  // (A, B, refusal, joint), A and B as linearization.py says.
  py::tuple linearize(const py::handle& position, const py::handle& velocity, const py::handle& effort) {
    const Numbers q = joints("position", position), v = joints("velocity", velocity), u = joints("effort", effort);
    const py::ssize_t n = chain_.joint_count;
    Array a({2 * n, 2 * n}), b({2 * n, n});
    double *const a_rows = a.mutable_data(), *const b_rows = b.mutable_data();
    const auto [refusal, joint] = linearize(q.data(), v.data(), u.data(), a_rows, b_rows);
    return py::make_tuple(std::move(a), std::move(b), static_cast<int>(refusal), joint);
  }

  // Largest eigenvalue of H^-1 law, `law` (joints,) on the diagonal, by six steps of the power iteration, and the joint
  // that moves most in its eigenvector; 0 where the configuration is singular or nothing is finite.
  std::pair<double, int> largest_rate(const py::handle& position, const py::handle& law) {
    const Numbers q = joints("position", position), weights = joints("law", law);
    const std::size_t n = effort_.size();
    const std::vector<double> zero(n);
    std::vector<double> rest(n), vector(n, 1.0), effort(n), answer(n);
    if (forward(q.data(), zero.data(), zero.data(), false, rest.data()).outcome == pc::Outcome::singular)
      return {0.0, 0};
    double rate = 0.0, size = 1.0;
    std::size_t most = 0;
    for (int step = 0; step < 6 && 0.0 < size && std::isfinite(size); ++step) {
      for (std::size_t i = 0; i < n; ++i) effort[i] = weights.data()[i] * (vector[i] / size);
      forward(q.data(), zero.data(), effort.data(), false, answer.data());
      rate = 0.0, most = 0;
      for (std::size_t i = 0; i < n; ++i) {
        vector[i] = answer[i] - rest[i];
        if (!(std::fabs(vector[i]) <= rate)) rate = std::fabs(vector[i]), most = i;
        if (std::isnan(rate)) break;
      }
      size = rate;
    }
    return {std::isfinite(rate) ? rate : 0.0, static_cast<int>(most)};
  }

  // The same evaluation of forward_dynamics in a compiled loop, each from a slightly different angle, for timing alone.
  double evaluate_repeatedly(const py::handle& position, const py::handle& velocity, const py::handle& effort,
                             std::int64_t count, bool dense) {
    const Numbers given = joints("position", position), v = joints("velocity", velocity), u = joints("effort", effort);
    std::vector<double> q(given.data(), given.data() + chain_.joint_count), acceleration(effort_.size());
    const std::vector<double> acting(u.data(), u.data() + chain_.joint_count);
    const std::vector<double> rate(v.data(), v.data() + chain_.joint_count);
    double sum = 0.0;
    const std::unique_ptr<pc::Form> chosen =
        pc::make_form<double>(chain_, dense);  // others may ask this model meanwhile
    py::gil_scoped_release release;
    for (std::int64_t k = 0; k < count; ++k) {
      q[0] += 1e-9;
      chosen->forward(q.data(), rate.data(), acting.data(), acceleration.data());
      sum += acceleration[0];
    }
    return sum;
  }

  // The computation of the call of this name, `count` times without the border, for timing alone.
  double repeat(const std::string& call, const py::handle& position, const py::handle& velocity,
                const py::handle& given, std::int64_t count, bool dense) {
    const Numbers start = joints("position", position), v = joints("velocity", velocity), u = joints("given", given);
    const std::size_t n = effort_.size();
    std::vector<double> q(start.data(), start.data() + n), out(4 * n * n), more(2 * n * n);
    double sum = 0.0;
    for (std::int64_t k = 0; k < count; ++k) {
      q[0] += 1e-9;
      if (call == "forward_dynamics") forward(q.data(), v.data(), u.data(), dense, out.data());
      else if (call == "inverse_dynamics") inverse(q.data(), v.data(), u.data(), out.data());
      else if (call == "mass_matrix") mass(q.data(), out.data());
      else if (call == "energy") out[0] = energy(q.data(), v.data()).first;
      else if (call == "linearize") linearize(q.data(), v.data(), u.data(), out.data(), more.data());
      else throw py::value_error("no such call: " + call);
      sum += out[0];
    }
    return sum;
  }

 private:
  Numbers joints(const char* name, const py::handle& values) const { return {name, values, {chain_.joint_count}}; }

  // For a function that Python calls for each of many states.
  Numbers state(const char* name, const py::handle& values) const { return {name, values, {chain_.joint_count}, true}; }

  struct Evaluation {
    pc::Outcome outcome;
    int joint;
  };

  Evaluation forward(const double* position, const double* velocity, const double* effort, bool dense,
                     double* acceleration) {
    const int n = chain_.joint_count;
    const double* const all = right_hand_side_->efforts(position, velocity, effort);
    const int joint = form(dense).forward(right_hand_side_->near_position(), velocity, all, acceleration);
    if (joint >= 0) return {pc::Outcome::singular, joint};
    for (int i = 0; i < n; ++i)
      if (!std::isfinite(acceleration[i])) return {pc::Outcome::not_finite, i};
    return {pc::Outcome::good, -1};
  }

  void inverse(const double* position, const double* velocity, const double* acceleration, double* effort) {
    std::fill(effort_.begin(), effort_.end(), 0.0);
    const double* const passive = right_hand_side_->efforts(position, velocity, effort_.data());
    recursion_->inverse(right_hand_side_->near_position(), velocity, acceleration, true, effort);
    for (int i = 0; i < chain_.joint_count; ++i) effort[i] -= passive[i];
  }

  // Column j is the effort of a unit acceleration of joint j, at rest and without gravity.
  void mass(const double* position, double* matrix) {
    const std::size_t n = effort_.size();
    std::vector<double> zero(n), unit(n);
    const double* const near = right_hand_side_->without_turns(position);
    for (std::size_t j = 0; j < n; ++j) {
      unit[j] = 1.0;
      recursion_->inverse(near, zero.data(), unit.data(), false, effort_.data());
      unit[j] = 0.0;
      for (std::size_t i = 0; i < n; ++i) matrix[i * n + j] = effort_[i];
    }
    for (std::size_t j = 0; j < n; ++j)  // equal up to rounding: make it exactly symmetric
      for (std::size_t i = 0; i < j; ++i) matrix[j * n + i] = matrix[i * n + j];
  }

  std::pair<double, double> energy(const double* position, const double* velocity) {
    double kinetic, potential;
    recursion_->energy(right_hand_side_->without_turns(position), velocity, kinetic, potential);
    return {kinetic, potential + forces.stored_energy(position)};
  }

  // A (2 joints, 2 joints) and B (2 joints, joints), row by row; or why not, and the joint to blame.
  std::pair<Refusal, int> linearize(const double* position, const double* velocity, const double* effort, double* a,
                                    double* b) {
    const int n = chain_.joint_count;
    for (const auto& law : forces.all<pc::FrictionOf>())
      if (velocity[law.joint] == 0.0) return {Refusal::standing, law.joint};
    const double* const all = right_hand_side_->efforts(position, velocity, effort);
    const double* const near = right_hand_side_->near_position();
    acceleration_.resize(effort_.size());
    int singular = recursion_->evaluate(near, velocity, all, acceleration_.data());
    if (singular < 0 && chain_.refined) singular = recursive_->forward(near, velocity, all, acceleration_.data());
    if (singular >= 0) return {Refusal::singular, singular};
    for (int i = 0; i < n; ++i)
      if (!std::isfinite(acceleration_[i])) return {Refusal::no_acceleration, i};

    jacobian().compute_derivatives(near, velocity, acceleration_.data());
    if (!response_) response_.emplace(*recursion_, 3 * n);
    for (int i = 0; i < n; ++i) {
      double* const row = response_->row(i);
      const double* const k = &jacobian_->by_position[static_cast<std::size_t>(i) * n];
      const double* const c = &jacobian_->by_velocity[static_cast<std::size_t>(i) * n];
      for (int j = 0; j < n; ++j) row[j] = -k[j];
      for (int j = 0; j < n; ++j) row[n + j] = -c[j];
      std::fill(row + 2 * n, row + 3 * n, 0.0);
      row[2 * n + i] = 1.0;
    }
    if (!response_->solve())
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < 3 * n; ++j)
          if (!std::isfinite(response_->row(i)[j])) return {Refusal::no_derivative, i};
    const std::ptrdiff_t square = static_cast<std::ptrdiff_t>(n) * n;
    std::fill(a, a + 2 * square, 0.0);
    std::fill(b, b + square, 0.0);
    for (int i = 0; i < n; ++i) {
      const double* const row = response_->row(i);
      a[static_cast<std::ptrdiff_t>(i) * 2 * n + n + i] = 1.0;
      std::copy(row, row + 2 * n, a + 2 * square + static_cast<std::ptrdiff_t>(i) * 2 * n);
      std::copy(row + 2 * n, row + 3 * n, b + square + static_cast<std::ptrdiff_t>(i) * n);
    }
    return {Refusal::none, -1};
  }

  pc::Jacobian& jacobian() {
    if (!jacobian_) jacobian_.emplace(chain_, forces);  // its matrices are made at the first use
    return *jacobian_;
  }

  // A tree in regular labelling in which each joint moves one link.
  static void check(const Ints& topology, const Array& constants, int joint_count) {
    const py::ssize_t links = topology.ndim() == 2 ? topology.shape(0) : -1, columns = std::size(pc::Link::numbers);
    bool good = links > 0 && topology.shape(1) == 3 && constants.ndim() == 2 && constants.shape(0) == links &&
                constants.shape(1) == columns && aligned(topology) && aligned(constants) && joint_count > 0 &&
                joint_count <= 2 * links;
    std::vector<int> moved(good ? static_cast<std::size_t>(joint_count) : 0);
    for (py::ssize_t i = 0; good && i < links; ++i) {
      const int carrier = topology.at(i, 0), slide = topology.at(i, 1), rotation = topology.at(i, 2);
      good = carrier >= 0 && carrier <= i && (slide >= 0 || rotation >= 0);
      for (const int joint : {slide, rotation}) {
        good = good && joint >= -1 && joint < joint_count;
        if (good && joint >= 0) ++moved[static_cast<std::size_t>(joint)];
      }
    }
    if (!good || std::any_of(moved.begin(), moved.end(), [](int links_moved) { return links_moved != 1; }))
      throw py::value_error("the kernel got arrays that describe no chain");
  }

  pc::Form& form(bool dense) {
    if (dense && !dense_) dense_ = pc::make_form<double>(chain_, true);  // its matrix is made at the first use
    return dense ? *dense_ : *recursive_;
  }

  pc::Chain chain_;
  std::optional<pc::Recursion> recursion_;
  std::unique_ptr<pc::Form> recursive_, dense_;
  std::optional<pc::RightHandSide> right_hand_side_;
  std::optional<pc::Jacobian> jacobian_;
  std::optional<pc::Response> response_;
  std::vector<double> effort_, acceleration_;
  py::list names_;    // of the bodies
  py::dict numbers_;  // body -> its number
  std::vector<pc::BodyPlace> places_;
};
