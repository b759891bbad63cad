// The dense form for every chain: the mass matrix H of equations.md 3 entry by entry, right sides by running sums, and
// L D L^T in place. In world axes, with R_u the lever of the child u of i towards j and X_j = m_j c_j turned:
//   D_j = X_j + sum over children w of M_w R_w,  H_ii = J_i + sum M_w |R_w|^2,
//   H_ij = R_u . D_j for i a proper carrier of j,
//   K_iv = D_i for v = i or a carrier of i,  K_iv = M_v R_u for i a proper carrier of v.
// Unknowns are the absolute angle of every link that turns and the displacement of every slide, at the joint's index.
// A link that cannot turn shares the angle of its carrier: rows and columns of one group are summed (equations.md 5).
#pragma once

#include <vector>

#include "../arithmetic/plane_vectors.hpp"
#include "recursive.hpp"
#include "wide.hpp"

namespace planar_chain {

template <class Real>
class DenseOf final : public WideForm<DenseOf<Real>, Real> {
  using Vec = VecOf<Real>;
  using Link = LinkOf<Real>;

 public:
  explicit DenseOf(const ChainOf<Real>& chain)
      : chain_(chain), count_(chain.joint_count), angle_of_(chain.links.size(), -1), state_(chain.links.size()),
        matrix_(std::size_t(count_) * count_), unknown_(count_), inverse_(count_) {
    for (int i = 1; i <= chain.link_count(); ++i)
      angle_of_[i] = chain.links[i].turns() ? chain.links[i].rotation : angle_of_[chain.links[i].carrier];
  }

  int evaluate(const Real* position, const Real* velocity, const Real* effort, Real* acceleration) {
    place(position, velocity);
    load(velocity, effort);
    assemble();
    const int singular = factor();
    if (singular < 0) substitute(acceleration);
    return singular;
  }

 private:
  struct LinkState {  // slot 0 is the base, at rest
    Real angle = 0.0, rate = 0.0, cosine = 1.0, sine = 0.0;
    Vec moment, first_moment;  // X_i, D_i
    Vec lever, slide_axis;     // R_i, chi_i
    Vec acceleration, force;   // of the joint point where no joint accelerates; F_i there
    Real scale = 0.0;          // what the pivot is compared with
  };

  Real& entry(int row, int column) {
    return matrix_[std::size_t(row > column ? row : column) * count_ + (row > column ? column : row)];
  }

  // Root to leaf: phi = P^T theta, unit vectors, levers; leaf to root: D_i.
  void place(const Real* position, const Real* velocity) {
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const Link& link = chain_.links[i];
      const LinkState& p = state_[link.carrier];
      LinkState& s = state_[i];
      s.angle = p.angle, s.rate = p.rate;
      if (link.turns()) {
        s.angle += link.sign * position[link.rotation];
        s.rate += link.sign * velocity[link.rotation];
      }
      sine_cosine(s.angle, s.sine, s.cosine);
      s.lever = rotate(link.offset_x, link.offset_y, p.cosine, p.sine);
      if (link.slides()) {
        s.slide_axis = rotate(link.axis_x, link.axis_y, p.cosine, p.sine);
        s.lever = s.lever + position[link.slide] * s.slide_axis;
      }
      s.moment = s.first_moment = rotate(link.moment_x, link.moment_y, s.cosine, s.sine);
    }
    for (int i = chain_.link_count(); i >= 1; --i) {
      const Link& link = chain_.links[i];
      if (link.carrier == 0) continue;
      LinkState& p = state_[link.carrier];
      p.first_moment = p.first_moment + link.outboard_mass * state_[i].lever;
    }
  }

  // Right sides of (5.87) and (5.88): Q = S tau and f less what the motion at zero phi'' and x'' asks for, with gravity
  // in it as a_0 = -g.
  void load(const Real* velocity, const Real* effort) {
    std::fill(unknown_.begin(), unknown_.end(), Real(0.0));
    state_[0].acceleration = Vec{-chain_.gravity_x, -chain_.gravity_y};
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const Link& link = chain_.links[i];
      const LinkState& p = state_[link.carrier];
      LinkState& s = state_[i];
      s.acceleration = p.acceleration - (p.rate * p.rate) * s.lever;
      if (link.slides()) s.acceleration = s.acceleration + (2.0 * velocity[link.slide] * p.rate) * perp(s.slide_axis);
      s.force = link.mass * s.acceleration - (s.rate * s.rate) * s.moment;
    }
    for (int i = chain_.link_count(); i >= 1; --i) {
      const Link& link = chain_.links[i];
      const LinkState& s = state_[i];
      const int own = angle_of_[i], carrier = angle_of_[link.carrier];
      if (own >= 0) unknown_[own] -= dot(perp(s.moment), s.acceleration);  // (5.87), m c u^ . a
      if (carrier >= 0) unknown_[carrier] -= dot(perp(s.lever), s.force);  // (5.87), (r a^ + x b^) . F
      if (link.turns()) {
        const Real torque = link.sign * effort[link.rotation];
        unknown_[own] += torque;
        if (carrier >= 0) unknown_[carrier] -= torque;
      }
      if (link.slides()) unknown_[link.slide] += effort[link.slide] - dot(s.slide_axis, s.force);  // (5.88)
      if (link.carrier != 0) state_[link.carrier].force = state_[link.carrier].force + s.force;
    }
  }

  // H, its lower triangle: coefficients of phi'' and x'' in (5.87) and (5.88).
  void assemble() {
    std::fill(matrix_.begin(), matrix_.end(), Real(0.0));
    for (int j = 1; j <= chain_.link_count(); ++j) {
      const Link& link = chain_.links[j];
      const LinkState& s = state_[j];
      const int own = angle_of_[j], carrier = angle_of_[link.carrier];
      if (own >= 0) entry(own, own) += link.inertia;
      if (carrier >= 0) entry(carrier, carrier) += link.outboard_mass * dot(s.lever, s.lever);
      if (link.has_rotor()) {  // S I_a S^T, equations.md 6.3
        entry(own, own) += link.rotor;
        if (carrier >= 0) entry(carrier, carrier) += link.rotor, entry(own, carrier) -= link.rotor;
      }
      if (link.slides()) {
        entry(link.slide, link.slide) += link.outboard_mass + link.slide_armature;
        if (own >= 0) entry(own, link.slide) += dot(perp(s.first_moment), s.slide_axis);
      }
      for (int u = j; chain_.links[u].carrier != 0; u = chain_.links[u].carrier) couple(j, u);
    }
  }

  // What link j and the carrier i of u, u on the path from i to j, have in common.
  void couple(int j, int u) {
    const int i = chain_.links[u].carrier;
    const Link &link = chain_.links[j], &inner = chain_.links[i];
    const LinkState &s = state_[j], &t = state_[i];
    const int own = angle_of_[j], other = angle_of_[i];
    if (own >= 0 && other >= 0) {
      const Real shared = dot(state_[u].lever, s.first_moment);  // H_ij = R_u . D_j
      entry(own, other) += own == other ? 2.0 * shared : shared;
    }
    if (link.slides() && other >= 0)  // (j K_iv) . chi_v with K_iv = M_v R_u
      entry(other, link.slide) += link.outboard_mass * dot(perp(state_[u].lever), s.slide_axis);
    if (inner.slides() && own >= 0)  // with K_jv = D_j
      entry(own, inner.slide) += dot(perp(s.first_moment), t.slide_axis);
    if (inner.slides() && link.slides())  // M_vw chi_v . chi_w
      entry(link.slide, inner.slide) += link.outboard_mass * dot(s.slide_axis, t.slide_axis);
  }

  // Leaf to root, each link's angle before its slide, as in the recursion, with its guard (equations.md 7).
  int factor() {
    for (int i = 0; i <= chain_.link_count(); ++i) state_[i].scale = chain_.links[i].inertia;
    for (int i = chain_.link_count(); i >= 1; --i) {
      const Link& link = chain_.links[i];
      LinkState& s = state_[i];
      Real passed = !link.turns() ? s.scale : Real(0.0);  // of a group or through a rotor
      if (link.turns()) {
        if (eliminate(link.rotation, s.scale + link.rotor)) return link.rotation;
        if (link.has_rotor()) passed = link.rotor * inverse_[link.rotation] * s.scale;
      }
      if (link.slides() && eliminate(link.slide, Real(link.outboard_mass + link.slide_armature))) return link.slide;
      state_[link.carrier].scale += link.outboard_mass * dot(s.lever, s.lever) + passed;
    }
    return -1;
  }

  // Takes unknown k out of those before it; true where its pivot is none.
  bool eliminate(int k, const Real& scale) {
    Real* const row = &matrix_[std::size_t(k) * count_];
    if (this->stops_at(row[k] > singular_pivot * scale)) return true;
    inverse_[k] = 1.0 / row[k];
    for (int j = 0; j < k; ++j) {
      const Real share = row[j] * inverse_[k];
      Real* const target = &matrix_[std::size_t(j) * count_];
      PLANAR_CHAIN_APART
      for (int i = 0; i <= j; ++i) target[i] -= share * row[i];
      unknown_[j] -= share * unknown_[k];
    }
    return false;
  }

  void substitute(Real* acceleration) {
    for (int k = 0; k < count_; ++k) {
      const Real* const row = &matrix_[std::size_t(k) * count_];
      for (int i = 0; i < k; ++i) unknown_[k] -= row[i] * unknown_[i];
      unknown_[k] = unknown_[k] * inverse_[k];
      acceleration[k] = unknown_[k];
    }
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const Link& link = chain_.links[i];
      if (!link.turns()) continue;
      const int carrier = angle_of_[link.carrier];
      const Real turned = unknown_[link.rotation];
      acceleration[link.rotation] = link.sign * (carrier >= 0 ? turned - unknown_[carrier] : turned);
    }
  }

  const ChainOf<Real>& chain_;
  const int count_;
  std::vector<int> angle_of_;  // joint whose angle a link turns with, -1: none, it stands
  std::vector<LinkState> state_;
  std::vector<Real> matrix_, unknown_, inverse_;
};

}  // namespace planar_chain
