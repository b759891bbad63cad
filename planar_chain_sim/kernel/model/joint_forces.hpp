// The laws of joint effort, each on the relative coordinate (equations.md 4), with one header each in laws/, twins of
// the rows of joint_forces.py; and wrenches from outside. A law that no joint has is an empty list and costs nothing.
#pragma once

#include <tuple>
#include <type_traits>
#include <vector>

#include "../arithmetic/lanes.hpp"
#include "chain.hpp"
#include "laws/damper.hpp"
#include "laws/effort_limit.hpp"
#include "laws/friction.hpp"
#include "laws/preload.hpp"
#include "laws/spring.hpp"
#include "laws/stop.hpp"
#include "wrench.hpp"

namespace planar_chain {

// For every law, the joints that have it.
template <class Real, template <class> class... Laws>
using ListsOf = std::tuple<std::vector<Laws<Real>>...>;

template <class Real>
struct JointForcesOf {
  ListsOf<Real, DamperOf, SpringOf, PreloadOf> smooth;  // laws that act smoothly
  ListsOf<Real, FrictionOf, EffortLimitOf, StopOf> others;
  std::vector<Wrench> wrenches;  // on `chain`; a simulation has them, a batch none
  const ChainOf<Real>* chain = nullptr;

  template <template <class> class Law>
  const std::vector<Law<Real>>& all() const {
    return std::get<std::vector<Law<Real>>>(others);
  }

  // Calls `act(law)` for every joint's smooth law, the laws one after the other.
  template <class Act>
  void each_smooth(Act&& act) const {
    std::apply([&](const auto&... laws) { (each_of(laws, act), ...); }, smooth);
  }

  // Calls `act(list)` for the list of every law.
  template <class Act>
  void each_list(Act&& act) {
    std::apply([&](auto&... laws) { (act(laws), ...); }, smooth);
    std::apply([&](auto&... laws) { (act(laws), ...); }, others);
  }

  // Whether anything acts except the actuators.
  bool passive() const {
    const auto acts = [](const auto&... laws) { return !(laws.empty() && ...); };
    return !bare && (std::apply(acts, smooth) || !all<FrictionOf>().empty());
  }

  // tau += -d theta' - k (theta - theta_0) + tau_p - tau_c sgn(theta')   (equations.md 4)
  void add_passive(const Real* position, const Real* velocity, Real* effort) const {
    if constexpr (bare) return;
    each_smooth([&](const auto& law) { effort[law.joint] += law.effort(position[law.joint], velocity[law.joint]); });
    for (const auto& law : all<FrictionOf>()) effort[law.joint] += law.effort(velocity[law.joint]);
  }

  // Whole turns may be left out of positions. `remainder`: their part below double precision, or null.
  void add_wrenches(const double* position, const double* remainder, double* effort) const {
    for (const Wrench& wrench : wrenches) add_wrench(*chain, wrench, position, remainder, effort);
  }

  void clamp(Real* effort) const {
    if constexpr (bare) return;
    for (const auto& law : all<EffortLimitOf>()) effort[law.joint] = law.clamped(effort[law.joint]);
  }

  // Energy in springs, and of preloads, J.
  Real stored_energy(const Real* position) const {
    Real energy = 0.0;
    each_smooth([&](const auto& law) {
      if constexpr (std::decay_t<decltype(law)>::stores) energy += law.energy(position[law.joint]);
    });
    return energy;
  }

  // Laws that do not act smoothly: events.hpp.
  bool have_events() const { return !bare && !(all<StopOf>().empty() && all<FrictionOf>().empty()); }

 private:
  template <class List, class Act>
  static void each_of(const List& laws, Act&& act) {
    for (const auto& law : laws) act(law);
  }
};

using JointForces = JointForcesOf<double>;

}  // namespace planar_chain
