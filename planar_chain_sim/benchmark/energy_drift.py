"""The double pendulum over 1000 s: its energy error, how that grows with time, and the CPU time of the run."""
from __future__ import annotations

from dataclasses import replace
import sys
from time import process_time
from typing import Callable, Iterator

import numpy as np

from .problems import configured
from .work_precision import OWN
from ..chain.chain import Chain
from ..chain.joint_arrays import initial_state
from ..mechanics.dynamics import energy
from ..motion.integrators import METHODS
from ..motion.simulation import Simulation

COLUMNS = ('library', 'method', 'kind', 'setting', 'largest energy error / range', 'of all runs', 'runs', 'growth',
           'CPU median, s', 'CPU min, s')
DURATION = 1000          # s, sampled once a second
RUNS = 12                # the first from the named angles, the others a little apart
# `growth`: the slope of log(root mean square over the runs of the error) against log t
BUDGET = 6.0             # s of CPU time per row, after which there are fewer runs
FIXED_STEPS = {1: (1e-3,), 2: (1e-3,), 4: (1e-3, 2.5e-4), 6: (5e-3, 2.5e-3), 8: (5e-3, 2.5e-3)}   # by order, s
TOLERANCES = (1e-9, 1e-12, 1e-15, 1e-17)


def _scenes(count: int) -> list[Chain]:
    """Return the double pendulum from angles a little apart."""
    chain = configured('double_pendulum')
    first = chain.bodies[0]
    return [replace(chain, source='', bodies=(
        replace(first, rotation=replace(first.rotation, position=first.rotation.position + 1e-3 * k)),
        *chain.bodies[1:])) for k in range(count)]


def _own(chain: Chain, method: str, setting: float, seconds: int) -> Callable[[], list]:
    """Return a run that gives the states after each second."""
    adaptive = METHODS[method].adaptive
    simulation = Simulation(chain, method, 1.0 if adaptive else setting, setting if adaptive else None)
    ticks = 1 if adaptive else round(1.0 / setting)

    def run():
        states = []
        for _ in range(seconds):
            simulation.advance(ticks)
            states.append((simulation.position, simulation.velocity))
        return states
    return run


def _heyoka(peer, chain: Chain, method: str, tolerance: float, seconds: int) -> Callable[[], list]:
    taylor, system = peer.integrator(chain, method, tolerance)

    def run():
        states = taylor.propagate_grid(np.arange(0.0, seconds + 1.0))[-1]
        return [system.joints(state) for state in states[1:]]
    return run


def _contenders(peers: dict) -> list[tuple]:
    """Return library, method, kind, setting and what makes a run of a chain over so many seconds."""
    result = []
    for name, row in METHODS.items():
        for setting in TOLERANCES if row.adaptive else FIXED_STEPS.get(row.order, (1e-3,)):
            result.append((OWN, name, 'tolerance' if row.adaptive else 'step', setting,
                           lambda chain, seconds, name=name, setting=setting: _own(chain, name, setting, seconds)))
    if 'heyoka' in peers:
        for method in peers['heyoka'].formulations(configured('double_pendulum')):
            result += [('heyoka', method, 'tolerance', tolerance, lambda chain, seconds, method=method, tol=tolerance: (
                _heyoka(peers['heyoka'], chain, method, tol, seconds))) for tolerance in (1e-15, 1e-18)]
    return result


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """Yield a row of COLUMNS per method and setting."""
    from tqdm import tqdm
    seconds, scenes = (20, _scenes(2)) if quick else (DURATION, _scenes(RUNS))
    contenders = _contenders(peers)
    for library, method, kind, setting, prepare in tqdm(
            contenders, 'energy', file=sys.stderr, leave=False, disable=None):
        errors, times = [], []
        for chain in scenes:
            run, (start, range_) = prepare(chain, seconds), _energy_range(chain)
            began = process_time()
            try:
                states = run()
            except RuntimeError:   # too coarse a step, too fine a tolerance
                break
            times.append(process_time() - began)
            errors.append([abs(sum(energy(chain, *state)) - start) / range_ for state in states])
            if sum(times) > BUDGET:
                break
        if errors:
            yield (library, method, kind, setting, max(errors[0]), float(np.max(errors)), len(errors),
                   _growth(np.array(errors)), float(np.median(times)), min(times))


def _energy_range(chain: Chain) -> tuple[float, float]:
    """Return the energy at the start, and how far that is above the least there can be: both rods hanging, J."""
    start = sum(energy(chain, *initial_state(chain)))
    return start, start - sum(energy(chain, np.zeros(2), np.zeros(2)))


def _growth(errors: np.ndarray) -> float:
    """Return the slope of log(root mean square over runs) against log t, from 1 % of the time on."""
    size = np.sqrt((errors**2).mean(axis=0))
    time = np.arange(1, len(size) + 1)
    late = (time >= max(2, len(size) // 100)) & (size > 0.0)
    return float(np.polyfit(np.log(time[late]), np.log(size[late]), 1)[0]) if late.sum() > 1 else float('nan')
