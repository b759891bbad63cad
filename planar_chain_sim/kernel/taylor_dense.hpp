// Coefficients of the motion for a short chain, unrolled for its number of joints.
//
// Every joint point and mass centre is a sum of constants times a few turning and stretching vectors: E_i = e^(j phi_i)
// of a link that turns, and Y_w = x_w E_p of one that slides on a carrier p (D of equations.md 3 and 5, with its x taken
// out). With Z = (E, Y) the equations of 3 are, for constant complex B and inertia,
//
//   Gamma_a = sum over b of B_ab Z_b'' - conj(C_a) g               B = C m C*, C_ak: coefficient of Z_a in C_k
//   Q_i = H_ii phi_i'' + (j E_i) . Gamma_i + sum over slides on i of (j Y_w) . Gamma_w
//   f_w = E_p . Gamma_w
//   E' = j phi' E,   Y = x E_p
//
// (the part of H_ii that does not change apart, B_ii = 0 for a link that turns), so that an order costs two complex
// convolutions a vector and two small products with matrices of the step: the inverse of H, and that inverse times what
// the left sides make of B Z''.
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

// `Vectors`: at least the joints of the chain; unknowns and vectors have the same numbers, links that turn first, then
// slides, then idle ones that make the number up: uncoupled, of unit inertia, at rest. `Slides`: whether any joint slides.
template <int Vectors, bool Slides>
class DenseSeries {
 public:
  static constexpr int width = Vectors <= 2 ? 2 : 4;             // of a machine's vector
  static constexpr int lanes = (Vectors + width - 1) / width * width;
  static constexpr int parts = lanes / width;
  static constexpr int together = 2;                             // terms of a convolution
  static constexpr int most_orders = 30;
  using Vector = typename VectorOf<width>::type;

  struct alignas(sizeof(Vector)) Row {
    double of[lanes] = {};
    Vector& operator()(int p) { return reinterpret_cast<Vector*>(of)[p]; }
    const Vector& operator()(int p) const { return reinterpret_cast<const Vector*>(of)[p]; }
  };
  class Series {  // a row for each order, zero beyond both ends
   public:
    Row& operator[](int k) { return rows_[k + together]; }
    const Row& operator[](int k) const { return rows_[k + together]; }

   private:
    Row rows_[most_orders + 3 + 2 * together];
  };

  // Constants of the chain.
  int turning = 0, joints = 0;                // unknowns that are angles; angles and slides
  int carrier[Vectors] = {};                  // the angle that carries, -1: base
  int pivot_order[Vectors] = {};              // from the leaves
  Row coupling_x[Vectors], coupling_y[Vectors];  // Re B_ij, Im B_ij: a row for each j, lanes i
  Row weight_x, weight_y;                     // -conj(C_i) g
  Row inertia[Vectors];                       // of H what does not change
  Row spread[most_orders + 1];                // 1 / (k + 1) for an angle, 1 / (k + 1) (k + 2) for a slide

  // Coefficients. speed: phi'_k, x_(k+1). unit: E, of the carrier for a slide. vector: E, Y. pull: Gamma.
  Series speed, unit_x, unit_y, pull_x, pull_y, stretched_x, stretched_y;
  Series& vector_x = Slides ? stretched_x : unit_x;
  Series& vector_y = Slides ? stretched_y : unit_y;
  Row known[most_orders + 1];                 // Q_k, f_k of joint laws
  Row acceleration;                           // of the order just done

  // Matrices of the step from orders 0 of the vectors. Returns -1, or the unknown whose pivot vanished.
  __attribute__((always_inline)) inline int prepare() {
    Row arm_x[Vectors], arm_y[Vectors];  // column b: what unknown i feels of z at Z_b'' is arm . z
    for (int b = 0; b < Vectors; ++b)
      for (int p = 0; p < parts; ++p) {
        arm_x[b](p) = vector_x[0](p) * coupling_y[b](p) - vector_y[0](p) * coupling_x[b](p);
        arm_y[b](p) = vector_x[0](p) * coupling_x[b](p) + vector_y[0](p) * coupling_y[b](p);
      }
    if constexpr (Slides)
      for (int b = 0; b < Vectors; ++b)
        for (int w = turning; w < joints; ++w) {
          if (carrier[w] >= 0) arm_x[b].of[carrier[w]] += arm_x[b].of[w], arm_y[b].of[carrier[w]] += arm_y[b].of[w];
          const double bx = coupling_x[b].of[w], by = coupling_y[b].of[w], x = unit_x[0].of[w], y = unit_y[0].of[w];
          arm_x[b].of[w] = x * bx + y * by, arm_y[b].of[w] = y * bx - x * by;
        }
    for (int j = 0; j < Vectors; ++j)  // H, column by column
      for (int p = 0; p < parts; ++p) {
        const bool slides = Slides && j >= turning && j < joints;
        const double x = slides ? unit_x[0].of[j] : -unit_y[0].of[j], y = slides ? unit_y[0].of[j] : unit_x[0].of[j];
        inverse_[j](p) = inertia[j](p) + (arm_x[j](p) * x + arm_y[j](p) * y);
      }
    if constexpr (Slides)
      for (int w = turning; w < joints; ++w)
        if (const int j = carrier[w]; j >= 0)
          for (int p = 0; p < parts; ++p)
            inverse_[j](p) += arm_y[w](p) * vector_x[0].of[w] - arm_x[w](p) * vector_y[0].of[w];

    Row scale;
    for (int i = 0; i < Vectors; ++i) scale.of[i] = inverse_[i].of[i];
    for (int l = 0; l < joints; ++l) {  // Gauss and Jordan: the pivots are those of L D L^T, equations.md 6.2
      const int k = pivot_order[l];
      const double pivot = inverse_[k].of[k];
      if (!(pivot > 100.0 * 2.220446049250313e-16 * scale.of[k])) return k;
      const double reciprocal = 1.0 / pivot;
      inverse_[k].of[k] = 1.0;
      for (int p = 0; p < parts; ++p) inverse_[k](p) *= reciprocal;
      for (int i = 0; i < Vectors; ++i) {
        if (i == k) continue;
        const double factor = inverse_[i].of[k];
        inverse_[i].of[k] = 0.0;
        for (int p = 0; p < parts; ++p) inverse_[i](p) -= factor * inverse_[k](p);
      }
    }
    for (int b = 0; b < Vectors; ++b)
      for (int p = 0; p < parts; ++p) {
        Vector x = inverse_[0](p) * arm_x[b].of[0], y = inverse_[0](p) * arm_y[b].of[0];
        for (int l = 1; l < Vectors; ++l) x += inverse_[l](p) * arm_x[b].of[l], y += inverse_[l](p) * arm_y[b].of[l];
        answer_x_[b](p) = x, answer_y_[b](p) = y;
      }
    return -1;
  }

  // Everything of order k from what is known up to it. The newest coefficients come last in each sum, so that most of it
  // can be done while these are still being computed.
  __attribute__((always_inline)) inline void advance(int k, const double* reciprocal) {
    Row turn_x, turn_y, bend_x, bend_y, balance;
    const double order = k + 1;
    for (int p = 0; p < parts; ++p) {
      Vector x[together] = {}, y[together] = {}, torque[together] = {}, against[together] = {};
      for (int m = 1; m < k; m += together)  // sum over m <= k of speed_m unit_(k+1-m)
        for (int q = 0; q < together; ++q) {
          x[q] += speed[m + q](p) * unit_x[k + 1 - m - q](p);
          y[q] += speed[m + q](p) * unit_y[k + 1 - m - q](p);
        }
      for (int m = 2; m <= k; m += together)  // sum over m = 1 .. k of (j Z_m) . Gamma_(k-m)
        for (int q = 0; q < together; ++q) {
          torque[q] += vector_x[m + q](p) * pull_y[k - m - q](p);
          against[q] += vector_y[m + q](p) * pull_x[k - m - q](p);
        }
      Vector sum_x = x[0] + x[1], sum_y = y[0] + y[1];
      Vector rest = known[k](p) - ((torque[0] + torque[1]) - (against[0] + against[1]));
      if (k > 0) {
        if (k % 2 != 0) sum_x += speed[k](p) * unit_x[1](p), sum_y += speed[k](p) * unit_y[1](p);
        rest -= vector_x[1](p) * pull_y[k - 1](p) - vector_y[1](p) * pull_x[k - 1](p);
      }
      sum_x += speed[0](p) * unit_x[k + 1](p), sum_y += speed[0](p) * unit_y[k + 1](p);
      turn_x(p) = sum_x, turn_y(p) = sum_y, balance(p) = rest;
      bend_x(p) = -order * sum_y, bend_y(p) = order * sum_x;
    }
    if constexpr (Slides) slide_known(k, turn_x, turn_y, bend_x, bend_y, balance);
    for (int p = 0; p < parts; ++p) {
      Vector sum = inverse_[0](p) * balance.of[0], less = answer_x_[0](p) * bend_x.of[0];
      Vector more = answer_y_[0](p) * bend_y.of[0];
      for (int j = 1; j < Vectors; ++j) {
        sum += inverse_[j](p) * balance.of[j];
        less += answer_x_[j](p) * bend_x.of[j], more += answer_y_[j](p) * bend_y.of[j];
      }
      acceleration(p) = sum - (less + more);
    }
    for (int p = 0; p < parts; ++p) {
      speed[k + 1](p) = acceleration(p) * spread[k](p);
      turn_x(p) += speed[k + 1](p) * unit_x[0](p), turn_y(p) += speed[k + 1](p) * unit_y[0](p);
      unit_x[k + 2](p) = -turn_y(p) * reciprocal[k + 2], unit_y[k + 2](p) = turn_x(p) * reciprocal[k + 2];
      bend_x(p) = -order * turn_y(p), bend_y(p) = order * turn_x(p);
    }
    if constexpr (Slides) slide_new(k, turn_x, turn_y, bend_x, bend_y);
    for (int p = 0; p < parts; ++p) {
      Vector x = k == 0 ? weight_x(p) : Vector{}, y = k == 0 ? weight_y(p) : Vector{}, minus = Vector{}, plus = Vector{};
      for (int j = 0; j < Vectors; ++j) {
        x += coupling_x[j](p) * bend_x.of[j], minus += coupling_y[j](p) * bend_y.of[j];
        y += coupling_x[j](p) * bend_y.of[j], plus += coupling_y[j](p) * bend_x.of[j];
      }
      pull_x[k](p) = x - minus, pull_y[k](p) = y + plus;
    }
  }

 private:
  // Y'' as far as it is known, its torque moved to the carrier, and the force f_k - sum over m = 1 .. k of E_m . Gamma.
  __attribute__((always_inline)) inline void slide_known(int k, const Row& turn_x, const Row& turn_y, Row& bend_x,
                                                         Row& bend_y, Row& balance) {
    const double factor = (k + 1) * (k + 2);
    for (int w = turning; w < joints; ++w) {
      const int i = carrier[w];
      double x = factor * turn_x.of[w], y = factor * turn_y.of[w];
      if (i >= 0) {
        x += place[w] * bend_x.of[i], y += place[w] * bend_y.of[i];
        balance.of[i] += balance.of[w] - known[k].of[w];
      }
      bend_x.of[w] = x, bend_y.of[w] = y;
      double force = known[k].of[w];
      for (int m = 1; m <= k; ++m)
        force -= unit_x[m].of[w] * pull_x[k - m].of[w] + unit_y[m].of[w] * pull_y[k - m].of[w];
      balance.of[w] = force;
    }
  }

  // E_(k+2) of the carrier and Y_(k+2) for every slide, E_(k+2) for every angle; Y'' whole.
  __attribute__((always_inline)) inline void slide_new(int k, const Row& turn_x, const Row& turn_y, Row& bend_x,
                                                       Row& bend_y) {
    const double factor = (k + 1) * (k + 2);
    for (int p = 0; p < parts; ++p) vector_x[k + 2](p) = unit_x[k + 2](p), vector_y[k + 2](p) = unit_y[k + 2](p);
    for (int w = turning; w < joints; ++w) {
      const int i = carrier[w];
      const double ex = i >= 0 ? unit_x[k + 2].of[i] : 0.0, ey = i >= 0 ? unit_y[k + 2].of[i] : 0.0;
      const double x = turn_x.of[w] + place[w] * ex, y = turn_y.of[w] + place[w] * ey;
      unit_x[k + 2].of[w] = ex, unit_y[k + 2].of[w] = ey;
      vector_x[k + 2].of[w] = x, vector_y[k + 2].of[w] = y;
      bend_x.of[w] = factor * x, bend_y.of[w] = factor * y;
    }
  }

 public:
  double place[Vectors] = {};                 // x_w

 private:
  Row inverse_[Vectors], answer_x_[Vectors], answer_y_[Vectors];  // a row for each column
};

template <int Vectors, bool Slides>
class TaylorDense final : public Taylor {
 public:
  TaylorDense(const Chain& chain, const JointForces& forces, double tick_length, int order, double tolerance,
              double fixed)
      : Taylor(chain, forces, tick_length, order, tolerance, fixed), chain_(chain) {
    number_unknowns();
    couple();
    for (int k = 0; k < order; ++k)
      for (int i = 0; i < series_.lanes; ++i)
        series_.spread[k].of[i] = i < series_.turning ? inverse_[k + 1] : inverse_[k + 1] * inverse_[k + 2];
  }

 protected:
  int expand(const JointState& base) override {
    place(base);
    know(effort_.data(), 0);
    auto& s = series_;
    for (int a = 0; a < s.joints; ++a) {  // gravity, which the pulls of order 0 hold from then on
      const int i = a < s.turning ? a : s.carrier[a];
      if (i >= 0)
        s.known[0].of[i] -= s.vector_x[0].of[a] * s.weight_y.of[a] - s.vector_y[0].of[a] * s.weight_x.of[a];
      if (a >= s.turning)
        s.known[0].of[a] -= s.unit_x[0].of[a] * s.weight_x.of[a] + s.unit_y[0].of[a] * s.weight_y.of[a];
    }
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
    const int unknown = series_.prepare();
    if (unknown >= 0) return joint_[unknown];
    for (int k = 1; k < order_ + series_.together; ++k) series_.speed[k] = {};  // not known yet
    const bool passive = !forces_.dampers.empty() || !forces_.springs.empty();
    for (int k = 0; k < order_; ++k) {
      if (k > 0 && passive) add_passive(k);
      series_.advance(k, inverse_.data());
      double* const next = velocity(k + 1);
      for (int i = 0; i < joints_; ++i) {
        const double own = series_.acceleration.of[i];
        next[joint_[i]] = sign_[i] * (i < series_.turning && series_.carrier[i] >= 0
                                          ? own - series_.acceleration.of[series_.carrier[i]] : own) * inverse_[k + 1];
      }
    }
    return -1;
  }

  // Angles get the first numbers, then slides; the order of pivots is from the leaves, an angle before its slide.
  void number_unknowns() {
    const int n = chain_.link_count();
    angle_.assign(n + 1, -1), slide_.assign(n + 1, -1);
    int count = 0;
    for (int i = 1; i <= n; ++i) {
      const Link& link = chain_.links[i];
      angle_[i] = link.rotation >= 0 ? count++ : angle_[link.carrier];
      if (link.rotation >= 0)
        series_.carrier[angle_[i]] = angle_[link.carrier], joint_[angle_[i]] = link.rotation, sign_[angle_[i]] = link.sign;
    }
    series_.turning = count;
    for (int i = 1; i <= n; ++i) {
      const Link& link = chain_.links[i];
      if (link.slide < 0) continue;
      slide_[i] = count++;
      series_.carrier[slide_[i]] = angle_[link.carrier], joint_[slide_[i]] = link.slide, sign_[slide_[i]] = 1.0;
    }
    series_.joints = count;
    for (int i = count; i < Vectors; ++i) series_.inertia[i].of[i] = 1.0;
    int* next = series_.pivot_order;
    for (int i = n; i >= 1; --i) {
      if (chain_.links[i].rotation >= 0) *next++ = angle_[i];
      if (chain_.links[i].slide >= 0) *next++ = slide_[i];
    }
  }

  // B, gravity and constant inertia, link by link: its joint point is the sum of arm_a Z_a, its mass centre has its own
  // first moment besides.
  void couple() {
    const int n = chain_.link_count();
    auto& s = series_;
    std::vector<std::vector<double>> arm_x(n + 1, std::vector<double>(Vectors)), arm_y(arm_x);
    for (int k = 1; k <= n; ++k) {
      const Link& link = chain_.links[k];
      std::vector<double>&x = arm_x[k] = arm_x[link.carrier], &y = arm_y[k] = arm_y[link.carrier];
      if (const int p = angle_[link.carrier]; p >= 0) x[p] += link.offset_x, y[p] += link.offset_y;
      if (link.slide >= 0) x[slide_[k]] += link.axis_x, y[slide_[k]] += link.axis_y;
      std::vector<double> moment_x(Vectors), moment_y(Vectors);  // m_k C_ak
      for (int a = 0; a < Vectors; ++a) moment_x[a] = link.mass * x[a], moment_y[a] = link.mass * y[a];
      const int own = angle_[k];
      if (own >= 0) {
        moment_x[own] += link.moment_x, moment_y[own] += link.moment_y;
        s.inertia[own].of[own] += link.inertia + (x[own] * link.moment_x + y[own] * link.moment_y);
      }
      for (int a = 0; a < Vectors; ++a) {
        s.weight_x.of[a] -= moment_x[a] * chain_.gravity_x + moment_y[a] * chain_.gravity_y;
        s.weight_y.of[a] -= moment_x[a] * chain_.gravity_y - moment_y[a] * chain_.gravity_x;
        for (int b = 0; b < Vectors; ++b) {
          double re = x[a] * moment_x[b] + y[a] * moment_y[b], im = x[a] * moment_y[b] - y[a] * moment_x[b];
          if (a == own) re += link.moment_x * x[b] + link.moment_y * y[b], im += link.moment_x * y[b] - link.moment_y * x[b];
          if (a == b && a < s.turning) {
            s.inertia[a].of[a] += a == own ? re - (x[a] * link.moment_x + y[a] * link.moment_y) : re;
          } else {
            s.coupling_x[b].of[a] += re, s.coupling_y[b].of[a] += im;
          }
        }
      }
      if (link.rotation >= 0) {  // S I_a S^T
        s.inertia[own].of[own] += link.rotor;
        if (const int p = s.carrier[own]; p >= 0)
          s.inertia[p].of[p] += link.rotor, s.inertia[p].of[own] -= link.rotor, s.inertia[own].of[p] -= link.rotor;
      }
      if (link.slide >= 0) s.inertia[slide_[k]].of[slide_[k]] += link.slide_armature;
    }
  }

  // Orders 0 and 1 from angles summed with what rounding loses.
  void place(const JointState& base) {
    auto& s = series_;
    double high[Vectors] = {}, low[Vectors] = {};
    for (int i = 0; i < s.turning; ++i) {
      const int p = s.carrier[i], joint = joint_[i];
      const double angle = p < 0 ? 0.0 : high[p], turned = sign_[i] * base.position[joint], sum = angle + turned;
      const double back = sum - angle;
      low[i] = (p < 0 ? 0.0 : low[p]) +
               (((angle - (sum - back)) + (turned - back)) + sign_[i] * base.position_remainder[joint]);
      high[i] = sum;
      const double rate = (p < 0 ? 0.0 : s.speed[0].of[p]) + sign_[i] * base.velocity[joint];
      double sine, cosine;
      sine_cosine(high[i], low[i], sine, cosine);
      s.speed[0].of[i] = rate;
      s.unit_x[0].of[i] = s.vector_x[0].of[i] = cosine, s.unit_y[0].of[i] = s.vector_y[0].of[i] = sine;
      s.unit_x[1].of[i] = s.vector_x[1].of[i] = -rate * sine, s.unit_y[1].of[i] = s.vector_y[1].of[i] = rate * cosine;
    }
    for (int w = s.turning; w < joints_; ++w) {
      const int p = s.carrier[w];
      const double x = s.place[w] = base.position[joint_[w]], rate = s.speed[0].of[w] = base.velocity[joint_[w]];
      for (int k = 0; k < 2; ++k) {
        s.unit_x[k].of[w] = p >= 0 ? s.unit_x[k].of[p] : 1.0 - k;
        s.unit_y[k].of[w] = p >= 0 ? s.unit_y[k].of[p] : 0.0;
      }
      s.vector_x[0].of[w] = x * s.unit_x[0].of[w], s.vector_y[0].of[w] = x * s.unit_y[0].of[w];
      s.vector_x[1].of[w] = rate * s.unit_x[0].of[w] + x * s.unit_x[1].of[w];
      s.vector_y[1].of[w] = rate * s.unit_y[0].of[w] + x * s.unit_y[1].of[w];
    }
  }

  // Q = S tau for angles, f for slides.
  void know(const double* effort, int k) {
    double* const known = series_.known[k].of;
    for (int i = 0; i < joints_; ++i) known[i] = 0.0;
    for (int i = 0; i < joints_; ++i) {
      const double own = sign_[i] * effort[joint_[i]];
      known[i] += own;
      if (i < series_.turning && series_.carrier[i] >= 0) known[series_.carrier[i]] -= own;
    }
  }

  // Coefficient k of what dampers and springs do; actuators, friction and gravity are constant and have none.
  void add_passive(int k) {
    std::memset(effort_.data(), 0, effort_.size() * sizeof(double));
    const double *v = velocity(k), *before = velocity(k - 1);
    for (const auto& law : forces_.dampers) effort_[law.joint] -= law.damping * v[law.joint];
    for (const auto& law : forces_.springs) effort_[law.joint] -= law.stiffness * before[law.joint] * inverse_[k];
    know(effort_.data(), k);
  }

  const Chain& chain_;
  std::vector<int> angle_, slide_;  // unknown of a link's angle, its carrier's where it has none; of its slide; else -1
  int joint_[Vectors] = {};
  double sign_[Vectors] = {};
  DenseSeries<Vectors, Slides> series_;
};

}  // namespace planar_chain
