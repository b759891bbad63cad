// Python's view of a chain: single evaluations of its equations.
#pragma once

#include <pybind11/complex.h>
#include <pybind11/numpy.h>
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

#include "chain.hpp"
#include "forms.hpp"
#include "jacobian.hpp"
#include "joint_forces.hpp"
#include "recursive.hpp"
#include "whole_turns.hpp"

namespace py = pybind11;
namespace pc = planar_chain;

using Array = py::array_t<double, py::array::c_style>;
using Ints = py::array_t<int, py::array::c_style>;

// Whether the numbers lie where the processor can read them.
inline bool aligned(const py::array& array) { return (array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_) != 0; }

// An array of so many numbers; Python, which has checked it, says what was wanted.
inline const double* numbers_of(const Array& array, py::ssize_t count) {
  if (array.size() != count || !aligned(array))
    throw py::value_error("the kernel got an array of " + std::to_string(array.size()) + " numbers, must be " +
                          std::to_string(count) + ", aligned");
  return array.data();
}

inline Array make_array(const std::vector<double>& values) {
  return Array(static_cast<py::ssize_t>(values.size()), values.data());
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
    recursion_.emplace(chain_), turns_.emplace(chain_);
    chain_.refined = pc::needs_refinement(chain_);
    recursive_ = pc::make_form<double>(chain_, false);
    effort_.resize(static_cast<std::size_t>(joint_count));
  }
  Model(const Model&) = delete;

  const pc::Chain& chain() const { return chain_; }
  pc::JointForces forces;

  // Of a law that is added.
  int joint(int index) const {
    if (index < 0 || index >= chain_.joint_count) throw py::value_error("the kernel got joint " + std::to_string(index));
    return index;
  }

  std::pair<Array, int> forward_dynamics(const Array& position, const Array& velocity, const Array& effort,
                                         bool dense) {
    Array acceleration(chain_.joint_count);
    check({&position, &velocity, &effort});
    std::copy(effort.data(), effort.data() + chain_.joint_count, effort_.begin());
    forces.add_passive(position.data(), velocity.data(), effort_.data());
    const int joint =
        form(dense).forward(near(position), velocity.data(), effort_.data(), acceleration.mutable_data());
    return {acceleration, joint};
  }

  // The same evaluation in a compiled loop, each from a slightly different angle, for timing alone.
  double evaluate_repeatedly(const Array& position, const Array& velocity, const Array& effort, std::int64_t count,
                             bool dense) {
    check({&position, &velocity, &effort});
    std::vector<double> q(position.data(), position.data() + chain_.joint_count), acceleration(effort_.size());
    const std::vector<double> acting(effort.data(), effort.data() + chain_.joint_count);
    double sum = 0.0;
    const std::unique_ptr<pc::Form> chosen = pc::make_form<double>(chain_, dense);  // others may ask this model meanwhile
    py::gil_scoped_release release;
    for (std::int64_t k = 0; k < count; ++k) {
      q[0] += 1e-9;
      chosen->forward(q.data(), velocity.data(), acting.data(), acceleration.data());
      sum += acceleration[0];
    }
    return sum;
  }

  Array inverse_dynamics(const Array& position, const Array& velocity, const Array& acceleration) {
    Array effort(chain_.joint_count);
    check({&position, &velocity, &acceleration});
    recursion_->inverse(near(position), velocity.data(), acceleration.data(), true, effort.mutable_data());
    std::fill(effort_.begin(), effort_.end(), 0.0);
    forces.add_passive(position.data(), velocity.data(), effort_.data());
    for (int i = 0; i < chain_.joint_count; ++i) effort.mutable_data()[i] -= effort_[static_cast<std::size_t>(i)];
    return effort;
  }

  // Column j is the effort of a unit acceleration of joint j, at rest and without gravity.
  Array mass_matrix(const Array& position) {
    const int n = chain_.joint_count;
    check({&position});
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
    check({&position, &velocity, &acceleration});
    pc::Jacobian jacobian(chain_, forces);
    jacobian.compute(near(position), velocity.data(), acceleration.data());
    const int n = chain_.joint_count;
    const auto square = [n](const std::vector<double>& rows) { return Array({n, n}, rows.data()); };
    return {square(jacobian.mass), square(jacobian.by_position), square(jacobian.by_velocity)};
  }

  std::pair<double, double> energy(const Array& position, const Array& velocity) {
    check({&position, &velocity});
    double kinetic, potential;
    recursion_->energy(near(position), velocity.data(), kinetic, potential);
    return {kinetic, potential + forces.spring_energy(position.data())};
  }

 private:
  void check(std::initializer_list<const Array*> arrays) const {
    for (const Array* array : arrays) numbers_of(*array, chain_.joint_count);
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
