// The O(n) recursion of equations.md 6: forward dynamics by 2x2 articulated masses, the rest by running sums.
// World axes throughout; `perp` is the rotation by +90 degrees, multiplication by j. Written for one scene, Real =
// double, and for several in lanes, Real = Lanes<n>.
#pragma once

#include <limits>
#include <vector>

#include "../arithmetic/cache_lines.hpp"
#include "../arithmetic/plane_vectors.hpp"
#include "../arithmetic/trigonometry.hpp"
#include "../model/chain.hpp"
#include "form.hpp"

namespace planar_chain {

// The share of the links outboard of a joint in the balance of its carrier.
template <class Real>
struct OutboardOf {
  SymOf<Real> articulated;                        // B, then A
  VecOf<Real> coupling, bias;                     // h, q, the latter then b
  Real inertia = 0.0, torque = 0.0, scale = 0.0;  // I, t, what the pivot I is compared with

  void operator+=(const OutboardOf& other) {
    articulated.xx += other.articulated.xx;
    articulated.xy += other.articulated.xy;
    articulated.yy += other.articulated.yy;
    coupling = coupling + other.coupling, bias = bias + other.bias;
    inertia += other.inertia, torque += other.torque, scale += other.scale;
  }
};

// The numbers of a link during one evaluation; slot 0 is the base, at rest.
template <class Real>
struct LinkStateOf {
  Real rate = 0.0;                               // phi_i'
  VecOf<Real> moment;                            // X_i = m_i C_i
  VecOf<Real> lever;                             // R_i = rho~_i e^(j phi_i-)
  VecOf<Real> slide_axis;                        // chi_i
  VecOf<Real> carried;                           // k_i, the velocity terms of the joint point
  OutboardOf<Real> branches;                     // sum over children other than the next link
  VecOf<Real> turn_row, slide_row;               // kept for the way back: h, y / Delta
  Real turn_inverse = 0.0, turn_torque = 0.0;    // 1 / (I + I_a), t
  Real slide_inverse = 0.0;                      // 1 / Delta
  Real slide_known = 0.0, slide_coupling = 0.0;  // nu / Delta, chi.h / Delta
  VecOf<Real> acceleration;                      // a_i
  Real angular_acceleration = 0.0;               // phi_i''
  VecOf<Real> force;                             // F_i, inverse dynamics alone
  Real torque_carried = 0.0;                     // P Q_phi, tau_i before its sign, inverse dynamics alone
};

// A pivot at or below this fraction of its scale is taken as zero: equations.md 7, "Guard".
constexpr double singular_pivot = 100.0 * std::numeric_limits<double>::epsilon();

// `Plain`: every link turns and does nothing else, as in trees of rotations without armature.
template <class Real, bool Plain = false>
class RecursionOf final : public FormOf<Real> {
  using Vec = VecOf<Real>;
  using Sym = SymOf<Real>;
  using Outboard = OutboardOf<Real>;
  using LinkState = LinkStateOf<Real>;
  using Link = LinkOf<Real>;

 public:
  explicit RecursionOf(const ChainOf<Real>& chain)
      : chain_(chain), state_(chain.links.size()), angle_((chain.links.size() / sine_block + 1) * sine_block),
        sine_(angle_.size()), cosine_(angle_.size(), 1.0) {}

  int forward(const Real* position, const Real* velocity, const Real* effort, Real* acceleration) override {
    if constexpr (lanes_in<Real> > 1) return evaluate_in_lanes(*this, position, velocity, effort, acceleration);
    return evaluate(position, velocity, effort, acceleration);
  }

  int evaluate(const Real* position, const Real* velocity, const Real* effort, Real* acceleration) {
    return forward(position, nullptr, velocity, effort, acceleration);
  }

  // The same at position + remainder, for angles that are known beyond double precision.
  int forward(const Real* position, const Real* remainder, const Real* velocity, const Real* effort,
              Real* acceleration) {
    if constexpr (lanes_in<Real> > 1) this->good_ = -1;
    turn(position, velocity, remainder);
    const int singular = eliminate(position, velocity, effort);
    if (singular >= 0) return singular;
    state_[0].acceleration = against_gravity();
    substitute(acceleration);
    return -1;
  }

  // After forward(), with its factors: the accelerations that the joint efforts `effort` alone cause, H x = effort.
  void respond(const Real* effort, Real* acceleration) {
    Vec bias;
    Real torque = 0.0;
    for (int i = chain_.link_count(); i >= 1; --i) {
      const Link& link = chain_.links[i];
      LinkState& s = state_[i];
      if (link.has_branches) {
        bias = bias + s.branches.bias, torque += s.branches.torque;
        s.branches = Outboard{};
      }
      const bool three = !turns(link) || has_rotor(link);
      Real reaction = 0.0;
      if (turns(link)) {
        reaction = link.sign * effort[link.rotation];
        torque += reaction;
        s.turn_torque = torque;
        bias = bias + (s.turn_inverse * torque) * s.turn_row;
        torque *= link.rotor * s.turn_inverse;
      }
      if (slides(link)) {
        const Real nu = effort[link.slide] - dot(s.slide_axis, bias);
        s.slide_known = s.slide_inverse * nu;
        torque -= nu * s.slide_coupling;
        bias = bias + nu * s.slide_row;
      }
      torque = (three ? torque : Real(0.0)) - dot(perp(s.lever), bias) - reaction;
      if (link.carrier != i - 1) {
        if (link.carrier != 0) {
          state_[link.carrier].branches.bias = state_[link.carrier].branches.bias + bias;
          state_[link.carrier].branches.torque += torque;
        }
        bias = Vec{}, torque = 0.0;
      }
    }
    state_[0].acceleration = Vec{};
    substitute(acceleration, false);
  }

  const ChainOf<Real>& chain() const { return chain_; }
  Real cosine(int link) const { return cosine_[link]; }
  Real sine(int link) const { return sine_[link]; }
  Real rate(int link) const { return state_[link].rate; }
  const LinkState& state(int link) const { return state_[link]; }

  // Efforts of the bare mechanism (armature in, joint laws out) for given accelerations: equations.md 6.1.
  void inverse(const Real* position, const Real* velocity, const Real* acceleration, bool gravity, Real* effort) {
    turn(position, velocity);
    state_[0].acceleration = gravity ? against_gravity() : Vec{};
    for (int i = 1; i <= chain_.link_count(); ++i) {
      place(i, position, velocity);
      accelerate(i, acceleration);
    }
    for (int i = chain_.link_count(); i >= 1; --i) balance(i, acceleration, effort);
  }

  // After inverse(): the sizes of the sums in its efforts, zero where nothing is added, to bound their rounding errors.
  // Gravity by component, so that a component that is exactly zero adds nothing.
  void sizes(const Real* velocity, const Real* acceleration, Real* size);

  // After forward(): what accelerations of the joints an effort of 1 gives, with all joints inboard held.
  void pivot_inverses(Real* inverse) const {
    for (int i = 1; i <= chain_.link_count(); ++i) {
      if (turns(chain_.links[i])) inverse[chain_.links[i].rotation] = state_[i].turn_inverse;
      if (slides(chain_.links[i])) inverse[chain_.links[i].slide] = state_[i].slide_inverse;
    }
  }

  // Kinetic energy with armature, and potential energy of gravity: equations.md 6.1.
  void energy(const Real* position, const Real* velocity, Real& kinetic, Real& potential);

 private:
  static bool slides(const Link& link) { return !Plain && link.slides(); }
  static bool turns(const Link& link) { return Plain || link.turns(); }
  static bool has_rotor(const Link& link) { return !Plain && link.has_rotor(); }

  Vec against_gravity() const { return {-chain_.gravity_x, -chain_.gravity_y}; }

  // Absolute angles and rates by prefix sums, phi = P^T theta, and the unit vectors e^(j phi).
  void turn(const Real* position, const Real* velocity, const Real* remainder = nullptr) {
    if (remainder != nullptr) return turn_beyond_double(position, velocity, remainder);
    const int n = chain_.link_count();
    Real angle = 0.0, rate = 0.0;
    for (int i = 1; i <= n; ++i) {
      const Link& link = chain_.links[i];
      if (link.carrier != i - 1) angle = angle_[link.carrier], rate = state_[link.carrier].rate;
      if (turns(link)) {
        angle += link.sign * position[link.rotation];
        rate += link.sign * velocity[link.rotation];
      }
      angle_[i] = angle, state_[i].rate = rate;
    }
    if constexpr (lanes_in<Real> > 1) {
      sine_cosine_each(&angle_[1], NothingLost(), &sine_[1], &cosine_[1], n);
    } else if (n <= few_angles) {
      for (int i = 1; i <= n; ++i) sine_cosine(angle_[i], sine_[i], cosine_[i]);
    } else {
      sine_cosine(angle_.data(), sine_.data(), cosine_.data(), static_cast<int>(angle_.size()) / sine_block);
    }
  }

  // The same for angles position + remainder, summed with their rounding errors.
  void turn_beyond_double(const Real* position, const Real* velocity, const Real* remainder) {
    if (low_.empty()) low_.resize(angle_.size());
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const Link& link = chain_.links[i];
      Real high = angle_[link.carrier], low = low_[link.carrier], rate = state_[link.carrier].rate;
      if (turns(link)) {
        const Real turned = link.sign * position[link.rotation], sum = high + turned, back = sum - high;
        low += ((high - (sum - back)) + (turned - back)) + link.sign * remainder[link.rotation];
        high = sum;
        rate += link.sign * velocity[link.rotation];
      }
      angle_[i] = high, low_[i] = low, state_[i].rate = rate;
      sine_cosine(high, low, sine_[i], cosine_[i]);
    }
  }

  // Lever, slide axis, velocity terms and first moment of a link in world axes.
  void place(int i, const Real* position, const Real* velocity) {
    const Link& link = chain_.links[i];
    LinkState& s = state_[i];
    const Real carrier_rate = state_[link.carrier].rate;
    s.lever = rotate(link.offset_x, link.offset_y, cosine_[link.carrier], sine_[link.carrier]);
    if (slides(link)) {
      s.slide_axis = rotate(link.axis_x, link.axis_y, cosine_[link.carrier], sine_[link.carrier]);
      s.lever = s.lever + position[link.slide] * s.slide_axis;
    }
    s.carried = (-carrier_rate * carrier_rate) * s.lever;  // k_i
    if (slides(link)) s.carried = s.carried + (2.0 * velocity[link.slide] * carrier_rate) * perp(s.slide_axis);
    s.moment = rotate(link.moment_x, link.moment_y, cosine_[i], sine_[i]);
  }

  // Leaf to root. The share that a link passes on stays in registers if its carrier comes next, as in a serial chain.
  int eliminate(const Real* position, const Real* velocity, const Real* effort) {
    Outboard sum;
    for (int i = chain_.link_count(); i >= 1; --i) {
      const Link& link = chain_.links[i];
      LinkState& s = state_[i];
      place(i, position, velocity);
      if (link.has_branches) {
        sum += s.branches;
        s.branches = Outboard{};
      }
      const int singular = eliminate(link, s, effort, sum);
      if (singular >= 0) {
        for (LinkState& state : state_) state.branches = Outboard{};
        return singular;
      }
      if (link.carrier != i - 1) {
        if (link.carrier != 0) state_[link.carrier].branches += sum;
        sum = Outboard{};
      }
    }
    return -1;
  }

  // Steps (1) to (3) of equations.md 6.2 for one link: `sum` over its children comes in, its own share goes out.
  int eliminate(const Link& link, LinkState& s, const Real* effort, Outboard& sum) {
    Sym a = {link.mass + sum.articulated.xx, sum.articulated.xy, link.mass + sum.articulated.yy};
    Vec h = perp(s.moment) + sum.coupling;
    Vec b = sum.bias - (s.rate * s.rate) * s.moment;
    Real inertia = link.inertia + sum.inertia, torque = sum.torque, scale = link.inertia + sum.scale;
    Real reaction = 0.0;  // effect of the joint's own effort on the carrier
    // Three components (h, I, t) go on to a carrier whose angle is the link's own or which a rotor couples to it.
    const bool three = !turns(link) || has_rotor(link);

    if (turns(link)) {  // (1) own angle
      const Real pivot = inertia + link.rotor;
      if (this->stops_at(pivot > singular_pivot * (scale + link.rotor))) return link.rotation;
      reaction = link.sign * effort[link.rotation];
      torque += reaction;  // Q_phi = S tau
      s.turn_row = h;
      s.turn_inverse = 1.0 / pivot;
      s.turn_torque = torque;
      const Vec g = s.turn_inverse * h;
      subtract_outer(a, h, g);
      b = b + torque * g;
      if (three) {  // equations.md 6.3, zeta = I_a / (I + I_a)
        const Real zeta = link.rotor * s.turn_inverse;
        h = zeta * h;
        inertia *= zeta, torque *= zeta, scale *= zeta;
      }
    }

    if (slides(link)) {  // (2) slide
      const Vec y = a * s.slide_axis;
      const Real pivot = dot(s.slide_axis, y) + link.slide_armature;
      const Real least = singular_pivot * (link.outboard_mass + link.slide_armature);
      if (this->stops_at(pivot > least)) return link.slide;
      const Real inverse = 1.0 / pivot;
      const Real nu = effort[link.slide] - dot(s.slide_axis, b);
      s.slide_inverse = inverse;
      s.slide_row = inverse * y;
      s.slide_known = inverse * nu;
      if (three) {
        const Real sigma = dot(s.slide_axis, h);
        s.slide_coupling = sigma * inverse;
        inertia -= sigma * s.slide_coupling;
        torque -= nu * s.slide_coupling;
        h = h - sigma * s.slide_row;
      }
      subtract_outer(a, y, s.slide_row);
      b = b + nu * s.slide_row;
    }

    if (link.carrier == 0) return -1;
    const Vec lever = perp(s.lever);  // (3) the share in the carrier, s_i
    const Vec z = a * lever;
    sum.articulated = a;
    sum.bias = a * s.carried + b;  // beta
    sum.coupling = z;
    sum.inertia = dot(lever, z);
    sum.torque = -dot(lever, sum.bias) - reaction;
    sum.scale = link.outboard_mass * dot(lever, lever);
    if (three) {
      sum.coupling = sum.coupling + h;
      sum.inertia += inertia + 2.0 * dot(h, lever);
      sum.torque += torque - dot(h, s.carried);
      sum.scale += scale;
    }
    return -1;
  }

  // Root to leaf: accelerations of joint point, slide and angle, the carrier's in registers along a serial chain.
  void substitute(Real* acceleration, bool moving = true) {
    Vec linear;
    Real angular = 0.0;
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const Link& link = chain_.links[i];
      LinkState& s = state_[i];
      if (link.carrier != i - 1 || i == 1)
        linear = state_[link.carrier].acceleration, angular = state_[link.carrier].angular_acceleration;
      if (moving) linear = linear + s.carried;
      linear = linear + angular * perp(s.lever);
      if (slides(link)) {
        const Real slide = s.slide_known - dot(s.slide_row, linear) - s.slide_coupling * angular;
        linear = linear + slide * s.slide_axis;
        acceleration[link.slide] = slide;
      }
      if (turns(link)) {
        const Real turned = (s.turn_torque - dot(s.turn_row, linear) + link.rotor * angular) * s.turn_inverse;
        acceleration[link.rotation] = link.sign * (turned - angular);
        angular = turned;
      }
      s.acceleration = linear, s.angular_acceleration = angular;
    }
  }

  // Inverse dynamics, root to leaf: a_i, and F_i and Q_i of link i before its children are added.
  void accelerate(int i, const Real* acceleration) {
    const Link& link = chain_.links[i];
    LinkState& s = state_[i];
    const LinkState& p = state_[link.carrier];
    s.angular_acceleration = p.angular_acceleration;
    if (turns(link)) s.angular_acceleration += link.sign * acceleration[link.rotation];
    s.acceleration = p.acceleration + p.angular_acceleration * perp(s.lever) + s.carried;
    if (slides(link)) s.acceleration = s.acceleration + acceleration[link.slide] * s.slide_axis;
    s.force = link.mass * s.acceleration + s.angular_acceleration * perp(s.moment) - (s.rate * s.rate) * s.moment;
    s.torque_carried = link.inertia * s.angular_acceleration + dot(perp(s.moment), s.acceleration);
  }

  // Inverse dynamics, leaf to root: F_i and tau_i = P Q_phi are complete, pass them on.
  void balance(int i, const Real* acceleration, Real* effort) {
    const Link& link = chain_.links[i];
    const LinkState& s = state_[i];
    if (turns(link)) effort[link.rotation] = link.sign * s.torque_carried + link.rotor * acceleration[link.rotation];
    if (slides(link)) effort[link.slide] = dot(s.slide_axis, s.force) + link.slide_armature * acceleration[link.slide];
    if (link.carrier == 0) return;
    LinkState& p = state_[link.carrier];
    p.force = p.force + s.force;
    p.torque_carried += s.torque_carried + dot(perp(s.lever), s.force);
  }

  static constexpr int few_angles = 3;  // up to here one by one is faster than a block; the bits are the same

  const ChainOf<Real>& chain_;
  std::vector<LinkState> state_;
  AlignedVector<Real> angle_, sine_, cosine_;  // phi_i, e^(j phi_i); slot 0 is the base, the last block is padded
  std::vector<Real> low_;                      // the part of phi_i below double precision, where that is known
};

using Recursion = RecursionOf<double>;

template <class Real, bool Plain>
void RecursionOf<Real, Plain>::sizes(const Real* velocity, const Real* acceleration, Real* size) {
  const auto magnitude = [](const Real& x) { return x < Real(0.0) ? -x : x; };
  const auto both = [&](const Vec& v) { return magnitude(v.x) + magnitude(v.y); };
  // An angle is a rounded sum, so each component of a vector turned by it has an error from both components.
  const auto turned = [&](const Vec& v, int link) {
    return sine_[link] == Real(0.0) ? Vec{magnitude(v.x), magnitude(v.y)} : Vec{both(v), both(v)};
  };
  const auto across = [](const Vec& a, const Vec& b) { return a.x * b.y + a.y * b.x; };
  struct Size {
    Real rate = 0.0, angular = 0.0, linear = 0.0, force = 0.0, torque = 0.0;  // of motion, whatever its direction
    Vec weight;                                                               // of gravity, by component
  };
  std::vector<Size> of(state_.size());
  const Vec gravity = {magnitude(chain_.gravity_x), magnitude(chain_.gravity_y)};
  for (int i = 1; i <= chain_.link_count(); ++i) {
    const Link& link = chain_.links[i];
    const Size& p = of[link.carrier];
    Size& s = of[i];
    s.rate = p.rate, s.angular = p.angular;
    s.linear = p.linear + (p.angular + p.rate * p.rate) * both(state_[i].lever);
    if (slides(link))
      s.linear += (magnitude(acceleration[link.slide]) + 2.0 * p.rate * magnitude(velocity[link.slide])) *
                  both(state_[i].slide_axis);
    if (turns(link)) {
      s.rate += magnitude(velocity[link.rotation]), s.angular += magnitude(acceleration[link.rotation]);
    }
    const Real moment = both(state_[i].moment);
    s.force = link.mass * s.linear + (s.angular + s.rate * s.rate) * moment;
    s.torque = link.inertia * s.angular + moment * s.linear + across(turned(state_[i].moment, i), gravity);
    s.weight = link.mass * gravity;
  }
  for (int i = chain_.link_count(); i >= 1; --i) {
    const Link& link = chain_.links[i];
    const Size& s = of[i];
    if (turns(link)) size[link.rotation] = s.torque + link.rotor * magnitude(acceleration[link.rotation]);
    if (slides(link))
      size[link.slide] = both(state_[i].slide_axis) * s.force +
                         dot(turned(state_[i].slide_axis, link.carrier), s.weight) +
                         link.slide_armature * magnitude(acceleration[link.slide]);
    if (link.carrier == 0) continue;
    Size& p = of[link.carrier];
    p.force += s.force, p.weight = p.weight + s.weight;
    p.torque += s.torque + both(state_[i].lever) * s.force + across(turned(state_[i].lever, link.carrier), s.weight);
  }
}

template <class Real, bool Plain>
void RecursionOf<Real, Plain>::energy(const Real* position, const Real* velocity, Real& kinetic, Real& potential) {
  turn(position, velocity);
  kinetic = potential = 0.0;
  std::vector<Vec> place_of(state_.size()), velocity_of(state_.size());  // r_i, v_i
  for (int i = 1; i <= chain_.link_count(); ++i) {
    place(i, position, velocity);
    const Link& link = chain_.links[i];
    const LinkState& s = state_[i];
    const LinkState& p = state_[link.carrier];
    Vec w = p.rate * perp(s.lever);
    if (slides(link)) {
      const Real rate = velocity[link.slide];
      w = w + rate * s.slide_axis;
      kinetic += 0.5 * link.slide_armature * rate * rate;
    }
    if (turns(link)) kinetic += 0.5 * link.rotor * velocity[link.rotation] * velocity[link.rotation];
    place_of[i] = place_of[link.carrier] + s.lever;
    velocity_of[i] = velocity_of[link.carrier] + w;  // (5.56)
    const Vec v = velocity_of[i];
    kinetic += 0.5 * link.mass * dot(v, v) + s.rate * dot(v, perp(s.moment)) + 0.5 * link.inertia * s.rate * s.rate;
    potential += dot(against_gravity(), link.mass * place_of[i] + s.moment);
  }
}

}  // namespace planar_chain
