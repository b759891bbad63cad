// Ticks in a row under given efforts: the loop that Simulation.advance and rollout call once. No allocation inside.
#pragma once

#include <cstdint>
#include <cstring>

#include "integrators.hpp"

namespace planar_chain {

struct Efforts {  // one row that is held (stride 0) or a row per tick (stride = joints)
  const double* data;
  std::size_t stride;
};

struct Record {  // where states and efforts go, row by row; null pointers: nowhere
  double* position = nullptr;
  double* velocity = nullptr;
  double* effort = nullptr;
};

struct Progress {
  std::int64_t ticks = 0;
  Outcome outcome = Outcome::good;
  int joint = -1;
};

// Advances up to `ticks` ticks and stops before the first one that fails; `effort` keeps what the actuators did last.
template <class Method>
Progress roll(Method& method, const JointForces& forces, JointState& state, std::int64_t ticks, Efforts efforts,
              const Record& record, std::vector<double>& effort, std::vector<double>& latched) {
  const std::size_t joints = effort.size();
  const std::size_t bytes = joints * sizeof(double);
  Progress progress;
  for (; progress.ticks < ticks; ++progress.ticks) {
    const std::size_t k = static_cast<std::size_t>(progress.ticks);
    if (k == 0 || efforts.stride != 0) {
      std::memcpy(latched.data(), efforts.data + k * efforts.stride, bytes);
      forces.clamp(latched.data());
    }
    progress.outcome = method.step(state, latched.data(), progress.joint);
    if (progress.outcome != Outcome::good) break;
    effort = latched;
    if (record.position == nullptr) continue;
    std::memcpy(record.position + k * joints, state.position.data(), bytes);
    std::memcpy(record.velocity + k * joints, state.velocity.data(), bytes);
    std::memcpy(record.effort + k * joints, latched.data(), bytes);
  }
  return progress;
}

}  // namespace planar_chain
