// Coefficients of the motion for a short chain by short_chain_series.hpp: constants from the chain, first orders from a
// state, results in joint coordinates.
#pragma once

#include <complex>
#include <type_traits>
#include <vector>

#include "../arithmetic/trigonometry.hpp"
#include "short_chain_series.hpp"
#include "taylor.hpp"

namespace planar_chain {

template <int Angles, bool Slides>
class TaylorShortChain final : public Taylor {
  using Series = ShortChainSeries<Angles, Slides>;
  using Complex = std::complex<double>;

 public:
  TaylorShortChain(const Chain& chain, const JointForces& forces, double tick_length, int order, double tolerance,
                   double fixed)
      : Taylor(chain, forces, tick_length, order, tolerance, fixed), chain_(chain) {
    number_unknowns();
    couple();
    resist();
    push();
  }

  void forces_changed() override {
    forget();
    push();
  }

 protected:
  int expand(const JointState& base) override { return widest_ ? fill_wide(base) : fill(base); }

 private:
  // The same code twice; without contraction the wider vectors change no bit. Where there are wide ones, the other code
  // is for processors of before 2013: it is made small, not fast, as it takes longer to compile than the wide one.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(PLANAR_CHAIN_NARROW)
  __attribute__((target("avx2"))) int fill_wide(const JointState& base) { return coefficients(base); }
  __attribute__((cold)) int fill(const JointState& base) { return coefficients(base); }
  const bool widest_ = __builtin_cpu_supports("avx2");
#else
  int fill_wide(const JointState& base) { return coefficients(base); }
  int fill(const JointState& base) { return coefficients(base); }
  const bool widest_ = false;
#endif

  PLANAR_CHAIN_INLINE int coefficients(const JointState& base) {
    Series& s = series_;
    place(base);
    set_known_efforts();
    const int unknown = s.prepare();
    if (unknown >= 0) return unknown < Angles ? joint_[unknown] : slide_joint_[unknown - Angles];
    for (int k = 0; k < order_; ++k) s.advance(k, inverse_.data());
    for (int k = 0; k < order_; ++k) {
      double* const next = velocity(k + 1);
      const double* const own = s.acceleration[k].of;
      for (int i = 0; i < s.angles; ++i)
        next[joint_[i]] = sign_[i] * (s.carrier[i] >= 0 ? own[i] - own[s.carrier[i]] : own[i]) * inverse_[k + 1];
      if constexpr (Slides)
        for (int w = 0; w < s.slides; ++w) next[slide_joint_[w]] = s.slide[w].acceleration[k] * inverse_[k + 1];
    }
    return -1;
  }

  // From the root to the leaves.
  void number_unknowns() {
    const int n = chain_.link_count();
    Series& s = series_;
    angle_.assign(n + 1, -1), slide_.assign(n + 1, -1);
    for (int i = 1; i <= n; ++i) {
      const Link& link = chain_.links[i];
      const int below = angle_[i] = angle_[link.carrier];
      if (link.slides()) {
        const int w = slide_[i] = s.slides++;
        s.rides_on[w] = below, slide_joint_[w] = link.slide;
      }
      if (link.turns()) {
        const int a = angle_[i] = s.angles++;
        s.carrier[a] = below, joint_[a] = link.rotation, sign_[a] = link.sign;
      }
    }
    for (int i = s.angles; i < Angles; ++i) s.inertia[i].of[i] = 1.0;
  }

  // B, gravity and constant inertia, link by link: its joint point is the sum of arm_a Z_a, its mass centre has its own
  // first moment besides. Here all Z have one numbering, angles and then slides.
  void couple() {
    const int n = chain_.link_count();
    Series& s = series_;
    const int count = s.angles + s.slides;
    const Complex gravity(chain_.gravity_x, chain_.gravity_y);
    arms_.assign(n + 1, std::vector<Complex>(count));
    std::vector<std::vector<Complex>> coupling(count, std::vector<Complex>(count));
    std::vector<Complex> weight(count);
    for (int k = 1; k <= n; ++k) {
      const Link& link = chain_.links[k];
      std::vector<Complex>& arm = arms_[k] = arms_[link.carrier];
      if (const int p = angle_[link.carrier]; p >= 0) arm[p] += Complex(link.offset_x, link.offset_y);
      if (link.slides()) arm[s.angles + slide_[k]] += Complex(link.axis_x, link.axis_y);
      std::vector<Complex> weighted(count);  // m_k C_ak
      const int own = angle_[k];
      const Complex moment(link.moment_x, link.moment_y);
      for (int a = 0; a < count; ++a) weighted[a] = link.mass * arm[a] + (a == own ? moment : 0.0);
      for (int a = 0; a < count; ++a) {
        weight[a] -= std::conj(weighted[a]) * gravity;
        for (int b = 0; b < count; ++b)  // m_k conj(C_ak) C_bk but for m_k |c_k|^2, which is in J_k
          coupling[a][b] += std::conj(arm[a]) * weighted[b] + (a == own ? std::conj(moment) * arm[b] : 0.0);
      }
      if (own >= 0) s.inertia[own].of[own] += link.inertia;
      if (link.turns()) {  // S I_a S^T
        s.inertia[own].of[own] += link.rotor;
        if (const int p = s.carrier[own]; p >= 0)
          s.inertia[p].of[p] += link.rotor, s.inertia[p].of[own] -= link.rotor, s.inertia[own].of[p] -= link.rotor;
      }
      if (link.slides()) s.slide_inertia[slide_[k]] += link.slide_armature;
    }
    for (int a = 0; a < s.angles; ++a) {  // |C_aa|^2 turns with nothing
      s.inertia[a].of[a] += coupling[a][a].real(), coupling[a][a] = 0.0;
      s.weight_x.of[a] = weight[a].real(), s.weight_y.of[a] = weight[a].imag();
    }
    for (int b = 0; b < count; ++b)
      for (int a = 0; a < count; ++a) {
        const double re = coupling[a][b].real(), im = coupling[a][b].imag();
        const int v = a - s.angles, w = b - s.angles;
        if (v < 0 && w < 0)
          s.coupling_x[b].of[a] = re, s.coupling_y[b].of[a] = im, s.straight = s.straight && im == 0.0;
        if (v < 0 && w >= 0) s.slide_coupling_x[w].of[a] = re, s.slide_coupling_y[w].of[a] = im;
        if (v >= 0 && w >= 0) s.between_x[v][w] = re, s.between_y[v][w] = im;
      }
    for (int w = 0; w < s.slides; ++w)
      s.slide_weight_x[w] = weight[s.angles + w].real(), s.slide_weight_y[w] = weight[s.angles + w].imag();
  }

  // Linear laws on the coordinates of the series.
  void resist() {
    Series& s = series_;
    const auto add = [&](auto& columns, double* of_slides, int joint, double coefficient) {
      for (int w = 0; w < s.slides; ++w)
        if (slide_joint_[w] == joint) of_slides[w] += coefficient;
      for (int i = 0; i < s.angles; ++i) {
        if (joint_[i] != joint) continue;
        columns[i].of[i] += coefficient;
        if (const int p = s.carrier[i]; p >= 0)
          columns[p].of[p] += coefficient, columns[i].of[p] -= coefficient, columns[p].of[i] -= coefficient;
      }
    };
    forces_.each_smooth([&](const auto& law) {
      if constexpr (std::decay_t<decltype(law)>::of_velocity)
        add(s.damping, s.slide_damping, law.joint, -law.by_velocity());
      if constexpr (std::decay_t<decltype(law)>::of_position)
        add(s.stiffness, s.slide_stiffness, law.joint, -law.by_position());
    });
    for (int j = 0; j < s.angles; ++j) {
      if (s.damping[j].of[j] != 0.0) s.damped.push_back(j);
      if (s.stiffness[j].of[j] != 0.0) s.sprung.push_back(j);
    }
  }

  // Forces from outside on the vectors of the series.
  void push() {
    Series& s = series_;
    s.pushes.clear();
    for (const Wrench& wrench : forces_.wrenches) {
      typename Series::Push made{wrench.turns ? angle_[wrench.link] : -1};
      std::vector<Complex> weighted = arms_[wrench.link];
      if (const int own = angle_[wrench.link]; own >= 0) weighted[own] += Complex(wrench.point_x, wrench.point_y);
      const Complex force(wrench.force_x, wrench.force_y);
      for (int a = 0; a < s.angles + s.slides; ++a) {
        const Complex pushed = std::conj(weighted[a]) * force;
        if (a < s.angles) made.x.of[a] = pushed.real(), made.y.of[a] = pushed.imag();
        else made.slide_x[a - s.angles] = pushed.real(), made.slide_y[a - s.angles] = pushed.imag();
      }
      s.pushes.push_back(made);
    }
  }

  // Orders 0 and 1 from angles summed with what rounding loses.
  PLANAR_CHAIN_INLINE void place(const JointState& base) {
    Series& s = series_;
    double high[Series::lanes] = {}, low[Series::lanes] = {}, sine[Series::lanes], cosine[Series::lanes];
    for (int i = 0; i < s.angles; ++i) {
      const int p = s.carrier[i], joint = joint_[i];
      const double angle = p < 0 ? 0.0 : high[p], turned = sign_[i] * base.position[joint], sum = angle + turned;
      const double back = sum - angle;
      low[i] = (p < 0 ? 0.0 : low[p]) +
               (((angle - (sum - back)) + (turned - back)) + sign_[i] * base.position_remainder[joint]);
      high[i] = sum;
      s.speed[0].of[i] = (p < 0 ? 0.0 : s.speed[0].of[p]) + sign_[i] * base.velocity[joint];
    }
    sine_cosine_each(high, low, sine, cosine, Series::lanes);
    for (int i = 0; i < s.angles; ++i) {
      const double rate = s.speed[0].of[i];
      s.unit_x[0].of[i] = cosine[i], s.unit_y[0].of[i] = sine[i];
      s.unit_x[1].of[i] = -rate * sine[i], s.unit_y[1].of[i] = rate * cosine[i];
    }
    if constexpr (Slides)
      for (int w = 0; w < s.slides; ++w) {
        auto& of = s.slide[w];
        const double x = of.place[0] = base.position[slide_joint_[w]];
        const double rate = of.place[1] = base.velocity[slide_joint_[w]];
        if (const int p = s.rides_on[w]; p >= 0)
          for (int k = 0; k < 2; ++k) of.unit_x[k] = s.unit_x[k].of[p], of.unit_y[k] = s.unit_y[k].of[p];
        of.arm_x[0] = x * of.unit_x[0], of.arm_y[0] = x * of.unit_y[0];
        of.arm_x[1] = rate * of.unit_x[0] + x * of.unit_x[1], of.arm_y[1] = rate * of.unit_y[0] + x * of.unit_y[1];
      }
  }

  // Q = S tau for angles, f for slides, with gravity, which the pulls of order 0 hold from then on.
  PLANAR_CHAIN_INLINE void set_known_efforts() {
    Series& s = series_;
    double known[Angles] = {};
    for (int i = 0; i < s.angles; ++i) {
      const double own = sign_[i] * effort_[joint_[i]];
      known[i] += own - (s.unit_x[0].of[i] * s.weight_y.of[i] - s.unit_y[0].of[i] * s.weight_x.of[i]);
      if (s.carrier[i] >= 0) known[s.carrier[i]] -= own;
    }
    if constexpr (Slides)
      for (int w = 0; w < s.slides; ++w) {
        auto& of = s.slide[w];
        of.known = effort_[slide_joint_[w]] - (of.unit_x[0] * s.slide_weight_x[w] + of.unit_y[0] * s.slide_weight_y[w]);
        if (s.rides_on[w] >= 0)
          known[s.rides_on[w]] -= of.arm_x[0] * s.slide_weight_y[w] - of.arm_y[0] * s.slide_weight_x[w];
      }
    for (int i = 0; i < s.angles; ++i) s.known.of[i] = known[i];
  }

  const Chain& chain_;
  std::vector<std::vector<Complex>> arms_;  // coefficients of the vectors in each link's joint point
  std::vector<int> angle_, slide_;  // number of a link's angle, its carrier's where it has none; of its slide; else -1
  int joint_[Angles] = {}, slide_joint_[Series::most_slides] = {};
  double sign_[Angles] = {};
  Series series_;
};

}  // namespace planar_chain
