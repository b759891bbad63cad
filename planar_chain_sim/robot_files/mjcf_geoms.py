"""Geoms of an MJCF: shape, place, mass and inertia."""
from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

import numpy as np

from .mjcf_document import Compiler, Element, turn_to

SIZES = {'sphere': 1, 'capsule': 2, 'cylinder': 2, 'ellipsoid': 3, 'box': 3}    # numbers that a size has
WITHOUT_MASS = ('plane', 'hfield')
TYPES = (*SIZES, *WITHOUT_MASS, 'mesh', 'sdf')
KNOWN = ('adhesion axisangle castshadow class conaffinity condim contype density euler fitscale fluidcoef fluidshape '
         'friction fromto gap group hfield margin mass material mesh name pos priority quat rgba shellinertia size '
         'solimp solmix solref surfacevel type user xyaxes zaxis').split()


@dataclass
class Geom:
    """One geom: its shape and where it is in the root's frame as the file draws it."""

    element: Element
    name: str
    kind: str
    size: list                  # m, half lengths as MJCF has them
    turn: np.ndarray            # (3, 3)
    point: np.ndarray           # (3,), m
    body: int                   # index of its body, -1 the world

    @property
    def reach(self) -> float:
        """Return how far the shape goes from its own middle, m."""
        if self.kind not in SIZES:
            return inf
        if self.kind == 'capsule':
            return self.size[0] + self.size[1]
        if self.kind in ('sphere', 'ellipsoid'):
            return max(self.size)
        return float(np.linalg.norm(self.size))

    def reach_along(self, direction: np.ndarray) -> float:
        """Return how far the shape goes from its middle along a unit direction of the root's frame, m."""
        if self.kind not in SIZES:
            return inf
        along = abs(self.turn.T @ direction)
        if self.kind == 'sphere':
            return self.size[0]
        if self.kind == 'capsule':
            return self.size[0] + self.size[1] * along[2]
        if self.kind == 'cylinder':
            return self.size[0] * float(np.hypot(along[0], along[1])) + self.size[1] * along[2]
        if self.kind == 'box':
            return float(np.dot(self.size, along))
        return float(np.linalg.norm(self.size * along))


def read_geom(element: Element, compiler: Compiler, turn: np.ndarray, shift: np.ndarray, body: int) -> Geom:
    """Return a geom, defaults already in its element, of a body or frame that is turned and shifted so."""
    element.refuse_unknown(KNOWN)
    kind = element.word('type', TYPES, 'mesh' if element.text('mesh') and 'type' not in element.attributes
                        else 'sphere')
    size = list(np.array(element.numbers('size', 0, 3) or []))    # of numpy: what overflows is inf, no exception
    fromto = element.numbers('fromto', 6, 6)
    if element.text('mesh'):
        kind = 'mesh'           # also where a simple shape is fitted to one
    if fromto is not None and kind in ('capsule', 'cylinder', 'box', 'ellipsoid'):
        start, end = np.array(fromto[:3]), np.array(fromto[3:])
        length = float(np.linalg.norm(end - start))
        if not 1e-14 < length < inf:
            element.fail('has a fromto of no length, must be two points')
        own_turn, own_shift = turn_to((start - end) / length), 0.5 * (start + end)
        size = [*size[:1] * (SIZES[kind] - 1), 0.5 * length]
    else:
        if fromto is not None and kind == 'sphere':
            element.fail('has a fromto, must then be a capsule, cylinder, box or ellipsoid')
        own_turn, own_shift = compiler.pose(element)
    wanted = SIZES.get(kind, 0)
    if len(size) < wanted or min(size[:wanted], default=1.0) <= 0.0:
        element.fail(f"has size '{element.text('size')}', must be {wanted} positive number{'s' * (wanted > 1)} for a "
                     f'{kind}')
    return Geom(element, element.text('name'), kind, size[:wanted], turn @ own_turn, shift + turn @ own_shift, body)


def mass_of(geom: Geom) -> float:
    """Return the mass of a geom, kg: as it is given, or by density and volume."""
    element = geom.element
    density, mass = element.number('density', 1000.0, 0.0), element.number('mass', -1.0, 0.0)
    if geom.kind in WITHOUT_MASS:
        return 0.0
    if geom.kind not in SIZES:
        if mass == 0.0 or (mass < 0.0 and density == 0.0):
            return 0.0
        element.fail(f'is a {geom.kind}, whose mass and inertia are in another file, must stand beside an <inertial> '
                     'of its body or have mass 0')
    if element.word('shellinertia', ('true', 'false'), 'false') == 'true':
        element.fail('has shellinertia, must be solid')
    if mass >= 0.0:
        return mass
    a, *rest = geom.size
    volume = {'sphere': lambda: 4.0 / 3.0 * pi * a**3, 'capsule': lambda: pi * a**2 * (2.0 * rest[0] + 4.0 / 3.0 * a),
              'cylinder': lambda: 2.0 * pi * a**2 * rest[0], 'box': lambda: 8.0 * a * rest[0] * rest[1],
              'ellipsoid': lambda: 4.0 / 3.0 * pi * a * rest[0] * rest[1]}[geom.kind]()
    return density * volume


def inertia_of(geom: Geom, mass: float) -> np.ndarray:
    """Return the inertia (3, 3) of a solid geom about its middle, kg m^2, in the root's frame."""
    a, *rest = geom.size
    if geom.kind == 'sphere':
        moments = np.full(3, 0.4 * a**2)
    elif geom.kind == 'cylinder':
        across = (3.0 * a**2 + 4.0 * rest[0]**2) / 12.0
        moments = np.array([across, across, 0.5 * a**2])
    elif geom.kind == 'capsule':      # a cylinder and two halves of a sphere
        length = 2.0 * rest[0]
        ball = 4.0 * a / (4.0 * a + 3.0 * length)
        rod = 1.0 - ball
        across = (rod * (3.0 * a**2 + length**2) / 12.0
                  + ball * (0.4 * a**2 + 0.375 * a * length + 0.25 * length**2))
        moments = np.array([across, across, 0.5 * rod * a**2 + 0.4 * ball * a**2])
    else:
        squares = np.array(geom.size)**2
        moments = (squares.sum() - squares) / (3.0 if geom.kind == 'box' else 5.0)
    return mass * (geom.turn * moments) @ geom.turn.T
