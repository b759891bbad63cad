"""
The bits of smooth motion, recorded: every method on every shipped chain, and every form of the equations.

A change of the code that is none of the physics leaves them alone. One that means to change them says so, and records
them anew: python test/motion/test_recorded_bits.py
"""
import hashlib
import json
from pathlib import Path
import warnings

import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.mechanics.plan import plan_of

CHAINS = sorted(path.stem for path in (Path(__file__).parents[2] / 'config').glob('*.yaml'))
RECORD = Path(__file__).with_name('recorded_bits.json')
FAR = 1e4   # rad or m, from where whole turns are left out


def efforts(ticks, joints):
    """Return efforts that change at every tick, made of sums alone."""
    return np.array([[0.25 * ((7 * tick + 3 * joint) % 11 - 5) for joint in range(joints)] for tick in range(ticks)])


def bits(chain, method, form):
    """Return a hash of a run near zero, one far out, under a wrench, held and changing efforts; and of a batch."""
    found = hashlib.sha256()
    simulation = pcs.Simulation(chain, method, form=form)
    simulation.set_wrench(chain.bodies[-1].name, [1.0, 0.5], 0.1)
    for far in (0.0, FAR):
        simulation.set_state(simulation.position + far, simulation.velocity)
        try:
            simulation.advance(40, efforts(1, chain.joint_count)[0])
            simulation.advance(10, efforts(10, chain.joint_count))
        except pcs.SimulationError as error:   # of a method whose step is too long for the chain
            found.update(error.reason.encode())
        for numbers in (simulation.position, simulation.velocity, simulation.acceleration):
            found.update(numbers.tobytes())
    batch = pcs.rollout_batch(chain, [simulation.position - FAR, simulation.position], duration=0.02, method=method,
                              form=form)
    found.update(batch.position.tobytes())
    return found.hexdigest()[:16]


def cases():
    """Return (chain, method, form): every method as it chooses, and the forms with one of each family."""
    forms = [(method, form) for method in ('rk4', 'taylor', 'rodas5p') for form in ('dense', 'recursive')]
    return [(chain, method, form) for chain in CHAINS for method, form in [*((m, 'auto') for m in pcs.METHODS), *forms]]


@pytest.mark.filterwarnings('ignore::RuntimeWarning')
@pytest.mark.parametrize('name, method, form', cases())
def test_smooth_motion_keeps_its_bits(name, method, form):
    chain = pcs.load_chain(f'{name}.yaml')
    assert not {'stops', 'friction'} & set(plan_of(chain).used)
    assert bits(chain, method, form) == json.loads(RECORD.read_text())[f'{name} {method} {form}']


if __name__ == '__main__':
    warnings.simplefilter('ignore')
    RECORD.write_text(json.dumps({f'{name} {method} {form}': bits(pcs.load_chain(f'{name}.yaml'), method, form)
                                  for name, method, form in cases()}, indent=1) + '\n')
