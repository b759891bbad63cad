// Sine and cosine of an angle: the one place where the kernel and the loader take them from.
#pragma once

#include <cmath>

namespace planar_chain {

inline void sine_cosine(double angle, double& sine, double& cosine) {
#if defined(__GNUC__) && defined(__linux__)
  ::sincos(angle, &sine, &cosine);
#else
  sine = std::sin(angle);
  cosine = std::cos(angle);
#endif
}

}  // namespace planar_chain
