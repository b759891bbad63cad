"""Named chains that benchmarks and tests share."""
from __future__ import annotations

from ..chain import Body, Chain, Joint


def uniform_rods(count: int, gravity: complex = -9.81j) -> Chain:
    """Return a serial chain of `count` equal uniform rods in a row, 1 / count m and kg each; all angles zero."""
    length = mass = 1.0 / count
    return Chain(f'{count} rods', gravity, tuple(
        Body(f'rod{i}', i - 1, complex(length if i else 0.0), 0.0, mass, complex(length / 2), mass * length**2 / 3,
             mass * length**2 / 12, None, Joint(f'joint{i}', 'rotation', 1.0)) for i in range(count)))
