"""Smooth motion: long runs, whips, stiff laws, many turns."""
from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Iterator

import numpy as np

from . import by_mujoco, Check, energies, INTEGRATORS, largest_rise, MuJoCoRun, one_joint, sampled, total_energy
from .masses import exact_acceleration, relative_error
from ..problems import configured, uniform_rods
from ...chain.chain import Chain
from ...chain.tree import Body, Joint
from ...mechanics.dynamics import forward_dynamics, mass_matrix
from ...motion.integrators import METHODS
from ...motion.simulation import Simulation

PENDULUM_TICK = 5e-3   # s
PENDULUM_SAMPLES = 200


@lru_cache(maxsize=None)
def pendulum_energy(library: str, method: str, ticks: int) -> tuple[np.ndarray, np.ndarray, int]:
    """
    Return times, s, energy errors over the range that the energy has, and steps, of the double pendulum.

    `library`: '' for ours, else MuJoCo. Kept, for the picture.
    """
    chain = configured('double_pendulum')
    if library:
        run = MuJoCoRun(chain, PENDULUM_TICK, method)
    else:
        run = Simulation(chain, method, PENDULUM_TICK)
    count = min(PENDULUM_SAMPLES, ticks)
    found = (run.sampled if library else lambda *count: sampled(run, *count))(count, ticks // count)
    values = energies(chain, found)
    scale = values[0] - sum(energies(chain, [np.zeros((2, 2))]))
    steps = ticks if library else run.statistics['steps']
    return np.arange(count + 1) * (ticks // count) * PENDULUM_TICK, (values - values[0]) / scale, steps


def long_pendulum(peers: dict, size: float) -> Iterator[Check]:
    """Measure the energy of the double pendulum: bounded, and without a trend for the symmetric method."""
    ticks = int(1e7 * size)

    def trend(errors):
        half = len(errors) // 2
        return abs(errors[1 + half:].mean() - errors[1:half].mean()) / np.abs(errors).max()
    theirs = min((pendulum_energy('MuJoCo', method, ticks)[1] for method in INTEGRATORS if 'MuJoCo' in peers),
                 key=lambda errors: np.abs(errors).max(), default=None)
    least = None if theirs is None else np.abs(theirs).max()
    _, errors, _ = pendulum_energy('', 'gauss6', ticks)
    yield Check(f'gauss6, {ticks} ticks of 5 ms: energy error / range', 1e-7, np.abs(errors).max(), least)
    yield Check('its mean in the second half against the first, of the largest error', 0.3, trend(errors),
                None if theirs is None else trend(theirs))
    _, errors, steps = pendulum_energy('', 'auto', ticks)
    yield Check('auto, the same ticks: energy error / range, of tolerance times steps', 1.0,
                np.abs(errors).max() / (1e-9 * steps), None if least is None else least / (1e-9 * steps))


def floating(count: int, spin) -> tuple[Chain, np.ndarray]:
    """
    Return rods that float, and velocities: two slides and a turn carry the first rod; nothing acts.

    `spin`: rates of the rods, rad/s; the slides have those that keep the mass centre where it is.
    """
    rods = uniform_rods(count, gravity=0j, bend=0.4)
    shift = Body('along', -1, 0j, 0.0, 0.0, 0j, 0.0, 0.0, Joint('x', 'slide', 0.0))
    first = replace(rods.bodies[0], carrier=0, slide=Joint('y', 'slide', np.pi / 2))
    rest = tuple(replace(body, carrier=body.carrier + 1) for body in rods.bodies[1:])
    chain = Chain('floating', 0j, (shift, first, *rest))
    H = mass_matrix(chain, np.zeros(count + 2))
    return chain, np.r_[-np.linalg.solve(H[:2, :2], H[:2, 2:] @ spin), spin]


def free_chain(peers: dict, size: float) -> Iterator[Check]:
    """Measure the momenta of a chain that floats and spins."""
    chain, velocity = floating(4, np.array([5.0, 2.0, -3.0, 1.0]))
    start, seconds = np.array([np.zeros(6), velocity]), max(2, int(100 * size))

    def momenta(state):
        """Return linear momenta and the angular one about the origin, and the size of their terms."""
        position, velocity = state
        H = mass_matrix(chain, position)
        p = H @ velocity
        return (np.array([p[0], p[1], p[2] + position[0] * p[1] - position[1] * p[0]]),
                (np.abs(H) @ np.abs(velocity))[:3].max())

    def drift(states):
        found, sizes = zip(*map(momenta, states))
        return np.abs(np.array(found) - found[0]).max(axis=0) / max(sizes)
    simulation = Simulation(chain, 'taylor', 0.1, 1e-16)
    simulation.set_state(*start)
    x, y, turn = drift(sampled(simulation, seconds, 10))
    theirs = [None, None]
    if 'MuJoCo' in peers:
        found = []
        for method in INTEGRATORS:
            run = MuJoCoRun(chain, 1e-3, method)
            run.set_state(*start)
            found.append(drift(run.sampled(seconds, 1000)))
        theirs = [min(max(a, b) for a, b, _ in found), min(c for _, _, c in found)]
    yield Check(f'linear momentum after {seconds} s, relative', 1e-13, max(x, y), theirs[0])
    yield Check(f'angular momentum after {seconds} s, relative', 1e-13, turn, theirs[1])


def let_go(peers: dict, size: float) -> Iterator[Check]:
    """Release a straight horizontal chain from rest: only every fourth term of its series is not zero."""
    chain, worst = uniform_rods(3), 0.0
    for power in range(4, 17):
        simulation = Simulation(chain, 'taylor', tolerance=10.0**-power)
        simulation.advance(1000)
        worst = max(worst, abs(total_energy(simulation)))
    yield Check('three rods, 1 s, tolerances 1e-4 to 1e-16: energy error, J', 1e-3, worst, by_mujoco(
        peers, chain, 1e-3, lambda run: np.abs(energies(chain, run.sampled(10, 100))).max()))


def rope(peers: dict, size: float) -> Iterator[Check]:
    """
    Let a rope with a little damping go from the horizontal: finite, its energy falls, its momentum balances.

    The angular momentum about the suspension changes by gravity's moment and the first joint's damping alone; neither
    needs the force there. Both momenta are summed here from the links' angles, and integrated by the trapezium rule
    with its end correction.
    """
    links, tick = max(16, int(1000 * size)), 1e-3
    damping, rods = 1e-3 / links, uniform_rods(links)
    chain = replace(rods, bodies=tuple(
        replace(body, rotation=replace(body.rotation, damping=damping)) for body in rods.bodies))
    simulation = Simulation(chain, 'auto', tick, 1e-7)
    ticks = 10_000 if size == 1.0 else 2000
    moments, values = [_moments(simulation)], [total_energy(simulation)]
    for k in range(ticks):
        simulation.advance(1)
        moments.append(_moments(simulation))
        if k % 100 == 99:
            values.append(total_energy(simulation))
    momentum, moment, growth, turned = np.array(moments).T
    impulse = np.r_[0.0, np.cumsum(0.5 * (moment[1:] + moment[:-1]))] * tick + (growth[0] - growth) * tick**2 / 12.0
    off = momentum - momentum[0] - impulse + damping * (turned - turned[0])
    theirs = None
    if 'MuJoCo' in peers:   # 0.1 s of CPU a tick: only the beginning
        run = MuJoCoRun(chain, tick)
        theirs = largest_rise(energies(chain, run.sampled(20, 5)))
    yield Check(f'{links} links, {ticks * tick:g} s: largest rise of the energy in 0.1 s, J (MuJoCo: 0.1 s in all)',
                0.0, largest_rise(np.array(values)), theirs)
    yield Check('angular momentum about the suspension against the moments, relative', 1e-6,
                np.abs(off).max() / np.abs(momentum).max())


def _moments(simulation: Simulation) -> tuple[float, float, float, float]:
    """Return of uniform rods: angular momentum, gravity's moment about the suspension, its rate, the first angle."""
    position, velocity = simulation.position, simulation.velocity
    length = mass = 1.0 / len(position)
    angle, rate = np.cumsum(position), np.cumsum(velocity)
    along, across = length * np.exp(1j * angle), 1j * rate * length * np.exp(1j * angle)
    center, speed = np.cumsum(along) - 0.5 * along, np.cumsum(across) - 0.5 * across
    momentum = mass * (center.conj() * speed).imag.sum() + mass * length**2 / 12.0 * rate.sum()
    return momentum, -9.81 * mass * center.real.sum(), -9.81 * mass * speed.real.sum(), position[0]


def spun(peers: dict, size: float) -> Iterator[Check]:
    """Spin a slender chain at 1000 rad/s: each method of fixed step converges with its order."""
    chain, duration = uniform_rods(3, gravity=0j), 0.02
    start = np.array([[0.0, 0.2, -0.1], [1000.0, 0.0, 0.0]])
    exact = Simulation(chain, 'taylor', duration, 1e-15)
    exact.set_state(*start)
    exact.advance(1)

    def slope(ends):
        coarse, fine = (np.abs(end - exact.position).max() for end in ends)
        return float(np.log2(coarse / fine))

    def end(run, step):
        run.set_state(*start)
        run.advance(round(duration / step))
        return run.state[0] if isinstance(run, MuJoCoRun) else run.position
    for name, row in METHODS.items():
        if row.adaptive:
            continue
        step = {1: 1e-6, 4: 5e-6, 6: 4e-5, 8: 1e-4}[row.order]
        found = slope([end(Simulation(chain, name, h), h) for h in (2.0 * step, step)])
        theirs = None
        if 'MuJoCo' in peers and row.order == 4:
            theirs = abs(slope([end(MuJoCoRun(chain, h, 'RK4'), h) for h in (2.0 * step, step)]) - 4.0)
        yield Check(f'{name}: measured order against {row.order}', 0.3, abs(found - row.order), theirs)


def stiff(peers: dict, size: float) -> Iterator[Check]:
    """Compare damping and springs over nine decades with the closed form, ticks of 1 ms by auto."""
    worst = {'damping': [0.0, 0.0], 'springs': [0.0, 0.0]}
    for decade in range(-3, 7):
        strength = 10.0**decade
        for kind, chain, exact in (
                ('damping', one_joint(gravity=0j, damping=strength, velocity=1.0),
                 -np.expm1(-strength * 0.1) / strength),
                ('springs', one_joint(gravity=0j, stiffness=strength, position=1.0),
                 np.cos(np.sqrt(strength) * 0.1))):
            simulation = Simulation(chain)
            simulation.advance(100)
            theirs = by_mujoco(peers, chain, 1e-3, lambda run: abs(run.sampled(1, 100)[-1, 0, 0] - exact))
            for k, error in enumerate((abs(simulation.position[0] - exact), theirs or 0.0)):
                worst[kind][k] = max(worst[kind][k], error)
    for kind, limit, unit in (('damping', 1e-8, 'N m s/rad'), ('springs', 1e-6, 'N m/rad')):
        ours, theirs = worst[kind]
        yield Check(f'{kind} 1e-3 to 1e6 {unit}: error, rad', limit, ours, theirs if 'MuJoCo' in peers else None)
    yield from _stiff_arm(peers, size)


def _stiff_arm(peers: dict, size: float) -> Iterator[Check]:
    """Do the same to three links, the last a light one, and hold auto against the L-stable method at 1e-13."""
    ours = theirs = 0.0
    for decade in range(-3, 7 if size == 1.0 else 3):
        rods = uniform_rods(3, bend=0.4)
        light = replace(rods.bodies[2], mass=1e-3, inertia=1e-4, inertia_com=1e-4 - 1e-3 / 36.0, rotation=replace(
            rods.bodies[2].rotation, damping=10.0**min(decade, 4), stiffness=10.0**decade))
        chain = replace(rods, bodies=(*rods.bodies[:2], light))
        run, exact = Simulation(chain), Simulation(chain, 'rodas5p', 0.1, 1e-13)
        run.advance(100)
        exact.advance(1)
        ours = max(ours, np.abs(run.position - exact.position).max())
        if 'MuJoCo' in peers:
            theirs = max(theirs, by_mujoco(peers, chain, 1e-3, lambda run: (
                np.abs(run.sampled(1, 100)[-1, 0] - exact.position).max())))
    yield Check('three links, springs to 1e6 and damping to 1e4 on the light last: auto against rodas5p at 1e-13, rad',
                1e-7, ours, theirs if 'MuJoCo' in peers else None)


def turns(peers: dict, size: float) -> Iterator[Check]:
    """Compare the motion after a million turns of the first joint with the same at none."""
    from mpmath import mp
    many = float(2e6 * np.pi)
    with mp.workdps(50):
        few = float(mp.mpf(many) - 2 * mp.pi * 1_000_000)   # the same angle
    chain, rate = uniform_rods(3), np.array([3.0, 1.0, -2.0])
    far, near = np.array([many, 0.3, -0.2]), np.array([few, 0.3, -0.2])
    exact, zero = exact_acceleration(chain, near, rate), np.zeros(3)
    theirs = None
    if 'MuJoCo' in peers:
        theirs = relative_error(peers['MuJoCo'].forward_dynamics(chain, far, rate, zero), exact)
    for title, forms in (('compiled', ('dense', 'recursive')), ('reference form', ('reference',))):
        errors = [relative_error(forward_dynamics(chain, far, rate, zero, form), exact) for form in forms]
        yield Check(f'one evaluation, {title}: against 50 digits, relative', 1e-14, max(errors), theirs)

    def velocity(run, position):
        run.set_state(position, rate)
        run.advance(1000)
        return run.state[1] if isinstance(run, MuJoCoRun) else run.velocity
    theirs = by_mujoco(peers, chain, 1e-3, lambda run: np.abs(velocity(run, near) - velocity(run, far)).max())
    for name, row in METHODS.items():   # at no turn, an angle that is off by one rounding gives 2e-12
        simulations = [Simulation(chain, name, 1e-3, 1e-12 if row.adaptive else None) for _ in range(2)]
        found = [velocity(run, position) for run, position in zip(simulations, (near, far))]
        yield Check(f'{name}, 1 s: velocities against those of no turn, rad/s', 1e-10,
                    np.abs(found[1] - found[0]).max(), theirs)
        steps = [run.statistics['steps'] for run in simulations]
        if row.adaptive:
            yield Check(f'{name}, tolerance 1e-12: steps against those of no turn', 1.1, steps[1] / steps[0])
