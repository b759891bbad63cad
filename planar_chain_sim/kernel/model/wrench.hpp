// A force and a moment that act on a link from outside, as the joint efforts that do the same work:
//
//   tau_k = sign_k ((j (r - P_k)) . F + N) of a rotation,  chi_k . F of a slide on the path from the link to the base
//
// (virtual work; equations.md 6.5). On the way inboard everything is kept in the frame of the present link.
#pragma once

#include "../arithmetic/trigonometry.hpp"
#include "chain.hpp"

namespace planar_chain {

struct Wrench {
  int link;    // slot
  bool turns;  // whether the force turns with the link: it is given in the link's axes, else in the plane's
  double point_x, point_y;  // where it acts, link's frame
  double force_x, force_y, moment;
};

// Where a body's frame lies in that of its link: slot (0: it is welded to the base), joint point, e^(j angle).
struct BodyPlace {
  int link;
  double x, y, cosine, sine;
};

// A wrench at the joint point of a body, in the axes of the body, which it `turns` with, or of the plane. The former is
// given about the link's joint point, so that its moment is a constant.
inline Wrench on_link(const BodyPlace& place, bool turns, double force_x, double force_y, double moment) {
  if (!turns) return {place.link, false, place.x, place.y, force_x, force_y, moment};
  const double fx = force_x * place.cosine - force_y * place.sine, fy = force_x * place.sine + force_y * place.cosine;
  return {place.link, true, 0.0, 0.0, fx, fy, moment + (place.x * fy - place.y * fx)};
}

// `remainder`: the part of positions below double precision, or null.
inline void add_wrench(const Chain& chain, const Wrench& wrench, const double* position, const double* remainder,
                       double* effort) {
  const auto unit_vector = [&](const Link& link, double& cosine, double& sine) {
    const double low = remainder != nullptr ? link.sign * remainder[link.rotation] : 0.0;
    sine_cosine(link.sign * position[link.rotation], low, sine, cosine);
  };
  double x = wrench.point_x, y = wrench.point_y, fx = wrench.force_x, fy = wrench.force_y, cosine, sine;
  const auto turn = [&](double& a, double& b, double s) {
    const double before = a;
    a = before * cosine - b * s, b = before * s + b * cosine;
  };
  if (!wrench.turns)
    for (int i = wrench.link; i > 0; i = chain.links[i].carrier)
      if (chain.links[i].turns()) unit_vector(chain.links[i], cosine, sine), turn(fx, fy, -sine);
  for (int i = wrench.link; i > 0; i = chain.links[i].carrier) {
    const Link& link = chain.links[i];
    if (link.turns()) {
      effort[link.rotation] += link.sign * ((x * fy - y * fx) + wrench.moment);
      unit_vector(link, cosine, sine);
      turn(x, y, sine), turn(fx, fy, sine);
    }
    x += link.offset_x, y += link.offset_y;
    if (!link.slides()) continue;
    effort[link.slide] += link.axis_x * fx + link.axis_y * fy;
    x += position[link.slide] * link.axis_x, y += position[link.slide] * link.axis_y;
  }
}

}  // namespace planar_chain
