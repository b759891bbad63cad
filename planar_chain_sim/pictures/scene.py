"""
Scene: a motion as strokes in pixels, to scale, for every kind of moving picture.

Bodies, joints, mass centres, slide rails, springs of slides, stops, forces from outside, trails, a grid and the time.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Optional, Union

import numpy as np

from ..chain.chain import Chain
from ..chain.tree import BASE, Joint
from ..chain.visual import body_color
from ..mechanics.body_lines import body_lines
from ..mechanics.body_poses import body_poses

SAMPLE = 0.01             # s of the picture's own time between two rows of positions
LEAST = 200               # px, of either side: the time and the width of the grid stand beside each other
AWAY = -1000.0 - 1000.0j  # px: out of the picture
FORCE = 0.18              # length of the largest force, of the wider side
FAR = 4.0                 # times its own size: an arm that goes further is followed
MOST_LINES = 20_000       # of the grid in one direction, over all that is seen


class Stroke(NamedTuple):
    """
    A polyline with round ends, in front of those before it; one point is a dot.

    `color`: 'ink', 'faint', 'paper', or red, green, blue and opacity. `points` (rows or 1, points), complex, px from
    the upper left corner, x right and y down; one row: it stands still, in the world.
    """

    color: Union[str, tuple]
    width: float
    points: np.ndarray


class Trail(NamedTuple):
    """The way of a point in the world: its colour, and `points` (rows,), complex, px. A picture shows the last part."""

    color: tuple
    points: np.ndarray


class Force(NamedTuple):
    """A force on a body's joint point in rows `first` to `last`: complex, N; in the body's axes, or in the world's."""

    body: int
    first: int
    last: int
    force: complex
    turns: bool


@dataclass(frozen=True)
class Look:
    """How a motion is shown; `speed`: simulated seconds per second of the picture."""

    speed: float = 1.0
    size: int = 480                            # px, of the wider side
    trail: float = 1.0                         # s of the picture's time, 0 for none
    traced: list = field(default_factory=list)    # (body, complex point in its frame, m, or None for its end)
    start: float = 0.0                         # s, simulated time of the first row
    forces: list = field(default_factory=list)    # of Force


class Scene:
    """
    The strokes of a motion `position` (rows, joints), a row every SAMPLE * look.speed s.

    width, height: px, even; `head`: of the height, above the plane, for text. behind, trails, strokes: what is drawn,
    in this order; labels: text (x, y, anchor, text). shift: (rows,) complex px, by which trails and what stands in the
    world are moved, zero unless an arm that goes far is followed. ValueError: bad shape, non-finite value.
    """

    def __init__(self, chain: Chain, position: np.ndarray, look: Look):
        self.look, self.rows, self.title = look, len(position), chain.name
        self.unit = look.size / 480
        self.font = max(12.0, 13.0 * self.unit**0.7)       # px
        self._chain, self._position = chain, position
        self._lines, poses = body_lines(chain, position), body_poses(chain, position)
        self._point, self._turn = poses.point @ (1.0, 1.0j), np.exp(1j * poses.angle)
        center, ways = poses.center_of_mass @ (1.0, 1.0j), [self._way(*each) for each in look.traced]
        base = np.array([body.origin for body in chain.bodies if body.carrier == BASE])
        middle = center @ np.array([body.mass for body in chain.bodies]) / sum(body.mass for body in chain.bodies)
        ends = [end for body in self._lines for line in body for end in line]
        self._frame([self._point, center, *(each[:, None] for each in (*ends, *(way for _, way in ways)))], base,
                    middle)
        lengths = [np.abs(end - start).max() for body in self._lines for start, end in body]
        thick = float(np.clip(0.16 * self.scale * np.median(lengths), 2.0, 4.2)) * self.unit
        colors = [body_color(chain, k) for k in range(len(chain.bodies))]
        self.behind = [*self._ground(base), *self._guides(1.2 * self.unit)]
        self.trails = [Trail(colors[body], self.px(way)) for body, way in ways] if look.trail else []
        self.strokes = [self._stroke(color, thick, line)
                        for color, body in zip(colors, self._lines) for line in body]
        for color, point, middle in zip(colors, self._point.T, center.T):
            ring = self._stroke(color, 2.0 * thick, [point])
            self.strokes += [ring, Stroke('paper', 0.9 * thick, ring.points),
                             self._stroke('ink', 0.8 * thick, [middle])]
        self.strokes += self._arrows(0.7 * thick)

    def px(self, places: np.ndarray) -> np.ndarray:
        """Return places of the plane, complex, m, as complex px, which `shift` is to be added to."""
        away = np.conj((places - self._corner) * self.scale)
        return away + 1j * self.height

    def time(self, row: int) -> str:
        """Return the text of the simulated time at a row."""
        step = SAMPLE * self.look.speed
        digits = int(np.clip(np.ceil(-np.log10(step)), 2, 9))
        return f't = {self.look.start + row * step:.{digits}f} s'

    def _way(self, body: int, point: Optional[complex]) -> tuple:
        """Return a body and the way of a point in its frame, or of the end of its last line."""
        return body, self._lines[body][-1][1] if point is None else self._point[:, body] + point * self._turn[:, body]

    def _frame(self, points: list, base: np.ndarray, middle: np.ndarray) -> None:
        """Set scale, size and shift so that all points (rows, any), and the base, are in the picture."""
        places = np.concatenate(points, axis=1)
        own = max(np.ptp(places.real, axis=1).max(), np.ptp(places.imag, axis=1).max(), 1e-9)
        seen = np.append(places, base)
        follows = max(np.ptp(seen.real), np.ptp(seen.imag)) > FAR * own
        if follows:
            seen = places - middle[:, None]
        low, high = (complex(pick(seen.real), pick(seen.imag)) for pick in (np.min, np.max))
        self._reach = max((high - low).real, (high - low).imag, 1e-9)
        low, high = low - 0.07 * self._reach * (1 + 1j), high + 0.07 * self._reach * (1 + 1j)
        self.head, self.scale = 2.0 * self.font, self.look.size / (1.14 * self._reach)
        width, height = (max(LEAST, int(side * self.scale + 0.5)) for side in ((high - low).real, (high - low).imag))
        self.width, self.height = width + width % 2, int(height + self.head + 1.5) // 2 * 2
        spare = complex(self.width, self.height - self.head) / self.scale - (high - low)
        self._corner = low - 0.5 * spare     # of the lower left
        self.shift = -np.conj(middle * self.scale) if follows else np.zeros(self.rows, complex)

    def _ground(self, base: np.ndarray) -> list:
        """Return the grid, and a triangle below each point of the base that carries a body; sets the labels."""
        power = 10.0**np.floor(np.log10(self._reach / 3))
        step = max(factor * power for factor in (1, 2, 5) if factor * power <= self._reach / 3)
        # all of the plane that is seen at some time, px and m
        left, top = -self.shift.real.max(), self.head - self.shift.imag.max()
        right, floor = self.width - self.shift.real.min(), self.height - self.shift.imag.min()
        low, high = (self._corner + complex(x, self.height - y) / self.scale for x, y in ((left, floor), (right, top)))
        strokes = []
        if not max((high - low).real, (high - low).imag) < MOST_LINES * step:   # the arm passes all too fast to be seen
            low = high = 0.5j * step - 0.5 * step   # no line
        for k in range(int(np.ceil(low.real / step)), int(np.floor(high.real / step)) + 1):
            x = self.px(np.array(k * step + 0j)).real
            strokes.append(Stroke('grid', 1.0, np.array([[x + 1j * top, x + 1j * floor]])))
        for k in range(int(np.ceil(low.imag / step)), int(np.floor(high.imag / step)) + 1):
            y = self.px(np.array(k * step * 1j)).imag
            strokes.append(Stroke('grid', 1.0, np.array([[left + 1j * y, right + 1j * y]])))
        size = 8.0 * self.unit
        for place in np.unique(self.px(base)):
            strokes.append(Stroke('faint', 1.6 * self.unit, np.array(
                [[place, place + size * (1.5j - 0.9), place + size * (1.5j + 0.9), place]])))
        self.labels = [(self.width - 0.7 * self.font, 1.35 * self.font, 'end', f'grid {step:g} m')]
        return strokes

    def _guides(self, thin: float) -> list:
        """Return the rails and springs of slides, and the stops of all joints."""
        strokes, joints = [], {joint.name: k for k, joint in enumerate(self._chain.joints)}
        for k, body in enumerate(self._chain.bodies):
            turn = np.ones(1) if body.carrier == BASE else self._turn[:, body.carrier]
            if body.slide is not None:
                strokes += self._rail(k, body.slide, self._position[:, joints[body.slide.name]],
                                      np.exp(1j * body.slide.axis) * turn, thin)
            if body.rotation is not None and body.rotation.upper - body.rotation.lower < 2.0 * np.pi:
                start, end = (each[0] for each in self._lines[k][0])
                own = np.angle((end - start) * np.conj(self._turn[0, k])) if end != start else 0.0
                for stop in (body.rotation.lower, body.rotation.upper):
                    along = turn * np.exp(1j * (body.angle + body.rotation.axis * stop + own)) * self._reach
                    strokes.append(self._stroke('faint', 1.5 * thin, [
                        self._point[:, k] + share * along for share in (0.035, 0.075)]))
        return strokes

    def _rail(self, k: int, slide: Joint, moved: np.ndarray, along: np.ndarray, thin: float) -> list:
        """Return the rail on which a body slides by `moved`, m, its stops, if they are near, and its spring."""
        zero, ends, strokes = self._point[:, k] - moved * along, [], []
        for stop, reached, side in ((slide.lower, moved.min(), -1.0), (slide.upper, moved.max(), 1.0)):
            near = abs(stop - reached) < 0.3 * self._reach
            ends.append(zero + (stop if near else reached + 0.05 * side * self._reach) * along)
            if near:
                cap = 0.018j * self._reach * along
                strokes.append(self._stroke('faint', 1.5 * thin, [ends[-1] - cap, ends[-1] + cap]))
        strokes.append(self._stroke('faint', thin, ends))
        if slide.stiffness:
            across, way = 0.016j * self._reach * along, self._point[:, k] - ends[0]
            strokes.append(self._stroke('faint', thin, [ends[0] + share * way + side * across for share, side in zip(
                (0.0, 0.1, *np.linspace(0.15, 0.85, 8), 0.9, 1.0), (0, 0, 1, -1, 1, -1, 1, -1, 1, -1, 0, 0))]))
        return strokes

    def _arrows(self, width: float) -> list:
        """Return an arrow for each body on which a force acts at some time."""
        strokes, largest = [], max((abs(each.force) for each in self.look.forces), default=0.0)
        for k in sorted({each.body for each in self.look.forces if each.force}):
            tips = np.zeros(self.rows, complex)
            for each in self.look.forces:
                if each.body == k:
                    rows = slice(each.first, each.last + 1)
                    tips[rows] = each.force / largest * (self._turn[rows, k] if each.turns else 1.0)
            arrow = self.px(self._point[:, k, None] + FORCE * self._reach * tips[:, None] * [
                0.0, 1.0, 0.75 + 0.12j, 1.0, 0.75 - 0.12j])
            strokes.append(Stroke('ink', width, np.where(tips[:, None] == 0.0, AWAY, arrow + self.shift[:, None])))
        return strokes

    def _stroke(self, color, width: float, points) -> Stroke:
        """Return a stroke through points (rows,) or (1,), m; one row, if it stands still in the world."""
        places = self.px(np.stack(np.broadcast_arrays(*points), axis=-1))
        still = np.abs(places - places[0]).max() < 1e-3
        return Stroke(color, width, places[:1] if still else places + self.shift[:, None])
