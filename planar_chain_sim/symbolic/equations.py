"""equations: a chain's equations of motion as objects, in the chosen coordinates and form."""
from __future__ import annotations

from collections.abc import Sequence
import operator
from typing import Iterable, Optional, TYPE_CHECKING, Union

import numpy as np

from .derivation import Derivation
from .factors import Coordinate, Motion, ScalarProduct, State, Symbol
from .terms import Equation
from .trigonometry import in_numbers, in_trigonometric_functions
from ..chain.chain import Chain
from ..chain.joint_arrays import joint_array
from ..chain.section import clipped, suggestion
from ..mechanics.dynamics import forward_dynamics
from ..mechanics.path_matrix import motion_of_joints
from ..mechanics.plan import plan_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

COORDINATES = ('absolute', 'joint')


class Equations(Sequence):
    """
    The equations of a chain, one for each coordinate, each made at its first use.

    [k] takes a number, the name of a joint or of a coordinate. `coordinates` is 'absolute', angles and then slides as
    in the book's example, or 'joint', joints in file order; `unknowns` are the coordinates themselves.
    """

    def __init__(self, chain: Chain, coordinates: str, trigonometric: bool, numeric: bool) -> None:
        self.chain, self.coordinates, self.trigonometric, self.numeric = chain, coordinates, trigonometric, numeric
        self._derivation = Derivation(chain, coordinates == 'absolute')
        self.unknowns: tuple[Coordinate, ...] = self._derivation.names.coordinates
        self._derived: dict[int, Equation] = {}     # scalar products, symbols
        self._made: dict[int, Equation] = {}        # in the form wanted

    def __repr__(self) -> str:
        names = [f'{unknown.name} ({unknown.joint})' for unknown in self.unknowns]
        more = f', and {len(names) - 6} more' if len(names) > 6 else ''
        return f'Equations of {self.chain.name} in {self.coordinates} coordinates: {", ".join(names[:6])}{more}'

    def __len__(self) -> int:
        return len(self.unknowns)

    def __getitem__(self, key: Union[int, str]) -> Equation:   # type: ignore[override]
        place = self.place_of(key) if isinstance(key, str) else range(len(self))[operator.index(key)]
        if place not in self._made:
            made = self._derive(place)
            made = in_trigonometric_functions(made) if self.trigonometric else made
            self._made[place] = in_numbers(made) if self.numeric else made
        return self._made[place]

    def _derive(self, place: int) -> Equation:
        if place not in self._derived:
            self._derived[place] = self._derivation.equation(self.unknowns[place])
        return self._derived[place]

    def place_of(self, name: str) -> int:
        """Return the number of a coordinate by its joint's or its own name; KeyError has the names of all."""
        for names in ([unknown.joint for unknown in self.unknowns], [unknown.name for unknown in self.unknowns]):
            if name in names:
                return names.index(name)
        joints = [unknown.joint for unknown in self.unknowns]
        symbols = ', '.join(unknown.name for unknown in self.unknowns[:6]) + (', ...' if len(self) > 6 else '')
        raise KeyError(f"coordinate '{clipped(name)}' is not one of this chain{suggestion(name, joints)}, must be the "
                       f'name of a joint or a symbol as {symbols}')

    def symbols(self, chosen: Optional[Iterable[Equation]] = None) -> dict[str, Symbol]:
        """
        Return the symbols of all or of the `chosen` equations by name, body by body; none where they are numbers.

        These are the symbols of coefficients, of the vectors in scalar products and of M = P m P^T.
        """
        places = range(len(self)) if chosen is None else [equation.coordinate.place for equation in chosen]
        return {} if self.numeric else symbols_of(self._derivation, [self._derive(place) for place in places])

    def state(self, position: ArrayLike, velocity: ArrayLike, acceleration: Optional[ArrayLike] = None,
              effort: Optional[ArrayLike] = None) -> State:
        """
        Return a state at which terms can be evaluated; arrays (joints,) in joint coordinates, SI units.

        The default of `effort` is zero, that of `acceleration` is computed by forward_dynamics. ValueError: bad shape
        or non-finite value. SimulationError: this computation meets a singular configuration.
        """
        shape = (self.chain.joint_count,)
        effort = joint_array('effort', np.zeros(shape) if effort is None else effort, shape)
        position, velocity = joint_array('position', position, shape), joint_array('velocity', velocity, shape)
        if acceleration is None:
            acceleration = forward_dynamics(self.chain, position, velocity, effort)
        acceleration = joint_array('acceleration', acceleration, shape)
        motion = np.array([position, velocity, acceleration])
        if self.coordinates == 'absolute':
            G, offset = motion_of_joints(self.chain)
            bodies = len(self.chain.bodies)
            rows = [unknown.index - 1 + bodies * (unknown.letter == 'x') for unknown in self.unknowns]
            motion = motion @ G[rows].T
            motion[0] += offset[rows]
        return State(motion, effort)


def equations(chain: Chain, coordinates: str = 'absolute', trigonometric: bool = False,
              numeric: bool = False) -> Equations:
    """
    Return the equations of motion of a chain as terms: (5.87) for its angles, (5.88) for its slides.

    `coordinates`: 'absolute' angles as in the book, or 'joint' coordinates. Scalar products stay as such or, if
    `trigonometric`, become sines and cosines; symbols stay or, if `numeric`, become the chain's numbers, like terms
    added. The residual of an equation in joint coordinates is inverse_dynamics - effort of that joint; those in
    absolute coordinates are mapped to these by the transposed joint map (equations.md 4). ValueError: unknown
    coordinates; ChainError: a chain made by hand that cannot be.
    """
    if coordinates not in COORDINATES:
        raise ValueError(f'coordinates is {coordinates!r}, must be one of {", ".join(map(repr, COORDINATES))}')
    plan_of(chain)   # which refuses one that cannot be
    return Equations(chain, coordinates, trigonometric, numeric)


def symbols_of(derivation: Derivation, made: Iterable[Equation]) -> dict[str, Symbol]:
    """Return the symbols of scalar products, coefficients and of M = P m P^T, by name, body by body."""
    found = {name for name, symbol in derivation.names.symbols.items() if symbol.letter in ('m', 'M')}
    for equation in made:
        for term in equation.terms:
            found.update(symbol.name for symbol in term.coefficient.symbols)
            for factor in term.factors:
                if isinstance(factor, Motion) and factor.rest:
                    found.add(factor.rest.name)
                elif isinstance(factor, ScalarProduct):
                    for vector in (factor.left, factor.right):
                        found.update(offset.name for offset in vector.offsets)
                        found.update([vector.length.name] if vector.length else [])
    rank = {letter: k for k, letter in enumerate(('m', 'M', 'c', 'eta', 'J', 'r', 'gamma', 'beta', 'epsilon'))}
    return {name: symbol for name, symbol in sorted(
        derivation.names.symbols.items(), key=lambda item: (item[1].index, rank.get(item[1].letter, len(rank))))
        if name in found}
