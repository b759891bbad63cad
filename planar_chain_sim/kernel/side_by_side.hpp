// Chains of one make side by side in lanes: the same links, joints and laws, each with its own numbers.
#pragma once

#include <algorithm>
#include <iterator>
#include <vector>

#include "chain.hpp"
#include "joint_forces.hpp"

namespace planar_chain {

struct Scene {  // what is const in it
  const Chain* chain;
  const JointForces* forces;
  bool dense;  // form of the equations
};

// Whether the chains differ in numbers alone, not in what turns, slides and acts: then they can share lanes.
template <class Law>
inline bool same_joints(const std::vector<Law>& some, const std::vector<Law>& others) {
  return std::equal(some.begin(), some.end(), others.begin(), others.end(),
                    [](const Law& one, const Law& other) { return one.joint == other.joint; });
}
inline bool same_make(const Scene& one, const Scene& other) {
  const auto same_link = [](const Link& a, const Link& b) {
    return a.carrier == b.carrier && a.slide == b.slide && a.rotation == b.rotation && a.with_rotor == b.with_rotor;
  };
  const std::vector<Link>&some = one.chain->links, &others = other.chain->links;
  const JointForces &acting = *one.forces, &there = *other.forces;
  return one.dense == other.dense && one.chain->refined == other.chain->refined &&
         std::equal(some.begin(), some.end(), others.begin(), others.end(), same_link) &&
         same_joints(acting.dampers, there.dampers) && same_joints(acting.springs, there.springs) &&
         same_joints(acting.preloads, there.preloads) && same_joints(acting.frictions, there.frictions) &&
         same_joints(acting.limits, there.limits) && same_joints(acting.stops, there.stops);
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
    set_lane(forces.dampers, i, scene.forces->dampers), set_lane(forces.springs, i, scene.forces->springs);
    set_lane(forces.preloads, i, scene.forces->preloads), set_lane(forces.frictions, i, scene.forces->frictions);
    set_lane(forces.limits, i, scene.forces->limits), set_lane(forces.stops, i, scene.forces->stops);
  }
};

}  // namespace planar_chain
