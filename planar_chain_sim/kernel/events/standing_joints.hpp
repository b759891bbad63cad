// A chain some of whose joints stand still: the same links, with the angles and displacements of the standing joints
// built into the constants, so that they cannot move by as much as a bit, and nothing is computed for them.
#pragma once

#include <vector>

#include "../arithmetic/plane_vectors.hpp"
#include "../arithmetic/trigonometry.hpp"
#include "../model/chain.hpp"
#include "../model/joint_forces.hpp"

namespace planar_chain {

struct ReducedChain {
  Chain chain;              // with new joint numbers
  JointForces forces;       // smooth laws, wrenches; efforts that do not change are the caller's
  std::vector<int> joints;  // what the new joints were
};

// Leaves the joints standing at position + remainder, without whole turns, out of the chain.
inline ReducedChain without_standing(const Chain& whole, const JointForces& forces, const std::vector<bool>& standing,
                                     const double* position, const double* remainder) {
  ReducedChain part;
  std::vector<int> number(standing.size(), -1);
  for (std::size_t j = 0; j < standing.size(); ++j)
    if (!standing[j]) number[j] = static_cast<int>(part.joints.size()), part.joints.push_back(static_cast<int>(j));
  part.chain = whole;
  part.chain.joint_count = static_cast<int>(part.joints.size());
  std::vector<VecOf<double>> turned(whole.links.size(), {1.0, 0.0});  // unit vector of a link's frame in the new one's
  for (int i = 1; i <= whole.link_count(); ++i) {
    const Link& link = whole.links[i];
    Link& made = part.chain.links[i];
    const VecOf<double> carrier = turned[link.carrier];
    VecOf<double> own = carrier;
    const auto rotated = [](const VecOf<double>& by, double x, double y) { return rotate(x, y, by.x, by.y); };
    VecOf<double> offset = rotated(carrier, link.offset_x, link.offset_y);
    const VecOf<double> axis = rotated(carrier, link.axis_x, link.axis_y);
    if (link.slide >= 0) {
      made.slide = number[link.slide];
      if (made.slide < 0) offset = offset + position[link.slide] * axis, made.slide_armature = 0.0;
    }
    if (link.rotation >= 0) {
      made.rotation = number[link.rotation];
      if (made.rotation < 0) {
        double sine, cosine;
        sine_cosine(link.sign * position[link.rotation], link.sign * remainder[link.rotation], sine, cosine);
        own = rotated(carrier, cosine, sine);
        made.rotor = 0.0;
      }
    }
    turned[i] = own;
    const VecOf<double> moment = rotated(own, link.moment_x, link.moment_y);
    made.moment_x = moment.x, made.moment_y = moment.y, made.offset_x = offset.x, made.offset_y = offset.y;
    made.axis_x = axis.x, made.axis_y = axis.y;
  }
  part.chain.find_features();
  forces.each_smooth([&](auto law) {
    if ((law.joint = number[law.joint]) >= 0) std::get<std::vector<decltype(law)>>(part.forces.smooth).push_back(law);
  });
  for (Wrench wrench : forces.wrenches) {
    const VecOf<double> own = turned[wrench.link], point = rotate(wrench.point_x, wrench.point_y, own.x, own.y);
    wrench.point_x = point.x, wrench.point_y = point.y;
    if (wrench.turns) {
      const VecOf<double> force = rotate(wrench.force_x, wrench.force_y, own.x, own.y);
      wrench.force_x = force.x, wrench.force_y = force.y;
    }
    part.forces.wrenches.push_back(wrench);
  }
  return part;
}

}  // namespace planar_chain
