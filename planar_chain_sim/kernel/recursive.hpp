// The O(n) recursion of equations.md 6: forward dynamics by 2x2 articulated masses, inverse dynamics and energy by running sums.
// World axes throughout; `perp` is the rotation by +90 degrees, multiplication by j.
#pragma once

#include <limits>
#include <vector>

#include "chain.hpp"
#include "trigonometry.hpp"

namespace planar_chain {

struct Vec {
  double x = 0.0, y = 0.0;
};
inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y}; }
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y}; }
inline Vec operator*(double s, Vec a) { return {s * a.x, s * a.y}; }
inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y; }
inline Vec perp(Vec a) { return {-a.y, a.x}; }
inline Vec rotate(double x, double y, double cosine, double sine) { return {x * cosine - y * sine, x * sine + y * cosine}; }

struct Sym {  // symmetric 2x2 matrix
  double xx = 0.0, xy = 0.0, yy = 0.0;
};
inline Vec operator*(const Sym& a, Vec v) { return {a.xx * v.x + a.xy * v.y, a.xy * v.x + a.yy * v.y}; }
inline void subtract_outer(Sym& a, Vec u, Vec v) {  // a -= u v^T, which is symmetric where it is used
  a.xx -= u.x * v.x;
  a.xy -= u.x * v.y;
  a.yy -= u.y * v.y;
}

// What a link carries during one evaluation; slot 0 is the base, at rest.
struct LinkState {
  double angle = 0.0, rate = 0.0, cosine = 1.0, sine = 0.0;  // phi_i, phi_i', e^(j phi_i)
  Vec lever;                                                  // R_i = rho~_i e^(j phi_i-)
  Vec slide_axis;                                             // chi_i
  Vec carried;                                                // k_i, the velocity terms of the joint point
  Sym articulated;                                            // B, then A
  Vec coupling, bias;                                         // h, q
  double inertia = 0.0, torque = 0.0, scale = 0.0;            // I, t, what the pivot I is compared with
  Vec turn_row, slide_row;                                    // kept for the way back: h, y / Delta
  double turn_inverse = 0.0, turn_torque = 0.0;               // 1 / (I + I_a), t
  double slide_known = 0.0, slide_coupling = 0.0;             // nu / Delta, chi.h / Delta
  Vec acceleration;                                           // a_i
  double angular_acceleration = 0.0;                          // phi_i''
};

// A pivot at or below this fraction of its scale is no pivot: equations.md 7, "Guard".
constexpr double singular_pivot = 100.0 * std::numeric_limits<double>::epsilon();

class Recursion {
 public:
  explicit Recursion(const Chain& chain) : chain_(chain), state_(chain.links.size()) {}

  // Joint accelerations from joint efforts that already contain every joint law. Returns -1, or the joint whose pivot vanished.
  int forward(const double* position, const double* velocity, const double* effort, double* acceleration) {
    place(position, velocity);
    start_elimination(effort);
    for (int i = chain_.link_count(); i >= 1; --i) {
      const int singular = eliminate(i, effort);
      if (singular >= 0) return singular;
    }
    state_[0].acceleration = {-chain_.gravity_x, -chain_.gravity_y};
    for (int i = 1; i <= chain_.link_count(); ++i) substitute(i, acceleration);
    return -1;
  }

  // Efforts of the bare mechanism (armature in, joint laws out) for given accelerations: equations.md 6.1.
  void inverse(const double* position, const double* velocity, const double* acceleration, bool gravity, double* effort) {
    place(position, velocity);
    state_[0].acceleration = gravity ? Vec{-chain_.gravity_x, -chain_.gravity_y} : Vec{};
    for (int i = 1; i <= chain_.link_count(); ++i) accelerate(i, acceleration);
    for (int i = chain_.link_count(); i >= 1; --i) balance(i, acceleration, effort);
  }

  // Kinetic energy with armature, and potential energy of gravity: equations.md 6.1.
  void energy(const double* position, const double* velocity, double& kinetic, double& potential);

 private:
  // Absolute angles by prefix sums, phi = P^T theta; levers, slide axes and velocity terms from them.
  void place(const double* position, const double* velocity) {
    const int n = chain_.link_count();
    for (int i = 1; i <= n; ++i) {
      const Link& link = chain_.links[i];
      LinkState& s = state_[i];
      const LinkState& p = state_[link.carrier];
      if (link.rotation >= 0) {
        s.angle = p.angle + link.sign * position[link.rotation];
        s.rate = p.rate + link.sign * velocity[link.rotation];
        sine_cosine(s.angle, s.sine, s.cosine);
      } else {
        s.angle = p.angle, s.rate = p.rate, s.sine = p.sine, s.cosine = p.cosine;
      }
      s.lever = rotate(link.offset_x, link.offset_y, p.cosine, p.sine);
      if (link.slide >= 0) {
        s.slide_axis = rotate(link.axis_x, link.axis_y, p.cosine, p.sine);
        s.lever = s.lever + position[link.slide] * s.slide_axis;
      }
      s.carried = (-p.rate * p.rate) * s.lever;  // k_i
      if (link.slide >= 0) s.carried = s.carried + (2.0 * velocity[link.slide] * p.rate) * perp(s.slide_axis);
    }
  }

  void start_elimination(const double* effort) {
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const Link& link = chain_.links[i];
      LinkState& s = state_[i];
      const Vec moment = rotate(link.moment_x, link.moment_y, s.cosine, s.sine);  // X_i = m_i C_i
      s.articulated = {link.mass, 0.0, link.mass};
      s.coupling = perp(moment);
      s.bias = (-s.rate * s.rate) * moment;
      s.inertia = s.scale = link.inertia;
      s.torque = 0.0;
      if (link.rotation >= 0) {  // Q_phi = S tau
        s.torque = link.sign * effort[link.rotation];
        state_[link.carrier].torque -= s.torque;
      }
    }
  }

  // Steps (1) to (3) of equations.md 6.2 for link i, its children already added in.
  int eliminate(int i, const double* effort) {
    const Link& link = chain_.links[i];
    LinkState& s = state_[i];
    Sym a = s.articulated;
    Vec b = s.bias;
    // Three components (h, I, t) go on to the carrier where the link's angle is its carrier's or a rotor couples the two.
    bool three = false;
    Vec h = s.coupling;
    double inertia = s.inertia, torque = s.torque, scale = s.scale;

    if (link.rotation >= 0) {  // (1) own angle
      const double pivot = inertia + link.rotor;
      if (!(pivot > singular_pivot * (scale + link.rotor))) return link.rotation;
      s.turn_row = h;
      s.turn_inverse = 1.0 / pivot;
      s.turn_torque = torque;
      const Vec g = s.turn_inverse * h;
      subtract_outer(a, h, g);
      b = b + torque * g;
      three = link.rotor > 0.0 && link.carrier > 0;
      if (three) {  // equations.md 6.3, zeta = I_a / (I + I_a)
        const double zeta = link.rotor * s.turn_inverse;
        h = zeta * h;
        inertia *= zeta, torque *= zeta, scale *= zeta;
      }
    } else {
      three = link.carrier > 0;
    }

    if (link.slide >= 0) {  // (2) slide
      const Vec y = a * s.slide_axis;
      const double pivot = dot(s.slide_axis, y) + link.slide_armature;
      if (!(pivot > singular_pivot * (link.outboard_mass + link.slide_armature))) return link.slide;
      const double inverse = 1.0 / pivot;
      const double nu = effort[link.slide] - dot(s.slide_axis, b);
      s.slide_row = inverse * y;
      s.slide_known = inverse * nu;
      s.slide_coupling = 0.0;
      if (three) {
        const double sigma = dot(s.slide_axis, h);
        s.slide_coupling = sigma * inverse;
        inertia -= sigma * s.slide_coupling;
        torque -= nu * s.slide_coupling;
        h = h - sigma * s.slide_row;
      }
      subtract_outer(a, y, s.slide_row);
      b = b + nu * s.slide_row;
    }

    if (link.carrier == 0) return -1;
    LinkState& p = state_[link.carrier];  // (3) add to the carrier
    const Vec lever = perp(s.lever);      // s_i
    const Vec beta = a * s.carried + b;
    const Vec z = a * lever;
    p.articulated.xx += a.xx, p.articulated.xy += a.xy, p.articulated.yy += a.yy;
    p.bias = p.bias + beta;
    p.coupling = p.coupling + z;
    p.inertia += dot(lever, z);
    p.torque -= dot(lever, beta);
    p.scale += link.outboard_mass * dot(lever, lever);
    if (three) {
      p.coupling = p.coupling + h;
      p.inertia += inertia + 2.0 * dot(h, lever);
      p.torque += torque - dot(h, s.carried);
      p.scale += scale;
    }
    return -1;
  }

  // Root to leaf: accelerations of joint point, slide and angle.
  void substitute(int i, double* acceleration) {
    const Link& link = chain_.links[i];
    LinkState& s = state_[i];
    const LinkState& p = state_[link.carrier];
    s.acceleration = p.acceleration + p.angular_acceleration * perp(s.lever) + s.carried;
    if (link.slide >= 0) {
      const double slide =
          s.slide_known - dot(s.slide_row, s.acceleration) - s.slide_coupling * p.angular_acceleration;
      s.acceleration = s.acceleration + slide * s.slide_axis;
      acceleration[link.slide] = slide;
    }
    if (link.rotation >= 0) {
      s.angular_acceleration =
          (s.turn_torque - dot(s.turn_row, s.acceleration) + link.rotor * p.angular_acceleration) * s.turn_inverse;
      acceleration[link.rotation] = link.sign * (s.angular_acceleration - p.angular_acceleration);
    } else {
      s.angular_acceleration = p.angular_acceleration;
    }
  }

  // Inverse dynamics, root to leaf: a_i and what link i needs, F_i and Q_i, before its children are added.
  void accelerate(int i, const double* acceleration) {
    const Link& link = chain_.links[i];
    LinkState& s = state_[i];
    const LinkState& p = state_[link.carrier];
    s.angular_acceleration = p.angular_acceleration;
    if (link.rotation >= 0) s.angular_acceleration += link.sign * acceleration[link.rotation];
    s.acceleration = p.acceleration + p.angular_acceleration * perp(s.lever) + s.carried;
    if (link.slide >= 0) s.acceleration = s.acceleration + acceleration[link.slide] * s.slide_axis;
    const Vec moment = rotate(link.moment_x, link.moment_y, s.cosine, s.sine);
    s.bias = link.mass * s.acceleration + s.angular_acceleration * perp(moment) - (s.rate * s.rate) * moment;
    s.torque = link.inertia * s.angular_acceleration + dot(perp(moment), s.acceleration);
  }

  // Inverse dynamics, leaf to root: F_i and tau_i = P Q_phi are complete, pass them on.
  void balance(int i, const double* acceleration, double* effort) {
    const Link& link = chain_.links[i];
    const LinkState& s = state_[i];
    if (link.rotation >= 0) effort[link.rotation] = link.sign * s.torque + link.rotor * acceleration[link.rotation];
    if (link.slide >= 0)
      effort[link.slide] = dot(s.slide_axis, s.bias) + link.slide_armature * acceleration[link.slide];
    if (link.carrier == 0) return;
    LinkState& p = state_[link.carrier];
    p.bias = p.bias + s.bias;
    p.torque += s.torque + dot(perp(s.lever), s.bias);
  }

  const Chain& chain_;
  std::vector<LinkState> state_;
};

inline void Recursion::energy(const double* position, const double* velocity, double& kinetic, double& potential) {
  place(position, velocity);
  kinetic = potential = 0.0;
  std::vector<Vec> place_of(state_.size()), velocity_of(state_.size());  // r_i, v_i
  for (int i = 1; i <= chain_.link_count(); ++i) {
    const Link& link = chain_.links[i];
    const LinkState& s = state_[i];
    const LinkState& p = state_[link.carrier];
    Vec w = p.rate * perp(s.lever);
    if (link.slide >= 0) {
      const double rate = velocity[link.slide];
      w = w + rate * s.slide_axis;
      kinetic += 0.5 * link.slide_armature * rate * rate;
    }
    if (link.rotation >= 0) kinetic += 0.5 * link.rotor * velocity[link.rotation] * velocity[link.rotation];
    place_of[i] = place_of[link.carrier] + s.lever;
    velocity_of[i] = velocity_of[link.carrier] + w;  // (5.56)
    const Vec moment = rotate(link.moment_x, link.moment_y, s.cosine, s.sine);
    const Vec v = velocity_of[i];
    kinetic += 0.5 * link.mass * dot(v, v) + s.rate * dot(v, perp(moment)) + 0.5 * link.inertia * s.rate * s.rate;
    potential -= dot({chain_.gravity_x, chain_.gravity_y}, link.mass * place_of[i] + moment);
  }
}

}  // namespace planar_chain
