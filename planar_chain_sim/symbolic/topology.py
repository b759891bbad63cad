"""The part before the equations: the matrices S, S_, P and M = P m P^T, and the directions of the unit vectors."""
from __future__ import annotations

from typing import Iterable

import numpy as np

from .factors import Coordinate, ScalarProduct, Vector
from .terms import Equation
from ..chain.chain import Chain
from ..chain.tree import BASE
from ..mechanics.path_matrix import incidence_matrix, path_matrix


def matrices(chain: Chain) -> dict[str, np.ndarray]:
    """S, S_ = I - S and P = S^-1, (bodies, bodies) integers (equations.md 1)."""
    S = incidence_matrix(chain).astype(int)
    return {'S': S, 'S_': np.eye(len(S), dtype=int) - S, 'P': path_matrix(chain).astype(int)}


def outer_bodies(chain: Chain) -> np.ndarray:
    """
    Return the number of the body whose M_i (5.60) is the entry of M = P m P^T: the outer one of the two, 0: none.

    Shape (bodies, bodies).
    """
    P, number = path_matrix(chain), np.arange(1, len(chain.bodies) + 1)
    return np.where(P + P.T > 0, np.maximum(number[:, None], number[None, :]), 0)


def carried_by(chain: Chain, i: int) -> list[int]:
    """Return the bodies that body i carries: M_i is m_i and the sum of their M."""
    return [k for k, body in enumerate(chain.bodies) if body.carrier == i]


def carrier_number(chain: Chain, i: int) -> int:
    """Return the number of body i's carrier, 0 for the base."""
    return 0 if chain.bodies[i].carrier == BASE else chain.bodies[i].carrier + 1


def coordinates_by_body(coordinates: Iterable[Coordinate]) -> dict[int, list[Coordinate]]:
    """Return the coordinates of each body by its number, its slide first."""
    found: dict[int, list[Coordinate]] = {}
    for coordinate in coordinates:
        found.setdefault(coordinate.index, []).append(coordinate)
    return {number: sorted(row, key=lambda coordinate: coordinate.letter != 'x') for number, row in found.items()}


def vectors_by_angle(equations: Iterable[Equation]) -> list[list[Vector]]:
    """Return the vectors of the scalar products, none of them turned, put together where they point the same way."""
    found: dict[tuple, dict] = {}
    for equation in equations:
        for term in equation.terms:
            for factor in term.factors:
                if isinstance(factor, ScalarProduct):
                    for vector in (factor.left, factor.right):
                        found.setdefault((vector.parts, vector.offsets), {})[vector.letter, vector.index] = vector
    order = {'r': 0, 'chi': 1, 'c': 2, 'g': 3}
    rows = [sorted(row.values(), key=lambda vector: (vector.index, order[vector.letter])) for row in found.values()]
    return sorted(rows, key=lambda row: (row[0].letter == 'g', row[0].index, order[row[0].letter]))
