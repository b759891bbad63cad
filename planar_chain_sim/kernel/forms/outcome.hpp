// Outcomes of an evaluation of the equations, of a step, of a run.
#pragma once

#include <cmath>

namespace planar_chain {

enum class Outcome { good, singular, not_finite, stalled, too_long, coarse, endless_events, interrupted };

inline const char* name_of(Outcome outcome) {
  switch (outcome) {
    case Outcome::good: return "good";
    case Outcome::singular: return "singular";
    case Outcome::not_finite: return "not_finite";
    case Outcome::stalled: return "stalled";
    case Outcome::too_long: return "too_long";
    case Outcome::coarse: return "coarse";
    case Outcome::endless_events: return "endless_events";
    case Outcome::interrupted: return "interrupted";
  }
  return nullptr;
}

// Pivots contain squares of positions: if these overflow or are NaN, no pivot can be judged.
inline Outcome singular_or_not_finite(const double* position, int joints) {
  for (int i = 0; i < joints; ++i)
    if (!std::isfinite(position[i] * position[i])) return Outcome::not_finite;
  return Outcome::singular;
}

// Outcome of an evaluation at `position` that named `joint`.
inline Outcome outcome_of(int joint, const double* position, int joints) {
  return joint < 0 ? Outcome::good : singular_or_not_finite(position, joints);
}

}  // namespace planar_chain
