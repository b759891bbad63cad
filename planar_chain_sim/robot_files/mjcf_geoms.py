"""Geoms of an MJCF: shape, place, mass and inertia; which of them could touch as the mechanism moves."""
from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi
from typing import Optional

import numpy as np

from .mjcf_document import Compiler, Element, turn_to

SIZES = {'sphere': 1, 'capsule': 2, 'cylinder': 2, 'ellipsoid': 3, 'box': 3}    # numbers that a size has
WITHOUT_MASS = ('plane', 'hfield')
TYPES = (*SIZES, *WITHOUT_MASS, 'mesh', 'sdf')
KNOWN = ('adhesion axisangle castshadow class conaffinity condim contype density euler fitscale fluidcoef fluidshape '
         'friction fromto gap group hfield margin mass material mesh name pos priority quat rgba shellinertia size '
         'solimp solmix solref surfacevel type user xyaxes zaxis').split()
CLOSE = 1e-12       # m: what touches without pressing is apart
MAX_PAIRS = 200_000


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


class Touching:
    """
    Which geoms could touch: MJCF's rules say which may, and the mechanism's reach how far they come.

    `bodies`: with `parent`, `weld` (the body that a body is fixed to, itself where it has joints, -1 the world),
    `joints`, each with `kind`, `axis`, `point` and `way`, the farthest it goes from where it is drawn.
    """

    def __init__(self, bodies: list, normal: Optional[np.ndarray], parents_apart: bool):
        """Take `normal`, of the plane if nothing leaves it; `parents_apart`: what a joint connects never touches."""
        self._bodies, self._normal, self._parents_apart = bodies, normal, parents_apart
        self._ways = {}

    def first(self, geoms: list, excluded: set, pairs: list):
        """Return the first two geoms that could touch, None where none can; `pairs`: those that may at any rate."""
        for one, other in pairs:
            if self._weld(one) != self._weld(other) and not self.apart(one, other):
                return one, other
        masks = [(int(geom.element.number('contype', 1)) & 0xffffffff,
                  int(geom.element.number('conaffinity', 1)) & 0xffffffff) for geom in geoms]
        awake = [index for index, mask in enumerate(masks) if mask != (0, 0)]
        looked_at = 0
        for place, i in enumerate(awake):
            for k in awake[place + 1:]:
                looked_at += 1
                if looked_at > MAX_PAIRS:
                    return geoms[i], geoms[k]
                if not (masks[i][0] & masks[k][1] or masks[k][0] & masks[i][1]):
                    continue
                one, other = geoms[i], geoms[k]
                if self._filtered(one, other) or (min(one.body, other.body), max(one.body, other.body)) in excluded:
                    continue
                if not self.apart(one, other):
                    return one, other
        return None

    def _weld(self, geom: Geom) -> int:
        return self._bodies[geom.body].weld if geom.body >= 0 else -1

    def _filtered(self, one: Geom, other: Geom) -> bool:
        welds = self._weld(one), self._weld(other)
        if welds[0] == welds[1] or {one.kind, other.kind} <= set(WITHOUT_MASS):
            return True
        above = [self._above(weld) for weld in welds]
        return self._parents_apart and -1 not in welds and (welds[0] == above[1] or welds[1] == above[0])

    def _above(self, weld: int) -> int:
        parent = self._bodies[weld].parent if weld >= 0 else -1
        return self._bodies[parent].weld if parent >= 0 else -1

    def apart(self, one: Geom, other: Geom) -> bool:
        """Tell whether two geoms never touch, whatever the joints read; False where that is not sure."""
        gap = one.element.number('margin', 0.0) + other.element.number('margin', 0.0) - CLOSE
        if self._normal is not None and self._apart_along(self._normal, one, other, gap):
            return True
        (one_way, other_way) = self._ways_from_common(one, other)
        if one.kind == 'plane' or other.kind == 'plane':
            plane, body, way = (one, other, other_way) if one.kind == 'plane' else (other, one, one_way)
            if (one_way if plane is one else other_way):     # the plane itself moves
                return False
            normal = plane.turn[:, 2]
            center, radius = _ball(body, way, normal)
            return float(normal @ (center - plane.point)) - radius > gap
        (one_center, one_radius), (other_center, other_radius) = _ball(one, one_way), _ball(other, other_way)
        return bool(np.linalg.norm(one_center - other_center) - one_radius - other_radius > gap)

    def _apart_along(self, normal: np.ndarray, one: Geom, other: Geom, gap: float) -> bool:
        intervals = []
        for geom in (one, other):
            middle = float(normal @ geom.point)
            if geom.kind == 'plane':
                facing = float(normal @ geom.turn[:, 2])
                if abs(facing) < 1.0 - 1e-12:
                    return False
                intervals.append((-inf, middle) if facing > 0.0 else (middle, inf))
            else:
                reach = geom.reach_along(normal)
                intervals.append((middle - reach, middle + reach))
        (low, high), (other_low, other_high) = intervals
        return other_low - high > gap or low - other_high > gap

    def _ways_from_common(self, one: Geom, other: Geom) -> tuple[list, list]:
        """Return the joints between the body that carries both geoms and each of them, the inner ones first."""
        paths = []
        for weld in (self._weld(one), self._weld(other)):
            if weld not in self._ways:
                path = []
                while weld >= 0:
                    path.append(weld)
                    weld = self._above(weld)
                self._ways[path[0] if path else -1] = path[::-1]
                paths.append(path[::-1])
            else:
                paths.append(self._ways[weld])
        common = 0
        while common < min(map(len, paths)) and paths[0][common] == paths[1][common]:
            common += 1
        one, other = ([joint for weld in path[common:] for joint in self._bodies[weld].joints] for path in paths)
        return one, other


def _ball(geom: Geom, joints: list, normal: Optional[np.ndarray] = None) -> tuple[np.ndarray, float]:
    """Return middle and radius of a ball that a geom never leaves; `normal`: that counts in this direction alone."""
    center, last, radius = None, None, 0.0
    for joint in joints:
        if joint.kind == 'slide':
            share = 1.0 if normal is None or center is not None else abs(float(normal @ joint.axis))
            radius += share * joint.way if share > CLOSE else 0.0
        elif center is None:
            center = last = joint.point
        else:
            radius += float(np.linalg.norm(joint.point - last))
            last = joint.point
    if center is None:
        return geom.point, radius + (geom.reach if normal is None else geom.reach_along(normal))
    return center, radius + float(np.linalg.norm(geom.point - last)) + geom.reach
