"""The cost of a call from Python above the kernel's own time, and of the same calls of Pinocchio, in one run."""
from __future__ import annotations

from typing import Callable, Iterator

import numpy as np

from .cpu_time import interleaved
from .problems import uniform_rods
from .work_precision import OWN
from ..chain.chain import Chain
from ..mechanics.dynamics import energy, forward_dynamics, inverse_dynamics, mass_matrix
from ..mechanics.linearization import linearize
from ..mechanics.plan import plan_of
from ..motion.simulation import Simulation

JOINTS = (2, 7, 32)
COLUMNS = ('joints', 'call', 'library', 'median, us', 'min, us', 'kernel: median, us', 'kernel: min, us',
           'above the kernel: min, us', 'times ours: min')
ROUNDS = 21
STEP = 1e-6   # s: a state that the calls hardly move


def evaluations(chain: Chain, position, velocity, given) -> dict[str, tuple]:
    """Return by name the call of each function of one state, and the kernel's loop of it, as functions of a count."""
    model, dense = plan_of(chain).model, plan_of(chain).dense
    calls = {'forward_dynamics': lambda: forward_dynamics(chain, position, velocity, given),
             'inverse_dynamics': lambda: inverse_dynamics(chain, position, velocity, given),
             'mass_matrix': lambda: mass_matrix(chain, position),
             'energy': lambda: energy(chain, position, velocity),
             'linearize': lambda: linearize(chain, position, velocity, given)}
    return {name: (repeated(call), lambda count, name=name: model.repeat(name, position, velocity, given, count, dense))
            for name, call in calls.items()}


def simulation_calls(chain: Chain, position, velocity, given) -> dict[str, tuple]:
    """Return the same of a simulation's members; a kernel's loop, None where the kernel only copies numbers."""
    moved, asked, looped = (Simulation(chain, 'rk4', STEP) for _ in range(3))
    for simulation in (moved, asked, looped):
        simulation.set_state(position, velocity)
    body, turn = chain.bodies[-1].name, iter(range(1, 2**62))

    def onwards():
        moved.advance_to((moved.tick + 1) * STEP)

    calls = {'advance(1)': lambda: moved.advance(1), 'advance(1, effort)': lambda: moved.advance(1, given),
             'advance_to': onwards}
    loop = {name: looped.advance for name in calls} | {'checkpoint': repeated(asked._stepper.save)}
    calls |= {'set_state': lambda: asked.set_state(position, velocity), 'position': lambda: asked.position,
              'velocity': lambda: asked.velocity, 'effort': lambda: asked.effort,
              'acceleration': lambda: asked.acceleration, 'time': lambda: asked.time,
              'statistics': lambda: asked.statistics, 'take_events': asked.take_events,
              'checkpoint': asked.checkpoint, 'set_wrench': lambda: asked.set_wrench(body, (0.0, 1e-9 * next(turn)))}
    for method in ('rk4', 'auto'):
        name, made = f"Simulation('{method}')", Simulation(chain, method, STEP)
        calls[name] = lambda method=method: Simulation(chain, method, STEP)
        loop[name] = repeated(lambda made=made: made._make_stepper(chain, made.form))
    return {name: (repeated(call), loop.get(name)) for name, call in calls.items()}


def repeated(call: Callable[[], object]) -> Callable[[int], None]:
    """Return a function that makes a call so many times."""
    def repeat(count):
        for _ in range(count):
            call()
    return repeat


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """Yield rows of COLUMNS for serial rods of each number of joints, in a state of no symmetry."""
    for joints in JOINTS[:1] if quick else JOINTS:
        chain = uniform_rods(joints, bend=0.2)
        state = np.random.default_rng(joints).normal(size=(3, joints))
        ours = evaluations(chain, *state) | simulation_calls(chain, *state)
        loops = {}
        for name, (call, kernel) in ours.items():
            loops[name, OWN] = call
            if kernel:
                loops[name, 'kernel'] = kernel
        for library, peer in peers.items():
            if hasattr(peer, 'calls'):
                loops |= {(name, library): repeated(call) for name, call in peer.calls(chain, *state).items()}
        times = interleaved(list(loops.values()), 2 if quick else ROUNDS, f'{joints} joints', budget=1.0)
        spread = {key: (float(np.median(seconds)) * 1e6, float(seconds.min()) * 1e6)
                  for key, seconds in zip(loops, times)}
        for (name, library), (median, least) in spread.items():
            if library != 'kernel':
                kernel = spread.get((name, 'kernel'), (None, None)) if library == OWN else (None, None)
                above = least - (kernel[1] or 0.0) if library == OWN else None
                yield joints, name, library, median, least, *kernel, above, least / spread[name, OWN][1]
