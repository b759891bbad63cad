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

#include "../arithmetic/compensated_sum.hpp"
#include "../forms/recursive.hpp"
#include "../forms/right_hand_side.hpp"
#include "../integrators/integrator.hpp"
#include "../model/chain.hpp"
#include "../model/joint_forces.hpp"
#include "box_problem.hpp"

namespace planar_chain {

// A rebound slower than this, rad/s or m/s, or over within this, s, is taken as none, so infinitely many bounces end.
struct LeastRebound {
  double speed, flight;

  // Whether a joint rebounds that is pressed against its stop with this acceleration.
  double with(double acceleration) const { return std::fmax(speed, 0.5 * flight * acceleration); }
};
constexpr LeastRebound least_rebound{1e-5, 1e-6};
// The same where other joints rest on stops: they might throw each other off in turn infinitely often.
constexpr LeastRebound least_rebound_of_many{1e-3, 3e-4};

// Impacts within this time, s, count as one: a joint thrown against its stop by the impact of another can throw that
// one back, infinitely often in no time.
constexpr double at_once = 1e-8;

// Number of impacts of one moment that rebound; the next ones do not.
constexpr int most_rounds = 8;

class Holding {
 public:
  static constexpr double infinity = std::numeric_limits<double>::infinity();

  std::vector<double> friction, lower, upper, restitution;  // of the joints
  std::vector<bool> standing;
  std::vector<double> sign;    // of the rate that friction acts against
  std::vector<double> places;  // of the joints when it was decided which of them stand
  std::vector<int> still;      // joints without rate that friction or a stop may hold
  std::vector<double> give;    // of those: acceleration per effort, (H^-1)_jj

  Holding(const Chain& chain, const JointForces& forces)
      : friction(chain.joint_count), lower(chain.joint_count, -infinity), upper(chain.joint_count, infinity),
        restitution(chain.joint_count), standing(chain.joint_count), sign(chain.joint_count), places(chain.joint_count),
        give(chain.joint_count), chain_(chain), forces_(forces), joints_(chain.joint_count), recursion_(chain),
        right_hand_side_(chain, forces), acceleration_(joints_), answer_(joints_), unit_(joints_), size_(joints_),
        unsure_(joints_) {
    for (const auto& law : forces.all<FrictionOf>()) friction[law.joint] = law.friction;
    for (const auto& law : forces.all<StopOf>())
      lower[law.joint] = law.lower, upper[law.joint] = law.upper, restitution[law.joint] = law.restitution;
  }

  bool on_lower(int j, double position) const { return position <= lower[j]; }
  bool on_upper(int j, double position) const { return position >= upper[j]; }
  bool on_stop(int j, double position) const { return on_lower(j, position) || on_upper(j, position); }

  // Bounds of the effort that may hold joint j where it stands.
  double least(int j) const { return on_upper(j, places[j]) ? -infinity : -friction[j]; }
  double most(int j) const { return on_lower(j, places[j]) ? infinity : friction[j]; }

  // Impacts of all joints that are on a stop and move into it, together; `touched` gets these joints and their speeds.
  // `actuator`: efforts of the actuators.
  bool collide(JointState& state, const double* actuator, std::vector<std::pair<int, double>>& touched,
               Progress& progress) {
    bool approaches = false;
    for (int j = 0; j < joints_; ++j) {
      const double n = on_lower(j, state.position[j]) ? 1.0 : on_upper(j, state.position[j]) ? -1.0 : 0.0;
      approaches = approaches || n * state.velocity[j] < 0.0;
    }
    if (!approaches) return true;
    if (!factorise(state, actuator, progress)) return false;
    // A joint that an impact throws at its stop, and that is there at once, has its own impact and may throw others.
    for (int rounds = 0; rounds < 2 * most_rounds && find_touching(state, rounds > 0, touched); ++rounds) {
      if (rounds < most_rounds && gentle(state)) {
        // A weak impact ends at once and moves no joint that stands; else two joints on their stops might push each
        // other off, weaker and weaker, for ever. Like a projection it only takes energy.
        for (int j = 0; j < joints_; ++j)
          if (standing[j] && state.velocity[j] == 0.0) touch(j, 1.0);
        strike(state, Impact::holding);
      } else if (rounds < most_rounds) {
        strike(state, Impact::rebounding);
      } else {
        // They throw each other back and forth without end: takes the nearest velocities that go into no stop.
        for (int j = 0; j < joints_; ++j) {
          const double near = at_once * (1.0 + std::fabs(state.velocity[j]));
          if (state.position[j] - lower[j] <= near) touch(j, 1.0);
          if (upper[j] - state.position[j] <= near) touch(j, -1.0);
        }
        strike(state, Impact::ending);
      }
    }
    return true;
  }

  static void put_rate(JointState& state, int joint, double rate) {
    state.velocity[joint] = rate, state.velocity_remainder[joint] = 0.0;
  }

  // Which of the joints without rate stand, and which way the others with friction slide. Rounding may make this wrong;
  // the caller checks it by the accelerations of the moving part.
  bool decide(const JointState& state, const double* actuator, Progress& progress) {
    still.clear();
    for (int j = 0; j < joints_; ++j) {
      sign[j] = state.velocity[j] > 0.0 ? 1.0 : state.velocity[j] < 0.0 ? -1.0 : 0.0;
      if (sign[j] == 0.0 && (friction[j] > 0.0 || on_stop(j, state.position[j]))) still.push_back(j);
    }
    places = state.position;
    std::fill(standing.begin(), standing.end(), false);
    if (still.empty()) return true;
    if (!factorise(state, actuator, progress)) return false;
    const std::size_t count = still.size();
    BoxProblem hold(count);
    for (std::size_t i = 0; i < count; ++i)
      hold.b[i] = acceleration_[still[i]], hold.lower[i] = least(still[i]), hold.upper[i] = most(still[i]);
    for (std::size_t i = 0; i < count; ++i) {
      respond(still[i]);
      for (std::size_t k = 0; k < count; ++k) hold.W[k * count + i] = answer_[still[k]];
      give[still[i]] = answer_[still[i]];
    }
    hold.solve();
    for (std::size_t i = 0; i < count; ++i) {
      standing[still[i]] = hold.at[i] == BoxProblem::At::inside || hold.y[i] == 0.0;
      if (!standing[still[i]]) sign[still[i]] = hold.at[i] == BoxProblem::At::lower ? 1.0 : -1.0;
    }
    return true;
  }

  // lambda of the standing joints, in a state with these accelerations: inverse dynamics less the efforts that act.
  void find_lambda(const JointState& state, const double* acceleration, const double* actuator, double* lambda) {
    const double* effort = right_hand_side_.efforts(state, actuator);
    const JointState& near = right_hand_side_.near();
    recursion_.inverse(near.position.data(), near.velocity.data(), acceleration, true, lambda);
    for (int j = 0; j < joints_; ++j) lambda[j] -= effort[j];
  }

  // After find_lambda() with the same arguments, and the mass matrix factorised there: bounds of the rounding errors of
  // lambda. The sum of n numbers of one size is off by at most n eps times that size (Higham, Accuracy and Stability,
  // 3.1); each link adds some ten numbers, each with a few roundings of its own. An acceleration of a moving joint is
  // as far off as the balance that it comes from. The bound is 0 if nothing was rounded: efforts alone are compared to
  // the last bit.
  void find_rounding(const JointState& state, const double* acceleration, const double* lambda, double* rounding_of) {
    recursion_.sizes(state.velocity.data(), acceleration, size_.data());
    recursion_.pivot_inverses(answer_.data());
    for (int j = 0; j < joints_; ++j)
      unsure_[j] = standing[j] ? 0.0 : std::fabs(acceleration[j]) + size_[j] * answer_[j];
    recursion_.sizes(state.velocity.data(), unsure_.data(), size_.data());
    forces_.each_smooth([&](const auto& law) { size_[law.joint] += law.size(state.position[law.joint]); });
    for (const Wrench& wrench : forces_.wrenches) add_size(wrench, state);
    for (int j = 0; j < joints_; ++j)
      rounding_of[j] =
          size_[j] == 0.0 ? 0.0 : rounding(size_[j]) + std::numeric_limits<double>::epsilon() * std::fabs(lambda[j]);
  }

  // The same for joint j, in the balance of efforts alone.
  double rounding_of_size(int j) const { return rounding(size_[j]); }

  double rounding(double size) const {
    return (16.0 + 10.0 * chain_.link_count()) * std::numeric_limits<double>::epsilon() * size;
  }

  // Factors of the mass matrix of all joints, and the accelerations that they would have with nothing held.
  bool factorise(const JointState& state, const double* actuator, Progress& progress) {
    const double* effort = right_hand_side_.efforts(state, actuator);
    const JointState& near = right_hand_side_.near();
    const int joint = recursion_.evaluate(near.position.data(), near.velocity.data(), effort, acceleration_.data());
    progress.outcome = outcome_of(joint, near.position.data(), joints_), progress.joint = joint;
    return joint < 0;
  }

 private:
  enum class Impact { rebounding, ending, holding };  // with restitution; without; also, nothing leaves its stop

  void touch(int j, double way) {
    if (std::find(touching_.begin(), touching_.end(), j) == touching_.end())
      touching_.push_back(j), way_.push_back(way);
  }

  // Finds the joints on a stop that do not leave it, and after an impact those that reach one `at once`; true if any of
  // them moves into its stop, which `touched` then gets.
  bool find_touching(const JointState& state, bool thrown, std::vector<std::pair<int, double>>& touched) {
    touching_.clear(), way_.clear(), resting_ = 0;
    bool approaches = false;
    for (int j = 0; j < joints_; ++j) {
      const double at = state.position[j], v = state.velocity[j];
      double n = on_lower(j, at) ? 1.0 : on_upper(j, at) ? -1.0 : 0.0;
      if (n == 0.0 && thrown && v != 0.0 && (v < 0.0 ? at - lower[j] : upper[j] - at) <= at_once * std::fabs(v))
        n = v < 0.0 ? 1.0 : -1.0;
      if (n == 0.0 || n * v > 0.0) continue;
      touch(j, n);
      if (v == 0.0) ++resting_;
      else approaches = true, touched.emplace_back(j, std::fabs(v));
    }
    return approaches;
  }

  // Whether all rebounds of the touching joints are too weak to count.
  bool gentle(const JointState& state) const {
    const LeastRebound& least = resting_ > 0 ? least_rebound_of_many : least_rebound;
    for (std::size_t i = 0; i < touching_.size(); ++i)
      if (std::fabs(state.velocity[touching_[i]]) > least.with(-way_[i] * acceleration_[touching_[i]])) return false;
    return true;
  }

  // After factorise(): the impact of touching_ changes the velocities. Each kind takes energy: a rebound because no
  // joint leaves its stop before it, the others because they are projections.
  void strike(JointState& state, Impact kind) {
    const std::size_t count = touching_.size();
    BoxProblem impact(count);
    std::vector<double> target(count);
    for (std::size_t i = 0; i < count; ++i) {
      const int j = touching_[i];
      const double speed = way_[i] * state.velocity[j], rebound = -restitution[j] * speed;
      if (kind == Impact::rebounding && rebound > least_rebound.with(-way_[i] * acceleration_[j])) target[i] = rebound;
      impact.b[i] = speed - target[i], impact.upper[i] = infinity;
      impact.lower[i] = kind == Impact::holding ? -infinity : 0.0;
      respond(j);
      for (std::size_t k = 0; k < count; ++k) impact.W[k * count + i] = way_[i] * way_[k] * answer_[touching_[k]];
    }
    if (!impact.solve()) {  // then nothing leaves its stop, which always has a solution
      std::fill(impact.lower.begin(), impact.lower.end(), -infinity);
      std::fill(impact.at.begin(), impact.at.end(), BoxProblem::At::inside);
      impact.solve();
    }
    const std::vector<double> before = state.velocity;
    double size = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      if (impact.x[i] == 0.0) continue;
      respond(touching_[i]);
      double largest = 0.0;
      for (int j = 0; j < joints_; ++j) {
        const double change = way_[i] * impact.x[i] * answer_[j];
        add_compensated(state.velocity[j], state.velocity_remainder[j], change, state.velocity[j],
                        state.velocity_remainder[j]);
        largest = std::fmax(largest, std::fabs(change));
      }
      size += largest;
    }
    // A joint at rest that the impacts do not move stays at rest, despite rounding.
    for (int j = 0; j < joints_; ++j)
      if (before[j] == 0.0 && std::fabs(state.velocity[j]) <= rounding(size)) put_rate(state, j, 0.0);
    // No joint moves on into its stop.
    for (std::size_t i = 0; i < count; ++i)
      if (impact.at[i] == BoxProblem::At::inside || way_[i] * state.velocity[touching_[i]] < target[i])
        put_rate(state, touching_[i], way_[i] * target[i]);
  }

  // answer_ <- column j of the inverse mass matrix.
  void respond(int j) {
    unit_[j] = 1.0;
    recursion_.respond(unit_.data(), answer_.data());
    unit_[j] = 0.0;
  }

  // What a wrench adds to the sizes of the joints on its path: the force on all arms, and the moment.
  void add_size(const Wrench& wrench, const JointState& state) {
    const double force = std::fabs(wrench.force_x) + std::fabs(wrench.force_y);
    double arm = std::fabs(wrench.point_x) + std::fabs(wrench.point_y);
    for (int i = wrench.link; i > 0; i = chain_.links[i].carrier) {
      const Link& link = chain_.links[i];
      if (link.turns()) size_[link.rotation] += force * arm + std::fabs(wrench.moment);
      if (link.slides()) size_[link.slide] += force, arm += std::fabs(state.position[link.slide]);
      arm += std::fabs(link.offset_x) + std::fabs(link.offset_y);
    }
  }

  const Chain& chain_;
  const JointForces& forces_;
  const int joints_;
  Recursion recursion_;
  RightHandSide right_hand_side_;
  std::vector<double> acceleration_, answer_, unit_, size_, unsure_;
  std::vector<int> touching_;  // joints of an impact
  std::vector<double> way_;    // direction off their stops, +1 or -1
  int resting_ = 0;            // number of them that rest there
};

}  // namespace planar_chain
