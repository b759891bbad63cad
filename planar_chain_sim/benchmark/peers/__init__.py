"""
Other libraries on the same chains, in the same run: their common interface, and which are installed.

A peer is an object with `version`; `evaluation(chain, position, velocity, effort)`, a compiled loop of forward dynamics
called with a count, where it has one; `curves(problem)`, its methods of integration. Missing, raised when it is made,
says why it cannot take part.
"""
from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Callable, Iterable, NamedTuple, Sequence

from .compiled import Missing

PEERS = {'Pinocchio': 'pinocchio_peer', 'MuJoCo': 'mujoco_peer', 'heyoka': 'heyoka_peer', 'SciPy': 'scipy_peer',
         'Drake': 'drake_peer'}


class Run(NamedTuple):
    """One integration of a problem, ready to be timed: `go()` from start to end; `end()` what the last one gave."""

    go: Callable[[], None]
    end: Callable[[], tuple]   # joint positions (joints,), evaluations, steps, rejected steps; None where not counted


@dataclass(frozen=True)
class Curve:
    """A method of a library and the settings, from coarse to fine, that make its curve of CPU time against error."""

    library: str
    method: str
    kind: str                          # 'step', s, or 'tolerance'
    settings: Sequence[float]
    start: Callable[[float], Run]      # for one setting; what it prepares is not timed


def steps_of(duration: float, least: float = 50.0, most: float = 2e6) -> list[float]:
    """Return step sizes, s, that divide `duration`: from `least` to `most` steps per second by factors of sqrt 2."""
    counts, rate = [], least
    while rate <= most:
        counts.append(max(1, round(duration * rate)))
        rate *= 2.0**0.5
    return [duration / count for count in counts]


def half_decades(first: int, last: int) -> list[float]:
    """Return the tolerances 10^first, 10^(first - 1/2), ..., 10^last."""
    return [10.0**(k / 2) for k in range(2 * first, 2 * last - 1, -1)]


def open_peers(names: Iterable[str] = PEERS) -> tuple[dict[str, object], dict[str, str]]:
    """Return those of the peers that are there, compiled where need be, and why the others are not, by name."""
    found, missing = {}, {}
    for name in names:
        try:
            found[name] = import_module(f'{__name__}.{PEERS[name]}').Peer()
        except Missing as reason:
            missing[name] = str(reason)
        except ImportError as error:
            missing[name] = f'not installed ({error})'
    return found, missing
