"""Names that a chain's equations are written with: symbols, coordinates, efforts, and the vectors of its bodies."""
from __future__ import annotations

from cmath import phase
from typing import Any

from .factors import Coordinate, Effort, Parts, Symbol, Vector
from .laws import ARMATURE, LAWS
from ..chain.chain import Chain
from ..chain.tree import BASE, Joint


class Names:
    """
    Symbols by name; `slide`, `turn`: coordinates by body; `effort` by joint; `r`, `chi`, `c`: (plain, turned) by body.

    `turning` and `fixed` are the angle of a body's frame, as coordinates and constants; `paths` lead from the root.
    """

    def __init__(self, chain: Chain, absolute: bool):
        self.chain, self.absolute = chain, absolute
        self.bodies = range(len(chain.bodies))
        self.symbols: dict[str, Symbol] = {}
        self.paths: list[tuple[int, ...]] = []
        for i, body in enumerate(chain.bodies):
            self.paths.append((*(self.paths[body.carrier] if body.carrier != BASE else ()), i))
        self._name_symbols()
        self.coordinates = self._name_coordinates()
        self._place_frames()

    def keep(self, letter: str, i: int, value: float, unit: str, meaning: str) -> None:
        """Keep a symbol, if it is not zero: what is zero appears in no term."""
        if value != 0.0:
            index = i + 1
            self.symbols[f'{letter}{index or ""}'] = Symbol(letter, index, float(value), unit, meaning)

    def of(self, letter: str, i: int) -> Any:
        """Return the Symbol of a letter and body, None where it is zero."""
        return self.symbols.get(f'{letter}{i + 1 or ""}')

    def _name_symbols(self) -> None:
        outboard = [body.mass for body in self.chain.bodies]
        for i in reversed(self.bodies):
            if self.chain.bodies[i].carrier != BASE:
                outboard[self.chain.bodies[i].carrier] += outboard[i]
        gravity = self.chain.gravity
        self.keep('g', -1, abs(gravity), 'm/s^2', 'gravity')
        self.keep('delta_g', -1, phase(gravity), 'rad', 'direction of gravity')
        for i, body in enumerate(self.chain.bodies):
            name = body.name
            self.keep('m', i, body.mass, 'kg', f'mass of {name}')
            self.keep('M', i, outboard[i], 'kg', f'mass of {name} and all outboard of it')
            self.keep('J', i, body.inertia, 'kg m^2', f'inertia of {name} about its joint point')
            self.keep('c', i, abs(body.center_of_mass), 'm', f'mass centre of {name} from its joint point')
            self.keep('eta', i, phase(body.center_of_mass), 'rad', f"direction of c in {name}'s frame")
            self.keep('r', i, abs(body.origin), 'm', f"joint point of {name} from its carrier's")
            self.keep('gamma', i, phase(body.origin), 'rad', "direction of r in the carrier's frame")
            self.keep('beta', i, body.angle, 'rad', f"{name}'s frame against its carrier's at zero")
            for joint in filter(None, (body.slide, body.rotation)):
                self._name_laws(i, joint)

    def _name_laws(self, i: int, joint: Joint) -> None:
        name = joint.name
        if joint.kind == 'slide':
            self.keep('epsilon', i, joint.axis, 'rad', f"direction of {name} in the carrier's frame")
        slide = joint.kind == 'slide'
        for law in (ARMATURE, *LAWS):
            self.keep(law.letters[slide], i, getattr(joint, law.number), law.units[slide], f'{law.number} of {name}')

    def _name_coordinates(self) -> tuple[Coordinate, ...]:
        """Absolute: angles, then slides, as (5.90) to (5.94) are ordered; else joints in file order."""
        rows, place = [], 0
        for i, body in enumerate(self.chain.bodies):
            for joint in filter(None, (body.slide, body.rotation)):
                letter = 'x' if joint.kind == 'slide' else 'phi' if self.absolute else 'q'
                rows.append((letter, i, joint, place))
                place += 1
        if self.absolute:
            rows.sort(key=lambda row: row[0])
        self.slide, self.turn, self.effort, made = {}, {}, {}, []
        for place, (letter, i, joint, slot) in enumerate(rows):
            coordinate = Coordinate(letter, i + 1, joint.name, place)
            (self.slide if letter == 'x' else self.turn)[i] = coordinate
            self.effort[joint.name] = Effort('f' if letter == 'x' else 'tau', i + 1, joint.name, slot)
            made.append(coordinate)
        return tuple(made)

    def _place_frames(self) -> None:
        """Angle of every body's frame as coordinates and constants; then the vectors that turn with the frames."""
        self.turning: dict[int, tuple] = {BASE: ()}
        self.fixed: dict[int, tuple] = {BASE: ()}
        self.r, self.chi, self.c = {}, {}, {}
        for i, body in enumerate(self.chain.bodies):
            turning, fixed = self.turning[body.carrier], self.fixed[body.carrier]
            self.r[i] = self._vectors('r', i, turning, fixed, 'gamma')
            self.chi[i] = self._vectors('chi', i, turning, fixed, 'epsilon')
            if self.absolute and body.rotation:
                turning, fixed = ((1, self.turn[i]),), ()
            else:
                if body.rotation:
                    turning = (*turning, (int(body.rotation.axis), self.turn[i]))
                if self.of('beta', i):
                    fixed = (*fixed, self.of('beta', i))
            self.turning[i], self.fixed[i] = turning, fixed
            self.c[i] = self._vectors('c', i, turning, fixed, 'eta')
        offsets = (self.symbols['delta_g'],) if 'delta_g' in self.symbols else ()
        self.g = Vector('g', False, 0, (), offsets, self.symbols.get('g'))

    def _vectors(self, letter: str, i: int, turning: Parts, fixed, direction: str) -> tuple[Vector, Vector]:
        """Return a unit vector and the same turned by 90 degrees."""
        own = self.of(direction, i)
        offsets = (*fixed, own) if own else fixed
        along, across = (Vector(letter, turned, i + 1, turning, offsets) for turned in (False, True))
        return along, across
