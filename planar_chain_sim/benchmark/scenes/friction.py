"""Dry friction: an arm held for an hour, stick and slip under a slow ramp."""
from __future__ import annotations

from functools import lru_cache
from typing import Iterator, Optional

import numpy as np

from . import Check, MuJoCoRun, one_joint
from .stops import HOUR
from ...chain.chain import Chain
from ...chain_file import chain_from_dict
from ...motion.integrators import METHODS
from ...motion.simulation import Simulation

RATE, GRIP = 2.0, 1.0   # N m/s, N m: the ramp, and the friction that it has to overcome
PERIOD = 4000           # ticks of the ramp up and down


def holding(peers: dict, size: float) -> Iterator[Check]:
    """Hold an arm against gravity by friction for an hour; it must break away at the right effort."""
    chain = one_joint(friction=7.0)
    simulation = Simulation(chain)
    simulation.advance(HOUR)
    theirs = None
    if 'MuJoCo' in peers:
        run = MuJoCoRun(chain, 1e-3)
        run.advance(int(HOUR * size))
        theirs = abs(run.state[0, 0])
    yield Check('creep in an hour, rad', 0.0, abs(simulation.position[0]), theirs)
    ramp = -1e-3 * np.arange(3000)[:, None]
    simulation.advance(3000, ramp)
    slipped = next(event for event in simulation.take_events() if event.kind == 'slipped')
    yield Check('break-away against 2 N m, N m', 1.001e-3, abs(ramp[slipped.tick - HOUR, 0] + 2.0))
    threshold = Simulation(one_joint(gravity=0j, friction=7.0))
    wrong = 0
    for effort, moves in ((7.0, False), (-7.0, False), (np.nextafter(7.0, 8.0), True)):
        threshold.set_state([0.0], [0.0])
        threshold.advance(1000, [effort])
        wrong += bool(threshold.position[0]) != moves
    yield Check('held at 7 N m and moving at the next number: wrong', 0, wrong)


@lru_cache(maxsize=None)
def stick_and_slip(ticks: int, mujoco: Optional[str] = None) -> tuple[np.ndarray, np.ndarray, list]:
    """
    Return efforts (ticks,), states (ticks + 1, 2) and events of a hinge with friction under a ramp.

    Kept, for the picture. `mujoco`: the integrator, None for ours.
    """
    phase = (np.arange(ticks) + PERIOD // 4) % PERIOD   # from no effort up
    efforts = 1e-3 * RATE * (np.minimum(phase, PERIOD - phase) - 0.25 * PERIOD)
    chain = one_joint(gravity=0j, friction=GRIP)
    run = MuJoCoRun(chain, 1e-3, mujoco) if mujoco else Simulation(chain)
    states = np.empty((ticks + 1, 2))
    states[0] = 0.0
    for tick, effort in enumerate(efforts):
        run.advance(1, np.array([effort]))
        states[tick + 1] = run.state[:, 0] if mujoco else (run.position[0], run.velocity[0])
    return efforts, states, [] if mujoco else run.take_events()


def ramp(peers: dict, size: float) -> Iterator[Check]:
    """Drive a hinge with friction by a slow ramp up and down: it sticks, slips at the right effort, sticks again."""
    ticks = max(2 * PERIOD, int(10 * PERIOD * size))
    efforts, states, events = stick_and_slip(ticks)
    exact, standing, slips = _stick_and_slip_exact(efforts)
    found = [event.tick for event in events if event.kind == 'slipped']
    theirs = None
    if 'MuJoCo' in peers:
        theirs = stick_and_slip(ticks, 'implicitfast')[1]
    moved = np.abs(np.diff(states[:, 0]))[standing]
    yield Check(f'{standing.sum()} ticks that it stands: largest motion in one, rad', 0.0, moved.max(),
                None if theirs is None else np.abs(np.diff(theirs[:, 0]))[standing].max())
    yield Check(f'{len(slips)} times it breaks away: ticks at which it does not, and should, or should not', 0,
                len(set(found) ^ set(slips)))
    yield Check(f'position over {ticks * 1e-3:g} s against the closed form, rad', 1e-10,
                np.abs(states[:, 0] - exact).max(), None if theirs is None else np.abs(theirs[:, 0] - exact).max())


def _stick_and_slip_exact(efforts: np.ndarray) -> tuple[np.ndarray, np.ndarray, list]:
    """Return positions, which ticks it stands throughout, and at which it breaks away: parabolas, 1 kg m^2."""
    position, velocity = 0.0, 0.0
    positions, standing, slips = [position], np.zeros(len(efforts), bool), []
    for tick, effort in enumerate(efforts):
        left = 1e-3
        if velocity == 0.0:
            if abs(effort) <= GRIP:
                standing[tick] = True
                positions.append(position)
                continue
            slips.append(tick)
            acceleration = effort - np.copysign(GRIP, effort)
        else:
            acceleration = effort - np.copysign(GRIP, velocity)
        if velocity and velocity * (velocity + acceleration * left) <= 0.0:   # it comes to rest within the tick
            rest = -velocity / acceleration
            position, velocity, left = position + 0.5 * velocity * rest, 0.0, left - rest
            acceleration = 0.0 if abs(effort) <= GRIP else effort - np.copysign(GRIP, effort)
        position += velocity * left + 0.5 * acceleration * left**2
        velocity += acceleration * left
        positions.append(position)
    return np.array(positions), standing, slips


def held_rods(friction: float) -> Chain:
    """Return two rods of 1 kg and 1 m: the first hangs and is held by friction, the second falls from 1.5 rad."""
    joints = ({'position': -np.pi / 2, 'friction': friction}, {'position': 1.5})
    return chain_from_dict({'name': 'held_rods', 'bodies': [
        {'name': f'rod{k}', 'carrier': 'rod0' if k else 'base', 'origin': [float(k), 0.0], 'mass': 1.0,
         'center_of_mass': [0.5, 0.0], 'inertia_com': 1.0 / 12.0, 'rotation': {'joint': f'joint{k}', **joint}}
        for k, joint in enumerate(joints)]})


NEEDED = 10.306463910586   # N m: what the first of held_rods needs at most; 1e-4 below, it slips for 1.5 ms a swing


def break_away(excess: float, method: str, step: float, tolerance: Optional[float] = None) -> tuple[float, list]:
    """Return how far the first rod has slipped in 3 s, rad, at `excess` below NEEDED, and the events."""
    simulation = Simulation(held_rods(NEEDED - excess), method, step, tolerance)
    simulation.advance(round(3.0 / step))
    return simulation.position[0] + np.pi / 2, simulation.take_events()


def short_slips(peers: dict, size: float) -> Iterator[Check]:
    """Let a joint slip for some ms only, at ticks from 0.1 ms to 3 s: the slip is the same."""
    for excess in (1e-2, 1e-4):
        exact, events = break_away(excess, 'taylor', 1e-3, 1e-14)
        for step in (1e-4, 1e-3, 1e-2, 0.1, 3.0):
            methods = [name for name, row in METHODS.items()
                       if name != 'semi_implicit_euler' and (row.adaptive or step < (2e-3 if name == 'rk4' else 2e-2))]
            found = [break_away(excess, name, step) for name in methods]
            theirs = None
            if 'MuJoCo' in peers and step < 2e-3:   # else it does not run
                run = MuJoCoRun(held_rods(NEEDED - excess), step)
                run.advance(round(3.0 / step))
                theirs = abs(run.state[0, 0] + np.pi / 2 - exact)
            yield Check(f'slip of {exact:.2g} rad at ticks of {step:g} s, {len(methods)} methods: error, rad', 1e-10,
                        max(abs(slip - exact) for slip, _ in found), theirs)
            yield Check(f'and events of {len(events)} that are missed', 0, max(abs(len(told) - len(events))
                                                                               for _, told in found))
