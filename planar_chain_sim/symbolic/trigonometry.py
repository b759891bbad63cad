"""Other terms for the same equations: scalar products written out (5.89), symbols replaced by numbers."""
from __future__ import annotations

from cmath import phase
from collections import Counter
from dataclasses import replace
from functools import lru_cache
from math import pi

from .factors import Motion, quarter_turns, ScalarProduct, Symbol, Trigonometric
from .terms import Coefficient, Equation, Term
from .._kernel import unit_vector

ROUNDING = 1e-15         # relative: what is left when numbers of a sum cancel
UNITS = (1.0, 1j, -1.0, -1j)                                            # e^(j k pi/2)
QUARTERS = ((1, 'cos'), (-1, 'sin'), (-1, 'cos'), (1, 'sin'))           # cos(a + k pi/2)


@lru_cache(maxsize=2**16)
def written_out(product: ScalarProduct) -> tuple[int, tuple]:
    """
    Return sign and (function, parts, offsets) of a scalar product of unit vectors, (5.89): 'cos', 'sin', '0' or '1'.

    Equal products give equal parts. Angles that are quarter turns are worked out; a length is left out.
    """
    left, right = product.left, product.right
    coordinates, symbols = Counter(), Counter()
    for vector, sign in ((left, 1), (right, -1)):
        for part_sign, coordinate in vector.parts:
            coordinates[coordinate] += sign * part_sign
        for offset in vector.offsets:
            symbols[offset] += sign
    turns = int(left.turned) - int(right.turned)
    offsets = []
    for symbol, count in symbols.items():
        if count and (quarter := quarter_turns(symbol.value)) is not None:
            turns += count * quarter
        elif count:
            offsets.append((count, symbol))
    parts = sorted(((count, coordinate) for coordinate, count in coordinates.items() if count),
                   key=lambda part: part[1].place)
    offsets.sort(key=lambda offset: (offset[1].letter, offset[1].index))
    if not parts and not offsets:
        return (1, 0, -1, 0)[turns % 4], ('1', (), ())
    sign, function = QUARTERS[turns % 4]
    if (parts or offsets)[0][0] < 0:      # the angle begins with a plus
        parts, offsets = ([(-count, item) for count, item in items] for items in (parts, offsets))
        sign = -sign if function == 'sin' else sign
    return sign, (function, tuple(parts), tuple(offsets))


def in_trigonometric_functions(equation: Equation) -> Equation:
    """Return the equation with its scalar products as sines and cosines."""
    made = {}

    def term_written_out(term: Term) -> Term:
        number, symbols, factors = term.coefficient.number, term.coefficient.symbols, []
        for factor in term.factors:
            if isinstance(factor, ScalarProduct):
                sign, (function, *angle) = written_out(factor)
                number *= sign
                symbols += tuple(vector.length for vector in (factor.left, factor.right) if vector.length)
                if function == '1':
                    continue
                factor = made.setdefault((function, *angle), Trigonometric(function, *angle))
            factors.append(factor)
        return replace(term, coefficient=Coefficient(number, symbols), factors=tuple(factors))

    return replace(equation, terms=tuple(map(term_written_out, equation.terms)))


def in_numbers(equation: Equation) -> Equation:
    """
    Return the equation with numbers for its symbols and like terms added.

    Sines and cosines of the same coordinates become one, of an angle with a constant where it has to be.
    """
    made, sums = {}, {}

    def numbered(factor):
        if not isinstance(factor, Motion) or not factor.rest:
            return factor
        return made.setdefault(factor, Motion(factor.order, factor.parts, Symbol('', 0, factor.rest.value)))

    for term in equation.terms:
        waves = [factor for factor in term.factors if isinstance(factor, Trigonometric)]
        others = tuple(numbered(factor) for factor in term.factors if factor not in waves)
        amplitude, parts = complex(term.coefficient.value), None
        for wave in waves:                            # at most one
            parts = wave.parts or None                # a constant angle leaves a number
            amplitude *= _turned(wave)
        row = sums.setdefault((term.kind, others, parts), [0j, 0.0])
        row[0] += amplitude
        row[1] += abs(amplitude)
    terms = []
    for (kind, factors, parts), (amplitude, size) in sums.items():
        terms += _terms_of(equation, kind, factors, parts, amplitude, ROUNDING * size)
    return replace(equation, terms=tuple(terms))


def _turned(wave: Trigonometric) -> complex:
    """Return e^(j a) with Re(e^(j a) e^(j parts)) the wave; quarter turns are in its function already."""
    turn = 1.0 if wave.function == 'cos' else -1j
    return turn * unit_vector(sum(sign * offset.value for sign, offset in wave.offsets)) if wave.offsets else turn


def _terms_of(equation: Equation, kind: str, factors, parts, amplitude: complex, rounding: float):
    """Yield the one term, or none, that Re(amplitude e^(j parts)) times factors is."""
    if abs(amplitude) <= rounding:
        return
    number = amplitude.real
    if parts is not None:
        # the angle's constant is made small: cos(a + k pi/2) is one of cos a, -sin a, -cos a, sin a
        turns = round(phase(amplitude) / (0.5 * pi))
        rest = amplitude * UNITS[-turns % 4]
        constant = phase(rest) if abs(rest.imag) > rounding else 0.0
        sign, function = QUARTERS[turns % 4]
        number = sign * (abs(rest) if constant else rest.real)
        wave = Trigonometric(function, parts, ((1, Symbol('', 0, constant)),) if constant else ())
        slides = tuple(factor for factor in factors if isinstance(factor, Motion) and factor.order == 0
                       and not factor.rest)
        factors = (*slides, wave, *factors[len(slides):])
    if abs(number) > rounding:
        yield Term(equation.coordinate, kind, Coefficient(number), factors)
