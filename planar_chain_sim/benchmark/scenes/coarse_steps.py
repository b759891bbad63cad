"""Fixed steps from 1 ms to 1 s on arms from random states: right after 5 and 10 s, or warned of."""
from __future__ import annotations

from typing import Iterator, NamedTuple
import warnings

import numpy as np

from . import Check
from ..problems import configured, damped
from ...chain.chain import Chain
from ...chain.joint_arrays import initial_state
from ...errors import SimulationError
from ...motion.integrators import METHODS
from ...motion.simulation import Simulation

FIXED = tuple(name for name, row in METHODS.items() if not row.adaptive)
HORIZONS = (5.0, 10.0)        # s
OFF, RIGHT = 0.1, 1e-3        # rad or m: what must not be quiet, and what should not be warned of
KNOWN = 0.01                  # rad or m to which two tolerances must agree: chaos makes much even of round-off
COUNTS = {'double_pendulum': 40, 'four_link_robot': 12, 'seven_link_arm': 14, 'cart_arm_telescope': 14}


class Found(NamedTuple):
    """A run up to a horizon: how far off it ended, how far off it ever was, rad or m, and whether it was warned of."""

    what: str
    end: float
    largest: float
    told: bool


def arms(counts: dict[str, int], seed: int = 1) -> Iterator[tuple[Chain, np.ndarray, np.ndarray]]:
    """Yield so many of each configured chain, some with more damping, each with random positions and velocities."""
    noise = np.random.default_rng(seed)
    for name, count in counts.items():
        base = configured(name)
        start = initial_state(base)[0]
        turns = np.array([joint.kind != 'slide' for joint in base.joints])
        for _ in range(count):
            size = base.joint_count
            position = np.where(turns, noise.uniform(-np.pi, np.pi, size), start + noise.normal(0.0, 0.1, size))
            position = np.clip(position, *zip(*((joint.lower, joint.upper) for joint in base.joints)))
            velocity = noise.normal(0.0, np.where(turns, 2.0, 0.3))
            damping = 10.0**noise.uniform(-4.0, 0.0) if noise.uniform() < 0.4 and turns.all() else None
            yield base if damping is None else damped(base, damping), position, velocity


def _positions(simulation: Simulation, start, count: int) -> Iterator[np.ndarray]:
    """Yield positions (count, joints) from `start` to each of HORIZONS, the last of count ticks each."""
    simulation.set_state(*start)
    for _ in HORIZONS:
        rows = [np.empty((count, simulation.chain.joint_count)) for _ in range(3)]
        simulation.advance(count, None, tuple(rows))
        yield rows[0]


def found(chain: Chain, start, step: float, methods=FIXED) -> Iterator[Found]:
    """Yield what the methods make of about that step, for each horizon at which the truth is known."""
    count = max(5, round(HORIZONS[0] / step))
    step = HORIZONS[0] / count
    truth = list(_positions(Simulation(chain, 'taylor', step, 1e-16), start, count))
    other = list(_positions(Simulation(chain, 'taylor', step, 1e-13), start, count))
    known = [np.abs(a - b).max() < KNOWN for a, b in zip(truth, other)]
    for method in methods:
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter('always')
            largest, runs = 0.0, _positions(Simulation(chain, method, step), start, count)
            for seconds, right, sure in zip(HORIZONS, truth, known):
                try:
                    off = np.abs(next(runs) - right)
                except SimulationError:
                    break
                largest = max(largest, off.max())
                if sure:
                    what = f'{chain.name} {method} {step:.3g} s, {seconds:g} s'
                    yield Found(what, off[-1].max(), largest, bool(told))


def coarse_steps(size: float) -> Iterator[Check]:
    """Count runs that are quietly off, and right ones that are warned of."""
    counts, steps = COUNTS, 10.0**np.linspace(-3.0, 0.0, 10)
    if size < 1.0:
        counts, steps = dict.fromkeys(COUNTS, 1), steps[2::3]
    runs = [run for chain, *start in arms(counts) for step in steps for run in found(chain, start, step)]
    quiet = [run.what for run in runs if not (run.told or run.end <= OFF)]
    right = [run for run in runs if run.largest <= RIGHT]
    told = f' ({", ".join(quiet)})' if quiet else ''
    yield Check(f'fixed steps of 1 ms to 1 s on random arms, {len(runs)} runs of 5 and 10 s: '
                f'quietly off by 0.1 rad{told}', 0, len(quiet))
    count = max(1, len(right))
    yield Check(f'part of the {len(right)} of them right to 1e-3 rad that are warned of', max(0.02, 1.0 / count),
                sum(run.told for run in right) / count)
