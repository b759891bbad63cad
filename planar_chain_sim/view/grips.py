"""What pages hold: efforts by a slider, bodies by the mouse. What a page does not renew in time is let go."""
from __future__ import annotations

from time import monotonic
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np

from ..chain.chain import Chain
from ..errors import Mistake
from ..mechanics.body_poses import body_poses, body_velocities, jacobian
from ..mechanics.dynamics import mass_matrix

PATIENCE = 0.5       # s after which an effort or a pull ends that a page has not renewed
FREQUENCY = 12.0     # rad/s of the lightest mass that a pull can meet, on its spring
DAMPING = 0.7        # of that, relative to the critical one
STRONGEST = 20.0     # N per kg of the whole arm: twice its weight


class Pull(NamedTuple):
    """
    A spring between a point of a body, in its frame, and a point of the plane, m.

    stiffness N/m, damping N s/m; `most`: the greatest force of the spring, N.
    """

    body: str
    point: complex
    to: complex
    stiffness: float
    damping: float
    most: float

    def load(self, chain: Chain, position: np.ndarray, velocity: np.ndarray) -> tuple[complex, float, float]:
        """Return force, in the plane's axes, N, moment about the body's joint point, N m, and the body's angle, rad."""
        index = chain.body_index[self.body]
        poses, rates = body_poses(chain, position), body_velocities(chain, position, velocity)
        angle = float(poses.angle[index])
        arm = self.point * np.exp(1j * angle)
        place = complex(*poses.point[index]) + arm
        rate = complex(*rates.point[index]) + 1j * float(rates.angle[index]) * arm
        spring = self.stiffness * (self.to - place)
        force = spring * min(1.0, self.most / max(abs(spring), 1e-300)) - self.damping * rate
        return force, (arm.conjugate() * force).imag, angle


def make_pull(chain: Chain, position: np.ndarray, body: str, point: complex, to: complex) -> Pull:
    """
    Return a pull of `point`, m in the body's frame, to `to`, m in the plane; `position` (joints,), rad or m.

    Its spring suits the mass that it meets in the lightest direction. Mistake: the point cannot move.
    """
    moves = jacobian(chain, position, body, (point.real, point.imag))[:2]
    if not moves.any():
        raise Mistake(f'body {body!r} cannot be pulled, it is welded to the base')
    try:
        ease = float(np.linalg.eigvalsh(moves @ np.linalg.solve(mass_matrix(chain, position), moves.T))[-1])
    except np.linalg.LinAlgError:
        ease = np.inf
    if not 0.0 < ease < np.inf:
        raise Mistake(f'body {body!r} cannot be pulled here, the configuration is singular')
    mass = 1.0 / ease
    return Pull(body, point, to, mass * FREQUENCY**2, 2.0 * DAMPING * mass * FREQUENCY,
                STRONGEST * sum(each.mass for each in chain.bodies))


class Grips:
    """Efforts by joint and pulls by body, each with the page that holds it and until when."""

    def __init__(self) -> None:
        self._efforts: dict[str, tuple[Any, float, float]] = {}
        self._pulls: dict[str, tuple[Any, Pull, float]] = {}

    def hold(self, page: Any, chain: Chain, joint: str, value: Optional[float]) -> None:
        """Hold an effort, N m or N, for a while; None lets go. Mistake: no such joint."""
        if joint not in chain.joint_names:
            raise Mistake(f'{joint!r:.80} is no joint of {chain.name}')
        if value is None:
            self._efforts.pop(joint, None)
        else:
            self._efforts[joint] = page, value, monotonic() + PATIENCE

    def pull(self, page: Any, chain: Chain, position: np.ndarray, body: str, point: Sequence[float],
             to: Sequence[float]) -> None:
        """
        Pull `point`, m in the body's frame, by a spring to `to`, m in the plane, for a while.

        Mistake: no such body, or it cannot move.
        """
        if body not in chain.body_index:
            raise Mistake(f'{body!r:.80} is no body of {chain.name}')
        place, aim = complex(*point), complex(*to)
        before = self._pulls.get(body)
        if before and before[0] is page and before[1].point == place:
            pull = before[1]._replace(to=aim)
        else:
            pull = make_pull(chain, position, body, place, aim)
        self._pulls[body] = page, pull, monotonic() + PATIENCE

    def release(self, page: Any) -> None:
        """Let go of all that a page holds."""
        for held in (self._efforts, self._pulls):
            for name in [name for name, grip in list(held.items()) if grip[0] is page]:
                held.pop(name, None)

    def clear(self) -> None:
        """Let go of everything."""
        self._efforts.clear()
        self._pulls.clear()

    def efforts(self) -> dict[str, float]:
        """Return the efforts that are held, by joint, N m or N."""
        now = monotonic()
        return {joint: value for joint, (_, value, until) in list(self._efforts.items()) if until > now}

    def pulls(self) -> list[Pull]:
        """Return the pulls that are held."""
        now = monotonic()
        return [pull for _, pull, until in list(self._pulls.values()) if until > now]
