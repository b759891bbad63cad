// Coefficients of the motion for a short tree of turning links, unrolled for its number of links.
//
// The torque balance of link i in absolute angles (equations.md 3, D m D* entry by entry, H_ij = Re B_ij E_j conj E_i):
//
//   H_ii phi_i'' + (j E_i) . G_i = Q_i,   G_i = sum over j != i of B_ij E_j'' - conj(D_i) g
//   B_ij = conj(rho_u) D_j  if i is a proper carrier of j and u its child on the way there;  B_ji = conj(B_ij)
//
// B is constant, so that an order costs two complex convolutions a link, E' = j phi' E and (j E) . G, and two small
// products with matrices of the step: the inverse of H and that inverse times (j E_i) . B_ij.
#pragma once

#include <cstring>
#include <vector>

#include "taylor.hpp"
#include "trigonometry.hpp"

namespace planar_chain {

// A few numbers at a time, with whatever vectors the machine has: the bits do not depend on it.
typedef double Two __attribute__((vector_size(16), aligned(16), may_alias));
typedef double Quad __attribute__((vector_size(32), aligned(32), may_alias));
template <int Width> struct VectorOf { using type = Quad; };
template <> struct VectorOf<2> { using type = Two; };

template <int Links>
struct DenseSeries {
  static constexpr int width = Links <= 2 ? 2 : 4;               // of a vector
  static constexpr int lanes = (Links + width - 1) / width * width;
  static constexpr int parts = lanes / width;                    // vectors in a row of lanes
  static constexpr int most_orders = 32;
  using Vector = typename VectorOf<width>::type;
  static constexpr int together = 2;                             // terms of a convolution
  struct alignas(sizeof(Vector)) Row { double of[lanes] = {}; };
  class Series {                                                 // a row for each order, zero beyond both ends
   public:
    Row& operator[](int k) { return rows_[k + together]; }
    const Row& operator[](int k) const { return rows_[k + together]; }

   private:
    Row rows_[most_orders + 3 + 2 * together];
  };

  // Constants of the chain.
  int carrier[Links];
  double sign[Links], rotor[Links];
  Row coupling_x[Links], coupling_y[Links];                      // Re B_ij, Im B_ij: a row for each j, lanes i
  Row gravity_x, gravity_y;                                      // -conj(D_i) g
  double inertia[Links][Links] = {};                             // of H what does not turn: H_ii, rotors
  double angle_inertia[Links] = {};
  // Coefficients, a row for each order.
  Series rate, unit_x, unit_y, pull_x, pull_y;
  Row known[most_orders + 1];                                    // Q_k of the joint laws
  // Matrices of the step: a row for each column.
  Row inverse[Links], answer_x[Links], answer_y[Links];

  static const Vector& part(const Row& row, int p) { return reinterpret_cast<const Vector*>(row.of)[p]; }
  static double lane(const Vector* vector, int i) { return vector[i / width][i % width]; }
  static Vector& part(Row& row, int p) { return reinterpret_cast<Vector*>(row.of)[p]; }

  // H, its inverse and inverse times (j E_i) . B_ij from E_0. Returns -1, or the link whose pivot vanished.
  __attribute__((always_inline)) inline int prepare() {
    Row arm_x[Links], arm_y[Links];  // (j E_i) . B_ij z = arm . z, a row for each j
    const Row &ex = unit_x[0], &ey = unit_y[0];
    double matrix[Links][lanes];
    for (int j = 0; j < Links; ++j)
      for (int i = 0; i < Links; ++i) {
        const double bx = coupling_x[j].of[i], by = coupling_y[j].of[i];
        arm_x[j].of[i] = ex.of[i] * by - ey.of[i] * bx;
        arm_y[j].of[i] = ex.of[i] * bx + ey.of[i] * by;
        matrix[j][i] = inertia[j][i] + (arm_y[j].of[i] * ex.of[j] - arm_x[j].of[i] * ey.of[j]);
      }
    // Gauss-Jordan from the leaves: the pivots are those of L D L^T, equations.md 6.2.
    for (int k = Links - 1; k >= 0; --k) {
      const double pivot = matrix[k][k];
      if (!(pivot > 100.0 * 2.220446049250313e-16 * angle_inertia[k])) return k;
      const double reciprocal = 1.0 / pivot;
      for (int i = 0; i < Links; ++i) {
        if (i == k) continue;
        const double factor = matrix[i][k] * reciprocal;
        for (int j = 0; j < Links; ++j)
          if (j != k) matrix[i][j] -= factor * matrix[k][j];
        matrix[i][k] = factor;
      }
      for (int j = 0; j < Links; ++j)
        if (j != k) matrix[k][j] *= -reciprocal;
      matrix[k][k] = reciprocal;
    }
    for (int j = 0; j < Links; ++j)
      for (int i = 0; i < Links; ++i) {
        inverse[j].of[i] = matrix[i][j];
        double x = 0.0, y = 0.0;
        for (int l = 0; l < Links; ++l) x += matrix[i][l] * arm_x[j].of[l], y += matrix[i][l] * arm_y[j].of[l];
        answer_x[j].of[i] = x, answer_y[j].of[i] = y;
      }
    return -1;
  }

  // Everything of order k from what is known up to it: rate[k + 1], unit[k + 2], pull[k]; known[k] is in.
  // Convolutions take `together` terms at a time; the rows beyond their ends are zero.
  __attribute__((always_inline)) inline void advance(int k, const double* reciprocal) {
    // The newest coefficients come last, so that most of the sums can be done while these are still being computed.
    Vector x[parts], y[parts], balance[parts];
    for (int p = 0; p < parts; ++p) {
      Vector turn_x[together] = {}, turn_y[together] = {}, torque[together] = {}, against[together] = {};
      for (int m = 1; m < k; m += together)
#pragma GCC unroll 2
        for (int q = 0; q < together; ++q) {  // sum over m <= k of phi'_m E_(k+1-m)
          turn_x[q] += part(rate[m + q], p) * part(unit_x[k + 1 - m - q], p);
          turn_y[q] += part(rate[m + q], p) * part(unit_y[k + 1 - m - q], p);
        }
      for (int m = 2; m <= k; m += together)
#pragma GCC unroll 2
        for (int q = 0; q < together; ++q) {  // sum over m = 1 .. k of (j E_m) . G_(k-m)
          torque[q] += part(unit_x[m + q], p) * part(pull_y[k - m - q], p);
          against[q] += part(unit_y[m + q], p) * part(pull_x[k - m - q], p);
        }
      x[p] = turn_x[0] + turn_x[1], y[p] = turn_y[0] + turn_y[1];
      balance[p] = part(known[k], p) - ((torque[0] + torque[1]) - (against[0] + against[1]));
      if (k > 0) {
        if (k % 2 != 0) x[p] += part(rate[k], p) * part(unit_x[1], p), y[p] += part(rate[k], p) * part(unit_y[1], p);
        balance[p] -= part(unit_x[1], p) * part(pull_y[k - 1], p) - part(unit_y[1], p) * part(pull_x[k - 1], p);
      }
      x[p] += part(rate[0], p) * part(unit_x[k + 1], p), y[p] += part(rate[0], p) * part(unit_y[k + 1], p);
    }
    const double order = k + 1;
    Vector bend_x[parts], bend_y[parts], angular[parts] = {}, less[parts] = {};  // E_k'' as far as it is known
    for (int p = 0; p < parts; ++p) bend_x[p] = -order * y[p], bend_y[p] = order * x[p];
#pragma GCC unroll 8
    for (int j = 0; j < Links; ++j)
      for (int p = 0; p < parts; ++p) {
        angular[p] += part(inverse[j], p) * lane(balance, j);
        less[p] += part(answer_x[j], p) * lane(bend_x, j) + part(answer_y[j], p) * lane(bend_y, j);
      }
    for (int p = 0; p < parts; ++p) {
      const Vector next = (angular[p] - less[p]) * reciprocal[k + 1];
      part(rate[k + 1], p) = next;
      x[p] += next * part(unit_x[0], p), y[p] += next * part(unit_y[0], p);
      part(unit_x[k + 2], p) = -y[p] * reciprocal[k + 2], part(unit_y[k + 2], p) = x[p] * reciprocal[k + 2];
      bend_x[p] = -order * y[p], bend_y[p] = order * x[p];
    }
    Vector gx[parts], gy[parts];
    for (int p = 0; p < parts; ++p) {
      gx[p] = k == 0 ? part(gravity_x, p) : Vector{};
      gy[p] = k == 0 ? part(gravity_y, p) : Vector{};
    }
#pragma GCC unroll 8
    for (int j = 0; j < Links; ++j)
      for (int p = 0; p < parts; ++p) {
        gx[p] += part(coupling_x[j], p) * lane(bend_x, j) - part(coupling_y[j], p) * lane(bend_y, j);
        gy[p] += part(coupling_x[j], p) * lane(bend_y, j) + part(coupling_y[j], p) * lane(bend_x, j);
      }
    for (int p = 0; p < parts; ++p) part(pull_x[k], p) = gx[p], part(pull_y[k], p) = gy[p];
  }
};

template <int Links>
class TaylorDense final : public Taylor {
 public:
  TaylorDense(const Chain& chain, const JointForces& forces, double tick_length, int order, double tolerance,
              double fixed)
      : Taylor(chain, forces, tick_length, order, tolerance, fixed), chain_(chain) {
    std::vector<double> moment_x(Links), moment_y(Links);  // D_i
    for (int i = 0; i < Links; ++i) {
      const Link& link = chain.links[i + 1];
      series_.carrier[i] = link.carrier - 1, series_.sign[i] = link.sign, series_.rotor[i] = link.rotor;
      moment_x[i] += link.moment_x, moment_y[i] += link.moment_y;
      series_.inertia[i][i] += link.inertia + link.rotor;
      const int p = link.carrier - 1;
      if (p < 0) continue;
      moment_x[p] += link.outboard_mass * link.offset_x, moment_y[p] += link.outboard_mass * link.offset_y;
      series_.inertia[p][p] += link.outboard_mass * (link.offset_x * link.offset_x + link.offset_y * link.offset_y);
      series_.inertia[p][p] += link.rotor;
      series_.inertia[p][i] = series_.inertia[i][p] = -link.rotor;
    }
    for (int j = 0; j < Links; ++j) {
      series_.angle_inertia[j] = series_.inertia[j][j];
      for (int u = j, i = series_.carrier[j]; i >= 0; u = i, i = series_.carrier[i]) {
        const double rx = chain.links[u + 1].offset_x, ry = chain.links[u + 1].offset_y;
        const double x = rx * moment_x[j] + ry * moment_y[j], y = rx * moment_y[j] - ry * moment_x[j];
        series_.coupling_x[j].of[i] = series_.coupling_x[i].of[j] = x;
        series_.coupling_y[j].of[i] = y, series_.coupling_y[i].of[j] = -y;
      }
      const double gx = chain.gravity_x, gy = chain.gravity_y;
      series_.gravity_x.of[j] = -(moment_x[j] * gx + moment_y[j] * gy);
      series_.gravity_y.of[j] = -(moment_x[j] * gy - moment_y[j] * gx);
    }
  }

 protected:
  int expand(const JointState& base) override {
    place(base);
    spread(effort_.data(), 0);
    for (int i = 0; i < Links; ++i)
      series_.known[0].of[i] -= series_.unit_x[0].of[i] * series_.gravity_y.of[i] -
                                series_.unit_y[0].of[i] * series_.gravity_x.of[i];
    return widest_ ? fill_wide() : fill();
  }

 private:
  // The same code twice; without contraction the wider vectors change no bit.
#if defined(__x86_64__) && defined(__GNUC__)
  __attribute__((target("avx2"))) int fill_wide() { return coefficients(); }
  const bool widest_ = __builtin_cpu_supports("avx2");
#else
  int fill_wide() { return coefficients(); }
  const bool widest_ = false;
#endif
  int fill() { return coefficients(); }

  __attribute__((always_inline)) inline int coefficients() {
    const int link = series_.prepare();
    if (link >= 0) return chain_.links[link + 1].rotation;
    for (int k = 1; k < order_ + series_.together; ++k) series_.rate[k] = {};  // not known yet
    for (int k = 0; k < order_; ++k) {
      if (k > 0 && passive()) add_passive(k);
      series_.advance(k, inverse_.data());
      double* const next = velocity(k + 1);
      for (int i = 0; i < Links; ++i) {
        const int p = series_.carrier[i];
        const double rate = series_.rate[k + 1].of[i] - (p < 0 ? 0.0 : series_.rate[k + 1].of[p]);
        next[chain_.links[i + 1].rotation] = series_.sign[i] * rate;
      }
    }
    return -1;
  }

  bool passive() const { return !forces_.dampers.empty() || !forces_.springs.empty(); }

  // E_0, E_1 and phi' from angles summed with what rounding loses.
  void place(const JointState& base) {
    double high[Links], low[Links];
    for (int i = 0; i < Links; ++i) {
      const Link& link = chain_.links[i + 1];
      const int p = link.carrier - 1, joint = link.rotation;
      double angle = 0.0, rest = 0.0, rate = 0.0;
      if (p >= 0) angle = high[p], rest = low[p], rate = series_.rate[0].of[p];
      const double turned = link.sign * base.position[joint], sum = angle + turned, back = sum - angle;
      low[i] = rest + (((angle - (sum - back)) + (turned - back)) + link.sign * base.position_remainder[joint]);
      high[i] = sum;
      rate += link.sign * base.velocity[joint];
      double sine, cosine;
      sine_cosine(high[i], low[i], sine, cosine);
      series_.rate[0].of[i] = rate;
      series_.unit_x[0].of[i] = cosine, series_.unit_y[0].of[i] = sine;
      series_.unit_x[1].of[i] = -rate * sine, series_.unit_y[1].of[i] = rate * cosine;
    }
  }

  // Q = S tau
  void spread(const double* effort, int k) {
    double* const known = series_.known[k].of;
    for (int i = 0; i < Links; ++i) known[i] = 0.0;
    for (int i = 0; i < Links; ++i) {
      const double torque = series_.sign[i] * effort[chain_.links[i + 1].rotation];
      known[i] += torque;
      if (series_.carrier[i] >= 0) known[series_.carrier[i]] -= torque;
    }
  }

  // Coefficient k of what dampers and springs do; actuators, friction and gravity are constant and have none.
  void add_passive(int k) {
    std::memset(effort_.data(), 0, effort_.size() * sizeof(double));
    const double *v = velocity(k), *before = velocity(k - 1);
    for (const auto& law : forces_.dampers) effort_[law.joint] -= law.damping * v[law.joint];
    for (const auto& law : forces_.springs) effort_[law.joint] -= law.stiffness * before[law.joint] * inverse_[k];
    spread(effort_.data(), k);
  }

  const Chain& chain_;
  DenseSeries<Links> series_;
};

}  // namespace planar_chain
