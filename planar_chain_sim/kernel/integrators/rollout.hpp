// Many ticks under given efforts: the loop that Simulation.advance calls once. It allocates nothing.
#pragma once

#include <cstdint>
#include <cstring>

#include "../model/joint_forces.hpp"
#include "integrator.hpp"

namespace planar_chain {

struct Efforts {  // one row for all ticks (stride 0) or a row per tick (stride = joints)
  const double* data;
  std::size_t stride;
};

struct Record {  // where states and efforts go, row by row; null pointers: nowhere
  double* position = nullptr;
  double* velocity = nullptr;
  double* effort = nullptr;
};

// Advances up to `ticks` ticks of `step` s from `tick`, or from `now` behind it, and stops before the first one that
// fails or is interrupted; `effort` keeps the last efforts of the actuators.
inline Progress roll(Integrator& integrator, const JointForces& forces, JointState& state, double step, double now,
                     std::int64_t tick, std::int64_t ticks, Efforts efforts, const Record& record,
                     std::vector<double>& effort, std::vector<double>& latched) {
  const std::size_t joints = effort.size();
  const std::size_t bytes = joints * sizeof(double);
  const bool tick_by_tick = efforts.stride != 0 || record.position != nullptr;
  Progress progress;
  while (progress.ticks < ticks) {
    const std::size_t k = static_cast<std::size_t>(progress.ticks);
    if (k == 0 || efforts.stride != 0) {
      std::memcpy(latched.data(), efforts.data + k * efforts.stride, bytes);
      forces.clamp(latched.data());
    }
    const std::int64_t at = tick + progress.ticks;
    const Progress part = integrator.advance(k == 0 ? now : static_cast<double>(at) * step, at,
                                             tick_by_tick ? 1 : ticks, state, latched.data());
    progress.ticks += part.ticks, progress.outcome = part.outcome, progress.joint = part.joint;
    if (part.ticks > 0) effort = latched;
    if (part.outcome != Outcome::good) break;
    if (record.position == nullptr) continue;
    std::memcpy(record.position + k * joints, state.position.data(), bytes);
    std::memcpy(record.velocity + k * joints, state.velocity.data(), bytes);
    std::memcpy(record.effort + k * joints, latched.data(), bytes);
  }
  return progress;
}

}  // namespace planar_chain
