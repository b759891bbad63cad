"""METHODS: one row per integration method; the kernel runs explicit Runge-Kutta rows from their coefficients alone."""
from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Method:
    """A method of integration. Butcher tableau: `a` (stages, stages), strictly lower triangular, and `b` (stages,)."""

    name: str
    family: str
    order: int
    adaptive: bool
    a: tuple
    b: tuple
    citation: str
    conserves: str


METHODS = {method.name: method for method in (
    Method('rk4', 'explicit Runge-Kutta', 4, False,
           a=((0.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0), (0.0, 0.5, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)),
           b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
           citation='W. Kutta, Z. Math. Phys. 46 (1901), 435-453; '
                    'Hairer, Norsett, Wanner, Solving ODEs I, table II.1.2',
           conserves='nothing exactly: the energy of a free arm drifts slowly, by O(step^4) over a fixed time'),
)}

AUTO = 'rk4'  # what `auto` picks until a method with error control is a row
