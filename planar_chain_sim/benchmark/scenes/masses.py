"""Extreme masses: light links that carry heavy ones, point masses, links without mass; accelerations to 50 digits."""
from __future__ import annotations

from dataclasses import replace
from typing import Iterator
import warnings

import numpy as np

from . import Check, energies, REFUSED, sampled, total_energy
from ..problems import uniform_rods
from ..references import VirtualPower
from ...chain.chain import Chain
from ...chain.tree import Body, Joint
from ...errors import SimulationError
from ...mechanics.dynamics import forward_dynamics, mass_matrix
from ...motion.integrators import METHODS
from ...motion.simulation import Simulation

DIGITS = 50
EPS = float(np.finfo(float).eps)
BLIND = [name for name, row in METHODS.items() if not row.adaptive and row.family != 'Gauss']


def exact_acceleration(chain: Chain, position, velocity) -> list:
    """Return accelerations (joints,) under no effort to 50 digits: mpmath, by virtual power, not by our recursion."""
    from mpmath import mp
    with mp.workdps(DIGITS):
        return VirtualPower(mp, chain).accelerations(*([mp.mpf(float(x)) for x in values]
                                                       for values in (position, velocity)))


def relative_error(got, exact: list) -> float:
    """Return the largest error of accelerations relative to the largest acceleration."""
    from mpmath import mp
    with mp.workdps(DIGITS):
        return float(max(abs(mp.mpf(float(g)) - e) for g, e in zip(got, exact)) / max(map(abs, exact)))


def mass_ratios(peers: dict, size: float) -> Iterator[Check]:
    """Compare accelerations with 50 digits where one of ten links is far lighter or heavier than the others."""
    random = np.random.default_rng(3)
    states = [np.zeros((2, 10)), np.array([0.3 * np.sin(np.arange(10)), np.linspace(-1.0, 1.0, 10)]),
              *random.normal(0.0, 1.5, (1 if size < 1.0 else 8, 2, 10))]
    for ratio in (1e-6, 1e6, 1e9):
        ours, theirs, refused = [], [], 0
        for place in (0, 5, 9):
            bodies = list(uniform_rods(10).bodies)
            bodies[place] = replace(bodies[place], **{
                name: ratio * getattr(bodies[place], name) for name in ('mass', 'inertia', 'inertia_com')})
            chain = replace(uniform_rods(10), bodies=tuple(bodies))
            for state in states:
                exact = exact_acceleration(chain, *state)
                ours.append(relative_error(forward_dynamics(chain, *state, np.zeros(10)), exact))
                if 'MuJoCo' in peers:
                    theirs.append(relative_error(peers['MuJoCo'].forward_dynamics(chain, *state, np.zeros(10)), exact))
            refused += _refused(chain, random.normal(0.0, 2.0, (max(20, int(1000 * size)), 10)))
        yield Check(f'a link of ten {ratio:g} times the others: acceleration against 50 digits, relative', 1e-12,
                    max(ours), max(theirs, default=None))
        yield Check(f'the same, {ratio:g}: good configurations called singular', 0, refused)


def _refused(chain: Chain, positions) -> int:
    """Count the configurations that some form of the equations calls singular."""
    refused, zero = 0, np.zeros(chain.joint_count)
    for position in positions:
        try:
            for form in ('dense', 'recursive', 'reference'):
                forward_dynamics(chain, position, zero, zero, form)
        except SimulationError:
            refused += 1
    return refused


def thin_links(kinds: str) -> Chain:
    """Return a serial chain, a letter a link of 0.2 m: rod and bob (a point mass at its end) of 0.2 kg, or massless."""
    of = {'r': (0.2, 0.1 + 0j, 0.008 / 3, 0.008 / 12), 'b': (0.2, 0.2 + 0j, 0.2 * 0.2**2, 0.0),
          '-': (0.0, 0j, 0.0, 0.0)}
    return Chain(f'thin {kinds}', -10j, tuple(
        Body(f'link{i}', i - 1, 0.2 + 0j if i else 0j, 0.0, *of[kind], None, Joint(f'joint{i}', 'rotation', 1.0))
        for i, kind in enumerate(kinds)))


def massless(peers: dict, size: float) -> Iterator[Check]:
    """Solve what can be solved with point masses and massless links, and name the joint of what can not."""
    random, refused = np.random.default_rng(5), REFUSED if 'MuJoCo' in peers else None
    for title, kinds in (('point masses', 'bbbbb'), ('massless links between rods', 'r-r-r')):
        chain, worst = thin_links(kinds), 0.0
        for position in (np.zeros(5), np.r_[0.3, np.full(4, np.pi)], *random.normal(0.0, 1.5, (int(20 * size) + 3, 5))):
            velocity = random.normal(size=5)
            exact = exact_acceleration(chain, position, velocity)
            worst = max(worst, *(relative_error(forward_dynamics(chain, position, velocity, np.zeros(5), form), exact)
                                 for form in ('dense', 'recursive', 'reference')))
        yield Check(f'{title}, straight, folded, bent: acceleration against 50 digits, relative', 1e-12, worst, refused)
    chain, worst = thin_links('-b'), 0.0
    for power in range(7):   # the condition grows as bend^-2
        position, velocity = np.array([0.3, 10.0**-power]), np.array([1.0, -2.0])
        got = forward_dynamics(chain, position, velocity, np.zeros(2))
        scale = EPS * np.linalg.cond(mass_matrix(chain, position))
        worst = max(worst, relative_error(got, exact_acceleration(chain, position, velocity)) / scale)
    yield Check('a bob on a massless link, bent by 1 to 1e-6 rad: error / (cond(H) eps)', 10.0, worst, refused)
    yield Check('the same straight or folded: not named as singular at its joint', 0, _unnamed(), refused)
    yield from _across(size, refused)


def _unnamed() -> int:
    """Count singular configurations that are not answered by an error that names the joint that cannot be solved."""
    wrong, zero = 0, np.zeros(3)
    for kinds, joint in (('-b', 'joint0'), ('--r', 'joint0'), ('r-b', 'joint1')):
        chain = thin_links(kinds)
        for fold in (0.0, np.pi):
            for form in ('dense', 'recursive', 'reference'):
                position, rest = np.r_[0.3, np.full(len(kinds) - 1, fold)], zero[:len(kinds)]
                try:
                    forward_dynamics(chain, position, rest, rest, form)
                    wrong += 1
                except SimulationError as error:
                    wrong += error.joint != joint
    return wrong


def _across(size: float, refused) -> Iterator[Check]:
    """Move through the collinear configuration where that can be, and into it where it can not."""
    chain = thin_links('r-r-r')
    simulation = Simulation(chain, 'taylor', 1e-3, 1e-14)
    simulation.set_state([0.1, 0.5, -0.3, 0.2, 0.4], np.zeros(5))
    states = sampled(simulation, max(200, int(5000 * size)))
    values = energies(chain, states)
    crossed = int((np.diff(np.sign(np.sin(states[:, 0, 1:])), axis=0) != 0).sum())
    yield Check(f'rods on massless links crossing the straight line {crossed} times: energy error / range', 1e-10,
                np.abs(values - values[0]).max() / np.ptp([_potential(chain, state) for state in states]), refused)
    nameless, gained, quietly = 0, {}, 0.0
    for name in ('auto', *METHODS):
        for kinds in ('-b', '--r', 'r-b'):   # the bob flies free until the links are stretched
            simulation = Simulation(thin_links(kinds), name)
            simulation.set_state(np.r_[0.0, np.full(len(kinds) - 1, 2.0)], np.zeros(len(kinds)))
            start = total_energy(simulation)
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter('always')
                try:
                    simulation.advance(2000)
                    nameless += 1
                except SimulationError as error:
                    nameless += error.joint not in simulation.chain.joint_names
            gain = abs(total_energy(simulation) - start)
            gained[name] = max(gained.get(name, 0.0), gain)
            quietly = quietly if told else max(quietly, gain)
    yield Check('flung into the straight line, every method: no stop that names a joint', 0, nameless, refused)
    for title, blind, most in (('methods that control their error or iterate', False, 1e-3),
                               ('explicit fixed steps, which warn', True, 10.0)):
        names = [name for name in gained if (name in BLIND) == blind]
        yield Check(f'the same, {title} ({", ".join(names)}): energy gained at the last good state, J', most,
                    max(gained[name] for name in names), refused)
    yield Check('the same, every method: energy gained with no warning, J', 1e-3, quietly, refused)


def _potential(chain: Chain, state) -> float:
    return float(energies(chain, [(state[0], np.zeros_like(state[1]))])[0])
