"""Scenes that try to break the integrator, each with a number that must hold; MuJoCo on the same where it can."""
from __future__ import annotations

from dataclasses import replace
import random
from typing import Callable, Iterator, NamedTuple, Optional
import warnings

import numpy as np

from .problems import configured, uniform_rods
from ..chain import Body, Chain, ChainError, Joint
from ..chain_yaml import chain_from_text, find_chain_file
from ..dynamics import energy, forward_dynamics, inverse_dynamics, mass_matrix, SimulationError
from ..simulation import Simulation

COLUMNS = ('scene', 'what must hold', 'at most', 'measured', 'holds', 'MuJoCo')


class Check(NamedTuple):
    """A number that must not exceed `limit`, and what MuJoCo makes of the same, None where it cannot run it."""

    what: str
    limit: float
    measured: float
    mujoco: Optional[float] = None


def one_joint(kind: str = 'rotation', gravity: complex = -10j, **laws) -> Chain:
    """Return 1 kg and 1 kg m^2 on a hinge, its weight of 10 N at 0.5 m across; or 1 kg on an upright slide."""
    upright = kind == 'slide'
    joint = Joint('joint', kind, np.pi / 2 if upright else 1.0, **laws)
    center = 0j if upright else 0.5 + 0j
    return Chain('one', gravity, (Body('body', -1, 0j, 0.0, 1.0, center, 1.0, 1.0 - abs(center)**2,
                                       joint if upright else None, None if upright else joint),))


def floating(count: int) -> Chain:
    """Return rods that float: two slides and a turn carry the first one; nothing else acts."""
    rods = uniform_rods(count, gravity=0j, bend=0.4)
    shift = Body('along', -1, 0j, 0.0, 0.0, 0j, 0.0, 0.0, Joint('x', 'slide', 0.0))
    first = replace(rods.bodies[0], carrier=0, slide=Joint('y', 'slide', np.pi / 2))
    rest = tuple(replace(body, carrier=body.carrier + 1) for body in rods.bodies[1:])
    return Chain('floating', 0j, (shift, first, *rest))


def mujoco_run(peers: dict, chain: Chain, step: float, ticks: int, every: int = 1) -> Optional[np.ndarray]:
    """Return positions and velocities (samples, 2, joints) by MuJoCo with stops and friction, or None."""
    if 'MuJoCo' not in peers:
        return None
    import mujoco
    from .peers.mujoco_peer import mujoco_model
    model = mujoco_model(chain, constrained=True)
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, step
    data = mujoco.MjData(model)
    address = np.array([model.joint(name).dofadr[0] for name in chain.joint_names])
    data.qpos[address] = [joint.position for joint in chain.joints]
    data.qvel[address] = [joint.velocity for joint in chain.joints]
    samples = []
    for tick in range(ticks):
        mujoco.mj_step(model, data)
        if (tick + 1) % every == 0:
            samples.append((data.qpos[address].copy(), data.qvel[address].copy()))
    return np.array(samples)


def _energies(chain: Chain, states) -> np.ndarray:
    return np.array([sum(energy(chain, *state)) for state in states])


def _samples(simulation: Simulation, count: int, ticks: int, effort=None) -> list:
    states = []
    for _ in range(count):
        simulation.advance(ticks, effort)
        states.append((simulation.position, simulation.velocity))
    return states


def long_pendulum(peers: dict, size: float) -> Iterator[Check]:
    """Measure the energy of the double pendulum: bounded, and without a trend for the symmetric method."""
    chain = configured('double_pendulum')
    ticks, step = int(1e7 * size), 5e-3
    simulation = Simulation(chain, 'gauss6', step)
    start = sum(energy(chain, simulation.position, simulation.velocity))
    scale = start - sum(energy(chain, np.zeros(2), np.zeros(2)))
    errors = (_energies(chain, _samples(simulation, 200, ticks // 200)) - start) / scale
    half = len(errors) // 2
    theirs = mujoco_run(peers, chain, step, min(ticks, 200_000), 1000)
    yield Check(f'gauss6, {ticks} ticks of 5 ms: energy error / range', 1e-7, np.abs(errors).max(),
                None if theirs is None else np.abs(_energies(chain, theirs) - start).max() / scale)
    yield Check('its mean in the second half against the first', 5e-9, abs(errors[half:].mean() - errors[:half].mean()))


def free_chain(peers: dict, size: float) -> Iterator[Check]:
    """Measure the momenta of a chain that floats and spins."""
    chain = floating(4)
    spin = np.array([0.3, -0.2, 5.0, 2.0, -3.0, 1.0])

    def momenta(position, velocity):
        p = mass_matrix(chain, position) @ velocity
        return np.array([p[0], p[1], p[2] + position[0] * p[1] - position[1] * p[0]])
    simulation = Simulation(chain, 'taylor', 0.1, 1e-16)
    simulation.set_state(np.zeros(6), spin)
    before = momenta(simulation.position, simulation.velocity)
    after = np.array([momenta(*state) for state in _samples(simulation, 50, max(1, int(400 * size)))])
    drift = np.abs(after - before) / np.abs(before).max()
    yield Check('linear momentum, relative', 1e-13, drift[:, :2].max())
    yield Check('angular momentum, relative', 1e-13, drift[:, 2].max())


def mass_ratios(peers: dict, size: float) -> Iterator[Check]:
    """See accelerations give their efforts back, with a tip that is lighter or heavier than the links."""
    for ratio in (1e-6, 1e6, 1e9):
        rods = uniform_rods(10, bend=0.3)
        *light, last = rods.bodies
        tip = replace(last, **{name: ratio * getattr(last, name) for name in ('mass', 'inertia', 'inertia_com')})
        chain = replace(rods, bodies=(*light, tip))
        position, effort = np.array([joint.position for joint in chain.joints]), np.linspace(-1.0, 1.0, 10)
        acceleration = forward_dynamics(chain, position, effort, effort)
        back = inverse_dynamics(chain, position, effort, acceleration)
        size_of_terms = np.abs(mass_matrix(chain, position)) @ np.abs(acceleration) + 1.0
        yield Check(f'tip {ratio:g} times a link: effort given back, relative', 1e-14,
                    (np.abs(back - effort) / size_of_terms).max())


def rope(peers: dict, size: float) -> Iterator[Check]:
    """Let a rope with a little damping go from the horizontal: finite, and its energy falls."""
    links = max(16, int(1000 * size))
    rods = uniform_rods(links)
    chain = replace(rods, bodies=tuple(
        replace(body, rotation=replace(body.rotation, damping=1e-4 / links)) for body in rods.bodies))
    simulation = Simulation(chain, 'auto', 0.1, 1e-5)
    energies = _energies(chain, [(simulation.position, simulation.velocity), *_samples(simulation, 100, 1)])
    yield Check(f'{links} links, 10 s: largest rise of the energy, J', 1e-4, np.diff(energies).max())


def spun(peers: dict, size: float) -> Iterator[Check]:
    """Spin a slender chain at 1000 rad/s: RK4 converges with its order."""
    chain = uniform_rods(3, gravity=0j)
    ends = []
    for step in (1e-5, 5e-6, 2.5e-6):
        simulation = Simulation(chain, 'rk4', step)
        simulation.set_state([0.0, 0.2, -0.1], [1000.0, 0.0, 0.0])
        simulation.advance(round(0.02 / step))
        ends.append(simulation.position)
    ratio = np.abs(ends[0] - ends[1]).max() / np.abs(ends[1] - ends[2]).max()
    yield Check('distance of log2 of the ratio of errors from 4', 0.2, abs(np.log2(ratio) - 4.0))


def stiff(peers: dict, size: float) -> Iterator[Check]:
    """Compare damping and springs over nine decades with the closed form, ticks of 1 ms by auto."""
    worst = {'damping': 0.0, 'stiffness': 0.0}
    for decade in range(-3, 7):
        chain = one_joint(gravity=0j, damping=10.0**decade, velocity=1.0)
        simulation = Simulation(chain)
        simulation.advance(100)
        exact = -np.expm1(-10.0**decade * 0.1) / 10.0**decade
        worst['damping'] = max(worst['damping'], abs(simulation.position[0] - exact))
        simulation = Simulation(one_joint(gravity=0j, stiffness=10.0**decade, position=1.0))
        simulation.advance(100)
        worst['stiffness'] = max(worst['stiffness'], abs(simulation.position[0] - np.cos(10.0**(decade / 2) * 0.1)))
    yield Check('damping 1e-3 to 1e6 N m s/rad: error, rad', 1e-8, worst['damping'])
    yield Check('springs 1e-3 to 1e6 N m/rad: error, rad', 1e-6, worst['stiffness'])


def stop_at_speed(peers: dict, size: float) -> Iterator[Check]:
    """Hit a stop at 100 rad/s."""
    chain = one_joint(upper=0.5, lower=-0.5, restitution=0.8, velocity=100.0)
    simulation = Simulation(chain)
    states = [(simulation.position, simulation.velocity), *_samples(simulation, 1000, 1)]
    theirs = mujoco_run(peers, chain, 1e-3, 1000)
    reached = np.abs([position for position, _ in states]).max()
    yield Check('penetration, rad', 1e-9, reached - 0.5,
                None if theirs is None else np.abs(theirs[:, 0]).max() - 0.5)
    yield Check('largest rise of the energy, J', 1e-6, np.diff(_energies(chain, states)).max(),
                None if theirs is None else np.diff(_energies(chain, theirs)).max())


def resting(peers: dict, size: float) -> Iterator[Check]:
    """Bounce to rest, then stay on the stop for an hour."""
    chain = one_joint('slide', lower=0.0, position=0.1, restitution=0.9)
    simulation = Simulation(chain)
    simulation.advance(5000)
    end = np.sqrt(0.02) * 1.9 / 0.1
    yield Check('bouncing: end against the closed form, s', 1e-4, abs(simulation.take_events()[-1].time - end))
    simulation.advance(3_600_000)
    theirs = mujoco_run(peers, chain, 1e-3, 10_000, 1000)
    yield Check('an hour later: distance from the stop, m', 0.0, abs(simulation.position[0]),
                None if theirs is None else abs(theirs[-1, 0, 0]))
    yield Check('events in that hour', 0, len(simulation.take_events()))


def together(peers: dict, size: float) -> Iterator[Check]:
    """Touch two stops in the same instant with a straight chain."""
    rods = uniform_rods(2, gravity=0j)
    bodies = tuple(replace(body, rotation=replace(body.rotation, lower=-0.5, velocity=-1.0)) for body in rods.bodies)
    simulation = Simulation(replace(rods, bodies=bodies))
    start = sum(energy(simulation.chain, simulation.position, simulation.velocity))
    simulation.advance(2000)
    after = sum(energy(simulation.chain, simulation.position, simulation.velocity))
    yield Check('penetration, rad', 1e-9, max(0.0, -0.5 - simulation.position.min()))
    yield Check('energy gained, J', 1e-12, after - start)


def sticking(peers: dict, size: float) -> Iterator[Check]:
    """Hold an arm by friction for an hour, and let go at the right effort."""
    chain = one_joint(friction=7.0)
    simulation = Simulation(chain)
    simulation.advance(3_600_000)
    theirs = mujoco_run(peers, chain, 1e-3, 10_000, 1000)
    yield Check('creep in an hour, rad', 0.0, abs(simulation.position[0]),
                None if theirs is None else abs(theirs[-1, 0, 0]) * 360.0)   # of 10 s, an hour's worth
    ramp = -1e-3 * np.arange(3000)[:, None]
    simulation.advance(3000, ramp)
    slipped = next(event for event in simulation.take_events() if event.kind == 'slipped')
    yield Check('break-away against 2 N m, N m', 1.001e-3, abs(ramp[slipped.tick - 3_600_000, 0] + 2.0))


def nonsense(peers: dict, size: float) -> Iterator[Check]:
    """Give efforts of all kinds: the state stays finite, or the run stops cleanly at its last good state."""
    noise = np.random.default_rng(1)
    chain = configured('seven_link_arm')
    kinds: dict[str, Callable[[int], np.ndarray]] = {
        'white noise of 100 N m': lambda tick: noise.normal(0.0, 100.0, 7),
        'steps of 1e6 N m': lambda tick: np.full(7, 1e6 * (-1.0)**(tick // 50)),
        'denormals': lambda tick: np.full(7, 5e-324), 'nan': lambda tick: np.full(7, np.nan),
        'inf': lambda tick: np.full(7, np.inf)}
    for kind, effort in kinds.items():
        simulation, bad = Simulation(chain, tolerance=1e-6), 0
        for tick in range(max(50, int(2000 * size))):
            before = simulation.position
            try:
                simulation.advance(1, effort(tick))
            except (ValueError, SimulationError):
                bad += simulation.position.tobytes() != before.tobytes()
            bad += not (np.isfinite(simulation.position).all() and np.isfinite(simulation.velocity).all())
        yield Check(f'{kind}: jumps and values that are not finite', 0, bad)


def steps(peers: dict, size: float) -> Iterator[Check]:
    """Take ticks from 1e-6 to 1 s: right, or refused or warned of, never quietly wrong."""
    chain = configured('four_link_robot')
    end = Simulation(chain, 'taylor', 1.0, 1e-13)
    end.advance(1)
    for name in ('auto', 'dop853', 'rodas5p'):
        worst = 0.0
        for step in (1e-6, 1e-4, 1e-2, 1.0):
            simulation = Simulation(chain, name, step)
            simulation.advance(round(1.0 / step))
            worst = max(worst, np.abs(simulation.position - end.position).max())
        yield Check(f'{name}: error after 1 s, any tick', 1e-6, worst)
    quiet = 0
    for name in ('rk4', 'semi_implicit_euler', 'gauss6', 'dop853_fixed'):
        for step in (0.25, 0.5, 1.0):
            with warnings.catch_warnings(record=True) as told:
                warnings.simplefilter('always')
                try:
                    simulation = Simulation(one_joint(gravity=0j, stiffness=1e4, position=1.0), name, step)
                    simulation.advance(round(10.0 / step))
                    quiet += not told and abs(simulation.position[0] - np.cos(1000.0)) > 0.1
                except SimulationError:
                    pass
    yield Check('fixed steps on a stiff spring: quietly wrong', 0, quiet)


def fuzzed_files(peers: dict, size: float) -> Iterator[Check]:
    """Read chain files with random damage: a chain or one sentence."""
    pick = random.Random(7)
    texts = [find_chain_file(name).read_text() for name in ('four_link_robot.yaml', 'cart_arm_telescope.yaml')]
    tokens = ['nan', '-1e400', '[', ']', '{', ': ', '\n', '  ', '- ', '&a', '*a', '0x', "'", '"', '\t', '!!binary ',
              'null', '1e308', '-0.0', '\u2028', 'mass', 'carrier', '~', '|', '<<: ']
    broken = 0
    for _ in range(int(1e5 * size)):
        text = pick.choice(texts)
        for _ in range(pick.randint(1, 4)):
            at, cut = pick.randrange(len(text)), pick.choice((0, 0, 1, 5, 40))
            text = text[:at] + pick.choice(tokens) + text[at + cut:]
        try:
            chain_from_text(text, 'fuzzed.yaml')
        except ChainError as error:
            broken += '\n' in str(error)
        except Exception:   # what must not be
            broken += 1
    yield Check(f'{int(1e5 * size)} damaged files: neither a chain nor one sentence', 0, broken)


SCENES = {'double pendulum': long_pendulum, 'spinning free chain': free_chain, 'mass ratios': mass_ratios, 'rope': rope,
          'spun to 1000 rad/s': spun, 'stiff laws': stiff, 'stop hit at 100 rad/s': stop_at_speed,
          'bouncing and resting': resting, 'two stops at once': together, 'stiction': sticking, 'efforts': nonsense,
          'ticks': steps, 'chain files': fuzzed_files}


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """Yield a row of COLUMNS per number; `quick` takes a thousandth of the long ones."""
    for name, scene in SCENES.items():
        for check in scene(peers, 0.002 if quick else 1.0):
            yield (name, check.what, check.limit, float(check.measured),
                   'yes' if check.measured <= check.limit else 'NO', check.mujoco)
