"""
The parts of the terms of an equation: symbols, coordinates, vectors and factors, each of which has a value at a state.

str() of each is an expression in the ASCII of programs: 'm3*r2*c3*dot(r2_hat, c3_hat)*phi3_dd'.

=====================  ====================================================================================
in an expression       meaning (equations.md 1)
=====================  ====================================================================================
m1, M1, J1, c1, r2     mass, mass outboard (5.60), inertia about the joint point, |P C|, |P- P|
gamma2, epsilon2       directions of r and of the slide in the carrier's frame
eta2, beta2            direction of the mass centre in the own frame; the own frame against the carrier's
phi1, x1, q1           absolute angle, slide, joint coordinate of a rotation; phi1_d, phi1_dd its derivatives
r2_hat, chi2_hat       unit vectors r^, chi, c^ and, turned by 90 degrees, a^, b^, u^
g_vec, g, delta_g      gravity, its magnitude and direction
=====================  ====================================================================================
"""
from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, prod, sin
from typing import Optional, Union

import numpy as np

TURNED = {'r': 'a', 'chi': 'b', 'c': 'u'}                                # r^ and a^, chi and b^, c^ and u^


@dataclass(frozen=True, eq=False)
class Symbol:
    """A constant of the chain: letter and number of the body (0: none), value in `unit`; without a letter, a number."""

    letter: str
    index: int
    value: float
    unit: str = ''
    meaning: str = ''

    @property
    def name(self) -> str:
        """Its name in expressions."""
        return f'{self.letter}{self.index or ""}' if self.letter else repr(self.value)

    def __str__(self):
        return self.name


@dataclass(frozen=True, eq=False)
class Coordinate:
    """An unknown of the equations: 'phi', 'x' or 'q' with the number of its body, and the joint that it belongs to."""

    letter: str
    index: int
    joint: str      # name of the joint
    place: int      # among the coordinates of the equations

    @property
    def name(self) -> str:
        """Its name in expressions."""
        return f'{self.letter}{self.index}'

    @property
    def unit(self) -> str:
        """Unit of its equation."""
        return 'N' if self.letter == 'x' else 'N m'

    def __str__(self):
        return self.name


Parts = tuple[tuple[int, Coordinate], ...]   # a sum of coordinates with signs


@dataclass(frozen=True)
class State:
    """`motion` (3, coordinates): coordinates, their rates and accelerations; `effort` (joints,); SI units."""

    motion: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True, eq=False)
class Motion:
    """A coordinate, rate or acceleration (order 0, 1, 2), or a sum of such, less a constant."""

    order: int
    parts: Parts
    rest: Optional[Symbol] = None

    def evaluate(self, state: State) -> float:
        """Value at a state: rad or m, per s or s^2."""
        values = state.motion[self.order]
        total = sum(sign * values[coordinate.place] for sign, coordinate in self.parts)
        return float(total - (self.rest.value if self.rest else 0.0))

    def __str__(self):
        text = sum_of((sign, f'{coordinate}{("", "_d", "_dd")[self.order]}') for sign, coordinate in self.parts)
        if self.rest:
            text += f' - {self.rest.name}' if self.rest.letter or self.rest.value >= 0.0 else f' + {-self.rest.value!r}'
        return text if len(self.parts) == 1 and not self.rest else f'({text})'


@dataclass(frozen=True, eq=False)
class SignOf:
    """The sign of a rate, 0 at rest: Coulomb's law."""

    motion: Motion

    def evaluate(self, state: State) -> float:
        """-1, 0 or 1."""
        return float(np.sign(self.motion.evaluate(state)))

    def __str__(self):
        return f'sign({_bare(self.motion)})'


@dataclass(frozen=True, eq=False)
class Effort:
    """The effort of one joint's actuator, 'tau' or 'f' with the number of its body."""

    letter: str
    index: int
    joint: str
    place: int   # among the chain's joints

    @property
    def name(self) -> str:
        """Its name in expressions."""
        return f'{self.letter}{self.index}'

    def evaluate(self, state: State) -> float:
        """Value at a state, N m or N."""
        return float(state.effort[self.place])

    def __str__(self):
        return self.name


@dataclass(frozen=True, eq=False)
class Vector:
    """A unit vector at the angle parts + offsets, turned by 90 degrees or not; gravity alone has a length."""

    letter: str                     # 'r', 'chi', 'c' or 'g', of the vector that is not turned
    turned: bool
    index: int
    parts: Parts
    offsets: tuple[Symbol, ...]
    length: Optional[Symbol] = None

    @property
    def name(self) -> str:
        """Its name in expressions."""
        return 'g_vec' if self.letter == 'g' else f'{self.shown_letter}{self.index}_hat'

    @property
    def shown_letter(self) -> str:
        """'r', 'chi', 'c', 'g', or of one that is turned 'a', 'b', 'u'."""
        return TURNED[self.letter] if self.turned else self.letter

    def angle(self, state: State) -> float:
        """Angle of the vector that is not turned, rad."""
        moving = sum(sign * state.motion[0, coordinate.place] for sign, coordinate in self.parts)
        return moving + sum(offset.value for offset in self.offsets)

    def __str__(self):
        return self.name


@dataclass(frozen=True, eq=False)
class ScalarProduct:
    """left . right of two vectors, (5.89)."""

    left: Vector
    right: Vector

    def evaluate(self, state: State) -> float:
        """Value at a state; m/s^2 with gravity."""
        angle = self.left.angle(state) - self.right.angle(state)
        length = prod(vector.length.value for vector in (self.left, self.right) if vector.length)
        turns = int(self.left.turned) - int(self.right.turned)
        return length * (cos(angle), -sin(angle), sin(angle))[turns]   # a turn adds pi/2 to its side

    def __str__(self):
        return f'dot({self.left}, {self.right})'


@dataclass(frozen=True, eq=False)
class Trigonometric:
    """The sine or cosine of a sum of coordinates and constants: a scalar product written out."""

    function: str                               # 'sin' or 'cos'
    parts: Parts
    offsets: tuple[tuple[int, Symbol], ...]

    def evaluate(self, state: State) -> float:
        """Value at a state."""
        angle = (sum(sign * state.motion[0, coordinate.place] for sign, coordinate in self.parts)
                 + sum(sign * offset.value for sign, offset in self.offsets))
        return cos(angle) if self.function == 'cos' else sin(angle)

    def __str__(self):
        return f'{self.function}({sum_of((*self.parts, *self.offsets))})'


Factor = Union[Motion, SignOf, Effort, ScalarProduct, Trigonometric]


def sum_of(parts) -> str:
    """Return 'a - b + c' of signs and names; a name may have its own minus."""
    text = ''
    for sign, name in parts:
        name = str(name)
        if name.startswith('-'):
            sign, name = -sign, name[1:]
        text += (' - ' if sign < 0 else ' + ') + name if text else ('-' if sign < 0 else '') + name
    return text


def _bare(motion: Motion) -> str:
    text = str(motion)
    return text[1:-1] if text.startswith('(') else text


def quarter_turns(value: float) -> Optional[int]:
    """How many quarter turns an angle is, rad; None where it is no whole number of them, beyond rounding."""
    turns = round(value / (0.5 * pi))
    return turns if abs(value - turns * (0.5 * pi)) <= 1e-15 * max(1.0, abs(value)) else None
