// Small complementarity problems with bounds: contact and friction of several joints at once.
//
//   y = W x + b,  lower <= x <= upper,   y_i = 0 inside, y_i >= 0 where x_i = lower_i, y_i <= 0 where x_i = upper_i
//
// with W symmetric and positive definite: then there is exactly one solution. Principal pivoting by Murty's least index
// rule, which ends for every such W (K. G. Murty, Opsearch 11 (1974); Cottle, Pang, Stone, The Linear Complementarity
// Problem, 4.2).
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "../arithmetic/lu.hpp"

namespace planar_chain {

class BoxProblem {
 public:
  std::vector<double> W, b, lower, upper;  // W row by row
  std::vector<double> x, y;                // the solution
  enum class At { inside, lower, upper };
  std::vector<At> at;  // whether each x_i is at a bound

  explicit BoxProblem(std::size_t size)
      : W(size * size), b(size), lower(size), upper(size), x(size), y(size), at(size, At::inside) {}

  // False if rounding keeps the pivoting from ending: x is then within bounds, but y may have a wrong sign.
  bool solve() {
    const std::size_t size = b.size();
    for (std::size_t rounds = 0; rounds < 64 + 32 * size; ++rounds) {
      settle();
      std::size_t i = 0;
      while (i < size && fits(i)) ++i;
      if (i == size) return true;
    }
    for (std::size_t i = 0; i < size; ++i) x[i] = std::fmin(std::fmax(x[i], lower[i]), upper[i]);
    return false;
  }

 private:
  // x of those inside from y = 0, with the others at their bounds; then y of the others.
  void settle() {
    const std::size_t size = b.size();
    std::vector<std::size_t> inside;
    for (std::size_t i = 0; i < size; ++i) {
      if (at[i] == At::inside) inside.push_back(i), x[i] = 0.0;
      else x[i] = at[i] == At::lower ? lower[i] : upper[i];
    }
    for (std::size_t i = 0; i < size; ++i) {
      y[i] = b[i];
      for (std::size_t j = 0; j < size; ++j) y[i] += W[i * size + j] * x[j];
    }
    if (inside.empty()) return;
    LU lu(static_cast<int>(inside.size()));
    std::vector<double> right(inside.size());
    for (std::size_t k = 0; k < inside.size(); ++k) {
      right[k] = -y[inside[k]];
      for (std::size_t l = 0; l < inside.size(); ++l)
        lu.matrix()[k * inside.size() + l] = W[inside[k] * size + inside[l]];
    }
    lu.factorise();
    lu.solve(right.data());
    for (std::size_t k = 0; k < inside.size(); ++k) x[inside[k]] = right[k];
    for (std::size_t i = 0; i < size; ++i) {
      y[i] = b[i];
      for (std::size_t j = 0; j < size; ++j) y[i] += W[i * size + j] * x[j];
    }
    for (std::size_t i : inside) y[i] = 0.0;
  }

  // Whether x_i is where it belongs, up to rounding; else it changes sides. Without this tolerance it could go back and
  // forth.
  bool fits(std::size_t i) {
    const std::size_t size = b.size();
    constexpr double rounding = 64.0 * std::numeric_limits<double>::epsilon();
    if (at[i] == At::inside) {
      double most = 0.0;
      for (std::size_t j = 0; j < size; ++j) most = std::fmax(most, std::fabs(x[j]) * std::sqrt(W[j * size + j]));
      const double slack = rounding * most / std::sqrt(W[i * size + i]);
      if (x[i] < lower[i] - slack) return at[i] = At::lower, false;
      if (x[i] > upper[i] + slack) return at[i] = At::upper, false;
      return true;
    }
    double sum = std::fabs(b[i]);
    for (std::size_t j = 0; j < size; ++j) sum += std::fabs(W[i * size + j] * x[j]);
    if (at[i] == At::lower ? y[i] >= -rounding * sum : y[i] <= rounding * sum) return true;
    return at[i] = At::inside, false;
  }
};

}  // namespace planar_chain
