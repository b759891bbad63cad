// Derivatives of the inverse dynamics of equations.md 6.1 by joint positions and velocities, in closed form.
//
// Turning joint k by a small angle turns everything outboard of it rigidly, and sliding it shifts everything, so each
// derivative follows from sums over what is outboard of a link, about its joint point P_i:
//
//   M, D = sum X + m (P - P_i), I = sum J + 2 X . (P - P_i) + m |P - P_i|^2      mass, first and second moment
//   F, p = sum m v + phi' X^perp, G = sum X . v + (P - P_i) . p_own             inertia force, momentum, moment of v
//
// A rotation of k adds (F - M a_k)^perp to the force at every carrier and takes D . a_k from the torque; its rate adds
// 2 (p - M v_k)^perp and 2 (G - D . v_k); a slide accelerates all outboard points alike. Time: one product per pair of
// links on a common path. Columns of H come out by the way.
#pragma once

#include <cstddef>
#include <type_traits>
#include <vector>

#include "../arithmetic/plane_vectors.hpp"
#include "../arithmetic/trigonometry.hpp"
#include "../model/chain.hpp"
#include "../model/joint_forces.hpp"
#include "recursive.hpp"

namespace planar_chain {

class Jacobian {
 public:
  // Square matrices, row by row: row i is the effort of joint i, column j the coordinate of joint j.
  std::vector<double> mass, by_position, by_velocity;  // H; d/dq and d/dq' of H q'' + bias - passive efforts

  Jacobian(const Chain& chain, const JointForces& forces)
      : mass(static_cast<std::size_t>(chain.joint_count) * chain.joint_count), by_position(mass), by_velocity(mass),
        chain_(chain), forces_(forces), joints_(chain.joint_count), links_(chain.links.size()) {}

  void compute(const double* position, const double* velocity, const double* acceleration) {
    compute_derivatives(position, velocity, acceleration);
    for (int i = 1; i <= chain_.link_count(); ++i) {
      Vec reach;  // P_i - P_j
      for (int j = i; j > 0; reach = reach + links_[j].lever, j = chain_.links[j].carrier) couple_masses(i, j, reach);
      const Link& link = chain_.links[i];
      if (link.turns()) mass[at(link.rotation, link.rotation)] += link.rotor;
      if (link.slides()) mass[at(link.slide, link.slide)] += link.slide_armature;
    }
  }

  // The same without `mass`, for callers that have H already.
  void compute_derivatives(const double* position, const double* velocity, const double* acceleration) {
    move(position, velocity, acceleration);
    gather();
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const Effects effects = effects_of(i);
      Vec reach;  // P_i - P_j
      for (int j = i; j > 0; reach = reach + links_[j].lever, j = chain_.links[j].carrier) couple(i, j, reach, effects);
    }
    forces_.each_smooth([&](const auto& law) {
      if constexpr (std::decay_t<decltype(law)>::of_velocity)
        by_velocity[at(law.joint, law.joint)] -= law.by_velocity();
      if constexpr (std::decay_t<decltype(law)>::of_position)
        by_position[at(law.joint, law.joint)] -= law.by_position();
    });
    for (const Wrench& wrench : forces_.wrenches) take(wrench);
  }

 private:
  using Vec = VecOf<double>;

  struct Motion {
    double angle = 0.0, cosine = 1.0, sine = 0.0, rate = 0.0, angular = 0.0;  // phi, phi', phi''
    Vec lever, axis, velocity, acceleration;                                  // R, chi, v, a of the joint point
    Vec slid, sliding;  // change of all outboard points' acceleration by a slide's x and by its x'
    double mass = 0.0, inertia = 0.0, moment_of_velocity = 0.0;  // M, I, G
    Vec moment, force, momentum;                                 // D, F, p
  };

  // Change of the force and, about P_i, of the torque at every carrier by a joint's coordinate.
  struct Effect {
    Vec force;
    double torque;
  };

  // Of one link's rotation and slide and of their rates, and what a slide adds to the torque at a carrier's.
  struct Effects {
    Effect turned{}, turning{}, slid{}, sliding{};
    double grown = 0.0;
  };

  std::size_t at(int row, int column) const { return static_cast<std::size_t>(row) * joints_ + column; }

  // Root to leaf: where every link is, how it moves, and its own share of the sums.
  void move(const double* position, const double* velocity, const double* acceleration) {
    links_[0].acceleration = {-chain_.gravity_x, -chain_.gravity_y};
    for (int i = 1; i <= chain_.link_count(); ++i) {
      const Link& link = chain_.links[i];
      const Motion& p = links_[link.carrier];
      Motion& s = links_[i];
      s.angle = p.angle, s.rate = p.rate, s.angular = p.angular;
      s.lever = rotate(link.offset_x, link.offset_y, p.cosine, p.sine);
      Vec gain;
      if (link.slides()) {
        const double speed = velocity[link.slide];
        s.axis = rotate(link.axis_x, link.axis_y, p.cosine, p.sine);
        s.lever = s.lever + position[link.slide] * s.axis;
        s.slid = p.angular * perp(s.axis) - (p.rate * p.rate) * s.axis;
        s.sliding = (2.0 * p.rate) * perp(s.axis);
        gain = acceleration[link.slide] * s.axis + speed * s.sliding;
      }
      s.velocity = p.velocity + p.rate * perp(s.lever);
      if (link.slides()) s.velocity = s.velocity + velocity[link.slide] * s.axis;
      s.acceleration = p.acceleration + p.angular * perp(s.lever) - (p.rate * p.rate) * s.lever + gain;
      if (link.turns()) {
        s.angle += link.sign * position[link.rotation];
        s.rate += link.sign * velocity[link.rotation];
        s.angular += link.sign * acceleration[link.rotation];
      }
      sine_cosine(s.angle, s.sine, s.cosine);
      s.mass = link.mass, s.inertia = link.inertia;
      s.moment = rotate(link.moment_x, link.moment_y, s.cosine, s.sine);
      s.force = link.mass * s.acceleration + s.angular * perp(s.moment) - (s.rate * s.rate) * s.moment;
      s.momentum = link.mass * s.velocity + s.rate * perp(s.moment);
      s.moment_of_velocity = dot(s.moment, s.velocity);
    }
  }

  // Leaf to root: the sums over everything outboard.
  void gather() {
    for (int i = chain_.link_count(); i >= 1; --i) {
      const Motion& s = links_[i];
      const int carrier = chain_.links[i].carrier;
      if (carrier == 0) continue;
      Motion& p = links_[carrier];
      p.mass += s.mass;
      p.inertia += s.inertia + 2.0 * dot(s.moment, s.lever) + s.mass * dot(s.lever, s.lever);
      p.moment_of_velocity += s.moment_of_velocity + dot(s.lever, s.momentum);
      p.moment = p.moment + s.moment + s.mass * s.lever;
      p.force = p.force + s.force;
      p.momentum = p.momentum + s.momentum;
    }
  }

  // Effect of the joints of link i on those inboard.
  Effects effects_of(int i) const {
    const Motion& s = links_[i];
    Effects effects;
    effects.turned = {perp(s.force - s.mass * s.acceleration), -dot(s.moment, s.acceleration)};
    effects.turning = {2.0 * perp(s.momentum - s.mass * s.velocity),
                       2.0 * (s.moment_of_velocity - dot(s.moment, s.velocity))};
    if (chain_.links[i].slides()) {
      effects.slid = uniform(s, s.slid), effects.sliding = uniform(s, s.sliding);
      effects.grown = dot(perp(s.axis), s.force);
    }
    return effects;
  }

  // All derivatives between the joints of link i and those of link j, which carries it or is i itself.
  void couple(int i, int j, Vec reach, const Effects& effects) {
    const Link &outer = chain_.links[i], &inner = chain_.links[j];
    const Motion &s = links_[i], &p = links_[j];
    if (outer.turns()) {
      set(by_position, inner, p, outer.rotation, outer.sign, reach, effects.turned);
      set(by_velocity, inner, p, outer.rotation, outer.sign, reach, effects.turning);
    }
    if (outer.slides()) {
      Effect effect = effects.slid;
      if (i != j) effect.torque += effects.grown;  // the force's own lever grows
      set(by_position, inner, p, outer.slide, 1.0, reach, effect);
      set(by_velocity, inner, p, outer.slide, 1.0, reach, effects.sliding);
    }
    if (i == j) return;
    if (inner.turns()) {
      const int k = inner.rotation;
      set(by_position, outer, s, k, inner.sign, {-s.mass * perp(p.acceleration), -dot(s.moment, p.acceleration)});
      set(by_velocity, outer, s, k, inner.sign,
          {2.0 * perp(s.momentum - s.mass * p.velocity), 2.0 * (s.moment_of_velocity - dot(s.moment, p.velocity))});
    }
    if (inner.slides()) {
      set(by_position, outer, s, inner.slide, 1.0, uniform(s, p.slid));
      set(by_velocity, outer, s, inner.slide, 1.0, uniform(s, p.sliding));
    }
  }

  // The same of H, which is symmetric.
  void couple_masses(int i, int j, Vec reach) {
    const Link &outer = chain_.links[i], &inner = chain_.links[j];
    const Motion &s = links_[i], &p = links_[j];
    if (outer.turns()) set(mass, inner, p, outer.rotation, outer.sign, reach, {perp(s.moment), s.inertia});
    if (outer.slides()) set(mass, inner, p, outer.slide, 1.0, reach, uniform(s, s.axis));
    if (i == j) return;
    for (int row : {inner.slide, inner.rotation})
      for (int column : {outer.slide, outer.rotation})
        if (row >= 0 && column >= 0) mass[at(column, row)] = mass[at(row, column)];
  }

  // Less the derivative of a wrench's joint efforts (equations.md 6.5): of the arms r - P_k, the slides' directions
  // and, where it turns with its link, the force.
  void take(const Wrench& wrench) {
    const Motion& own = links_[wrench.link];
    Vec force = {wrench.force_x, wrench.force_y};
    if (wrench.turns) force = rotate(force.x, force.y, own.cosine, own.sine);
    Vec inner_arm = rotate(wrench.point_x, wrench.point_y, own.cosine, own.sine);  // r - P_k
    for (int k = wrench.link; k > 0; inner_arm = inner_arm + links_[k].lever, k = chain_.links[k].carrier) {
      const Link& inner = chain_.links[k];
      Vec arm = rotate(wrench.point_x, wrench.point_y, own.cosine, own.sine);  // r - P_l, l from the link to k
      for (int l = wrench.link;; arm = arm + links_[l].lever, l = chain_.links[l].carrier) {
        const Link& outer = chain_.links[l];
        const double turned = wrench.turns ? dot(inner_arm, force) - dot(arm, force) : -dot(arm, force);
        if (inner.turns() && outer.turns()) {
          by_position[at(inner.rotation, outer.rotation)] -= inner.sign * outer.sign * turned;
          if (k != l && !wrench.turns)
            by_position[at(outer.rotation, inner.rotation)] += inner.sign * outer.sign * dot(arm, force);
        }
        if (inner.turns() && outer.slides() && k != l)
          by_position[at(inner.rotation, outer.slide)] -= inner.sign * dot(perp(links_[l].axis), force);
        if (inner.slides() && outer.turns() && wrench.turns)
          by_position[at(inner.slide, outer.rotation)] += outer.sign * dot(perp(links_[k].axis), force);
        if (inner.turns() && outer.slides() && k != l && !wrench.turns)
          by_position[at(outer.slide, inner.rotation)] -= inner.sign * dot(perp(links_[l].axis), force);
        if (l == k) break;
      }
    }
  }

  // Everything outboard gains the same acceleration.
  static Effect uniform(const Motion& s, Vec gain) { return {s.mass * gain, dot(perp(s.moment), gain)}; }

  // Column `column`, of a coordinate that turns by `sign`, in the rows of link's joints, P_j = P_i - reach.
  void set(std::vector<double>& matrix, const Link& link, const Motion& motion, int column, double sign, Vec reach,
           Effect effect) {
    if (link.turns())
      matrix[at(link.rotation, column)] = sign * link.sign * (effect.torque + dot(perp(reach), effect.force));
    if (link.slides()) matrix[at(link.slide, column)] = sign * dot(motion.axis, effect.force);
  }

  // The same in the rows of the link itself, about its own joint point.
  void set(std::vector<double>& matrix, const Link& link, const Motion& motion, int column, double sign,
           const Effect& effect) {
    if (link.turns()) matrix[at(link.rotation, column)] = sign * link.sign * effect.torque;
    if (link.slides()) matrix[at(link.slide, column)] = sign * dot(motion.axis, effect.force);
  }

  const Chain& chain_;
  const JointForces& forces_;
  const int joints_;
  std::vector<Motion> links_;
};

}  // namespace planar_chain
