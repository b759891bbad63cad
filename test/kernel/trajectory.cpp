// Reads a chain, a method and a state as portable_bits.py writes them, moves on, and prints the state in full: the
// kernel alone, with no Python, to be compiled for any machine.
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "../../planar_chain_sim/kernel/integrators/methods.hpp"
#include "../../planar_chain_sim/kernel/integrators/rollout.hpp"

namespace pc = planar_chain;

static std::string word() {
  char text[64];
  if (std::scanf("%63s", text) != 1) std::exit(2);
  return text;
}
static double number() { return std::strtod(word().c_str(), nullptr); }
static int integer() { return std::atoi(word().c_str()); }
static std::vector<double> numbers() {
  std::vector<double> values(integer());
  for (double& value : values) value = number();
  return values;
}

int main() {
  pc::Chain chain;
  chain.joint_count = integer();
  chain.gravity_x = number(), chain.gravity_y = number();
  chain.links.resize(integer() + 1);
  for (std::size_t i = 1; i < chain.links.size(); ++i) {
    pc::Link& link = chain.links[i];
    link.carrier = integer(), link.slide = integer(), link.rotation = integer();
    for (auto field : pc::Link::numbers) link.*field = number();
  }
  chain.find_features();
  chain.refined = integer() != 0;
  pc::JointForces forces;
  for (int left = integer(); left > 0; --left) {
    const int joint = integer();
    std::get<0>(forces.smooth).push_back({joint, number()});
  }
  for (int left = integer(); left > 0; --left) {
    const int joint = integer();
    const double stiffness = number();
    std::get<1>(forces.smooth).push_back({joint, stiffness, number()});
  }
  pc::MethodData method;
  std::string family = word();
  while (family.back() == '-') family.back() = ' ', family += word();
  const auto known = pc::family_of(family);
  if (!known) std::exit(2);
  method.family = *known;
  method.order = integer(), method.adaptive = integer() != 0, method.tolerance = number();
  method.tableau.stages = integer();
  for (auto* part : {&method.tableau.a, &method.tableau.b, &method.tableau.error, &method.tableau.interpolation_a,
                     &method.tableau.interpolation, &method.tableau.c})
    *part = numbers();
  method.tableau.gamma = number();
  const double step = number();
  const bool dense = integer() != 0;
  pc::JointState state(chain.joint_count);
  state.position = numbers(), state.velocity = numbers();
  const std::vector<double> effort = numbers();

  const auto form = pc::make_form<double>(chain, dense);
  const auto integrator = pc::make_motion(method, chain, *form, forces, step, dense);
  std::vector<double> acted(effort.size()), latched(effort.size());
  const std::int64_t ticks = integer();
  const pc::Progress progress =
      pc::roll(*integrator, forces, state, step, 0.0, 0, ticks, {effort.data(), 0}, {}, acted, latched);
  for (const double value : state.position) std::printf("%a ", value);
  for (const double value : state.velocity) std::printf("%a ", value);
  return progress.ticks == ticks ? 0 : 1;
}
