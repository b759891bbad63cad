"""
The equations of motion of a chain, (5.87) and (5.88), multiplied out product by product and reduced.

`equations_of_motion.py` has matrices with a row for every body; here each product of a row is a term. Rows of bodies
that share an angle are added, and in joint coordinates the rows of all bodies that a joint carries. Both follow from
virtual work, the transposed map of equations.md 4 and 5. Each equation is made by itself.
"""
from __future__ import annotations

from typing import Iterator, NamedTuple, Optional

from .factors import Coordinate, Motion, Parts, ScalarProduct, SignOf, Symbol, Vector
from .laws import ARMATURE, LAWS
from .naming import Names
from .terms import Coefficient, Equation, LEFT, RIGHT, Term
from .trigonometry import written_out
from ..chain.chain import Chain
from ..chain.tree import Joint

KINDS = (*LEFT, *RIGHT)
# the order of symbols in a product
LETTERS = {letter: k for k, letter in enumerate(
    ('m', 'M', 'J', 'Ia', 'ma', 'k', 'k_x', 'd', 'd_x', 'tau_c', 'f_c', 'tau_p', 'f_p', 'r', 'c', 'g'))}
GRAVITY = ('gravity',)


class Product(NamedTuple):
    """A product of a row before its rates are written out: number * symbols * slides * left . right * rate."""

    number: int
    symbols: tuple[Symbol, ...]
    slides: tuple[Motion, ...]
    left: Optional[Vector]
    right: Optional[Vector]
    rate: tuple       # kind and coordinates, as Derivation.rates takes them


class Derivation:
    """The equations of a chain one by one: rows of bodies, product by product, collected for a coordinate."""

    def __init__(self, chain: Chain, absolute: bool):
        self.names = Names(chain, absolute)
        self._motions, self._products, self._signs = {}, {}, {}
        self._row: dict = {}        # of the present coordinate: like terms by their common factors

    def equation(self, coordinate: Coordinate) -> Equation:
        """Return the equation of one of the names' coordinates."""
        self._row = {}
        for i in self.names.bodies:
            for sign, turn in self.names.turning[i]:     # virtual work: what turns body i has body i's row
                if turn is coordinate:
                    self._add(sign, self._products_of_angle(i))
            if self.names.slide.get(i) is coordinate:
                self._add(1, self._products_of_slide(i))
            self._add_joint_laws(coordinate, i)
        return Equation(coordinate, tuple(self._terms(coordinate)))

    # --- motion

    def motion(self, order: int, parts: Parts, rest: Optional[Symbol] = None) -> tuple[int, Motion]:
        """Return sign and motion with a plus in front; equal ones are one object."""
        sign = parts[0][0]
        parts = tuple((sign * part, coordinate) for part, coordinate in parts)
        key = (order, parts, rest)
        if key not in self._motions:
            self._motions[key] = Motion(*key)
        return sign, self._motions[key]

    def displacement(self, i: int) -> Motion:
        """Return x_i."""
        return self.motion(0, ((1, self.names.slide[i]),))[1]

    def rates(self, rate: tuple) -> Iterator[tuple[int, tuple[Motion, ...]]]:
        """
        Yield number and factors of an acceleration, squared rate or product of rates of frames.

        ('acceleration', parts); ('squared rate', parts); ('Coriolis', slide, parts). In joint coordinates a frame's
        rate is a sum, and its square is sum_m q_m'^2 + 2 (sum of the q' before m) q_m'.
        """
        kind, *slides, parts = rate
        if kind == 'acceleration':
            for sign, coordinate in parts:
                yield sign, (self.motion(2, ((1, coordinate),))[1],)
        elif kind == 'Coriolis':
            sign, turn = self.motion(1, parts)
            yield sign, (self.motion(1, ((1, slides[0]),))[1], turn)
        else:
            for m, (sign, coordinate) in enumerate(parts):
                _, own = self.motion(1, ((1, coordinate),))
                yield 1, (own, own)
                if m:
                    before_sign, before = self.motion(1, parts[:m])
                    yield 2 * sign * before_sign, (before, own)

    # --- (5.87) and (5.88)

    def _products_of_w(self, left: Vector, scale: tuple, mass, v: int) -> Iterator[Product]:
        """
        Yield left . mass w_v' (5.83).

        w' = (r a^ + x b^) {phi''_} - (r r^ + x chi) {phi'_^2} + chi x'' + 2 b^ x' {phi'_}.
        """
        body = self.names.chain.bodies[v]
        turning, (chi, b) = self.names.turning[body.carrier], self.names.chi[v]
        symbols, slides = scale
        symbols = (mass, *symbols)
        arms = []
        if self.names.of('r', v):
            arms.append(((*symbols, self.names.of('r', v)), slides, self.names.r[v]))
        if body.slide:
            arms.append((symbols, (*slides, self.displacement(v)), self.names.chi[v]))
            yield Product(1, symbols, slides, left, chi, ('acceleration', ((1, self.names.slide[v]),)))
        if not turning:
            return
        for arm_symbols, arm_slides, (along, across) in arms:
            yield Product(1, arm_symbols, arm_slides, left, across, ('acceleration', turning))
            yield Product(-1, arm_symbols, arm_slides, left, along, ('squared rate', turning))
        if body.slide:
            yield Product(2, symbols, slides, left, b, ('Coriolis', self.names.slide[v], turning))

    def _products_of_force(self, left: Vector, scale: tuple, w: int) -> Iterator[Product]:
        """Yield left . row w of M w' + P m u', the inertia force outboard of P_w; u' = c u^ {phi''} - c c^ {phi'^2}."""
        for v in self.names.bodies:
            outer, inner = (w, v) if v in self.names.paths[w] else (v, w)
            if inner in self.names.paths[outer] and self.names.of('M', outer):
                yield from self._products_of_w(left, scale, self.names.of('M', outer), v)
        symbols, slides = scale
        for k in self.names.bodies:
            if w in self.names.paths[k] and self.names.of('m', k) and self.names.of('c', k) and self.names.turning[k]:
                outboard = (self.names.of('m', k), *symbols, self.names.of('c', k))
                along, across = self.names.c[k]
                yield Product(1, outboard, slides, left, across, ('acceleration', self.names.turning[k]))
                yield Product(-1, outboard, slides, left, along, ('squared rate', self.names.turning[k]))

    def _products_of_angle(self, i: int) -> Iterator[Product]:
        """Yield row i of (5.87): left side and gravity."""
        if self.names.of('J', i):
            yield Product(1, (self.names.of('J', i),), (), None, None, ('acceleration', self.names.turning[i]))
        for w in self.names.bodies:
            if self.names.chain.bodies[w].carrier == i:
                for scale, across in self._levers(w):
                    yield from self._products_of_force(across, scale, w)
                    if self.names.of('g', -1) and self.names.of('M', w):
                        yield Product(1, (self.names.of('M', w), *scale[0]), scale[1], self.names.g, across, GRAVITY)
        mass, center = self.names.of('m', i), self.names.of('c', i)
        if mass and center:
            across = self.names.c[i][1]
            for v in self.names.paths[i]:
                yield from self._products_of_w(across, ((center,), ()), mass, v)
            if self.names.of('g', -1):
                yield Product(1, (mass, center), (), self.names.g, across, GRAVITY)

    def _levers(self, w: int) -> Iterator[tuple]:
        """Yield r_w a^_w and x_w b^_w as (symbols, slides) and vector."""
        if self.names.of('r', w):
            yield ((self.names.of('r', w),), ()), self.names.r[w][1]
        if self.names.chain.bodies[w].slide:
            yield ((), (self.displacement(w),)), self.names.chi[w][1]

    def _products_of_slide(self, i: int) -> Iterator[Product]:
        """Yield row i of (5.88): left side and gravity."""
        chi = self.names.chi[i][0]
        yield from self._products_of_force(chi, ((), ()), i)
        if self.names.of('g', -1) and self.names.of('M', i):
            yield Product(1, (self.names.of('M', i),), (), self.names.g, chi, GRAVITY)

    # --- joints

    def _add_joint_laws(self, coordinate: Coordinate, i: int) -> None:
        """Add what acts on the relative coordinates of body i's joints (equations.md 4, 6.3)."""
        body = self.names.chain.bodies[i]
        if body.slide:
            self._add_laws(coordinate, i, body.slide, ((1, self.names.slide[i]),), 1, body.slide.rest)
        if body.rotation and not self.names.absolute:
            self._add_laws(coordinate, i, body.rotation, ((1, self.names.turn[i]),), 1, body.rotation.rest)
        elif body.rotation:   # theta' = axis q' is the difference of two absolute rates
            axis = int(body.rotation.axis)
            carrier = tuple((-sign, turn) for sign, turn in self.names.turning[body.carrier])
            fixed = sum(symbol.value for symbol in self.names.fixed[body.carrier])
            slack = fixed + body.angle + axis * body.rotation.rest
            self._add_laws(coordinate, i, body.rotation, ((1, self.names.turn[i]), *carrier), axis, slack)

    def _add_laws(self, coordinate: Coordinate, i: int, joint: Joint, relative: Parts, axis: int, slack: float) -> None:
        slide = joint.kind == 'slide'
        armature = self.names.of(ARMATURE.letters[slide], i)
        rate = self.motion(1, relative)[1]
        for sign in (sign for sign, part in relative if part is coordinate):
            if armature:
                for other, turn in relative:
                    self._collect(sign * other, 'acceleration', (armature,), (), None,
                                  (self.motion(2, ((1, turn),))[1],))
            for law in LAWS:
                number = self.names.of(law.letters[slide], i)
                if not number:
                    continue
                if law.acts_on == 'displacement':
                    against = self.motion(0, relative, self._rest(i, relative, slack))[1]
                elif law.acts_on == 'rate':
                    against = rate
                elif law.acts_on == 'direction':
                    against = self._signs.setdefault(rate, SignOf(rate))
                else:
                    self._collect(sign * axis, law.kind, (number,), (), None, ())
                    continue
                self._collect(-sign, law.kind, (number,), (), None, (against,))
            self._collect(sign * axis, 'effort', (), (), None, (self.names.effort[joint.name],))

    def _rest(self, i: int, relative: Parts, slack: float) -> Optional[Symbol]:
        own = relative[0][1]
        letter, unit = {'x': ('x_rest', 'm'), 'q': ('q_rest', 'rad'), 'phi': ('theta_rest', 'rad')}[own.letter]
        if f'{letter}{i + 1}' not in self.names.symbols:
            what = 'frame against frame' if own.letter == 'phi' else own.name
            self.names.keep(letter, i, slack, unit, f'{what} where the spring of {own.joint} is slack')
        return self.names.of(letter, i)

    # --- reduction

    def _add(self, sign: int, products: Iterator[Product]) -> None:
        """Add products of a body's row, times a sign, to the present equation."""
        for product in products:
            dot = self._dot(product.left, product.right) if product.left and product.right else None
            symbols = tuple(sorted(product.symbols, key=lambda s: (LETTERS[s.letter], s.index)))
            slides = tuple(sorted(product.slides, key=lambda x: x.parts[0][1].place))
            for number, motions in ((1, ()),) if product.rate == GRAVITY else self.rates(product.rate):
                kind = product.rate[0]
                if kind == 'squared rate' and motions[0] is not motions[1]:
                    kind = 'Coriolis'
                self._collect(sign * number * product.number, kind, symbols, slides, dot, motions)

    def _dot(self, left: Vector, right: Vector) -> ScalarProduct:
        """Return left . right: not both turned; the turned one, or of two plain ones the inner one, comes first."""
        key = (left, right)
        if key not in self._products:
            if left.turned and right.turned:
                left, right = self._plain(left), self._plain(right)
            if left.letter != 'g' and (right.turned, -right.index) > (left.turned, -left.index):
                left, right = right, left
            self._products[key] = self._products.setdefault((left, right, 'reduced'), ScalarProduct(left, right))
        return self._products[key]

    def _plain(self, vector: Vector) -> Vector:
        return {'r': self.names.r, 'chi': self.names.chi, 'c': self.names.c}[vector.letter][vector.index - 1][0]

    def _collect(self, number: int, kind: str, symbols, slides, dot: Optional[ScalarProduct], motions) -> None:
        """Add to the like term; products are like if they are equal at every state; those that vanish are dropped."""
        sign, angle = written_out(dot) if dot else (1, None)
        if sign:
            entry = self._row.setdefault((kind, motions, symbols, slides, angle), [0, sign, dot])
            entry[0] += sign * number

    def _terms(self, coordinate: Coordinate) -> Iterator[Term]:
        """Yield the terms in the order of 5.4.8: by kind, by coordinate of the rates, inertias first."""
        def order(item):
            (kind, motions, symbols, *_), _ = item
            places = [] if kind in RIGHT else [tuple(part[1].place for part in motion.parts) for motion in motions]
            return KINDS.index(kind), places, not (symbols and symbols[0].letter in ('J', 'Ia'))

        for (kind, motions, symbols, slides, angle), (total, sign, dot) in sorted(self._row.items(), key=order):
            if total == 0:
                continue
            constant = dot is None or (angle[0] == '1' and kind != 'gravity')
            number = total if constant else total * sign
            factors = (*slides, *(() if constant else (dot,)), *motions)
            yield Term(coordinate, kind, Coefficient(number, symbols), factors)
