"""Stops: impacts, grazing, several at once, infinitely many, hours of rest."""
from __future__ import annotations

from dataclasses import replace
from typing import Iterator

import numpy as np

from . import Check, energies, largest_rise, MuJoCoRun, one_joint, sampled, total_energy
from ..problems import uniform_rods
from ...chain.chain import Chain
from ...mechanics.dynamics import energy
from ...motion.simulation import Simulation

HOUR = 3_600_000   # ticks of 1 ms


def beyond(chain: Chain, positions: np.ndarray) -> float:
    """Return how far positions (samples, joints) lie beyond a stop at most, rad or m; 0 where they never do."""
    lower, upper = (np.array([getattr(joint, name) for joint in chain.joints]) for name in ('lower', 'upper'))
    return max(0.0, float((lower - positions).max()), float((positions - upper).max()))


def beyond_at_events(chain: Chain, ticks: int, events, **settings) -> float:
    """Run again and look at each event: how far beyond a stop at its time, and one rounding before and after."""
    simulation, worst = Simulation(chain, **settings), 0.0
    for time in sorted({event.time for event in events if event.time < ticks * simulation.step}):
        for moment in (np.nextafter(time, 0.0), time, np.nextafter(time, np.inf)):
            if moment > simulation.time:
                simulation.advance_to(float(moment))
                worst = max(worst, beyond(chain, simulation.position[None]))
    return worst


def stop_at_speed(peers: dict, size: float) -> Iterator[Check]:
    """Hit stops at 100 rad/s, with the closed form where there is no gravity, and with gravity."""
    chain = one_joint(gravity=0j, upper=0.5, lower=-0.5, restitution=0.8, velocity=100.0)
    simulation = Simulation(chain)
    simulation.advance(500)
    events = simulation.take_events()
    way, speed = np.r_[0.5, np.ones(60)], 100.0 * 0.8**np.arange(61)
    due = np.cumsum(way / speed)
    due = due[due < simulation.time]
    found = np.array([event.time for event in events])
    yield Check('events more or fewer than the closed form has', 0, abs(len(found) - len(due)))
    count = min(len(found), len(due))
    yield Check(f'{count} impacts: time against the closed form, s', 1e-12, np.abs(found[:count] - due[:count]).max())

    chain = one_joint(upper=0.5, lower=-0.5, restitution=0.8, velocity=100.0)
    simulation = Simulation(chain, step=1e-4)
    states = sampled(simulation, 10_000)
    theirs = None if 'MuJoCo' not in peers else MuJoCoRun(chain, 1e-3).sampled(1000)
    deepest = max(beyond(chain, states[:, 0]), beyond_at_events(chain, 10_000, simulation.take_events(), step=1e-4))
    yield Check('under gravity: penetration, rad', 1e-9, deepest,
                None if theirs is None else beyond(chain, theirs[:, 0]))
    yield Check('largest rise of the energy, J', 1e-6, largest_rise(energies(chain, states)),
                None if theirs is None else largest_rise(energies(chain, theirs)))


def grazing(peers: dict, size: float) -> Iterator[Check]:
    """Throw a block up to just below a stop, and just above it, between two ticks of 0.1 s."""
    top, worst, wrong, risen, off, theirs = 0.0125, 0.0, 0, 0.0, 0.0, []
    for over in (-1e-6, -1e-9, 1e-12, 1e-9, 1e-6, 1e-3):
        chain = one_joint('slide', upper=top - over, velocity=0.5, restitution=0.5)
        for method in ('taylor', 'rk4', 'gauss6', 'dop853'):
            simulation = Simulation(chain, method, step=0.1)
            states = sampled(simulation, 3)
            events = simulation.take_events()
            wrong += len(events) != (over > 0.0)
            worst = max(worst, beyond(chain, states[:, 0]), beyond_at_events(chain, 3, events, method=method, step=0.1)
                        if method in ('taylor', 'dop853') else 0.0)
            risen = max(risen, largest_rise(energies(chain, states)))
            off = max(off, abs(simulation.position[0] - _thrown(top, over, simulation.time)))
        if 'MuJoCo' in peers:
            theirs.append(beyond(chain, MuJoCoRun(chain, 1e-3).sampled(300)[:, 0]))
    yield Check('peaks 1e-6 m below to 1e-3 m above it: penetration, m', 1e-9, worst, max(theirs, default=None))
    yield Check('touched where it is not reached, not touched, or touched again', 0, wrong)
    yield Check('largest rise of the energy, J', 1e-12, risen)
    yield Check('position 0.3 s later against the closed form, m', 1e-9, off)


def _thrown(top: float, over: float, time: float) -> float:
    """Return the height at `time` of a block thrown at 0.5 m/s under 10 m/s^2 whose peak is `over` a stop, e = 0.5."""
    if over <= 0.0:
        return 0.5 * time - 5.0 * time**2
    speed = np.sqrt(20.0 * over)
    rebound = 0.5 * speed if 0.5 * speed > 1e-5 else 0.0   # slower than that it is none: equations.md 6.4
    later = time - (0.5 - speed) / 10.0
    return top - over - rebound * later - 5.0 * later**2


def together(peers: dict, size: float) -> Iterator[Check]:
    """Touch two stops in the same instant, and many stops with arms of every restitution."""
    rods = uniform_rods(2, gravity=0j)
    falling = replace(rods, bodies=tuple(
        replace(body, rotation=replace(body.rotation, velocity=-1.0)) for body in rods.bodies))
    free = Simulation(falling)
    free.advance(250)   # it is on both stops at the 250th tick
    for restitution in (0.0, 0.5):
        chain = replace(falling, bodies=tuple(replace(body, rotation=replace(
            body.rotation, lower=float(lower), restitution=restitution))
            for body, lower in zip(falling.bodies, free.position)))
        simulation = Simulation(chain)
        states = sampled(simulation, 2000)
        events = simulation.take_events()
        theirs = None if 'MuJoCo' not in peers else MuJoCoRun(chain, 1e-3).sampled(2000)
        yield Check(f'restitution {restitution:g}: time of either impact from the instant, s', 1e-12,
                    max(min(abs(event.time - 0.25) for event in events if event.joint == name)
                        for name in chain.joint_names))
        yield Check(f'restitution {restitution:g}: penetration, rad', 1e-9,
                    max(beyond(chain, states[:, 0]), beyond_at_events(chain, 2000, events)),
                    None if theirs is None else beyond(chain, theirs[:, 0]))
        yield Check(f'restitution {restitution:g}: largest rise of the energy, J', 1e-9,
                    largest_rise(energies(chain, states)),
                    None if theirs is None else largest_rise(energies(chain, theirs)))
        yield Check(f'restitution {restitution:g}: events beyond the two', 0, len(events) - 2)
    yield _many_impacts(max(10, int(300 * size)))


def _many_impacts(count: int) -> Check:
    """Check that simultaneous impacts, each with its own restitution, give no energy, for any arm and rates."""
    random, worst = np.random.default_rng(11), -np.inf
    for _ in range(count):
        rods = uniform_rods(4, gravity=0j)
        bodies = []
        for body in rods.bodies:
            place = float(random.normal(0.0, 1.5))
            side = random.choice([-1, 0, 1])
            bodies.append(replace(body, rotation=replace(
                body.rotation, position=place, restitution=float(random.random()),
                lower=place if side < 0 else -np.inf, upper=place if side > 0 else np.inf)))
        chain = replace(rods, bodies=tuple(bodies))
        position, rate = np.array([joint.position for joint in chain.joints]), random.normal(size=4)
        simulation = Simulation(chain, step=1e-9)
        simulation.set_state(position, rate)
        simulation.advance(1)
        before = sum(energy(chain, position, rate))
        worst = max(worst, (total_energy(simulation) - before) / before)
    return Check(f'{count} arms on up to four stops with restitutions of their own: energy gained, relative', 1e-12,
                 worst)


def bouncing(peers: dict, size: float) -> Iterator[Check]:
    """Bounce to rest, infinitely often in finite time, then stay on the stop for an hour."""
    chain = one_joint('slide', lower=0.0, position=0.1, restitution=0.9)
    simulation = Simulation(chain)
    states = sampled(simulation, 5000)
    events = simulation.take_events()
    first, speed = np.sqrt(0.02), np.sqrt(2.0)
    impacts = 1 + int(np.floor(np.log(1e-5 / speed) / np.log(0.9)))   # the last rebounds slower than 1e-5: not at all
    yield Check('end of bouncing against the closed form, s', 1e-4, abs(events[-1].time - first * 1.9 / 0.1))
    yield Check(f'events more or fewer than its {impacts} impacts', 0, abs(len(events) - impacts))
    theirs = None if 'MuJoCo' not in peers else MuJoCoRun(chain, 1e-3)
    seen = None if theirs is None else theirs.sampled(5000)
    yield Check('penetration, m', 1e-9, max(beyond(chain, states[:, 0]), beyond_at_events(chain, 5000, events)),
                None if seen is None else beyond(chain, seen[:, 0]))
    yield Check('largest rise of the energy, J', 1e-9, largest_rise(energies(chain, states)),
                None if seen is None else largest_rise(energies(chain, seen)))
    simulation.advance(HOUR)
    if theirs:
        theirs.advance(int(HOUR * size))
    yield Check('an hour later: distance from the stop, m', 0.0, abs(simulation.position[0]),
                None if theirs is None else abs(theirs.state[0, 0]))
    yield Check('events in that hour', 0, len(simulation.take_events()))


def resting(peers: dict, size: float) -> Iterator[Check]:
    """Let an upper arm lie on its stop for an hour while the forearm swings."""
    rods = uniform_rods(2, gravity=-10j)
    upper = replace(rods.bodies[0], angle=-0.5, rotation=replace(rods.bodies[0].rotation, lower=0.0))
    fore = replace(rods.bodies[1], rotation=replace(rods.bodies[1].rotation, position=-0.6, damping=1e-6))
    chain = replace(rods, bodies=(upper, fore))
    simulation, count = Simulation(chain, step=0.01), max(10, int(3600 * size))
    states = sampled(simulation, count, 100)
    touched = [event for event in simulation.take_events() if event.joint == 'joint0']
    theirs = None
    if 'MuJoCo' in peers:
        theirs = np.abs(MuJoCoRun(chain, 1e-3).sampled(count, 1000)[:, 0, 0]).max()
    yield Check(f'{count} s under a swinging forearm: distance from the stop, rad', 0.0,
                np.abs(states[:, 0, 0]).max(), theirs)
    yield Check('events of the joint on its stop', 0, len(touched))
    yield Check('largest rise of the energy in a second, J', 1e-8, largest_rise(energies(chain, states)))
