// Chains of one make side by side in lanes: the same links, joints and laws, each with its own numbers.
#pragma once

#include <algorithm>
#include <iterator>
#include <tuple>
#include <vector>

#include "../model/chain.hpp"
#include "../model/joint_forces.hpp"

namespace planar_chain {

struct Scene {  // its const data
  const Chain* chain;
  const JointForces* forces;
  bool dense;  // form of the equations
};

// Whether the chains differ in numbers alone, and not in joints and laws: then they can share lanes.
template <class Law>
inline bool same_joints(const std::vector<Law>& some, const std::vector<Law>& others) {
  return std::equal(some.begin(), some.end(), others.begin(), others.end(),
                    [](const Law& one, const Law& other) { return one.joint == other.joint; });
}
template <class... Laws>
inline bool same_lists(const std::tuple<std::vector<Laws>...>& some, const std::tuple<std::vector<Laws>...>& others) {
  return (same_joints(std::get<std::vector<Laws>>(some), std::get<std::vector<Laws>>(others)) && ...);
}
inline bool same_make(const Scene& one, const Scene& other) {
  const auto same_link = [](const Link& a, const Link& b) {
    return a.carrier == b.carrier && a.slide == b.slide && a.rotation == b.rotation && a.with_rotor == b.with_rotor;
  };
  const std::vector<Link>&some = one.chain->links, &others = other.chain->links;
  const JointForces &acting = *one.forces, &there = *other.forces;
  return one.dense == other.dense && one.chain->refined == other.chain->refined &&
         std::equal(some.begin(), some.end(), others.begin(), others.end(), same_link) &&
         same_lists(acting.smooth, there.smooth) && same_lists(acting.others, there.others);
}

// The numbers of `from` into lane `i` of `to`.
template <template <class> class Part, class Real>
inline void set_lane(Part<Real>& to, int i, const Part<double>& from) {
  for (std::size_t k = 0; k < std::size(Part<double>::numbers); ++k)
    set_lane(to.*Part<Real>::numbers[k], i, from.*Part<double>::numbers[k]);
}
template <template <class> class Law, class Real>
inline void set_lane(std::vector<Law<Real>>& to, int i, const std::vector<Law<double>>& from) {
  to.resize(from.size());
  for (std::size_t k = 0; k < from.size(); ++k) to[k].joint = from[k].joint, set_lane(to[k], i, from[k]);
}
template <class... Laws, class... Scalar>
inline void set_lane(std::tuple<std::vector<Laws>...>& to, int i, const std::tuple<std::vector<Scalar>...>& from) {
  (set_lane(std::get<std::vector<Laws>>(to), i, std::get<std::vector<Scalar>>(from)), ...);
}
template <class Real>
struct SideBySide {
  ChainOf<Real> chain;
  JointForcesOf<Real> forces;

  void set(int i, const Scene& scene) {
    const Chain& one = *scene.chain;
    chain.links.resize(one.links.size());
    chain.joint_count = one.joint_count, chain.refined = one.refined;
    set_lane(chain.gravity_x, i, one.gravity_x), set_lane(chain.gravity_y, i, one.gravity_y);
    for (std::size_t k = 0; k < one.links.size(); ++k) {
      const Link& from = one.links[k];
      LinkOf<Real>& link = chain.links[k];
      link.carrier = from.carrier, link.slide = from.slide, link.rotation = from.rotation;
      link.has_branches = from.has_branches, link.with_rotor = from.with_rotor;
      set_lane(link, i, from);
    }
    set_lane(forces.smooth, i, scene.forces->smooth), set_lane(forces.others, i, scene.forces->others);
  }
};

}  // namespace planar_chain
