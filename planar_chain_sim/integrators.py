"""METHODS: one row per integration method; the kernel runs explicit Runge-Kutta rows from their coefficients alone."""
from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log
from typing import Optional

DEFAULT_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Method:
    """
    A method of integration.

    `order`: of the global error; None where it follows from the tolerance. `a` (stages, stages), strictly lower
    triangular, and `b` (stages,): Butcher tableau of a Runge-Kutta method.
    """

    name: str
    family: str
    order: Optional[int]
    adaptive: bool
    citation: str
    conserves: str
    a: tuple = ()
    b: tuple = ()


METHODS = {method.name: method for method in (
    Method('rk4', 'explicit Runge-Kutta', 4, False,
           a=((0.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0), (0.0, 0.5, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)),
           b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
           citation='W. Kutta, Z. Math. Phys. 46 (1901), 435-453; '
                    'Hairer, Norsett, Wanner, Solving ODEs I, table II.1.2',
           conserves='nothing exactly: the energy of a free arm drifts slowly, by O(step^4) over a fixed time'),
    Method('taylor', 'taylor', None, True,
           citation='A. Jorba, M. Zou, Experimental Mathematics 14 (2005), 99-117; recurrences: equations.md 11',
           conserves='nothing exactly: energy within the tolerance, at 1e-16 down to round-off that grows like '
                     'the square root of time'),
)}

AUTO = 'rk4'


def taylor_order(tolerance: float) -> int:
    """Order of the series for a tolerance: Jorba and Zou (2005), p = 1 + ln(1/tolerance) / 2."""
    return max(4, ceil(1.0 - 0.5 * log(tolerance)))
