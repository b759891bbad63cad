// Pinocchio as a peer: its articulated-body algorithm in a compiled loop and behind Boost.odeint's integrators.
// A C interface for ctypes; benchmark/peers/pinocchio_peer.py compiles it against the headers that are found.
#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/aba.hpp>

#include <boost/numeric/odeint.hpp>

#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

namespace odeint = boost::numeric::odeint;
namespace pin = pinocchio;

namespace {

using State = std::vector<double>;   // joint positions, then joint velocities

struct Body {          // one row of the table that Python sends: all numbers
  double carrier;      // index of an earlier row, -1 is the base
  double origin_x, origin_y, angle;
  double mass, center_x, center_y, inertia_com;
  double slides, slide_axis, rotation_axis;   // rotation_axis 0: does not turn
};

struct Peer {
  pin::Model model;
  std::unique_ptr<pin::Data> data;
  Eigen::VectorXd position, velocity, effort, damping, stiffness, rest;
  bool passive = false;
  long evaluations = 0, accepted = 0, rejected = 0;

  // The laws of joint effort and the articulated-body algorithm: q'' of a state.
  void operator()(const State& state, State& rate, double) {
    const Eigen::Index joints = model.nv;
    position = Eigen::Map<const Eigen::VectorXd>(state.data(), joints);
    velocity = Eigen::Map<const Eigen::VectorXd>(state.data() + joints, joints);
    if (passive)
      effort.array() = -damping.array() * velocity.array() - stiffness.array() * (position - rest).array();
    pin::aba(model, *data, position, velocity, effort);
    Eigen::Map<Eigen::VectorXd>(rate.data(), joints) = velocity;
    Eigen::Map<Eigen::VectorXd>(rate.data() + joints, joints) = data->ddq;
    ++evaluations;
  }
};

Eigen::Matrix3d about_z(double angle) {
  return Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

// Joints of the cheapest type there is: about +z, along x or y where the axis is one of them.
pin::JointIndex add_slide(pin::Model& model, pin::JointIndex parent, const pin::SE3& frame, double axis, int number) {
  const std::string name = "slide" + std::to_string(number);
  if (axis == 0.0) return model.addJoint(parent, pin::JointModelPX(), frame, name);
  if (axis == M_PI / 2) return model.addJoint(parent, pin::JointModelPY(), frame, name);
  const Eigen::Vector3d direction(std::cos(axis), std::sin(axis), 0.0);
  return model.addJoint(parent, pin::JointModelPrismaticUnaligned(direction), frame, name);
}

pin::JointIndex add_rotation(pin::Model& model, pin::JointIndex parent, const pin::SE3& frame, double axis, int number) {
  const std::string name = "rotation" + std::to_string(number);
  if (axis > 0.0) return model.addJoint(parent, pin::JointModelRZ(), frame, name);
  return model.addJoint(parent, pin::JointModelRevoluteUnaligned(Eigen::Vector3d(0.0, 0.0, axis)), frame, name);
}

template <class Stepper>
void run_controlled(Peer& peer, Stepper stepper, State& state, double duration) {
  double time = 0.0, step = 1e-3;
  while (time < duration) {
    if (time + step > duration) step = duration - time;
    const double before = time;
    if (stepper.try_step(std::ref(peer), state, time, step) == odeint::success) {
      ++peer.accepted;
      if (time == before) return;   // a step of zero length: cannot be met
    } else {
      ++peer.rejected;
      if (step < 1e-12) return;
    }
  }
}

}  // namespace

#define EXPORTED extern "C" __attribute__((visibility("default")))

// `laws`: damping, stiffness, rest and armature per joint, one row each.
EXPORTED void* make_peer(const Body* bodies, int count, double gravity_x, double gravity_y, const double* laws) {
  auto* peer = new Peer;
  pin::Model& model = peer->model;
  model.gravity.linear() << gravity_x, gravity_y, 0.0;
  std::vector<std::pair<pin::JointIndex, pin::SE3>> placed;
  for (int i = 0; i < count; ++i) {
    const Body& body = bodies[i];
    auto [joint, frame] = body.carrier < 0.0 ? std::make_pair(pin::JointIndex(0), pin::SE3(pin::SE3::Identity()))
                                             : placed[static_cast<std::size_t>(body.carrier)];
    frame = frame * pin::SE3(Eigen::Matrix3d::Identity(), Eigen::Vector3d(body.origin_x, body.origin_y, 0.0));
    if (body.slides != 0.0) {
      joint = add_slide(model, joint, frame, body.slide_axis, i);
      frame = pin::SE3::Identity();
    }
    frame = frame * pin::SE3(about_z(body.angle), Eigen::Vector3d::Zero());
    if (body.rotation_axis != 0.0) {
      joint = add_rotation(model, joint, frame, body.rotation_axis, i);
      frame = pin::SE3::Identity();
    }
    const Eigen::Vector3d center(body.center_x, body.center_y, 0.0);
    model.appendBodyToJoint(joint, pin::Inertia(body.mass, center, body.inertia_com * Eigen::Matrix3d::Identity()),
                            frame);
    placed.emplace_back(joint, frame);
  }
  const auto row = [&](int k) { return Eigen::Map<const Eigen::VectorXd>(laws + k * model.nv, model.nv); };
  peer->damping = row(0), peer->stiffness = row(1), peer->rest = row(2);
  model.armature = row(3);
  peer->passive = !peer->damping.isZero(0.0) || !peer->stiffness.isZero(0.0);
  peer->effort = peer->position = peer->velocity = Eigen::VectorXd::Zero(model.nv);
  peer->data = std::make_unique<pin::Data>(model);
  return peer;
}

EXPORTED void free_peer(void* peer) { delete static_cast<Peer*>(peer); }

// `count` evaluations of aba alone, each from a slightly different angle; the last acceleration goes to `acceleration`.
EXPORTED void evaluate(void* handle, const double* position, const double* velocity, const double* effort, long count,
                       double* acceleration) {
  Peer& peer = *static_cast<Peer*>(handle);
  const Eigen::Index joints = peer.model.nv;
  Eigen::VectorXd q = Eigen::Map<const Eigen::VectorXd>(position, joints);
  const Eigen::VectorXd v = Eigen::Map<const Eigen::VectorXd>(velocity, joints);
  const Eigen::VectorXd tau = Eigen::Map<const Eigen::VectorXd>(effort, joints);
  for (long k = 0; k < count; ++k) {
    pin::aba(peer.model, *peer.data, q, v, tau);
    q[0] += 1e-9;
  }
  Eigen::Map<Eigen::VectorXd>(acceleration, joints) = peer.data->ddq;
}

// Integrates `state` (positions, velocities) over `duration`, in place; `setting` is the number of steps of method 0
// and the tolerance of the others; `counts` takes evaluations, accepted and rejected steps.
EXPORTED void integrate(void* handle, int method, double setting, double duration, double* state, long* counts) {
  Peer& peer = *static_cast<Peer*>(handle);
  State x(state, state + 2 * peer.model.nv);
  peer.evaluations = peer.accepted = peer.rejected = 0;
  if (method == 0) {
    const long steps = std::lround(setting);
    odeint::runge_kutta4<State> stepper;
    for (long k = 0; k < steps; ++k) stepper.do_step(std::ref(peer), x, 0.0, duration / static_cast<double>(steps));
    peer.accepted = steps;
  } else if (method == 1) {
    run_controlled(peer, odeint::make_controlled<odeint::runge_kutta_dopri5<State>>(setting, setting), x, duration);
  } else if (method == 2) {
    run_controlled(peer, odeint::make_controlled<odeint::runge_kutta_fehlberg78<State>>(setting, setting), x, duration);
  } else {
    run_controlled(peer, odeint::bulirsch_stoer<State>(setting, setting), x, duration);
  }
  std::copy(x.begin(), x.end(), state);
  counts[0] = peer.evaluations, counts[1] = peer.accepted, counts[2] = peer.rejected;
}
