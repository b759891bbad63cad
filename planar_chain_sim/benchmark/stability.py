"""Scenes that try to break the integrator, each with numbers checked against limits; also by MuJoCo where it can."""
from __future__ import annotations

from typing import Iterator

from .scenes import Check
from .scenes.damaged_files import chain_files
from .scenes.flood import messages
from .scenes.friction import holding, ramp, short_slips
from .scenes.inputs import efforts, ticks
from .scenes.joint_family import at_random
from .scenes.masses import mass_ratios, massless
from .scenes.motion import free_chain, let_go, long_pendulum, rope, spun, stiff, turns
from .scenes.stops import bouncing, grazing, resting, stop_at_speed, together
from ..errors import Mistake

COLUMNS = ('scene', 'what must hold', 'at most', 'measured', 'holds', 'MuJoCo')

SCENES = {
    'double pendulum': long_pendulum, 'spinning free chain': free_chain, 'mass ratios': mass_ratios,
    'massless': massless, 'let go from across': let_go, 'rope': rope, 'spun to 1000 rad/s': spun, 'stiff laws': stiff,
    'a million turns': turns,
    'stop hit at 100 rad/s': stop_at_speed, 'grazing a stop': grazing, 'two stops at once': together,
    'bouncing to rest': bouncing, 'an hour on a stop': resting, 'an hour held by friction': holding,
    'stick and slip': ramp, 'slips of a few ms': short_slips, 'friction and stops at random': at_random,
    'efforts': efforts, 'ticks': ticks, 'chain files': chain_files, 'messages to the node': messages,
}


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """
    Yield a row of COLUMNS per number; `quick` takes a small part of the long ones.

    MuJoCo has its defaults, our ticks, implicitfast, or RK4 where that is better and motion is smooth.
    Mistake: no mpmath, without which there are no 50 digits.
    """
    try:
        import mpmath  # noqa: F401
    except ImportError as error:
        raise Mistake(f'the scenes need mpmath, the extra [benchmark] ({error})') from None
    for name, scene in SCENES.items():
        for check in scene(peers, 0.002 if quick else 1.0):
            yield row_of(name, check)


def row_of(scene: str, check: Check) -> tuple:
    """Return a check of a scene as a row of COLUMNS."""
    def number(value):
        return value if value is None or isinstance(value, str) else float(value)
    return scene, check.what, float(check.limit), number(check.measured), check.holds, number(check.mujoco)


def draw(table: list[tuple], path) -> None:
    """Draw four scenes over time, and all checks against their limits."""
    from . import stability_picture
    stability_picture.draw(table, path)
