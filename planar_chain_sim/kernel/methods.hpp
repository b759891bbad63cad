// From a method's row to the class that runs it.
#pragma once

#include <memory>
#include <string>
#include <type_traits>

#include "adaptive_runge_kutta.hpp"
#include "chain.hpp"
#include "forms.hpp"
#include "gauss.hpp"
#include "joint_forces.hpp"
#include "rosenbrock.hpp"
#include "runge_kutta.hpp"
#include "semi_implicit_euler.hpp"
#include "taylor_dense.hpp"
#include "taylor_recursive.hpp"

namespace planar_chain {

// What a method is made of, from its row of METHODS in integrators.py.
struct MethodData {
  std::string family;
  int order = 0;
  bool adaptive = false;
  Tableau tableau;
  double tolerance = 0.0;  // adaptive methods
  double fixed = 0.0;      // s: an adaptive method takes steps of this length, to measure its order; 0: its own
};

// The first of `Sizes`, rising, that the chain's angles fit into.
template <bool Slides, int... Sizes>
std::unique_ptr<Motion> make_taylor_dense(const MethodData& data, const Chain& chain, const JointForces& forces,
                                              double step, int angles) {
  std::unique_ptr<Motion> made;
  const auto make = [&](auto size) {
    if (made == nullptr && angles <= size)
      made = std::make_unique<TaylorDense<size, Slides>>(chain, forces, step, data.order, data.tolerance, data.fixed);
  };
  (make(std::integral_constant<int, Sizes>{}), ...);
  return made;
}

inline std::unique_ptr<Motion> make_taylor(const MethodData& data, const Chain& chain,
                                            const JointForces& forces, double step, bool unrolled) {
  if (!unrolled || chain.joint_count > 8)
    return std::make_unique<TaylorRecursive>(chain, forces, step, data.order, data.tolerance, data.fixed);
  int angles = 0;
  for (const Link& link : chain.links) angles += link.turns();
  return angles < chain.joint_count ? make_taylor_dense<true, 2, 4, 6, 8>(data, chain, forces, step, angles)
                                    : make_taylor_dense<false, 2, 4, 6, 8>(data, chain, forces, step, angles);
}

inline std::unique_ptr<Motion> make_motion(const MethodData& data, const Chain& chain, Form& form,
                                                const JointForces& forces, double step, bool dense) {
  if (data.family == "taylor") return make_taylor(data, chain, forces, step, dense);
  if (data.family == "semi-implicit") return std::make_unique<SemiImplicitEuler>(chain, form, forces, step);
  if (data.family == "Gauss") return std::make_unique<Gauss>(chain, form, forces, data.tableau, data.order, step);
  if (data.family == "Rosenbrock")
    return std::make_unique<Rosenbrock>(chain, form, forces, data.tableau, data.order, step, data.tolerance,
                                            data.fixed);
  if (data.adaptive)
    return std::make_unique<AdaptiveRungeKutta>(chain, form, forces, data.tableau, data.order, step,
                                                    data.tolerance, data.fixed);
  return std::make_unique<ExplicitRungeKutta>(chain, form, forces, data.tableau, data.order, step);
}

}  // namespace planar_chain
