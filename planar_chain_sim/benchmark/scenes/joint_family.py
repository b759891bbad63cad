"""A random family of scenes with stops and dry friction: serial arms, trees and sliding carts, and what drives them."""
from __future__ import annotations

import time
from typing import Iterator, NamedTuple, Optional

import numpy as np

from . import Check, energies, largest_rise, MuJoCoRun, total_energy
from ...chain.chain import Chain
from ...chain_file import chain_from_dict
from ...errors import SimulationError
from ...motion.integrators import METHODS as ROWS
from ...motion.simulation import Simulation

METHODS = ('auto', 'rk4', 'dop853', 'dop853_fixed', 'gauss6', 'rodas5p')
STEPS = (1e-4, 1e-3, 1e-2)   # s
DRIVES = ('none', 'held', 'random per tick', 'sines')


class Scene(NamedTuple):
    """A chain, the method and tick it is run with, and what drives it: one of DRIVES, with the sizes that it needs."""

    chain: Chain
    method: str
    step: float
    drive: str
    amplitude: np.ndarray   # (joints,), N m or N
    frequency: np.ndarray   # (joints,), rad/s, of the sines
    seed: int

    def efforts(self, ticks: int, step: Optional[float] = None) -> Optional[np.ndarray]:
        """Return a row per tick (ticks, joints), one row that is held (joints,), or None."""
        if self.drive == 'none':
            return None
        if self.drive == 'held':
            return self.amplitude
        if self.drive == 'random per tick':
            random = np.random.default_rng(self.seed)
            return self.amplitude * random.uniform(-1.0, 1.0, (ticks, len(self.amplitude)))
        time = np.arange(ticks)[:, None] * (step or self.step)
        return self.amplitude * np.sin(self.frequency * time)


def random_scene(seed: int) -> Scene:
    """Return scene `seed`: 2 to 8 joints; friction of 1e-4 to 10, often equal; stops, rotors, dampers, springs."""
    random = np.random.default_rng(seed)
    joints = int(random.integers(2, 9))
    shape = random.choice(['serial', 'tree', 'cart'])
    alike = 10.0 ** random.uniform(-4.0, 1.0)
    many = {name: random.random() for name in ('friction', 'stops', 'armature', 'damping', 'spring')}
    bodies, number = [], 0

    def joint(slides: bool) -> dict:
        nonlocal number
        number += 1
        place = random.uniform(-0.3, 0.3) if slides else random.uniform(-2.0, 2.0)
        row = {'joint': f'joint{number}', 'position': place, 'velocity': random.choice([0.0, 1.0]) * random.normal()}
        if random.random() < 0.3 + 0.7 * many['friction']:
            row['friction'] = alike if random.random() < 0.4 else 10.0 ** random.uniform(-4.0, 1.0)
        if random.random() < 0.6 * many['stops']:
            row['lower'] = place - random.choice([0.0, random.uniform(0.0, 1.0)])
        if random.random() < 0.6 * many['stops']:
            row['upper'] = place + random.choice([0.0, random.uniform(0.01, 1.0)])
        if 'lower' in row or 'upper' in row:
            row['restitution'] = float(random.choice([0.0, 0.0, 0.3, 0.7]))
        if 'lower' in row and row['lower'] == row.get('upper'):
            row['upper'] += 0.1
        if random.random() < 0.5 * many['armature']:
            row['armature'] = 10.0 ** random.uniform(-3.0, 0.0)
        if random.random() < 0.5 * many['damping']:
            row['damping'] = 10.0 ** random.uniform(-3.0, 0.0)
        if random.random() < 0.5 * many['spring']:
            row.update(stiffness=10.0 ** random.uniform(-1.0, 2.0), rest=place + random.normal())
        return row

    while number < joints:
        index = len(bodies)
        carrier = 'base' if index == 0 else f'body{index - 1}'
        if shape == 'tree' and index:
            carrier = f'body{random.integers(0, index)}' if random.random() < 0.9 else 'base'
        length = random.uniform(0.2, 0.8)
        body = {'name': f'body{index}', 'carrier': carrier, 'mass': random.uniform(0.3, 3.0),
                'origin': [0.0, 0.0] if carrier == 'base' else [length, random.choice([0.0, random.normal() * 0.1])],
                'center_of_mass': [0.5 * length, random.choice([0.0, 0.05])]}
        body['inertia_com'] = body['mass'] * length**2 / 12.0
        slides = shape == 'cart' and (index == 0 or random.random() < 0.2)
        if slides:
            body['slide'] = {'axis': random.choice([0.0, random.uniform(-1.0, 1.0)]), **joint(True)}
        if not slides or (number < joints and random.random() < 0.3):
            body['rotation'] = joint(False)
        bodies.append(body)
    chain = chain_from_dict({'name': f'scene{seed}', 'bodies': bodies})
    return Scene(chain, METHODS[seed % 6], STEPS[seed // 6 % 3], DRIVES[seed // 18 % 4],
                 10.0 ** random.uniform(-1.0, 1.0) * random.normal(size=joints), random.uniform(0.5, 20.0, joints),
                 seed)


class Report(NamedTuple):
    """
    What a run of a scene gave: why it ended early, or None; the most steps of a tick; ticks of more than 1 ms of CPU.

    `events`; `steps` of the ticks that had one; `rise` of the energy in a tick, J, beyond 1e-9 of its range and 1e-13
    of its size, where nothing drives the scene, else 0.
    """

    failed: Optional[str]
    most_steps: int
    slow: frozenset
    events: int
    steps: int
    rise: float


def run_scene(scene: Scene, duration: float) -> Report:
    """Run a scene tick by tick for `duration` s; one that nothing drives, adaptive, with a tolerance of 1e-12."""
    free = scene.drive == 'none'
    tolerance = 1e-12 if free and (scene.method == 'auto' or ROWS[scene.method].adaptive) else None
    simulation = Simulation(scene.chain, scene.method, scene.step, tolerance)
    ticks = round(duration / scene.step)
    efforts = scene.efforts(ticks)
    energies = [total_energy(simulation)] if free else []
    most_steps, slow, steps, failed, before = 0, set(), 0, None, simulation.statistics
    for tick in range(ticks):
        effort = efforts if efforts is None or efforts.ndim == 1 else efforts[tick]
        start = time.thread_time()
        try:
            simulation.advance(1, effort)
        except SimulationError as error:
            failed = str(error)
            break
        if time.thread_time() - start > 1e-3:
            slow.add(tick)
        now = simulation.statistics
        taken = now['steps'] - before['steps']
        most_steps = max(most_steps, taken)
        steps += taken if now['events'] > before['events'] else 0
        before = now
        if free:
            energies.append(total_energy(simulation))
    rise = 0.0
    if len(energies) > 1:
        rise = max(0.0, np.diff(energies).max() - 1e-9 * np.ptp(energies) - 1e-13 * np.abs(energies).max())
    return Report(failed, most_steps, frozenset(slow), before['events'], steps, float(rise))


def at_random(peers: dict, size: float) -> Iterator[Check]:
    """Run the family, 5 s each; ticks of 1 ms and 0.1 ms are short enough for methods of fixed step, 10 ms are not."""
    count = max(18, int(5000 * size))
    reports = [(scene, run_scene(scene, 5.0)) for scene in map(random_scene, range(count))]
    failures = [report.failed for _, report in reports if report.failed]
    coarse = [failure for failure in failures if 'the step is too long' in failure]
    ended = len(failures) - len(coarse)
    yield Check(f'{count} scenes with friction and stops, 5 s: runs that end', 0, ended)
    yield Check('and those that end as a step of 10 ms is too long, which is said', count // 200 + 1, len(coarse))
    fine = [report for scene, report in reports if scene.step < 5e-3 or scene.method == 'auto'
            or ROWS[scene.method].adaptive]
    yield Check('nothing drives them: energy rises in a tick by more than 1e-9 of its range: scenes', count // 500,
                sum(report.rise > 0.0 for report in fine),
                None if 'MuJoCo' not in peers else sum(map(_rises_in_mujoco, map(random_scene, range(count)))))
    yield Check('steps in ticks with events, per event', 10.0,
                sum(report.steps for _, report in reports) / max(1, sum(report.events for _, report in reports)))
    most = np.array([report.most_steps for _, report in reports])
    spread = ', '.join(f'{100.0 * np.mean(most <= bound):.1f} % at most {bound}' for bound in (10, 20, 50, 100))
    yield Check(f'most steps in a tick, where several joints bounce at once; {spread}', 400, int(most.max()))
    if size >= 1.0:   # with few scenes the result would depend on the machine
        slow = sum(bool(always_slow(scene, report)) for scene, report in reports)
        yield Check('scenes with a tick of more than 1 ms of CPU, in each of three runs', count // 50 + 1, slow)


def always_slow(scene: Scene, report: Report) -> frozenset:
    """Return the ticks that are slow again in two more runs: not those in which the machine was."""
    slow = report.slow
    for _ in range(2):
        slow = slow and slow & run_scene(scene, 5.0).slow
    return slow


def _rises_in_mujoco(scene: Scene) -> bool:
    """Return whether energy rises in a tick by more than 1e-9 of its range in MuJoCo, within 0.1 s; of free scenes."""
    if scene.drive != 'none':
        return False
    ticks = round(0.1 / scene.step)
    values = energies(scene.chain, MuJoCoRun(scene.chain, scene.step).sampled(ticks))
    return bool(largest_rise(values) > 1e-9 * np.ptp(values) + 1e-13 * np.abs(values).max())
