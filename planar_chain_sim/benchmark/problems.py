"""Named problems that benchmarks and tests share: a chain, the duration of its motion, and the state at the end."""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Callable

import numpy as np

from ..chain.chain import Chain
from ..chain.tree import Body, Joint
from ..chain_file import find_chain_file, load_chain


@dataclass(frozen=True)
class Problem:
    """
    `chain()` moves from its own initial state, with no effort, for `duration` s; `end`: joint positions and velocities.

    The digits of `end` are those on which the two integrations of references.py agree: `benchmark references`.
    """

    title: str
    chain: Callable[[], Chain]
    duration: float
    end: tuple[tuple[float, ...], tuple[float, ...]]

    def error(self, position) -> float:
        """Return the largest error of joint positions (joints,) at the end, rad or m; inf where one is not finite."""
        error = np.abs(np.asarray(position) - self.end[0]).max()
        return float(error) if np.isfinite(error) else float('inf')


def uniform_rods(count: int, gravity: complex = -9.81j, bend: float = 0.0) -> Chain:
    """Return a serial chain of `count` equal uniform rods, 1 / count m and kg each; joint k stands at bend sin(k)."""
    length = mass = 1.0 / count
    return Chain(f'{count} rods', gravity, tuple(
        Body(f'rod{i}', i - 1, complex(length if i else 0.0), 0.0, mass, complex(length / 2), mass * length**2 / 3,
             mass * length**2 / 12, None, Joint(f'joint{i}', 'rotation', 1.0, position=bend * float(np.sin(i))))
        for i in range(count)))


def configured(name: str) -> Chain:
    """Return a chain of the package's own configuration."""
    return load_chain(find_chain_file(f'{name}.yaml'))


def damped(chain: Chain, damping: float) -> Chain:
    """Return the chain with the same damping in every rotation, N m s/rad."""
    return replace(chain, name=f'{chain.name}_damped', source='', bodies=tuple(
        replace(body, rotation=replace(body.rotation, damping=damping)) for body in chain.bodies))


PROBLEMS = {
    'double_pendulum': Problem(
        'double pendulum, two 1 m rods from 2.0 and 2.5 rad, 5 s', lambda: configured('double_pendulum'), 5.0,
        ((0.2054622395250033704, -7.7265043614408366975), (1.6815866859031859344, 10.046078448207871405))),
    'four_link_robot': Problem(
        'four-link robot with slide, spring and damping, 5 s', lambda: configured('four_link_robot'), 5.0,
        ((0.19035253395035517075, -1.5843613199748194824, 0.11762123228583247819, 0.084108740470177462912,
          0.089349606214752836968),
         (-0.060313849454052296487, 1.7719631662558644975, 0.31299578962879338878, 0.97001962006811127765,
          -0.09300093328294043563))),
    'seven_link_arm': Problem(
        'seven-link arm, damping 0.0005 N m s, 5 s', lambda: damped(configured('seven_link_arm'), 0.0005), 5.0,
        ((0.22472982186136744394, -0.22818813438137984571, -0.02747219527384953503, 0.2803196845409075717,
          0.27120790494395038555, -0.11947525441869524301, -0.6836420906578125341),
         (-0.31188716608025837989, 3.9629326084907029934, 2.5903316129344980799, 1.8926984731323739135,
          -1.6568882906138297356, -17.098205771585545915, 46.021726909383713536))),
}
