"""
Terms put together as the worked example 5.4.8 does it: one coefficient for each acceleration and product of rates.

What the products of a coefficient have in common is put outside a bracket: r2 r2^.(M3 r3 r3^ + M4 r4 r4^ + m2 c2 c2^).
"""
from __future__ import annotations

from collections import Counter
from typing import Any, Iterator, NamedTuple, Optional, Sequence

from .factors import Effort, Motion, ScalarProduct, SignOf, Symbol, Trigonometric, Vector
from .notation import SOFT_BREAK, Text
from .terms import Equation, Term

Piece = tuple[int, str]     # a sign and what follows it


class Parts(NamedTuple):
    """A term taken apart: number * scalars (symbols and slides) * geometry * rates."""

    number: float
    scalars: tuple
    geometry: Any            # ScalarProduct, Trigonometric or None
    rates: tuple


def parts_of(term: Term) -> Parts:
    """Take a term apart."""
    slides = tuple(factor for factor in term.factors if isinstance(factor, Motion)
                   and factor.order == 0 and term.kind != 'spring')
    geometry = [factor for factor in term.factors if isinstance(factor, (ScalarProduct, Trigonometric))]
    rates = tuple(factor for factor in term.factors if factor not in slides and factor not in geometry)
    return Parts(term.coefficient.number, term.coefficient.symbols + slides, geometry[0] if geometry else None, rates)


class Writer:
    """Writes terms and equations in a notation."""

    def __init__(self, notation: Text):
        self.notation = notation

    def term(self, term: Term) -> Piece:
        """One term alone."""
        parts = parts_of(term)
        return self._sign(parts.number), self._product(parts, self._rates(parts.rates))

    def left(self, equation: Equation) -> list[Piece]:
        """Left side: a piece for every acceleration, squared rate and product of rates."""
        return [piece for group in _groups(equation.left) for piece in self._group(group)]

    def right(self, equation: Equation) -> list[Piece]:
        """Right side: gravity, springs, dampers, friction, preloads, efforts."""
        return [piece for group in _groups(equation.right) for piece in self._group(group)]

    def sum_of(self, pieces: Sequence[Piece]) -> str:
        """Pieces with their signs; a line may be broken before a sign."""
        text = ''
        for sign, piece in pieces:
            operator = self.notation.minus if sign < 0 else '+'
            text += f'{SOFT_BREAK}{operator} {piece}' if text else (operator if sign < 0 else '') + piece
        return text or '0'

    # --- a coefficient

    def _group(self, terms: list[Parts]) -> list[Piece]:
        """All terms with the same rates: one piece, or several where there is no rate to put behind a bracket."""
        rates = self._rates(terms[0].rates)
        if len(terms) == 1:
            return [(self._sign(terms[0].number), self._product(terms[0], rates))]
        factored = self._common_vector(terms, rates)
        if factored:
            return [factored]
        if not rates:
            return self._alike(terms)
        number, scalars, rest = _taken_out(terms)
        pieces = self._alike(rest)
        inner = pieces[0][1] if len(pieces) == 1 else self._bracket(pieces)     # the first piece has no minus any more
        outside = Parts(abs(number), scalars, None, ())
        return [(self._sign(number), self._product(outside, inner, rates))]

    def _alike(self, terms: list[Parts]) -> list[Piece]:
        """Terms with equal sines and cosines put together: M3 r2 r3 cos + m2 r2 c2 cos = r2 (M3 r3 + m2 c2) cos."""
        alike = {}
        for parts in terms:
            wave = isinstance(parts.geometry, Trigonometric)
            alike.setdefault(self._geometry(parts.geometry) if wave else len(alike), []).append(parts)
        pieces = []
        for group in alike.values():
            number, scalars, rest = _taken_out(group) if len(group) > 1 else (group[0].number, group[0].scalars, [])
            bracket = self._bracket([(self._sign(parts.number), self._product(parts._replace(geometry=None)))
                                     for parts in rest]) if rest else ''
            outside = Parts(abs(number), scalars, None, ())
            pieces.append((self._sign(number), self._product(outside, bracket, self._geometry(group[0].geometry))))
        return pieces

    def _common_vector(self, terms: list[Parts], rates: str) -> Optional[Piece]:
        """r2 r2^.(M3 r3 r3^ + m2 c2 c2^) where all terms are scalar products with one vector."""
        if not all(isinstance(parts.geometry, ScalarProduct) for parts in terms):
            return None
        first = terms[0].geometry
        for vector in (first.left, first.right):
            split: list[Any] = [_other_vector(parts.geometry, vector) for parts in terms]
            if None not in split:
                break
        else:
            return None
        number, scalars, rest = _taken_out(terms)
        inner = self._bracket([
            (self._sign(parts.number), self._product(parts._replace(geometry=None), self.notation.vector(other)))
            for parts, other in zip(rest, split)])
        sides = (self.notation.vector(vector), inner)
        product = self.notation.dot.join(sides if vector is first.left else sides[::-1])
        return self._sign(number), self._product(Parts(abs(number), scalars, None, ()), product, rates)

    # --- products

    def _product(self, parts: Parts, *behind: str) -> str:
        """Return |number| * scalars * geometry, then the rates behind it."""
        counts = Counter(parts.scalars)
        factors = [self._power(self._scalar(item), count) for item, count in counts.items()]
        factors += [text for text in (self._geometry(parts.geometry), *behind) if text]
        size = abs(parts.number)
        if size != 1 or not factors:
            factors.insert(0, self.notation.number(size))
        return self.notation.times.join(factors)

    def _power(self, text: str, count: int) -> str:
        return self.notation.squared(text) if count == 2 else self.notation.times.join([text] * count)

    def _scalar(self, item) -> str:
        return self.notation.symbol(item) if isinstance(item, Symbol) else self.motion(item)

    def _geometry(self, geometry) -> str:
        if isinstance(geometry, ScalarProduct):
            return self.notation.dot.join(map(self.notation.vector, (geometry.left, geometry.right)))
        if isinstance(geometry, Trigonometric):
            return f'{self.notation.functions[geometry.function]}({self.angle(geometry.parts, geometry.offsets)})'
        return ''

    def angle(self, parts, offsets) -> str:
        """Return a sum of coordinates and constants, in which no line is broken."""
        pieces = [(sign, self.notation.coordinate(coordinate)) for sign, coordinate in parts]
        pieces += [_signed(sign, offset, self.notation) for sign, offset in offsets]
        return self.sum_of(pieces).replace(SOFT_BREAK, ' ')

    def _rates(self, rates) -> str:
        counts = Counter(rates)
        return self.notation.times.join(self._power(self._rate(rate), count) for rate, count in counts.items())

    def _rate(self, rate) -> str:
        if isinstance(rate, Effort):
            return self.notation.effort(rate)
        if isinstance(rate, SignOf):
            return f'{self.notation.functions["sign"]}({self.motion(rate.motion, bare=True)})'
        return self.motion(rate)

    def motion(self, motion: Motion, bare: bool = False) -> str:
        """Return a rate or a coordinate; a sum in brackets unless `bare`."""
        pieces = [(sign, self.notation.coordinate(coordinate, motion.order)) for sign, coordinate in motion.parts]
        if motion.rest:
            pieces.append(_signed(-1, motion.rest, self.notation))
        text = self.sum_of(pieces).replace(SOFT_BREAK, ' ')
        return text if bare or len(pieces) == 1 else self.notation.opening + text + self.notation.closing

    def _bracket(self, pieces: list[Piece]) -> str:
        return self.notation.opening + self.sum_of(pieces) + self.notation.closing

    @staticmethod
    def _sign(number: float) -> int:
        return -1 if number < 0 else 1


def _signed(sign: int, symbol: Symbol, notation: Text) -> Piece:
    """Return a constant of an angle; a negative number gives its sign away."""
    if not symbol.letter and symbol.value < 0:
        sign, symbol = -sign, Symbol('', 0, -symbol.value)
    return sign, notation.symbol(symbol)


def _groups(terms) -> Iterator[list[Parts]]:
    """Terms with the same rates, in the order in which these come."""
    groups = {}
    for term in terms:
        parts = parts_of(term)
        groups.setdefault((term.kind, parts.rates), []).append(parts)
    return iter(groups.values())


def _taken_out(terms: list[Parts]) -> tuple[float, tuple, list[Parts]]:
    """Return number and scalars that all terms have, and the terms without them."""
    common = Counter(terms[0].scalars)
    for parts in terms[1:]:
        common &= Counter(parts.scalars)
    sizes = {abs(parts.number) for parts in terms}
    number = sizes.pop() if len(sizes) == 1 else 1.0
    number = -number if terms[0].number < 0 else number
    rest = []
    for parts in terms:
        left = Counter(common)
        scalars = []
        for item in parts.scalars:
            if left[item]:
                left[item] -= 1
            else:
                scalars.append(item)
        rest.append(parts._replace(number=parts.number / number, scalars=tuple(scalars)))
    return number, tuple(common.elements()), rest


def _other_vector(product: ScalarProduct, vector: Vector) -> Optional[Vector]:
    """Return what a product multiplies `vector` with, None where it is not in it."""
    return product.right if product.left is vector else product.left if product.right is vector else None
