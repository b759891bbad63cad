"""METHODS: one row per integration method; the kernel runs explicit Runge-Kutta rows from their coefficients alone."""
from __future__ import annotations

from dataclasses import dataclass
from math import log10
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

AUTO = 'taylor'


def taylor_order(tolerance: float) -> int:
    """
    Order of the series for a tolerance.

    Jorba and Zou (2005) take p = 1 + ln(1/tolerance) / 2. Here an order costs little beside the start of a step, so
    that higher orders and longer steps are cheaper: 10 + 0.8 per digit, by measurement on chains of 2 to 7 joints.
    """
    return min(24, max(8, round(10.0 - 0.8 * log10(tolerance))))
