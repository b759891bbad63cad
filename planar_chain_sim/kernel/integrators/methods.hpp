// From a method's row to the class that runs it.
#pragma once

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "../forms/forms.hpp"
#include "../model/chain.hpp"
#include "../model/joint_forces.hpp"
#include "adaptive_runge_kutta.hpp"
#include "gauss.hpp"
#include "rosenbrock.hpp"
#include "runge_kutta.hpp"
#include "semi_implicit_euler.hpp"
#include "taylor_short_chain.hpp"
#include "taylor_recursive.hpp"

namespace planar_chain {

// What is common to methods of one class: `family` in METHODS.
enum class Family { explicit_runge_kutta, semi_implicit, gauss, rosenbrock, taylor };

inline const char* name_of(Family family) {
  switch (family) {
    case Family::explicit_runge_kutta: return "explicit Runge-Kutta";
    case Family::semi_implicit: return "semi-implicit";
    case Family::gauss: return "Gauss";
    case Family::rosenbrock: return "Rosenbrock";
    case Family::taylor: return "taylor";
  }
  return nullptr;
}

// Nothing where no family has this name.
inline std::optional<Family> family_of(const std::string& name) {
  for (int code = 0; code <= static_cast<int>(Family::taylor); ++code)
    if (name == name_of(static_cast<Family>(code))) return static_cast<Family>(code);
  return std::nullopt;
}

// What a method is made of, from its row of METHODS in integrators.py.
struct MethodData {
  Family family = Family::explicit_runge_kutta;
  int order = 0;
  bool adaptive = false;
  Tableau tableau;
  double tolerance = 0.0;  // adaptive methods
  double fixed = 0.0;      // s: an adaptive method takes steps of this length, to measure its order; 0: its own
};

constexpr int most_unrolled_series = 8;  // joints up to which Taylor series are unrolled
constexpr int most_order = 30;           // of a Taylor series, and of any other method
constexpr int least_free_order = 6;      // of a Taylor series that finds the length of its steps by its last terms
constexpr int most_stages = 64;

// Whether the numbers of a method fit each other; else a word for what does not.
inline const char* misfit(const MethodData& data) {
  const Tableau& t = data.tableau;
  const auto size = [](const std::vector<double>& values) { return values.size(); };
  const std::size_t stages = static_cast<std::size_t>(t.stages < 0 ? 0 : t.stages);
  if (data.order < 1 || data.order > most_order) return "order";
  if (!std::isfinite(data.fixed) || data.fixed < 0.0) return "fixed";
  if (data.adaptive && !(data.tolerance > 0.0 && data.tolerance < 1.0)) return "tolerance";
  if (t.stages > most_stages) return "stages";
  for (const auto* part : {&t.a, &t.b, &t.error, &t.interpolation_a, &t.interpolation, &t.c})
    for (const double number : *part)
      if (!std::isfinite(number)) return "tableau";
  const bool square = stages > 0 && size(t.a) == stages * stages && size(t.b) == stages;
  switch (data.family) {
    case Family::semi_implicit: return data.adaptive ? "adaptive" : nullptr;
    case Family::gauss: return data.adaptive ? "adaptive" : square ? nullptr : "tableau";
    case Family::taylor:
      if (!data.adaptive) return "adaptive";
      return data.order < (data.fixed > 0.0 ? 2 : least_free_order) ? "order" : nullptr;
    case Family::rosenbrock:
      if (!data.adaptive) return "adaptive";
      if (!(std::isfinite(t.gamma) && t.gamma > 0.0)) return "gamma";
      return square && size(t.c) == stages * stages && size(t.error) == stages && size(t.interpolation) % stages == 0 &&
                     size(t.interpolation) >= 2 * stages  // read_from_rest() reads two rows
                 ? nullptr
                 : "tableau";
    case Family::explicit_runge_kutta:
      for (std::size_t row = 0; square && row < stages; ++row)
        for (std::size_t l = row; l < stages; ++l)
          if (t.a[row * stages + l] != 0.0) return "tableau";
      if (!square || !data.adaptive) return square ? nullptr : "tableau";
      std::size_t extra = 0;
      while (extra <= most_stages && extra * (stages + 1 + extra) < size(t.interpolation_a)) ++extra;
      const std::size_t width = stages + 1 + extra, rows = size(t.error) / (stages + 1);
      return extra * width == size(t.interpolation_a) && size(t.interpolation) % width == 0 &&
                     rows * (stages + 1) == size(t.error) && (rows == 1 || rows == 2)
                 ? nullptr
                 : "tableau";
  }
  return "family";
}

// The first of `Sizes`, rising, that the chain's angles fit into.
template <bool Slides, int... Sizes>
std::unique_ptr<Motion> make_taylor_short_chain(const MethodData& data, const Chain& chain, const JointForces& forces,
                                                double step, int angles) {
  std::unique_ptr<Motion> made;
  const auto make = [&](auto size) {
    if (made == nullptr && angles <= size)
      made =
          std::make_unique<TaylorShortChain<size, Slides>>(chain, forces, step, data.order, data.tolerance, data.fixed);
  };
  (make(std::integral_constant<int, Sizes>{}), ...);
  return made;
}

inline std::unique_ptr<Motion> make_taylor(const MethodData& data, const Chain& chain, const JointForces& forces,
                                           double step, bool unrolled) {
  if (!unrolled || chain.joint_count > most_unrolled_series)
    return std::make_unique<TaylorRecursive>(chain, forces, step, data.order, data.tolerance, data.fixed);
  int angles = 0;
  for (const Link& link : chain.links) angles += link.turns();
  return angles < chain.joint_count ? make_taylor_short_chain<true, 2, 4, 6, 8>(data, chain, forces, step, angles)
                                    : make_taylor_short_chain<false, 2, 4, 6, 8>(data, chain, forces, step, angles);
}

inline std::unique_ptr<Motion> make_motion(const MethodData& data, const Chain& chain, Form& form,
                                           const JointForces& forces, double step, bool dense) {
  switch (data.family) {
    case Family::taylor: return make_taylor(data, chain, forces, step, dense);
    case Family::semi_implicit: return std::make_unique<SemiImplicitEuler>(chain, form, forces, step);
    case Family::gauss: return std::make_unique<Gauss>(chain, form, forces, data.tableau, data.order, step);
    case Family::rosenbrock:
      return std::make_unique<Rosenbrock>(chain, form, forces, data.tableau, data.order, step, data.tolerance,
                                          data.fixed);
    case Family::explicit_runge_kutta:
      if (data.adaptive)
        return std::make_unique<AdaptiveRungeKutta>(chain, form, forces, data.tableau, data.order, step, data.tolerance,
                                                    data.fixed);
      return std::make_unique<ExplicitRungeKutta>(chain, form, forces, data.tableau, data.order, step);
  }
  return nullptr;
}

}  // namespace planar_chain
