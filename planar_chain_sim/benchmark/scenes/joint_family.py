"""A random family of scenes with stops and dry friction: serial arms, trees and sliding carts, and what drives them."""
from __future__ import annotations

from typing import NamedTuple, Optional

import numpy as np

from ...chain import Chain
from ...chain_yaml import chain_from_dict

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
                 10.0 ** random.uniform(-1.0, 1.0) * random.normal(size=joints), random.uniform(0.5, 20.0, joints), seed)
