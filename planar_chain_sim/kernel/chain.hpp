// The const model: a tree of links as the recursion reads it. Built once by Python, which has checked every number.
//
// Welded bodies are merged into their carrier (equations.md 5) and every fixed angle is absorbed into the constants, so
// that phi_i = phi_carrier + sign * theta_i for a link that turns and phi_i = phi_carrier for one that only slides.
#pragma once

#include <vector>

namespace planar_chain {

struct Link {
  int carrier = 0;                        // slot of the carrier; slot 0 is the base
  int slide = -1;                         // joint index, -1: does not slide
  int rotation = -1;                      // joint index, -1: does not turn on its carrier
  double sign = 1.0;                      // +1 counter-clockwise, -1 clockwise
  double mass = 0.0;                      // m_i
  double outboard_mass = 0.0;             // M_i (5.60)
  double moment_x = 0.0, moment_y = 0.0;  // first moment m_i c_i, own frame
  double inertia = 0.0;                   // J_i, about the joint point
  double offset_x = 0.0, offset_y = 0.0;  // rho_i = r_i e^(j gamma_i), carrier's frame
  double axis_x = 0.0, axis_y = 0.0;      // e^(j epsilon_i), carrier's frame
  double rotor = 0.0;                     // armature on the rotation, I_a
  double slide_armature = 0.0;            // armature on the slide, m_a
  bool has_branches = false;              // carries a link that is not the next one
};

struct Chain {
  std::vector<Link> links;  // slot 0 is the base and carries no data
  int joint_count = 0;
  bool refined = false;     // whether one evaluation takes a step of iterative refinement
  double gravity_x = 0.0, gravity_y = 0.0;

  // Call once all carriers are known.
  void find_branches() {
    for (int i = 1; i <= link_count(); ++i)
      if (links[i].carrier != i - 1) links[links[i].carrier].has_branches = true;
  }

  int link_count() const { return static_cast<int>(links.size()) - 1; }
};

}  // namespace planar_chain
