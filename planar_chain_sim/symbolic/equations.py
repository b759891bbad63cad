"""equations: a chain's equations of motion as objects, in the coordinates and the form that are asked for."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Iterable, Iterator, Union

import numpy as np

from .derivation import Derivation
from .factors import Motion, ScalarProduct, State, Symbol
from .terms import Equation
from .trigonometry import in_numbers, in_trigonometric_functions
from ..chain import Chain
from ..chain_section import clipped, suggestion
from ..dynamics import forward_dynamics, joint_array
from ..path_matrix import motion_of_joints

COORDINATES = ('absolute', 'joint')


@dataclass(frozen=True)
class Equations:
    """
    The equations of a chain, one for each coordinate; iterable, [k] by number, joint or coordinate name.

    `coordinates` is 'absolute', angles and then slides as in the book's example, or 'joint', joints in file order.
    `symbols` are those that the terms use, by name.
    """

    chain: Chain
    coordinates: str
    trigonometric: bool
    numeric: bool
    equations: tuple[Equation, ...]
    symbols: dict[str, Symbol]

    def __iter__(self) -> Iterator[Equation]:
        return iter(self.equations)

    def __len__(self):
        return len(self.equations)

    def __getitem__(self, key: Union[int, str]) -> Equation:
        if not isinstance(key, str):
            return self.equations[key]
        for name in (lambda coordinate: coordinate.joint, lambda coordinate: coordinate.name):
            for equation in self.equations:
                if name(equation.coordinate) == key:
                    return equation
        names = [equation.coordinate.joint for equation in self.equations]
        symbols = ', '.join(equation.coordinate.name for equation in self.equations[:6])
        raise KeyError(f"coordinate '{clipped(key)}' is none of this chain{suggestion(key, names)}, must be the name "
                       f'of a joint or a symbol as {symbols}{", ..." if len(names) > 6 else ""}')

    def state(self, position, velocity, acceleration=None, effort=None) -> State:
        """
        Return a state at which terms can be evaluated; arrays (joints,) in joint coordinates, SI units.

        `effort` is zero where none is given, `acceleration` what forward_dynamics makes of the rest. ValueError: bad
        shape or non-finite value. SimulationError: acceleration wanted in a singular configuration.
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
            rows = [equation.coordinate.index - 1 + bodies * (equation.coordinate.letter == 'x') for equation in self]
            motion = motion @ G[rows].T
            motion[0] += offset[rows]
        return State(motion, effort)


def equations(chain: Chain, coordinates: str = 'absolute', trigonometric: bool = False,
              numeric: bool = False) -> Equations:
    """
    Return the equations of motion of a chain as terms: (5.87) for its angles, (5.88) for its slides.

    `coordinates`: 'absolute' angles as in the book, or 'joint' coordinates. Scalar products stay as such or, if
    `trigonometric`, become sines and cosines; symbols stay or, if `numeric`, become the chain's numbers, like terms
    added. The residual of an equation in joint coordinates is inverse_dynamics - effort of that joint; in absolute
    coordinates it is S of that (equations.md 4). ValueError: unknown coordinates.
    """
    if coordinates not in COORDINATES:
        raise ValueError(f'coordinates is {coordinates!r}, must be one of {", ".join(map(repr, COORDINATES))}')
    derivation = Derivation(chain, coordinates == 'absolute')
    made = derivation.equations()
    symbols = {} if numeric else symbols_of(derivation, made)
    if trigonometric:
        made = map(in_trigonometric_functions, made)
    if numeric:
        made = map(in_numbers, made)
    return Equations(chain, coordinates, trigonometric, numeric, tuple(made), symbols)


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
