"""What is drawn: the run in a log, or the motion of a chain with no effort; and which of its points are traced."""
from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Optional
from warnings import warn

import numpy as np

from ..chain.chain import Chain
from ..chain.section import clipped, suggestion
from ..chain_file import load_chain
from ..command_line import Parser
from ..errors import Mistake
from ..motion.rollout import rollout
from ..recording.events import EVENTS
from ..recording.seekable_log import SeekableLog

CHANGING = [name for name, kind in EVENTS.items() if kind.apply]
ALONE = 8.0     # s: of a chain without --to or --duration
SOURCE = 'chain file (YAML, URDF or MJCF), or an MCAP log'


@dataclass(frozen=True, eq=False)
class Source:
    """
    A motion as arrays: time (ticks+1,) s, position and velocity (ticks+1, joints), effort (ticks, joints).

    `events`: as of Log; none of a chain file. `step`: s.
    """

    name: str
    chain: Chain
    step: float
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    events: list

    def part(self, start: Optional[float], end: Optional[float]) -> Source:
        """Return what lies between two times, s, with all events; None: no bound."""
        slack = 0.5 * self.step
        first = 0 if start is None else int(np.searchsorted(self.time, start - slack))
        last = len(self.time) if end is None else int(np.searchsorted(self.time, end + slack))
        rows, moves = slice(first, last), slice(first, max(first, last - 1))
        return replace(self, time=self.time[rows], position=self.position[rows], velocity=self.velocity[rows],
                       effort=self.effort[moves])

    def say_what_is_missing(self, start: Optional[float], end: Optional[float]) -> None:
        """Warn in one sentence if a part from `start` to `end` was asked for, s, and this is less; None: no bound."""
        first, last, slack = self.time[0], self.time[-1], 1.5 * self.step
        if start is not None and start < first - slack or end is not None and end > last + slack:
            warn(f'{self.name!r} holds no more than is drawn, {first:g} to {last:g} s', RuntimeWarning, stacklevel=2)


def is_log(path: str) -> bool:
    """Whether the path is that of a log."""
    return path.lower().endswith('.mcap')


def no_motion(path: str, first: float, last: float) -> Mistake:
    """Return the Mistake for a part of a run without two states; `first`, `last`: s, what the run holds."""
    return Mistake(f'{clipped(path)!r} has no motion in this time, it holds {first:g} to {last:g} s')


def source_of_chain(path: str, hold: Optional[list], ticks: int, step: float) -> Source:
    """Return `ticks` steps of a chain from its initial state with no effort; Mistake, ChainError."""
    chain = load_chain(path, hold)
    run = rollout(chain, ticks * step, step)
    return Source(Path(path).name, chain, step, run.time, run.position, run.velocity, run.effort, [])


def source_of_log(log: SeekableLog, start: float = -inf, end: float = inf) -> Source:
    """Return the run in a log from a tick before `start` to a tick after `end`, s; Mistake, LogError."""
    if not log.complete:
        warn(f'log {str(log.path)!r}: it was not closed properly, only its whole chunks are drawn', RuntimeWarning,
             stacklevel=2)
    step = log.settings['step']
    begin, stop = max(start - step, log.first_time), min(end + step, log.last_time)
    time, position, velocity, effort = log.states(begin, stop)
    if len(time) < 2:
        raise no_motion(str(log.path), log.first_time, log.last_time)
    before = log.events.between(log.first_time, begin, kinds=CHANGING) if begin > log.first_time else []
    events = [event for event in before if event['tick'] < log.tick_at(begin)] + log.events.between(begin, stop)
    return Source(log.path.name, log.chain, step, time, position, velocity, effort, events)


def add_trace(parser: Parser) -> None:
    """Add `--trace`, for read_trace."""
    parser.add_argument('--trace', action='append', metavar='BODY[=X,Y]', help='draw the path of the end of this body, '
                        'or of a point in its frame, m; can be given several times (default: the ends of all bodies '
                        'that carry nothing)')


def read_trace(texts: Optional[list], chain: Chain) -> list:
    """Return (index of a body, complex point in its frame or None for its end) for each option `--trace`; Mistake."""
    if texts is None:
        carriers = {body.carrier for body in chain.bodies}
        return [(k, None) for k in range(len(chain.bodies)) if k not in carriers]
    return [_traced(text, chain) for text in texts]


def _traced(text: str, chain: Chain) -> tuple:
    name, given, place = text.rpartition('=') if '=' in text else (text, '', '')
    if name not in chain.body_index:
        names = list(chain.body_index)
        raise Mistake(f'--trace {clipped(text)!r}: {chain.name} has no body {clipped(name)!r}'
                      f'{suggestion(name, names)}, its bodies are {clipped(", ".join(names), 200)}')
    if not given:
        return chain.body_index[name], None
    try:
        x, y = map(float, place.split(','))
    except ValueError:
        x = y = np.nan
    if not (abs(x) < 1e9 and abs(y) < 1e9):
        raise Mistake(f'--trace {clipped(text)!r} must end in a point x,y in the frame of the body, two numbers of m')
    return chain.body_index[name], complex(x, y)
