"""METHODS: one row per integration method; the kernel runs explicit Runge-Kutta rows from their coefficients alone."""
from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from math import inf, log10, sqrt
from typing import Any, Optional

from . import tableaux
from .. import _kernel

DEFAULT_TOLERANCE = 1e-9
LEAST_TOLERANCE = 1e-20   # far below what a double resolves; with less, steps get so short that a run never ends


@dataclass(frozen=True)
class Method:
    """
    A method of integration.

    `family`: a name of the kernel's FAMILIES; ValueError for another. `order`: of the global error; None where it
    follows from the tolerance. `a` (stages, stages) and `b` (stages,): Butcher tableau of a Runge-Kutta method;
    strictly lower triangular where that is explicit. An adaptive one has `error`, one or two rows (stages + 1,): b less
    the weights of the embedded methods, of which the last acts on the derivative at the step's end. Within a step it is
    interpolated (Hairer calls that dense output) by the cubic Hermite polynomial and, beyond that, `interpolation`,
    rows of terms in the order of Hairer's codes, (stages + 1 + extra,), over the stages, the end, and extra stages that
    have their rows in `interpolation_a`. A Rosenbrock method has `a`, `c` and `gamma` in the variables of Hairer,
    Wanner, Solving ODEs II, (IV.7.25), and `error`, one row, and `interpolation` over its stages (stages,).
    """

    name: str
    family: str
    order: Optional[int]
    adaptive: bool
    citation: str
    conserves: str
    a: tuple = ()
    b: tuple = ()
    error: tuple = ()
    interpolation_a: tuple = ()
    interpolation: tuple = ()
    c: tuple = ()
    gamma: float = 0.0

    def __post_init__(self) -> None:
        if self.family not in _kernel.FAMILIES:
            raise ValueError(f'family of method {self.name!r} is {self.family!r}, must be one of '
                             f'{", ".join(map(repr, _kernel.FAMILIES))}')

    def __repr__(self) -> str:
        order = f'order {self.order}' if self.order else 'order by the tolerance'
        return f'Method {self.name}: {self.family}, {order}, {"adaptive" if self.adaptive else "fixed step"}'

    @cached_property
    def stability_limits(self) -> tuple[float, float]:
        """
        How far the stability region of a fixed-step method reaches along the negative real and the imaginary axis.

        In units of 1 / step; inf where it has no end or the step is the method's own. Of an explicit Runge-Kutta method
        by its R(z) = 1 + z b (1 - z A)^-1 1, Hairer, Wanner, Solving ODEs II, (IV.2.2); of semi-implicit Euler 2 and 2.
        """
        if self.adaptive or self.family == 'Gauss':
            return inf, inf
        if self.family == 'semi-implicit':
            return 2.0, 2.0

        def growth(z: Any) -> Any:
            stages = []
            for row in self.a:
                stages.append(1.0 + z * sum(a * stage for a, stage in zip(row, stages)))
            return abs(1.0 + z * sum(b * stage for b, stage in zip(self.b, stages)))

        def extent(direction: Any) -> Any:
            reach = 0.0
            while growth((reach + 1e-2) * direction) <= 1.0 + 1e-6:
                reach += 1e-2
            return reach
        return extent(-1.0), extent(1j)

    @cached_property
    def tableau(self) -> _kernel.Tableau:
        """The coefficients for the kernel, matrices row by row."""
        a, b, error, interpolation_a, interpolation, c = ([x for row in rows for x in row] for rows in (
            self.a, (self.b,), self.error, self.interpolation_a, self.interpolation, self.c))
        return _kernel.Tableau(len(self.b), a, b, error, interpolation_a, interpolation, c, self.gamma)

    def __getstate__(self) -> dict:
        return {entry.name: getattr(self, entry.name) for entry in fields(self)}  # all else can be computed again


class Methods(dict):
    """Name -> Method."""

    def __repr__(self) -> str:
        return f"METHODS: {', '.join(self)}; METHODS[name] has family, order, citation and what it conserves"


_S = sqrt(15.0)

METHODS = Methods({method.name: method for method in (
    Method('semi_implicit_euler', 'semi-implicit', 1, False,
           citation='Hairer, Lubich, Wanner, Geometric Numerical Integration, I.1.2',
           conserves='nothing exactly: it is symplectic where the mass matrix is constant, but here that depends on '
                     'the positions; the energy of a free arm drifts by O(step)'),
    Method('rk4', 'explicit Runge-Kutta', 4, False,
           a=((0.0, 0.0, 0.0, 0.0), (0.5, 0.0, 0.0, 0.0), (0.0, 0.5, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)),
           b=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
           citation='W. Kutta, Z. Math. Phys. 46 (1901), 435-453; '
                    'Hairer, Norsett, Wanner, Solving ODEs I, table II.1.2',
           conserves='nothing exactly: the energy of a free arm drifts slowly, by O(step^4) over a fixed time'),
    Method('dop853', 'explicit Runge-Kutta', 8, True,
           a=tableaux.DOP853_A, b=tableaux.DOP853_B, error=tableaux.DOP853_ERROR,
           interpolation_a=tableaux.DOP853_INTERPOLATION_A, interpolation=tableaux.DOP853_INTERPOLATION,
           citation='P. J. Prince, J. R. Dormand, J. Comput. Appl. Math. 7 (1981), 67-75; '
                    'Hairer, Norsett, Wanner, Solving ODEs I, II.5, II.6, II.10, code DOP853',
           conserves='nothing exactly: energy within the tolerance, with an error that grows with time'),
    Method('dop853_fixed', 'explicit Runge-Kutta', 8, False, a=tableaux.DOP853_A, b=tableaux.DOP853_B,
           citation='as dop853',
           conserves='nothing exactly: the energy of a free arm drifts by O(step^8) over a fixed time, at small steps '
                     'by round-off alone'),
    Method('gauss6', 'Gauss', 6, False,
           a=((5 / 36, 2 / 9 - _S / 15, 5 / 36 - _S / 30), (5 / 36 + _S / 24, 2 / 9, 5 / 36 - _S / 24),
              (5 / 36 + _S / 30, 2 / 9 + _S / 15, 5 / 36)),
           b=(5 / 18, 4 / 9, 5 / 18),
           citation='J. C. Butcher, Math. Comp. 18 (1964), 50-64; Hairer, Lubich, Wanner, Geometric Numerical '
                    'Integration, II.1.3',
           conserves='nothing exactly, but it is symmetric and so reversible in time: the energy of a free arm stays '
                     'within O(step^6) without a trend, at small steps within round-off; it is not symplectic, as '
                     'joint rates are not momenta'),
    Method('rodas5p', 'Rosenbrock', 5, True,
           a=tableaux.RODAS5P_A, b=tableaux.RODAS5P_B, c=tableaux.RODAS5P_C, gamma=tableaux.RODAS5P_GAMMA,
           error=tableaux.RODAS5P_ERROR, interpolation=tableaux.RODAS5P_INTERPOLATION,
           citation='G. Steinebach, BIT Numerical Mathematics 63 (2023), 27; Hairer, Wanner, Solving ODEs II, IV.7',
           conserves='nothing: L-stable and stiffly accurate, it damps what is too fast for its steps, and energy '
                     'changes within the tolerance'),
    Method('taylor', 'taylor', None, True,
           citation='A. Jorba, M. Zou, Experimental Mathematics 14 (2005), 99-117; recurrences: equations.md 11',
           conserves='nothing exactly: energy within the tolerance, at 1e-16 down to round-off that grows like '
                     'the square root of time'),
)})

STIFF = 'rodas5p'  # what auto takes for stiff damping

UNROLLED_SERIES = _kernel.UNROLLED_SERIES  # joints up to which Taylor series are unrolled for their number


def choose_method(tolerance: float, damping_rate: float, joints: int) -> str:
    """
    Name of the method that `auto` stands for: least work at the tolerance.

    Explicit steps get as short as a few times 1 / damping_rate, s; those of STIFF only follow the tolerance, like its
    fifth root. They cost the same at 2000 1/s for 1e-6 and 8000 1/s for 1e-9, by measurement on arms of 2 to 7 joints.
    A step of STIFF solves systems of all joints, O(joints^3), one of the series is O(joints): measured at 128 and 1000.
    """
    dearer = 1.0 + (joints / 60.0)**2
    return STIFF if damping_rate > 2000.0 * dearer * (1e-6 / tolerance) ** 0.2 else 'taylor'


def taylor_order(tolerance: float) -> int:
    """
    Order of the series for a tolerance.

    Jorba and Zou (2005) take p = 1 + ln(1/tolerance) / 2. Here an order costs little beside the start of a step, so
    that higher orders and longer steps are cheaper: 10 + 0.8 per digit, by measurement on chains of 2 to 7 joints.
    """
    return min(24, max(8, round(10.0 - 0.8 * log10(tolerance))))


def method_data(method: Method, tolerance: Optional[float], fixed: float = 0.0) -> Any:
    """
    Return a method and its tolerance as the kernel takes them.

    `fixed`, s: an adaptive method takes steps of this length instead of its own, so that its order can be measured.
    """
    order = method.order or taylor_order(tolerance or DEFAULT_TOLERANCE)
    return _kernel.MethodData(method.family, order, method.adaptive, tolerance or 0.0, fixed, method.tableau)
