// What impacts do, and which joints stand after: the two complementarity problems of equations.md 6.4.
//
//   impact    v+ = v- + H^-1 n Lambda, 0 <= Lambda _|_ (n.v+ + e n.v-) >= 0 (Newton), of all joints that meet a stop
//   holding   theta'' = a_0 + H^-1 lambda, each lambda inside its bounds with theta'' = 0, or at a bound with theta'' away
//             from it, of all joints without rate: |lambda| <= tau_c of friction, lambda n >= 0 of a stop
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "box_problem.hpp"
#include "chain.hpp"
#include "integrators.hpp"
#include "joint_forces.hpp"
#include "recursive.hpp"

namespace planar_chain {

// A rebound slower than this, rad/s or m/s, is none: infinitely many bounces end in rest.
constexpr double rest_speed = 1e-5;

class Holding {
 public:
  static constexpr double infinity = std::numeric_limits<double>::infinity();

  std::vector<double> friction, lower, upper, restitution;  // of the joints
  std::vector<bool> standing;
  std::vector<double> sign;    // of the rate that friction acts against
  std::vector<double> places;  // of the joints when that was decided

  Holding(const Chain& chain, const JointForces& forces)
      : friction(chain.joint_count), lower(chain.joint_count, -infinity), upper(chain.joint_count, infinity),
        restitution(chain.joint_count), standing(chain.joint_count), sign(chain.joint_count), places(chain.joint_count),
        forces_(forces), joints_(chain.joint_count), recursion_(chain), acceleration_(joints_), effort_(joints_),
        answer_(joints_), unit_(joints_) {
    for (const auto& law : forces.frictions) friction[law.joint] = law.friction;
    for (const auto& law : forces.stops)
      lower[law.joint] = law.lower, upper[law.joint] = law.upper, restitution[law.joint] = law.restitution;
  }

  bool on_lower(int j, double position) const { return position <= lower[j]; }
  bool on_upper(int j, double position) const { return position >= upper[j]; }
  bool on_stop(int j, double position) const { return on_lower(j, position) || on_upper(j, position); }

  // Bounds of what may hold joint j where it stands.
  double least(int j) const { return on_upper(j, places[j]) ? -infinity : -friction[j]; }
  double most(int j) const { return on_lower(j, places[j]) ? infinity : friction[j]; }

  // Impacts of all joints that are on a stop and move into it, together; which they were, and how fast, goes to `touched`.
  // `held`: efforts of the actuators.
  bool collide(JointState& state, const double* held, std::vector<std::pair<int, double>>& touched, Progress& progress) {
    std::vector<int> touching;
    std::vector<double> way;
    bool gently = true;
    for (int j = 0; j < joints_; ++j) {
      const double n = on_lower(j, state.position[j]) ? 1.0 : on_upper(j, state.position[j]) ? -1.0 : 0.0;
      if (n == 0.0 || n * state.velocity[j] > 0.0) continue;
      touching.push_back(j), way.push_back(n);
      if (state.velocity[j] == 0.0) continue;
      gently = gently && std::fabs(state.velocity[j]) < rest_speed;
      touched.emplace_back(j, std::fabs(state.velocity[j]));
    }
    if (touched.empty()) return true;
    if (!factorise(state, held, progress)) return false;
    // An impact slower than rest_speed ends at once, and moves nothing that stands: else two joints on their stops might
    // push each other off, weaker and weaker, for ever. It only takes energy, as a projection does.
    if (gently)
      for (int j = 0; j < joints_; ++j)
        if (standing[j] && state.velocity[j] == 0.0 && std::find(touching.begin(), touching.end(), j) == touching.end())
          touching.push_back(j), way.push_back(1.0);
    const std::size_t count = touching.size();
    BoxProblem impact(count);
    std::vector<double> target(count);
    for (std::size_t i = 0; i < count; ++i) {
      const int j = touching[i];
      const double speed = way[i] * state.velocity[j], rebound = -restitution[j] * speed;
      target[i] = rebound > rest_speed ? rebound : 0.0;
      impact.b[i] = speed - target[i], impact.upper[i] = infinity, impact.lower[i] = gently ? -infinity : 0.0;
      respond(j);
      for (std::size_t k = 0; k < count; ++k) impact.W[k * count + i] = way[i] * way[k] * answer_[touching[k]];
    }
    impact.solve();
    for (std::size_t i = 0; i < count; ++i) {
      if (impact.x[i] == 0.0) continue;
      respond(touching[i]);
      for (int j = 0; j < joints_; ++j)
        add_compensated(state.velocity[j], state.velocity_remainder[j], way[i] * impact.x[i] * answer_[j],
                        state.velocity[j], state.velocity_remainder[j]);
    }
    for (std::size_t i = 0; i < count; ++i)
      if (impact.at[i] == BoxProblem::At::inside)
        state.velocity[touching[i]] = way[i] * target[i], state.velocity_remainder[touching[i]] = 0.0;
    return true;
  }

  // Which of the joints without rate stand, and which way the others with friction slide.
  bool decide(const JointState& state, const double* held, Progress& progress) {
    std::vector<int> still;
    for (int j = 0; j < joints_; ++j) {
      sign[j] = state.velocity[j] > 0.0 ? 1.0 : state.velocity[j] < 0.0 ? -1.0 : 0.0;
      if (sign[j] == 0.0 && (friction[j] > 0.0 || on_stop(j, state.position[j]))) still.push_back(j);
    }
    places = state.position;
    std::fill(standing.begin(), standing.end(), false);
    if (still.empty()) return true;
    if (!factorise(state, held, progress)) return false;
    const std::size_t count = still.size();
    BoxProblem hold(count);
    for (std::size_t i = 0; i < count; ++i)
      hold.b[i] = acceleration_[still[i]], hold.lower[i] = least(still[i]), hold.upper[i] = most(still[i]);
    for (std::size_t i = 0; i < count; ++i) {
      respond(still[i]);
      for (std::size_t k = 0; k < count; ++k) hold.W[k * count + i] = answer_[still[k]];
    }
    hold.solve();
    for (std::size_t i = 0; i < count; ++i) {
      standing[still[i]] = hold.at[i] == BoxProblem::At::inside || hold.y[i] == 0.0;
      if (!standing[still[i]]) sign[still[i]] = hold.at[i] == BoxProblem::At::lower ? 1.0 : -1.0;
    }
    return true;
  }

  // lambda, of all joints, in a state where those that stand are at rest: inverse dynamics less the efforts that act.
  void find_lambda(const JointState& state, const double* acceleration, const double* held, double* lambda) {
    recursion_.inverse(state.position.data(), state.velocity.data(), acceleration, true, lambda);
    std::copy_n(held, joints_, effort_.begin());
    for (const auto& law : forces_.springs) effort_[law.joint] -= law.stiffness * (state.position[law.joint] - law.rest);
    forces_.add_wrenches(state.position.data(), nullptr, effort_.data());
    for (int j = 0; j < joints_; ++j) lambda[j] -= effort_[j];
  }

 private:
  // Factors of the mass matrix of all joints, and the accelerations that they would have with nothing held.
  bool factorise(const JointState& state, const double* held, Progress& progress) {
    std::copy_n(held, joints_, effort_.begin());
    forces_.add_passive(state.position.data(), state.velocity.data(), effort_.data());
    forces_.add_wrenches(state.position.data(), state.position_remainder.data(), effort_.data());
    const int joint = recursion_.evaluate(state.position.data(), state.velocity.data(), effort_.data(),
                                          acceleration_.data());
    if (joint < 0) return true;
    progress.outcome = singular_or_not_finite(state.position.data(), joints_), progress.joint = joint;
    return false;
  }

  // answer_ <- column j of the inverse mass matrix.
  void respond(int j) {
    unit_[j] = 1.0;
    recursion_.respond(unit_.data(), answer_.data());
    unit_[j] = 0.0;
  }

  const JointForces& forces_;
  const int joints_;
  Recursion recursion_;
  std::vector<double> acceleration_, effort_, answer_, unit_;
};

}  // namespace planar_chain
