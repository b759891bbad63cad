// The kernel in compiled loops of their own, for skipping.py: as it is, and with -DPLANAR_CHAIN_BARE without all that a
// scene of plain rotations lacks. A C interface for ctypes.
#include <algorithm>
#include <memory>
#include <vector>

#include "../kernel/integrators/methods.hpp"

namespace pc = planar_chain;

#define EXPORTED extern "C" __attribute__((visibility("default")))

namespace {

struct Scene {
  pc::Chain chain;
  pc::JointForces forces;
  std::unique_ptr<pc::Form> form;
  std::unique_ptr<pc::Integrator> integrator;
};

}  // namespace

// `topology` (links, 3) and `numbers` (links, 12) as kernel_arrays of kernel_model.py gives them; RK4 with ticks of `step` s.
EXPORTED void* make(const int* topology, const double* numbers, int links, const double* gravity, int joints, int dense,
                    double step) {
  auto scene = std::make_unique<Scene>();
  pc::Chain& chain = scene->chain;
  chain.joint_count = joints, chain.gravity_x = gravity[0], chain.gravity_y = gravity[1];
  chain.links.resize(static_cast<std::size_t>(links) + 1);
  for (int i = 1; i <= links; ++i) {
    pc::Link& link = chain.links[static_cast<std::size_t>(i)];
    link.carrier = topology[0], link.slide = topology[1], link.rotation = topology[2], topology += 3;
    for (double pc::Link::* number : pc::Link::numbers) link.*number = *numbers++;
  }
  chain.find_features();
  pc::MethodData rk4;
  rk4.family = pc::Family::explicit_runge_kutta, rk4.order = 4;
  rk4.tableau.stages = 4;
  rk4.tableau.a = {0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0};
  rk4.tableau.b = {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
  scene->form = pc::make_form<double>(chain, dense != 0);
  scene->integrator = pc::make_motion(rk4, chain, *scene->form, scene->forces, step, dense != 0);
  return scene.release();
}

EXPORTED void destroy(void* scene) { delete static_cast<Scene*>(scene); }

// `count` evaluations, each from a slightly different angle; the sum of the first accelerations.
EXPORTED double evaluate(void* made, const double* position, const double* velocity, long count) {
  Scene& scene = *static_cast<Scene*>(made);
  const std::size_t joints = static_cast<std::size_t>(scene.chain.joint_count);
  std::vector<double> q(position, position + joints), effort(joints), acceleration(joints);
  double sum = 0.0;
  for (long k = 0; k < count; ++k) {
    q[0] += 1e-9;
    std::fill(effort.begin(), effort.end(), 0.0);
    scene.forces.add_passive(q.data(), velocity, effort.data());
    scene.form->forward(q.data(), velocity, effort.data(), acceleration.data());
    sum += acceleration[0];
  }
  return sum;
}

// `count` ticks from a state; the first position at the end.
EXPORTED double roll(void* made, const double* position, const double* velocity, long count) {
  Scene& scene = *static_cast<Scene*>(made);
  const std::size_t joints = static_cast<std::size_t>(scene.chain.joint_count);
  pc::JointState state(scene.chain.joint_count);
  std::copy_n(position, joints, state.position.begin());
  std::copy_n(velocity, joints, state.velocity.begin());
  std::vector<double> effort(joints);
  scene.forces.clamp(effort.data());
  scene.integrator->advance(0.0, 0, count, state, effort.data());
  return state.position[0];
}
