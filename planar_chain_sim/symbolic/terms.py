"""
Terms and equations: a number times symbols times factors, each term evaluated alone at a state.

str() of a term is an expression in the ASCII of programs (see factors.py): 'm3*r2*c3*dot(r2_hat, c3_hat)*phi3_dd'.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import prod

from .factors import Coordinate, Factor, State, sum_of, Symbol
from .laws import LAWS

LEFT = ('acceleration', 'squared rate', 'Coriolis')                      # kinds of terms, in the order of 5.4.8
RIGHT = ('gravity', *(law.kind for law in LAWS), 'effort')


@dataclass(frozen=True)
class Coefficient:
    """What is constant in a term: a number times symbols."""

    number: float
    symbols: tuple[Symbol, ...] = ()

    @property
    def value(self) -> float:
        """The product, SI units."""
        return prod((symbol.value for symbol in self.symbols), start=float(self.number))

    def __str__(self):
        number = f'{self.number!r}'
        if self.symbols and abs(self.number) == 1:
            return ('-' if self.number < 0 else '') + '*'.join(map(str, self.symbols))
        return '*'.join((number, *map(str, self.symbols)))


@dataclass(frozen=True)
class Term:
    """One product: `kind` is one of LEFT or RIGHT, the sides of the equation where it stands; `factors` move."""

    coordinate: Coordinate
    kind: str
    coefficient: Coefficient
    factors: tuple[Factor, ...]

    @property
    def side(self) -> str:
        """'left' or 'right', where the equation is written as in 5.4.8."""
        return 'left' if self.kind in LEFT else 'right'

    def contribution(self, state: State) -> float:
        """Value at a state as the term stands in its equation, N m or N."""
        return prod((factor.evaluate(state) for factor in self.factors), start=self.coefficient.value)

    def evaluate(self, state: State) -> float:
        """Share in the equation's residual, left side less right side, N m or N: these add up to it."""
        value = self.contribution(state)
        return value if self.side == 'left' else -value

    def __repr__(self):
        return f'Term {str(self)!r}: {self.kind}, {self.side} side of {self.coordinate}'

    def __str__(self):
        factors = '*'.join(map(str, self.factors))
        constant = str(self.coefficient)
        if not factors or constant not in ('1', '-1', '1.0', '-1.0'):
            return f'{constant}*{factors}' if factors else constant
        return f'-{factors}' if constant.startswith('-') else factors


@dataclass(frozen=True)
class Equation:
    """The equation of one coordinate: its terms in the order of 5.4.8."""

    coordinate: Coordinate
    terms: tuple[Term, ...]

    @property
    def number(self) -> str:
        """'5.87' or '5.88': which of the book's formulae it is made by."""
        return '5.88' if self.coordinate.letter == 'x' else '5.87'

    @cached_property
    def left(self) -> tuple[Term, ...]:
        """Terms of accelerations and rates."""
        return tuple(term for term in self.terms if term.side == 'left')

    @cached_property
    def right(self) -> tuple[Term, ...]:
        """Terms of gravity, springs, dampers and efforts."""
        return tuple(term for term in self.terms if term.side == 'right')

    def residual(self, state: State) -> float:
        """Left side less right side, N m or N: the sum of all terms evaluated alone."""
        return sum(term.evaluate(state) for term in self.terms)

    def __repr__(self):
        return (f'Equation of {self.coordinate}, {self.coordinate.joint}, ({self.number}): {len(self.left)} terms on '
                f'the left, {len(self.right)} on the right; str() writes them out')

    def __str__(self):
        left, right = (sum_of((1, str(term)) for term in side) for side in (self.left, self.right))
        return f'{left} = {right or 0}'
