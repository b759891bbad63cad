"""SeekableLog: a log of any size, of which only the chunks that are asked for are read."""
from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import OrderedDict
from pathlib import Path
from threading import Lock
from typing import Any, Collection, Iterator, NamedTuple, Optional

import numpy as np

from .events import decode_event, KIND
from .log_index import LogIndex, read_index
from .mcap_records import beginning_of, content_of, MESSAGE, open_mcap, read_records, whole_records
from .run_settings import readable_settings, simulation_of
from .states import message_heads, StateDecoder
from ..errors import LogError

try:
    from mcap.opcode import Opcode
except ImportError:
    pass   # read_index() says so in words

CACHE_SIZE = 2**24      # bytes of chunks that are kept, on disk
EXACT_SIZE = 2**25      # bytes of chunks up to which series() reads all states of a range ...
EXACT_CHUNKS = 256      # ... if they are no more than these
SAMPLE_SIZE = 2**13     # bytes at the beginning of a chunk that series() reads of it beyond that
GRID = 1e-6             # ticks: a time this little before a tick counts as at the tick


class State(NamedTuple):
    """
    A state of a log. time: s, step * tick. Arrays (joints,): position rad or m, velocity rad/s or m/s, effort N m or N.

    effort: what the actuators gave over the tick before, as in Simulation.effort.
    """

    tick: int
    time: float
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


class Series(NamedTuple):
    """
    The least and the greatest value of rows of ticks: time (rows,), s, of the first tick of each row.

    low, high: (3, rows, joints), position, velocity and effort. exact: all states were read; else samples of them.
    """

    time: np.ndarray
    low: np.ndarray
    high: np.ndarray
    exact: bool


class SeekableLog:
    """
    A log of a run, however long, open for reading at any place; its answers may be asked for from several threads.

    chain: the Chain that the run began with; settings: as Log.settings; complete: the file was closed properly.
    first_time, last_time: s, simulated time, step * tick, of the first and the last state; first_tick, last_tick;
    tick_count: ticks from the first to the last. events: the Events. A log that was cut short ends with its last whole
    chunk. `index`: its LogIndex, if that has been read. LogError, here and where it is read: as load_log, and for a
    log without a state.
    """

    def __init__(self, path: Any, index: Optional[LogIndex] = None) -> None:
        self._index = index = index or read_index(path)
        self.path = Path(path)
        simulation, settings = simulation_of(index.log), index.log.settings
        self.chain, self.complete = simulation.chain, index.log.complete
        self.settings = readable_settings(settings)
        self._step, self._origin = simulation.step, simulation.tick
        self._states, self._event_counts = (index.count_of(settings[key]) for key in ('state_topic', 'events_topic'))
        self._rows = np.flatnonzero(self._states).tolist()   # chunks with states
        if not self._rows:
            raise LogError(f'log {str(path)!r}: it holds no state')
        self._first_ticks: dict = {}                         # chunk -> the tick of its first state
        self._kinds: dict = {}                               # chunk -> the kinds of its events, None where unknown
        self._decoder = StateDecoder(path, self.chain)
        self._lock, self._cache, self._cached = Lock(), OrderedDict(), 0
        self._file = open_mcap(self.path)
        self.first_tick = self._first_tick(self._rows[0])
        self.last_tick = int(self._chunk(self._rows[-1]).tick[-1])
        self.first_time, self.last_time = self.first_tick * self._step, self.last_tick * self._step
        self.tick_count = self.last_tick - self.first_tick
        self.events = Events(self)

    def __enter__(self) -> 'SeekableLog':
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def tick_at(self, time: float) -> int:
        """Return the last tick of the log at or before a time, s; the first, if it is before that."""
        if not time > self.first_time:   # nor NaN
            return self.first_tick
        return int(min(np.floor(time / self._step + GRID), self.last_tick))

    def state_at(self, time: float) -> State:
        """Return the last state at or before a time, s; the first, if that is before it."""
        tick = self.tick_at(time)
        chunk = self._chunk(self._rows[max(self._bisect(tick, after=True) - 1, 0)])
        last = max(int(np.searchsorted(chunk.tick, tick, 'right')) - 1, 0)
        found = int(chunk.tick[last])
        position, velocity, effort = chunk.numbers[last]
        # Of several states of a tick the first has the effort that led there; it may be in a chunk before.
        place = self._bisect(found, after=False)
        for first in (self._chunk(row) for row in self._rows[max(place - 1, 0):place + 1]):
            fresh = int(np.searchsorted(first.tick, found))
            if fresh < len(first.tick) and first.tick[fresh] == found:
                effort = first.numbers[fresh, 2]
                break
        return State(found, found * self._step, position.copy(), velocity.copy(), effort.copy())

    def states(self, begin: float, end: float) -> tuple:
        """
        Return the ticks from `begin` to `end`, s, as load_log does, a row for each: time, position, velocity, effort.

        Shapes (rows,), (rows, joints) twice and (rows - 1, joints): effort[k] led from row k to the next.
        """
        first, last = self.tick_at(begin), self.tick_at(end)
        ticks, numbers = [np.zeros(0, np.int64)], [np.zeros((0, 3, self.chain.joint_count))]
        for row in self._rows[max(self._bisect(first, after=False) - 1, 0):self._bisect(last, after=True)]:
            chunk = self._chunk(row)
            within = (chunk.tick >= first) & (chunk.tick <= last)
            ticks.append(chunk.tick[within])
            numbers.append(chunk.numbers[within])
        tick, number = np.concatenate(ticks), np.concatenate(numbers)
        ahead = np.diff(tick) != 0
        newest, fresh = np.append(ahead, True), np.append(True, ahead)   # of several states of one tick
        return tick[newest] * self._step, number[newest, 0], number[newest, 1], number[fresh, 2][1:]

    def series(self, begin: float, end: float, count: int) -> Series:
        """
        Return at most `count` rows for a chart from `begin` to `end`, s.

        All states of a short range are read; of a long one samples, so that no answer takes long.
        """
        first, last = self.tick_at(begin), self.tick_at(end)
        count = max(int(count), 1)
        rows = self._rows[max(self._bisect(first, after=False) - 1, 0):self._bisect(last, after=True)]
        exact = len(rows) <= EXACT_CHUNKS and int(self._index.length[rows].sum()) <= EXACT_SIZE
        width = max(-(-(last - first + 1) // count), 1)   # ticks in a row
        shape = (max((last - first) // width + 1, 0), 3, self.chain.joint_count)
        low, high, filled = np.full(shape, np.inf), np.full(shape, -np.inf), np.zeros(shape[0], bool)
        if not exact:
            rows = [rows[k] for k in np.unique(np.linspace(0, len(rows) - 1, count).astype(int)).tolist()]
        for row in rows:
            tick, numbers = (self._chunk(row) if exact else self._sample(row))[:2]
            within = (tick >= first) & (tick <= last)
            if within.any():
                place, starts = np.unique((tick[within] - first) // width, return_index=True)
                numbers = numbers[within]
                low[place] = np.minimum(low[place], np.minimum.reduceat(numbers, starts))
                filled[place] = True
                high[place] = np.maximum(high[place], np.maximum.reduceat(numbers, starts))
        time = (first + np.flatnonzero(filled) * width) * self._step
        return Series(time, low[filled].swapaxes(0, 1), high[filled].swapaxes(0, 1), exact)

    def _tick(self, sequence: Any) -> Any:
        """Return ticks of sequence numbers, which are ticks modulo 2^32."""
        return self._origin + (np.asarray(sequence, np.int64) - self._origin) % 2**32

    def _bisect(self, tick: int, after: bool) -> int:
        """Return how many of the chunks with states begin before a tick, or (after) at it or before."""
        return (bisect_right if after else bisect_left)(self._rows, tick, key=self._first_tick)

    def _first_tick(self, row: int) -> int:
        """Return the tick of the first state of a chunk."""
        tick = self._first_ticks.get(row)
        if tick is None:
            states = self._sample(row).tick
            tick = self._first_ticks[row] = int((states if len(states) else self._chunk(row).tick)[0])
        return tick

    def _chunk(self, row: int) -> _Chunk:
        """Return a chunk by its row in the index, one that was kept or one read from the file."""
        with self._lock:
            if row in self._cache:
                self._cache.move_to_end(row)
                return self._cache[row]
            index, size = self._index, int(self._index.length[row])
            start = int(index.start[row])
            content = content_of(self.path, self._file, start, size, check=True)
            chunk = self._cache[row] = self._decoded(content, read_records(self.path, start, content, {},
                                                                           index.channels))
            if self._states[row] and not len(chunk.tick):
                raise LogError(f'log {str(self.path)!r}: the chunk at byte {start} is damaged, its index names states '
                               'and it holds none')
            self._cached += size
            while self._cached > CACHE_SIZE and len(self._cache) > 1:
                dropped, _ = self._cache.popitem(last=False)
                self._cached -= int(index.length[dropped])
            return chunk

    def _may_hold(self, row: int, kinds: Collection) -> bool:
        """Return whether a chunk may hold events of these kinds; its messages are not decoded."""
        if row not in self._kinds:
            content = content_of(self.path, self._file, int(self._index.start[row]), int(self._index.length[row]))
            found = [kind for kind, _ in KIND.findall(content)]
            whole = len(found) >= self._event_counts[row]   # else written by another tool
            self._kinds[row] = frozenset(kind.decode() for kind in set(found)) if whole else None
        known = self._kinds[row]
        return known is None or not known.isdisjoint(kinds)

    def _sample(self, row: int) -> _Chunk:
        """Return the first states of a chunk, none where its beginning cannot be read alone."""
        index = self._index
        with self._lock:
            content = beginning_of(self._file, int(index.start[row]), int(index.length[row]), SAMPLE_SIZE)
            return self._decoded(content, [place for opcode, *place in whole_records(content)
                                           if opcode == Opcode.MESSAGE and place[1] - place[0] >= MESSAGE.size])

    def _decoded(self, content: bytes, places: list) -> _Chunk:
        """Return the states and events among the messages at these places."""
        channels, settings = self._index.channels, self._index.log.settings
        if not places:
            return _Chunk(np.zeros(0, np.int64), np.zeros((0, 3, self.chain.joint_count)), [])
        heads, start, end = message_heads(content, places)
        states, events = (sum((heads['channel'] == number for number, (topic, _) in channels.items()
                               if topic == settings[key]), np.zeros(len(places), bool))
                          for key in ('state_topic', 'events_topic'))
        numbers = np.zeros((0, 3, self.chain.joint_count))
        if states.any():
            numbers = self._decoder.numbers(content, start[states], end[states], heads['sequence'][states])
        return _Chunk(self._tick(heads['sequence'][states]), numbers,
                      [content[first:last] for first, last in zip(start[events].tolist(), end[events].tolist())])


class _Chunk(NamedTuple):
    """What a chunk holds: tick (states,), numbers (states, 3, joints), and the messages of events."""

    tick: np.ndarray
    numbers: np.ndarray
    events: list


class Events:
    """
    The events of a SeekableLog in order, each {'tick': int, 'kind': str, 'data': dict}, read as they are asked for.

    len() is their number, iteration reads them all. `kinds`: names of the kinds that count, all if None.
    """

    def __init__(self, log: SeekableLog) -> None:
        self._log = log
        self._count = int(log._event_counts.sum())
        self._rows = np.flatnonzero(log._event_counts).tolist()   # chunks with events

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[dict]:
        for row in self._rows:
            yield from self._events(row)

    def between(self, begin: float, end: float, limit: Optional[int] = None,
                kinds: Optional[Collection] = None) -> list:
        """Return the events from `begin` to `end`, s, both included, the first `limit` of them."""
        log = self._log
        first, last = log.tick_at(begin), log.tick_at(end)
        found: list = []
        for row in self._rows[self._place(first, after=False):]:
            if log._states[row] and log._first_tick(row) > last + 1:
                break
            found += [event for event in self._events(row, kinds) if first <= event['tick'] <= last]
            if limit is not None and len(found) >= limit:
                return found[:limit]
        return found

    def next(self, time: float, kinds: Optional[Collection] = None) -> Optional[dict]:
        """Return the first event after the tick at a time, s; None: there is none."""
        tick = self._log.tick_at(time)
        return next((event for row in self._rows[self._place(tick, after=False):] for event in self._events(row, kinds)
                     if event['tick'] > tick), None)

    def previous(self, time: float, kinds: Optional[Collection] = None) -> Optional[dict]:
        """Return the last event before the tick at a time, s; None: there is none."""
        tick = self._log.tick_at(time)
        return next((event for row in reversed(self._rows[:self._place(tick, after=True)])
                     for event in reversed(self._events(row, kinds)) if event['tick'] < tick), None)

    def _place(self, tick: int, after: bool) -> int:
        """Return the place in _rows of the first chunk that can hold events of a tick, or (after) behind the last."""
        log = self._log
        place = log._bisect(tick, after)   # of the first chunk with states that begins at the tick (after: after it)
        if after:
            return bisect_left(self._rows, log._rows[place]) if place < len(log._rows) else len(self._rows)
        return bisect_left(self._rows, log._rows[place - 1] if place else 0)

    def _events(self, row: int, kinds: Optional[Collection] = None) -> list:
        """Return the events of these kinds in a chunk."""
        log = self._log
        if kinds is not None and not log._may_hold(row, kinds):
            return []
        try:
            events = [decode_event(data) for data in log._chunk(row).events]
        except ValueError as error:
            topic = log.settings['events_topic']
            raise LogError(f'log {str(log.path)!r}: a message on {topic} is no event ({error})') from None
        return [event for event in events if kinds is None or event['kind'] in kinds]
