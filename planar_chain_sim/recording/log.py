"""Log: a log as arrays, for analysis; read in bulk, a million states in about a second."""
from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from functools import cached_property
import json
from pathlib import Path
from typing import Any, NamedTuple
from warnings import warn

import numpy as np

from .cdr import CdrError
from .events import decode_event
from .log_reader import LogFile, read_log
from .message_types import INPUT_TYPES, MESSAGE_TYPES
from .run_settings import readable_settings, simulation_of
from .states import message_heads, StateDecoder
from ..chain.chain import Chain
from ..chain.section import counted
from ..errors import LogError

_EVENT_HEAD = 8   # bytes of CDR before the text of a std_msgs/msg/String


class _Messages(NamedTuple):
    """Messages of one topic and chunk, end to end: their type, log times, ns, where each ends, and all their bytes."""

    topic: str
    type_name: str
    times: np.ndarray
    ends: np.ndarray
    data: bytes

    def each(self) -> Any:
        """Yield the bytes of each message."""
        start = 0
        for end in self.ends.tolist():
            yield self.data[start:end]
            start = end


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """
    A run as its log has it, one row per tick, in the joint order of `chain`.

    time: (ticks+1,) s, simulated time, step * tick; pauses and dropped time do not show in it.
    position, velocity: (ticks+1, joints), rad or m, rad/s or m/s. effort: (ticks, joints), N m or N: row k is what the
    actuators gave from time[k] to time[k+1]. After a reset, or another change of the state, the row of its tick is the
    state after it. A log that holds no state has no rows.
    chain: the Chain that the run began with; `events` tell of changes. settings: what the run was made with: method,
    step, tolerance, form, versions, topics, first tick. complete: the file was closed properly; else the states that
    are whole are here.
    """

    path: Path
    chain: Chain
    settings: dict
    complete: bool
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray
    _events: list = field(default_factory=list)      # of _Messages
    _commands: list = field(default_factory=list)

    def __repr__(self) -> str:
        torn = '' if self.complete else ', not closed properly'
        end = f', t = {self.time[0]:g} to {self.time[-1]:g} s' if len(self.time) else ''
        events, commands = (sum(len(each.ends) for each in part) for part in (self._events, self._commands))
        return (f'Log of {self.chain.name}: {counted(len(self.time), "state")} of '
                f'{counted(len(self.chain.joint_names), "joint")}{end}, {counted(events, "event")}, '
                f'{counted(commands, "command")}{torn}')

    @cached_property
    def events(self) -> list:
        """All events in order, each {'tick': int, 'kind': str, 'data': dict}; recording/events.py has the kinds."""
        return [event for messages in self._events for event in _decode_events(messages)]

    @cached_property
    def commands(self) -> list:
        """
        All messages on the input topics in order, as received, also those that were refused: a list of dicts.

        Each has `topic`, `received` (ns since the epoch) and, by its type: `effort`; or `stamp`, `names`, `position`,
        `velocity`, `effort`; or `body`, `force`, `torque`; or `error` where it cannot be decoded.
        """
        commands = [{'topic': messages.topic, 'received': time, **_decode_command(messages.type_name, data)}
                    for messages in self._commands for time, data in zip(messages.times.tolist(), messages.each())]
        return sorted(commands, key=lambda command: command['received'])

    def to_pandas(self) -> Any:
        """
        Return a pandas.DataFrame: index time, s; columns (quantity, joint), as in frame['position']['elbow'].

        The last row's efforts are NaN: no motion follows. ImportError where pandas is not installed.
        """
        try:
            from pandas import DataFrame, Index, MultiIndex
        except ImportError:
            raise ImportError('Log.to_pandas needs pandas, which is not installed: pip install pandas') from None
        names = self.chain.joint_names
        effort = np.vstack((self.effort, np.full((len(self.time) - len(self.effort), len(names)), np.nan)))
        columns = MultiIndex.from_product((('position', 'velocity', 'effort'), names), names=('quantity', 'joint'))
        return DataFrame(np.hstack((self.position, self.velocity, effort)), Index(self.time, name='time'), columns)


def load_log(path: Any) -> Log:
    """
    Return the Log of a file that the simulator, `rollout` or OfflineLog wrote.

    Of a file that a kill or a full disk cut short all whole chunks are read, with a RuntimeWarning. LogError: a file
    that cannot be read, is damaged or is no log of this package.
    """
    try:
        log = _load(read_log(path))
    except OSError as error:
        raise LogError(f'log {str(path)!r}: it cannot be read ({error.strerror or error})') from None
    if not log.complete:
        warn(f'log {str(path)!r}: it was not closed properly, {counted(len(log.time), "whole state")} could be read',
             RuntimeWarning, stacklevel=2)
    return log


def _load(file: LogFile) -> Log:
    simulation = simulation_of(file)
    chain, topics = simulation.chain, file.settings
    states, events, commands = _States(file, chain, simulation.tick), [], []
    for content, places, channels in file.blocks():
        if not places:
            continue
        heads, start, end = message_heads(content, places)
        for number in np.unique(heads['channel']).tolist():
            topic, type_name = channels[number]
            mine = heads['channel'] == number
            if topic == topics['state_topic']:
                states.add(content, start[mine], end[mine], heads['sequence'][mine])
            elif topic == topics['events_topic'] or type_name in INPUT_TYPES:
                data = [content[first:last] for first, last in zip(start[mine].tolist(), end[mine].tolist())]
                messages = _Messages(topic, type_name, heads['log_time'][mine], np.cumsum((end - start)[mine]),
                                     b''.join(data))
                if topic == topics['events_topic']:
                    _check_events(file, messages)
                    events.append(messages)
                else:
                    commands.append(messages)
    tick, position, velocity, effort = states.rows()
    return Log(file.path, chain, readable_settings(file.settings), file.complete, tick * simulation.step, position,
               velocity, effort, events, commands)


class _States:
    """The states of a log, gathered from chunk after chunk; LogError at one that cannot be."""

    def __init__(self, file: LogFile, chain: Chain, first_tick: int) -> None:
        self._file, self._chain, self._first = file, chain, first_tick
        self._decoder = StateDecoder(file.path, chain)
        self._sequences, self._numbers = array('I'), (array('d'), array('d'), array('d'))   # which grow in place

    def add(self, content: bytes, start: Any, end: Any, sequence: Any) -> None:
        """Take the messages from `start` to `end` in a chunk."""
        numbers = self._decoder.numbers(content, start, end, sequence)
        self._sequences.frombytes(sequence.tobytes())
        for kept, rows in zip(self._numbers, numbers.swapaxes(0, 1)):
            kept.frombytes(rows.tobytes())

    def rows(self) -> tuple:
        """Return ticks (rows,), position, velocity (rows, joints) and effort (rows - 1, joints), a row per tick."""
        joints = self._chain.joint_count
        if not self._sequences:
            return np.zeros(0), *(np.zeros((0, joints)) for _ in range(3))
        sequence = np.frombuffer(self._sequences, np.uint32)
        before = np.concatenate((np.array([self._first % 2**32], np.uint32), sequence[:-1]))
        ahead = sequence - before   # modulo 2^32, as the log keeps ticks
        if (ahead > 1).any():
            k = int(np.argmax(ahead > 1))
            raise LogError(f'log {str(self._file.path)!r}: its state of tick {sequence[k]} does not follow tick '
                           f'{before[k]}')
        tick = self._first + np.cumsum(ahead, dtype=np.int64)
        fresh = np.append(True, ahead[1:] != 0)     # the first state of its tick, with the effort that led there
        last = np.append(ahead[1:] != 0, True)
        position, velocity, effort = (np.frombuffer(numbers).reshape(-1, joints) for numbers in self._numbers)
        if not last.all():
            tick, position, velocity, effort = tick[last], position[last], velocity[last], effort[fresh]
        return tick, position, velocity, effort[1:]


def _decode_events(messages: _Messages) -> list:
    """Return the events of messages; ValueError: one is none."""
    whole = b'[' + b','.join([data[_EVENT_HEAD:-1] for data in messages.each()]) + b']'
    try:
        events = json.loads(whole)
        if len(events) == len(messages.ends) and all(
                type(event) is dict and type(event['tick']) is int and type(event['kind']) is str
                and type(event['data']) is dict for event in events):
            return events
    except (ValueError, KeyError, RecursionError):
        pass
    return [decode_event(data) for data in messages.each()]   # one by one, to see which it is


def _check_events(file: LogFile, messages: _Messages) -> None:
    try:
        _decode_events(messages)
    except ValueError as error:
        raise LogError(f'log {str(file.path)!r}: a message on {messages.topic} is no event ({error})') from None


def _decode_command(type_name: str, data: bytes) -> dict:
    decode = MESSAGE_TYPES[type_name].decode
    assert decode, type_name
    try:
        return decode(data)
    except CdrError as error:
        return {'error': str(error)}
