// The dense form of short chains: equations.md 3 for a serial chain whose links turn and do nothing else, unrolled for
// its number of links. In world axes H_ij = R_u . D_j for i a proper carrier of j, u the child of i towards j; H_ii and
// D_j = m_j c_j + M_w rho_w, w the next link, are constants of the chain up to the turning of D_j with link j.
#pragma once

#include <utility>

#include "recursive.hpp"
#include "recursive_serial.hpp"
#include "wide.hpp"

namespace planar_chain {

template <int N, class Real>
class alignas(64) UnrolledDenseOf final : public WideForm<UnrolledDenseOf<N, Real>, Real> {
 public:
  explicit UnrolledDenseOf(const ChainOf<Real>& chain) : gravity_x_(chain.gravity_x), gravity_y_(chain.gravity_y) {
    for (int i = 0; i < N; ++i) {
      const LinkOf<Real>& link = chain.links[i + 1];
      const LinkOf<Real> next = i + 1 < N ? chain.links[i + 2] : LinkOf<Real>();
      sign_[i] = link.sign;
      offset_x_[i] = next.offset_x, offset_y_[i] = next.offset_y;
      moment_x_[i] = link.moment_x + next.outboard_mass * next.offset_x;
      moment_y_[i] = link.moment_y + next.outboard_mass * next.offset_y;
      inertia_[i] = pivot_scale(link, next);
      least_[i] = singular_pivot * inertia_[i];
    }
  }

  int evaluate(const Real* position, const Real* velocity, const Real* effort, Real* acceleration) {
    Real angle[W], turning[W], s[W], c[W], rx[W], ry[W], dx[W], dy[W], x[N], H[N][N];
    turn(position, velocity, angle, turning);
    take_sines(angle, s, c);
    for (int i = 0; i < W; ++i) {
      rx[i] = offset_x_[i] * c[i] - offset_y_[i] * s[i], ry[i] = offset_x_[i] * s[i] + offset_y_[i] * c[i];  // R_(i+1)
      dx[i] = moment_x_[i] * c[i] - moment_y_[i] * s[i], dy[i] = moment_x_[i] * s[i] + moment_y_[i] * c[i];  // D_i
    }
    load(effort, turning, rx, ry, dx, dy, x);
#pragma GCC unroll 16
    for (int j = 0; j < N; ++j) {
#pragma GCC unroll 16
      for (int i = 0; i < j; ++i) H[j][i] = dx[j] * rx[i] + dy[j] * ry[i];  // (5.87), R_u . D_j
      H[j][j] = inertia_[j];
    }
    return solve(H, x, acceleration);
  }

 private:
  // Of a single scene several links are computed at once, in whole vectors.
  static constexpr int W = N <= 2 || lanes_in<Real> > 1 ? N : (N + 3) / 4 * 4;

  static void take_sines(const Real* angle, Real* s, Real* c) {
    if constexpr (N == 2 && lanes_in<Real> == 1) {  // too short for a loop to become vectors
      Lanes<2> both, sines, cosines;
      set_lane(both, 0, angle[0]), set_lane(both, 1, angle[1]);
      sine_cosine(both, sines, cosines);
      for (int i = 0; i < N; ++i) s[i] = lane(sines, i), c[i] = lane(cosines, i);
    } else {
      sine_cosine_each(angle, NothingLost(), s, c, W);
    }
  }

  // phi = P^T theta and -phi'^2.
  void turn(const Real* position, const Real* velocity, Real* angle, Real* turning) const {
    Real phi = 0.0, rate = 0.0;
#pragma GCC unroll 16
    for (int i = 0; i < N; ++i) {
      phi += sign_[i] * position[i], rate += sign_[i] * velocity[i];
      angle[i] = phi, turning[i] = -rate * rate;
    }
#pragma GCC unroll 16
    for (int i = N; i < W; ++i) angle[i] = 0.0;
  }

  // Right side of (5.87) by running sums: with a_i what the joint point of link i does at phi'' = 0, and F what links
  // beyond it then ask for, Q_i - (j D_i) . a_i - (j R_(i+1)) . F_(i+1).
  void load(const Real* effort, const Real* turning, const Real* rx, const Real* ry, const Real* dx, const Real* dy,
            Real* x) const {
    Real ax = -gravity_x_, ay = -gravity_y_, fx = 0.0, fy = 0.0;
#pragma GCC unroll 16
    for (int i = 0; i < N; ++i) {
      const Real torque = sign_[i] * effort[i];
      x[i] = (i + 1 < N ? torque - sign_[i + 1] * effort[i + 1] : torque) - (dx[i] * ay - dy[i] * ax);  // Q = S tau
      if (i + 1 < N) ax += turning[i] * rx[i], ay += turning[i] * ry[i];
    }
#pragma GCC unroll 16
    for (int i = N - 2; i >= 0; --i) {
      fx += turning[i + 1] * dx[i + 1], fy += turning[i + 1] * dy[i + 1];
      x[i] -= rx[i] * fy - ry[i] * fx;
    }
  }

  // L D L^T of H in place, leaf to root as in the recursion, and both substitutions. The next pivot is made of squares,
  // which need not wait for the division.
  int solve(Real (&H)[N][N], Real* x, Real* acceleration) {
#pragma GCC unroll 16
    for (int k = N - 1; k >= 0; --k) {
      if (this->stops_at(H[k][k] > Real(least_[k]))) return k;
      const Real inverse = 1.0 / H[k][k];
#pragma GCC unroll 16
      for (int j = 0; j < k; ++j) {
        const Real l = H[k][j] * inverse;
#pragma GCC unroll 16
        for (int i = 0; i < j; ++i) H[j][i] -= l * H[k][i];
        H[j][j] -= (H[k][j] * H[k][j]) * inverse;
        x[j] -= l * x[k];
      }
#pragma GCC unroll 16
      for (int j = 0; j < k; ++j) H[k][j] *= inverse;
      x[k] *= inverse;
    }
    Real before = 0.0;
#pragma GCC unroll 16
    for (int k = 0; k < N; ++k) {
#pragma GCC unroll 16
      for (int i = 0; i < k; ++i) x[k] -= H[k][i] * x[i];
      acceleration[k] = sign_[k] * (x[k] - before), before = x[k];
    }
    return -1;
  }

  const Real gravity_x_, gravity_y_;
  Real sign_[W] = {}, inertia_[W] = {}, least_[W] = {};
  Real offset_x_[W] = {}, offset_y_[W] = {}, moment_x_[W] = {}, moment_y_[W] = {};
};

}  // namespace planar_chain
