"""
The messages between the page and the program, and the numbers of an arm in them.

All goes over one WebSocket. The page asks, the program answers; nothing is sent unasked, so nothing piles up for a page
that is slow or hangs.

**The page sends** JSON objects, `{"do": ...}` with the other keys of the action:

    {"do": "frame"}, of a log {"do": "frame", "time": s}    ask for the newest state, or the one at a time
    {"do": "pause", "value": true}, {"do": "step"}, {"do": "reset"}
    {"do": "effort", "joint": name, "value": N m or N}      to be repeated while held; null lets go
    {"do": "pull", "body": name, "point": [x, y], "to": [x, y]}   a spring from a point of the body, in its frame, to a
                                                            point of the plane, m; to be repeated while held
    {"do": "release"}                                       lets go of all that this page holds
    {"do": "set", "name": name, "value": number or list}    gravity, damping, real_time_factor, payload_mass

**The program answers a request for a frame** with what is new since the last one, as JSON, then with the frame:

    {"scene": [arm, ...], "revision": n, "source": "chain", "live" or "log"}     each arm as Scene.described
    {"status": {...}}       sentence, paused, what can be done, values of `set`
    {"events": [{"tick", "kind", "data"}, ...]}
    {"refused": sentence}   an action that had no effect

**Of a log** the page asks besides, and gets an answer at once:

    {"do": "series", "begin": s, "end": s, "count": rows}   a window of the charts, at most so many rows of each arm
    {"do": "event", "time": s, "forward": true}             {"found": event}: the next, or the last one before; null
    {"do": "trail", "body": name, "point": [x, y], "begin": s, "end": s}    where that point of the body was

**A frame** is little-endian float64: the revision of the scene that it belongs to, then for each arm

    time s, tick, kinetic and potential energy J, real-time factor, lateness s
    positions, velocities, efforts                          `joints` each
    x, y, angle                                             per joint: where it reads 0, see below
    x, y, angle, x and y of the mass centre, force x, y, moment         per body, in the plane, m, rad, N, N m
    x, y of the start, x, y of the end                      per segment that draws a body, in body order

**The rows of a window** begin with -1, the revision and the number of arms, then for each arm the number of rows and of
columns, 1 where all states were read and 0 where they are samples, the times, s, and the least and the greatest values
of each row: positions, velocities, efforts, kinetic and potential energy and their sum.

**A trail** begins with -2, the revision and the number of arms, then for each arm the number of points, their times, x
and y; none of an arm that has no such body.

NaN stands for what is unknown. A slide that reads q has its joint point at (x, y) + q (cos angle, sin angle); a body
that turns about its joint point (x, y) and reads q has the angle `angle` + axis q.
"""
from __future__ import annotations

from math import inf, isfinite
from typing import Any, Iterable, Mapping, NamedTuple, Optional

import numpy as np

from ..chain.chain import Chain
from ..chain.tree import BASE, Body
from ..chain.visual import body_color, own_end
from ..mechanics.body_lines import body_lines
from ..mechanics.body_poses import body_poses
from ..mechanics.dynamics import energy
from ..mechanics.loads import Wrench

SERIES, TRAIL = -1.0, -2.0   # in place of a revision, at the beginning of the rows of a window and of a trail
WEIGHT = 9.81   # N/kg, of which the sliders must hold what a joint carries


class State(NamedTuple):
    """An arm at one instant: s, ticks, arrays (joints,) in rad or m, N m or N; wrenches by body; NaN is unknown."""

    time: float
    tick: float
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    wrenches: Mapping[str, Wrench] = {}
    real_time_factor: float = np.nan
    lateness: float = np.nan


class Scene:
    """A chain as the page draws it. `own`: number of bodies that are no payloads; None: all."""

    def __init__(self, chain: Chain, own: Optional[int] = None) -> None:
        self.chain, self._own = chain, len(chain.bodies) if own is None else own
        self._carriers = np.array([body.carrier for body in chain.bodies])
        self._zeros = [(index, body, joint) for index, body in enumerate(chain.bodies)
                       for joint in (body.slide, body.rotation) if joint is not None]
        self._segments = [len(lines) for lines in body_lines(chain, np.zeros(chain.joint_count))]

    def described(self) -> dict:
        """Return the arm as the page gets it once: names, looks, limits; null where there is no limit."""
        chain, reach = self.chain, self._reach()
        outboard = self._outboard_mass()
        joints = []
        for index, body, joint in self._zeros:
            span = joint.effort_limit
            if not isfinite(span):   # enough to hold all that it carries, stretched out
                span = _round_up(WEIGHT * outboard[index] * (reach[index] if joint.kind == 'rotation' else 2.0))
            joints.append({'name': joint.name, 'kind': joint.kind, 'body': index, 'axis': joint.axis,
                           'lower': _number(joint.lower), 'upper': _number(joint.upper), 'rest': joint.rest,
                           'stiffness': joint.stiffness, 'effort_limit': _number(joint.effort_limit), 'span': span})
        bodies = [{'name': body.name, 'carrier': body.carrier, 'mass': body.mass, 'segments': count,
                   'payload': index >= self._own, 'color': '#' + ''.join(
                       f'{round(255 * part):02x}' for part in body_color(chain, index)[:3])}
                  for index, (body, count) in enumerate(zip(chain.bodies, self._segments))]
        far = max((abs(body.origin) + _stroke(body) + reach[index] for index, body in enumerate(chain.bodies)
                   if body.carrier == BASE), default=1.0)
        return {'name': chain.name, 'bodies': bodies, 'joints': joints, 'reach': far or 1.0}

    def numbers(self, state: State) -> np.ndarray:
        """Return the part of a frame that is about this arm."""
        chain = self.chain
        known = bool(np.isfinite(state.velocity).all())
        kinetic, potential = energy(chain, state.position, state.velocity if known else np.zeros(chain.joint_count))
        kinetic = kinetic if known else np.nan
        point, angle, center = body_poses(chain, state.position)
        bodies = np.zeros((len(chain.bodies), 8))
        bodies[:, :2], bodies[:, 2], bodies[:, 3:5] = point, angle, center
        for name, wrench in state.wrenches.items():
            index = chain.body_index.get(name)
            if index is not None:
                force = wrench.force * (np.exp(1j * angle[index]) if wrench.axes == 'body' else 1.0)
                bodies[index, 5:] = force.real, force.imag, wrench.moment
        zeros = [self._zero(body, joint, point, angle, index) for index, body, joint in self._zeros]
        lines = [(start.real, start.imag, end.real, end.imag) for lines in body_lines(chain, state.position)
                 for start, end in lines]
        head = (state.time, state.tick, kinetic, potential, state.real_time_factor, state.lateness)
        return np.concatenate([head, state.position, state.velocity, state.effort, np.ravel(zeros), bodies.ravel(),
                               np.ravel(lines)])

    def _zero(self, body: Body, joint: Any, point: np.ndarray, angle: np.ndarray, index: int) -> tuple:
        """Return where a joint reads 0: x, y, angle."""
        carrier = body.carrier
        start, turn = (0j, 0.0) if carrier == BASE else (complex(*point[carrier]), angle[carrier])
        if joint.kind == 'slide':
            zero = start + body.origin * np.exp(1j * turn)
            return zero.real, zero.imag, turn + joint.axis
        return (*point[index], turn + body.angle)

    def _outboard_mass(self) -> list[float]:
        """Return for each body its mass with all that it carries, kg."""
        masses = [body.mass for body in self.chain.bodies]
        for index in reversed(range(len(masses))):
            if self._carriers[index] != BASE:
                masses[self._carriers[index]] += masses[index]
        return masses

    def _reach(self) -> list[float]:
        """Return for each body how far from its joint point it and what it carries can come, m."""
        bodies = self.chain.bodies
        reach = [max([abs(end) for end in own_end(body)] + [2.0 * abs(body.center_of_mass)]) for body in bodies]
        for index in reversed(range(len(bodies))):
            body = bodies[index]
            if body.carrier != BASE:
                reach[body.carrier] = max(reach[body.carrier], abs(body.origin) + _stroke(body) + reach[index])
        return reach


def frame(revision: int, arms: Iterable[np.ndarray]) -> bytes:
    """Return a frame of these arms' numbers."""
    return np.concatenate([[float(revision)], *arms]).astype('<f8').tobytes()


def _number(value: float) -> Optional[float]:
    return value if isfinite(value) else None


def _stroke(body: Body) -> float:
    """Return how far a slide leads at least, m."""
    slide = body.slide
    if slide is None:
        return 0.0
    ends = [abs(end) for end in (slide.lower, slide.upper) if abs(end) < inf]
    return max(*ends, abs(slide.position), abs(slide.rest))


def _round_up(value: float) -> float:
    """Return the next of 1, 2, 5, 10, 20, ... that is not smaller."""
    if not 0.0 < value < 1e12:
        return 1.0
    ten = 10.0 ** np.floor(np.log10(value))
    return float(next(step * ten for step in (1.0, 2.0, 5.0, 10.0) if step * ten >= value * (1 - 1e-9)))
