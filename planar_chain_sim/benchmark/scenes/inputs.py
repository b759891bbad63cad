"""Efforts and ticks of all kinds."""
from __future__ import annotations

from dataclasses import replace
from typing import Callable, Iterator
import warnings

import numpy as np

from . import Check, INTEGRATORS, MuJoCoRun, one_joint
from .coarse_steps import coarse_steps
from ..problems import configured
from ...errors import SimulationError
from ...mechanics.dynamics import energy
from ...motion.simulation import Simulation

LIMIT = 100.0    # N m, of the arm's joints


def efforts(peers: dict, size: float) -> Iterator[Check]:
    """
    Give efforts of all kinds: the state stays finite, or the run stops cleanly at its last good state; it never jumps.

    A jump is a change of the energy that the work of the effort in that tick does not explain.
    """
    noise = np.random.default_rng(1)
    arm = configured('seven_link_arm')
    limited = replace(arm, source='', bodies=tuple(
        replace(body, rotation=replace(body.rotation, effort_limit=LIMIT)) for body in arm.bodies))
    white = noise.normal(0.0, 3.0 * LIMIT, (2000, 7))
    kinds: dict[str, tuple[int, Callable[[int], np.ndarray]]] = {
        'white noise, clamped at 100 N m': (2000, lambda tick: white[tick]),
        'steps of 1e6 N m': (500, lambda tick: np.full(7, 1e6 * (-1.0)**(tick // 50))),
        'denormals': (2000, lambda tick: np.full(7, 5e-324)), 'nan': (2000, lambda tick: np.full(7, np.nan)),
        'inf': (2000, lambda tick: np.full(7, np.inf))}
    for kind, (ticks, effort) in kinds.items():
        chain, ticks = limited if 'clamped' in kind else arm, max(50, int(ticks * size))
        bad, gained = _pushed(Simulation(chain, tolerance=1e-6), ticks, effort)
        finite = np.isfinite(effort(0)).all()
        theirs = [None, None]
        if 'MuJoCo' in peers:
            runs = [_pushed_in_mujoco(MuJoCoRun(chain, 1e-3, name), chain, ticks, effort) for name in INTEGRATORS]
            theirs = [min(values) for values in zip(*runs)]
        yield Check(f'{kind}: states not finite, changed by a refusal, efforts beyond limits (MuJoCo: resets)', 0,
                    bad, theirs[0])
        if finite:
            yield Check(f'{kind}: energy that no work explains, relative', 1e-4, gained, theirs[1])


def _unexplained(chain, before, after, effort) -> float:
    """Return the change of the energy less the work, over the sum of their sizes."""
    first, last = sum(energy(chain, *before)), sum(energy(chain, *after))
    work = effort * (after[0] - before[0])
    return abs(last - first - work.sum()) / (abs(last) + abs(first) + np.abs(work).sum() + 1e-300)


def _pushed(simulation: Simulation, ticks: int, effort: Callable) -> tuple[int, float]:
    """Return the number of bad states, and the largest energy that no work explains."""
    bad, gained, chain = 0, 0.0, simulation.chain
    for tick in range(ticks):
        before = simulation.position, simulation.velocity
        try:
            simulation.advance(1, effort(tick))
        except (ValueError, SimulationError):
            bad += any(a.tobytes() != b.tobytes() for a, b in zip(before, (simulation.position, simulation.velocity)))
        after = simulation.position, simulation.velocity
        bad += not np.isfinite(after).all()
        bad += (np.abs(simulation.effort) > [joint.effort_limit for joint in chain.joints]).any()
        if np.isfinite(effort(tick)).all():
            gained = max(gained, _unexplained(chain, before, after, simulation.effort))
    return bad, gained


def _pushed_in_mujoco(run: MuJoCoRun, chain, ticks: int, effort: Callable) -> tuple[float, float]:
    gained, limit = 0.0, np.array([joint.effort_limit for joint in chain.joints])
    for tick in range(ticks):
        before, acted = run.state, np.clip(effort(tick), -limit, limit)
        run.advance(1, acted)
        if np.isfinite(acted).all() and np.isfinite(run.state).all():
            gained = max(gained, _unexplained(chain, before, run.state, acted))
    return run.resets, gained


def ticks(peers: dict, size: float) -> Iterator[Check]:
    """Take ticks from 1e-6 to 1 s: right, or refused or warned of, never quietly wrong."""
    chain = configured('four_link_robot')
    end = Simulation(chain, 'taylor', 1.0, 1e-14)
    end.advance(1)
    lengths = (1e-6 if size == 1.0 else 1e-4, 1e-4, 1e-2, 1.0)

    def worst(start):
        worst = 0.0
        for step in lengths:
            run = start(step)
            run.advance(round(1.0 / step))
            position = run.state[0] if isinstance(run, MuJoCoRun) else run.position
            worst = max(worst, np.abs(position - end.position).max())
        return worst if np.isfinite(worst) else np.inf
    theirs = None
    if 'MuJoCo' in peers:
        theirs = min(worst(lambda step, name=name: MuJoCoRun(chain, step, name)) for name in INTEGRATORS)
    for name in ('auto', 'taylor', 'dop853', 'rodas5p'):
        yield Check(f'{name}: error after 1 s, any tick, rad or m', 1e-6,
                    worst(lambda step, name=name: Simulation(chain, name, step)), theirs)
    fixed = ('rk4', 'semi_implicit_euler', 'gauss6', 'dop853_fixed')
    spring = one_joint(gravity=0j, stiffness=1e4, position=1.0)
    pendulum, exact = configured('double_pendulum'), Simulation(configured('double_pendulum'), 'taylor', 1.0, 1e-14)
    exact.advance(2)
    for title, chain, lengths, seconds, right in (
            ('a spring of 100 rad/s', spring, (0.25, 0.5, 1.0), 10.0, np.cos(1000.0)),
            ('the double pendulum', pendulum, (0.01, 0.1, 0.25, 0.5, 1.0), 2.0, exact.position)):
        wrong = [f'{name} {step:g} s' for name in fixed for step in lengths
                 if _quietly_wrong(chain, name, step, round(seconds / step), right)]
        theirs = None
        if 'MuJoCo' in peers:
            theirs = float(sum(_quietly_wrong_in_mujoco(chain, name, step, round(seconds / step), right)
                               for name in INTEGRATORS for step in lengths))
        told = f' ({", ".join(wrong)})' if wrong else ''
        yield Check(f'fixed steps of {lengths[0]:g} to 1 s on {title}: quietly off by 0.1 rad{told}', 0, len(wrong),
                    theirs)
    yield from coarse_steps(size)


def _quietly_wrong(chain, method: str, step: float, count: int, right) -> bool:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter('always')
        try:
            simulation = Simulation(chain, method, step)
            simulation.advance(count)
        except SimulationError:
            return False
        return not told and bool(np.abs(simulation.position - right).max() > 0.1)


def _quietly_wrong_in_mujoco(chain, method: str, step: float, count: int, right) -> bool:
    run = MuJoCoRun(chain, step, method)
    run.advance(count)
    return not run.resets and bool(np.abs(run.state[0] - right).max() > 0.1)
