"""
The same trajectory on another kind of machine, bit for bit: `make aarch64`, not a part of `make test`.

    portable_bits.py EMULATOR PROGRAM

runs trajectory.cpp, compiled for that machine, for every shipped chain and method, and compares with the kernel here.
"""
import subprocess
import sys

import numpy as np

import planar_chain_sim as pcs
from planar_chain_sim.chain.joint_arrays import initial_state
from planar_chain_sim.mechanics.kernel_model import kernel_arrays
from planar_chain_sim.mechanics.path_matrix import merge_welded
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.motion.integrators import taylor_order

CHAINS = ('arczewski_example', 'four_link_robot', 'double_pendulum', 'seven_link_arm', 'cart_arm_telescope',
          'chain_32_links')
TICKS = 50


def text_of(simulation, effort):
    """Return what trajectory.cpp reads."""
    chain, row = simulation.chain, pcs.METHODS[simulation.method]
    topology, constants = kernel_arrays(chain, merge_welded(chain)[0])
    words = [chain.joint_count, chain.gravity.real, chain.gravity.imag, len(topology)]
    for link, numbers in zip(topology.tolist(), constants.tolist()):
        words += [*link, *numbers]
    words.append(int(plan_of(chain).model.refined))
    for law in ('damping', 'stiffness'):
        joints = [(k, joint) for k, joint in enumerate(chain.joints) if getattr(joint, law) > 0.0]
        words.append(len(joints))
        for k, joint in joints:
            words += [k, getattr(joint, law)] + ([joint.rest] if law == 'stiffness' else [])
    words += [row.family.replace(' ', '- '), row.order or taylor_order(simulation.tolerance), int(row.adaptive),
              simulation.tolerance or 0.0, len(row.b)]
    for part in (row.a, (row.b,), row.error, row.interpolation_a, row.interpolation, row.c):
        numbers = [float(x) for line in part for x in line]
        words += [len(numbers), *numbers]
    words += [row.gamma, simulation.step, int(simulation.form == 'dense')]
    for numbers in (*initial_state(chain), effort):
        words += [len(numbers), *numbers.tolist()]
    return ' '.join(word.hex() if isinstance(word, float) else str(word) for word in [*words, TICKS])


def main(emulator, program):
    """Compare; return 1 where a bit differs."""
    different = 0
    for name in CHAINS:
        chain = pcs.load_chain(f'{name}.yaml')
        effort = 0.1 * np.cos(np.arange(float(chain.joint_count)))
        for method in pcs.METHODS:
            simulation = pcs.Simulation(chain, method)
            text = text_of(simulation, effort)
            simulation.advance(TICKS, effort)
            there = subprocess.run([emulator, program], input=text, capture_output=True, text=True)
            state = [float.fromhex(value) for value in there.stdout.split()]
            same = there.returncode == 0 and state == [*simulation.position, *simulation.velocity]
            different += not same
            print(f'{name} {method}: {"the same bits" if same else "DIFFERENT"}', flush=True)
    return min(different, 1)


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))
