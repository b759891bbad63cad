"""One log, or two laid over one another: their states at any time that a page asks for."""
from __future__ import annotations

import asyncio
from bisect import bisect_right
from math import inf
from time import monotonic
from typing import Any, Mapping, Optional, Sequence

import numpy as np

from .scene import frame, Scene, SERIES, State, TRAIL
from .source import KEPT, REPEATED, Source
from ..chain.quantities import changed_chain, QUANTITIES
from ..errors import LogError, Mistake
from ..mechanics.body_poses import body_poses
from ..mechanics.dynamics import energy
from ..mechanics.loads import Wrench
from ..recording.events import EVENTS
from ..recording.seekable_log import SeekableLog

MOST_ROWS = 2000        # of a chart
TRAIL_POINTS = 300
SAMPLES = 60            # states of a window too long to be read as a whole, for the energy
FIRST_LOOK = 5.0        # s for the events that a page is told at once
SEARCH_TIME = 3.0       # s for the search of the next event
FIRST_SPAN = 2.0        # s of the log that the search reads first
SEARCHED = frozenset(EVENTS).difference(REPEATED)   # kinds


class LogSource(Source):
    """
    Shows the run in a log, and that in a second one over it, until the process ends; LogError: one cannot be read.

    Each page has its own time. Gravity, damping and wrenches are those of the time that is shown, as far as the events
    have been read; payloads are not drawn.
    """

    kind = 'log'

    def __init__(self, paths: Sequence[str]) -> None:
        super().__init__()
        self._logs = [SeekableLog(path) for path in paths]
        self._scenes = [Scene(log.chain) for log in self._logs]
        # (tick, scene, wrenches) since when they hold, of each log; their ticks apart, for the search
        self._changes: list[list] = [[(-1, scene, {})] for scene in self._scenes]
        self._said = ''
        self.show(self._scenes)
        self._tell_status()

    def _tell_status(self) -> None:
        first = self._logs[0]
        torn = [log.path.name for log in self._logs if not log.complete]
        sentence = f'{first.last_time - first.first_time:.3f} s in ticks of {1e3 * first.settings["step"]:g} ms'
        if torn:
            sentence += f'; {" and ".join(torn)} was not closed properly and is shown up to its last whole part'
        self.status = {
            'sentence': sentence + self._said, 'fault': False, 'paused': True, 'name': str(first.path), 'can': [],
            'values': {},
            'log': [{'name': log.path.name, 'first': log.first_time, 'last': log.last_time,
                     'step': log.settings['step']} for log in self._logs]}

    async def frame(self, request: Mapping[str, Any]) -> Optional[bytes]:
        """Return the frame of a time; LogError: the log is damaged there."""
        return await asyncio.to_thread(self._frame, request.get('time', self._logs[0].first_time))

    def _frame(self, time: float) -> bytes:
        arms = []
        for log, changes in zip(self._logs, self._changes):
            state = log.state_at(time)
            _, scene, wrenches = changes[bisect_right(changes, state.tick, key=lambda change: change[0]) - 1]
            arms.append(scene.numbers(State(state.time, state.tick, state.position, state.velocity, state.effort,
                                            wrenches)))
        return frame(self.shown.revision, arms)

    async def answer(self, question: Mapping[str, Any]) -> Any:
        """Return the rows of a window for the charts, or the event after or before a time; Mistake."""
        if question['do'] == 'series':
            return await asyncio.to_thread(self._series, question['begin'], question['end'], question['count'])
        if question['do'] == 'event':
            return {'found': await asyncio.to_thread(self._event_near, question['time'], question['forward'])}
        if question['do'] == 'trail':
            return await asyncio.to_thread(self._trail, question['body'], complex(*question['point']),
                                           question['begin'], question['end'])
        return await super().answer(question)

    def _series(self, begin: float, end: float, count: float) -> bytes:
        parts: list = [[SERIES, self.shown.revision, len(self._logs)]]
        for log in self._logs:
            rows = log.series(begin, end, int(min(max(count, 1), MOST_ROWS)))
            stored = self._energy(log, rows)
            for_rows = [np.concatenate([*side, stored], axis=1) for side in (rows.low, rows.high)]
            parts += [[*for_rows[0].shape, rows.exact], rows.time, *(np.ravel(side) for side in for_rows)]
        return np.concatenate(parts).astype('<f8').tobytes()

    def _trail(self, body: str, point: complex, begin: float, end: float) -> bytes:
        parts: list = [[TRAIL, self.shown.revision, len(self._logs)]]
        for log in self._logs:
            index, ticks = log.chain.body_index.get(body), range(log.tick_at(begin), log.tick_at(end) + 1)
            if index is None:
                parts.append([0])
                continue
            chosen = np.unique(np.linspace(0, len(ticks) - 1, TRAIL_POINTS).astype(int)).tolist() if ticks else []
            states = [log.state_at(ticks[k] * log.settings['step']) for k in chosen]
            position = np.array([state.position for state in states]).reshape(-1, log.chain.joint_count)
            poses = body_poses(log.chain, position)
            place = poses.point[:, index] @ [1.0, 1.0j] + point * np.exp(1j * poses.angle[:, index])
            parts += [[len(states)], [state.time for state in states], place.real, place.imag]
        return np.concatenate(parts).astype('<f8').tobytes()

    def _energy(self, log: SeekableLog, rows: Any) -> np.ndarray:
        """Return kinetic and potential energy and their sum, J, of rows; between samples where not all was read."""
        time = rows.time
        if not len(time):
            return np.zeros((0, 3))
        sampled = time if rows.exact else time[np.unique(np.linspace(0, len(time) - 1, SAMPLES).astype(int))]
        states = [log.state_at(each) for each in sampled.tolist()]
        changes = self._changes[self._logs.index(log)]
        chains = [changes[bisect_right(changes, state.tick, key=lambda change: change[0]) - 1][1].chain
                  for state in states]
        parts = np.zeros((len(states), 2))
        for chain in {id(chain): chain for chain in chains}.values():
            chosen = [k for k, each in enumerate(chains) if each is chain]
            parts[chosen] = np.transpose(energy(chain, np.array([states[k].position for k in chosen]),
                                                np.array([states[k].velocity for k in chosen])))
        kinetic, potential = (np.interp(time, sampled, part) for part in parts.T)
        return np.transpose([kinetic, potential, kinetic + potential])

    def _event_near(self, time: float, forward: bool) -> Optional[dict]:
        """Return the first event after the tick at a time, or the last one before; Mistake: it takes too long."""
        log, until, span = self._logs[0], monotonic() + SEARCH_TIME, FIRST_SPAN
        tick, step = log.tick_at(time), log.settings['step']
        begin = end = tick * step
        while begin > log.first_time if not forward else end < log.last_time:
            begin, end = (end, end + span) if forward else (begin - span, begin)
            found = [event for event in log.events.between(begin, end, kinds=SEARCHED)
                     if (event['tick'] > tick if forward else event['tick'] < tick)]
            if found:
                return found[0 if forward else -1]
            if monotonic() > until:
                raise Mistake(f'no event {"up to" if forward else "down to"} '
                              f'{max(log.first_time, begin) if not forward else end:.3f} s, where the search ended')
            span *= 2.0
        return None

    def _run(self) -> None:
        """Read the events that all pages are told: of the first log, and what they change in both."""
        for index, log in enumerate(self._logs):
            until, told = monotonic() + FIRST_LOOK, 0
            try:
                for event in log.events:
                    self._follow(index, event)
                    told += event['kind'] not in REPEATED
                    if not index:
                        self.events.say(event)
                    if self._stopping:
                        return
                    if told >= KEPT // 2 or monotonic() > until:
                        if not index:
                            self._said = f'; events are listed up to {event["tick"] * log.settings["step"]:.3f} s'
                            self._tell_status()
                        break
            except LogError as error:
                self.complaints.say(str(error))

    def _follow(self, index: int, event: Mapping[str, Any]) -> None:
        """Note how an event changes what is drawn."""
        changes, kind, data = self._changes[index], event['kind'], event['data']
        _, scene, wrenches = changes[-1]
        if kind == 'wrench':
            wrench = Wrench(complex(*data.get('force', (0.0, 0.0))), data.get('moment', 0.0), data.get('axes', 'body'))
            wrenches = {**wrenches, data['body']: wrench}
        elif kind == 'reset':
            wrenches = {}
        elif kind == 'parameter' and data['name'] in QUANTITIES:
            values = [inf if each is None else each for each in data['value']]
            scene = Scene(changed_chain(scene.chain, data['name'], values))
        else:
            return
        changes.append((event['tick'], scene, wrenches))
