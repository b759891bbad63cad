// The const model: a tree of links as the recursion reads it. Built once by Python, which has checked every number.
// Real is double, or Lanes<n> for several chains of one topology side by side.
//
// Welded bodies are merged into their carrier (equations.md 5) and every fixed angle is absorbed into the constants, so
// that phi_i = phi_carrier + sign * theta_i for a link that turns and phi_i = phi_carrier for one that only slides.
#pragma once

#include <vector>

namespace planar_chain {

// `benchmark skipping` compares with a build that has plain rotations alone, without slides, rotors and joint laws. So
// it measures what each of these costs a scene that does not use it.
#ifdef PLANAR_CHAIN_BARE
constexpr bool bare = true;
#else
constexpr bool bare = false;
#endif

template <class Real>
struct LinkOf {
  int carrier = 0;                      // slot of the carrier; slot 0 is the base
  int slide = -1;                       // joint index, -1: does not slide
  int rotation = -1;                    // joint index, -1: does not turn on its carrier
  Real sign = 1.0;                      // +1 counter-clockwise, -1 clockwise
  Real mass = 0.0;                      // m_i
  Real outboard_mass = 0.0;             // M_i (5.60)
  Real moment_x = 0.0, moment_y = 0.0;  // first moment m_i c_i, own frame
  Real inertia = 0.0;                   // J_i, about the joint point
  Real offset_x = 0.0, offset_y = 0.0;  // rho_i = r_i e^(j gamma_i), carrier's frame
  Real axis_x = 0.0, axis_y = 0.0;      // e^(j epsilon_i), carrier's frame
  Real rotor = 0.0;                     // armature on the rotation, I_a
  Real slide_armature = 0.0;            // armature on the slide, m_a
  static constexpr Real LinkOf::* numbers[] = {&LinkOf::sign,     &LinkOf::mass,     &LinkOf::outboard_mass,
                                               &LinkOf::moment_x, &LinkOf::moment_y, &LinkOf::inertia,
                                               &LinkOf::offset_x, &LinkOf::offset_y, &LinkOf::axis_x,
                                               &LinkOf::axis_y,   &LinkOf::rotor,    &LinkOf::slide_armature};

  bool has_branches = false;  // carries a link that is not the next one
  bool with_rotor = false;    // armature on the rotation

  bool slides() const { return !bare && slide >= 0; }
  bool turns() const { return bare || rotation >= 0; }
  bool has_rotor() const { return !bare && with_rotor; }
};

template <class Real>
struct ChainOf {
  std::vector<LinkOf<Real>> links;  // slot 0 is the base and carries no data
  int joint_count = 0;
  bool refined = false;  // whether one evaluation takes a step of iterative refinement
  Real gravity_x = 0.0, gravity_y = 0.0;

  // Call once all links are known.
  void find_features() {
    for (int i = 1; i <= link_count(); ++i) {
      if (links[i].carrier != i - 1) links[links[i].carrier].has_branches = true;
      links[i].with_rotor = links[i].rotor > 0.0;
    }
  }

  int link_count() const { return static_cast<int>(links.size()) - 1; }
};

using Link = LinkOf<double>;
using Chain = ChainOf<double>;

}  // namespace planar_chain
