"""Which geoms of an MJCF could touch as the mechanism moves."""
from __future__ import annotations

from math import inf
from typing import Optional

import numpy as np

from .mjcf_geoms import Geom, WITHOUT_MASS

CLOSE = 1e-12       # m: what touches without pressing is apart
MAX_PAIRS = 200_000


class Touching:
    """
    Finds geoms that could touch: MJCF's rules say which pairs may, and the mechanism's reach how far they come.

    `bodies`: with `parent`, `weld` (the body that a body is fixed to, itself where it has joints, -1 the world),
    `joints`, each with `kind`, `axis`, `point` and `way`, the farthest it goes from where it is drawn.
    """

    def __init__(self, bodies: list, normal: Optional[np.ndarray], parents_apart: bool):
        """Take `normal`, of the plane if nothing leaves it; `parents_apart`: what a joint connects never touches."""
        self._bodies, self._normal, self._parents_apart = bodies, normal, parents_apart
        self._ways = {}

    def first(self, geoms: list, excluded: set, pairs: list):
        """Return the first two geoms that could touch, None if none can; `pairs`: those that explicitly may."""
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
        """Return whether two geoms never touch at any joint positions; False if that is not certain."""
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
    """Return centre and radius of a ball that a geom never leaves; with `normal`, in this direction alone."""
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
