"""The executable `info`: what a log or a bag holds, in ten lines; all of a log need not be read for that."""
from __future__ import annotations

from array import array
from collections import Counter
from datetime import datetime, timezone
from pathlib import Path
import sys
from typing import Any, Iterator, Sequence

import numpy as np

from .bag import Bag, bag_files, read_bag
from .cdr import CdrError, decode_joint_state
from .events import EVENTS, KIND
from .log_index import LogIndex, read_index
from .log_reader import NoLog
from .mcap_records import content_of, open_mcap
from .message_types import INPUT_TYPES
from .run_settings import simulation_of
from .seekable_log import SeekableLog
from ..chain.section import clipped, counted
from ..command_line import Parser, print_line, run_command

MOST_CHUNKS = 5000   # whose events are counted; of more, this many samples
STATE, STRING = 'sensor_msgs/msg/JointState', 'std_msgs/msg/String'
EPOCH = 10**17       # ns: a log time beyond this is wall time, three years after 1970


def main(arguments=None) -> int:
    """Exit 0: printed; 2: the log cannot be read, a mistake, or a bug."""
    return run_command('info', _print_info, arguments)


def _print_info(arguments) -> int:
    parser = Parser('info', 'Print what a log holds, in ten lines: size, duration, ticks, joints, method, messages, '
                    'changes, events, gaps. A log of 10 GB takes a second or two.', 'info run.mcap')
    parser.add_argument('log', help='MCAP log of the simulator or of rollout, or a bag: its folder or file')
    for label, text in log_info(parser.parse_args(arguments).log):
        print_line(f'{label + ":":<11}{text}')
    return 0


def log_info(path: Any) -> Iterator[tuple[str, str]]:
    """Yield ten lines on a log or a bag, each a label and a text; LogError: it cannot be read."""
    path = Path(path)
    files = bag_files(path)
    if len(files) == 1 and files[0].suffix != '.db3':
        try:
            index = read_index(files[0])
        except NoLog:
            pass
        else:
            return _of_log(files[0], index)
    return _of_bag(read_bag(path))


def _of_log(path: Path, index: LogIndex) -> Iterator[tuple[str, str]]:
    simulation, settings = simulation_of(index.log), index.log.settings
    states = int(index.count_of(settings['state_topic']).sum())
    log = SeekableLog(path, index) if states else None
    ticks = log.tick_count if log else 0

    end = 'finished' if index.log.complete else 'cut short: `repair` finishes it'
    yield 'log', f'{clipped(str(path), 200)} of {clipped(simulation.chain.name, 100)}, {end}'
    each = f', {index.size / ticks:.0f} bytes a tick' if ticks else ''
    version = settings.get('version', 'unknown')
    yield 'size', f'{_size(index.size)} in {counted(len(index.start), "chunk")}{each}; version {version:.40}'
    simulated = log.last_time - log.first_time if log else 0.0
    span = f', t = {log.first_time:g} to {log.last_time:g} s' if log else ''
    recorded = _recorded(int(index.first_time[0]), int(index.last_time[-1])) if log else ''
    yield 'duration', f'{simulated:g} s simulated{span}{recorded}'
    yield 'ticks', (f'{ticks} of {simulation.step:g} s, {log.first_tick} to {log.last_tick}; '
                    f'{counted(states, "state")}' if log else f'no state is whole; {simulation.step:g} s each')
    tolerance = '' if simulation.tolerance is None else f', tolerance {simulation.tolerance:g}'
    yield 'method', f'{simulation.method}{tolerance}, form {simulation.form_asked}'
    yield 'joints', _names(simulation.chain.joint_names)
    own = settings['state_topic'], settings['events_topic']
    yield 'received', _list({topic: int(index.count_of(topic).sum()) for topic, type_name in sorted(
        set(index.channels.values())) if type_name in INPUT_TYPES and topic not in own})
    kinds, seconds, share = _kinds(index)
    about = '' if share == 1.0 else 'about '
    yield from _events(kinds, about)
    gaps = [f'{about}{seconds:.3g} s of wall time dropped'] if seconds else []
    gaps += [f'at least {ticks + 1 - states} ticks are missing'] if states and states < ticks + 1 else []
    yield 'gaps', ', '.join(gaps) or ('none' if share == 1.0 else f'none seen in {100 * share:.2g} % of the events')


def _of_bag(bag: Bag) -> Iterator[tuple[str, str]]:
    """Yield what a bag of the node tells: not its chain, method and ticks; it is read to its end."""
    counts: Counter = Counter()   # messages by topic and type
    kinds: Counter = Counter()    # of events
    seconds, names, first, last = 0.0, (), 0, 0
    states: dict = {}             # topic of states -> when they were received, ns
    for message in bag.messages:
        first, last = first if counts else message.log_time, message.log_time
        counts[message[:2]] += 1
        if message.type_name == STATE and not message.topic.endswith('/joint_commands'):
            if message.topic not in states:
                states[message.topic], names = array('Q'), _joints(message.data) or names
            states[message.topic].append(message.log_time)
        elif message.type_name == STRING and message.topic.endswith('/events'):
            for kind, dropped in KIND.findall(message.data):
                kinds[kind.decode()] += 1
                seconds += float(dropped) if kind == b'dropped_time' and dropped else 0.0

    end = 'finished' if bag.complete else 'cut short'
    yield 'log', f'{clipped(str(bag.path), 200)}, a bag, {end}'
    yield 'size', f'{_size(sum(file.stat().st_size for file in bag.files))} in {counted(len(bag.files), "file")}'
    yield 'duration', f'unknown{_recorded(first, last)}'
    yield 'ticks', f'unknown; states received: {_list({topic: len(each) for topic, each in states.items()})}'
    yield 'method', 'unknown: a bag does not tell it'
    yield 'joints', _names(names)
    yield 'received', _list({topic: count for (topic, type_name), count in sorted(counts.items())
                             if type_name in INPUT_TYPES and topic not in states})
    yield from _events(dict(kinds.most_common()), '')
    gaps = [f'{seconds:.3g} s of wall time dropped'] if seconds else []
    gaps += [f'{np.diff(np.array(each, np.int64)).max() * 1e-9:.3g} s at most between two states on {topic}'
             for topic, each in states.items() if len(each) > 1]
    yield 'gaps', ', '.join(gaps) or 'none'


def _joints(data: bytes) -> tuple:
    """Return the names in a state; none where it cannot be read."""
    try:
        return decode_joint_state(data).names
    except CdrError:
        return ()


def _names(names: Sequence[str]) -> str:
    return f'{len(names)}: {clipped(", ".join(names), 200)}' if names else 'unknown'


def _recorded(first: int, last: int) -> str:
    """Return when a file was recorded, by the log times, ns, of its first and last message, if they are wall times."""
    if first < EPOCH:
        return ''
    begin = datetime.fromtimestamp(first * 1e-9, timezone.utc)
    return f'; recorded in {(last - first) * 1e-9:.6g} s from {begin:%Y-%m-%d %H:%M:%S} UTC'


def _events(kinds: dict, about: str) -> Iterator[tuple[str, str]]:
    """Yield the lines of the events that change the run, and of the others."""
    changes = {kind: count for kind, count in kinds.items() if kind in EVENTS and EVENTS[kind].changes_run}
    yield 'changes', about + _list(changes)
    yield 'events', about + _list({kind: count for kind, count in kinds.items() if kind not in changes})


def _kinds(index: LogIndex) -> tuple[dict, float, float]:
    """Return kind -> number of events, s of wall time that were dropped, and the share of the events that was read."""
    counts = index.count_of(index.log.settings['events_topic'])
    rows = np.flatnonzero(counts)
    if len(rows) > MOST_CHUNKS:
        rows = rows[np.linspace(0, len(rows) - 1, MOST_CHUNKS).astype(int)]
    share = float(counts[rows].sum() / counts.sum()) if len(rows) else 1.0
    kinds: Counter = Counter()
    seconds = 0.0
    with open_mcap(index.log.path) as file:
        for start, length in zip(index.start[rows].tolist(), index.length[rows].tolist()):
            for kind, dropped in KIND.findall(content_of(index.log.path, file, start, length)):
                kinds[kind.decode()] += 1
                seconds += float(dropped) if kind == b'dropped_time' and dropped else 0.0
    return {kind: round(count / share) for kind, count in kinds.most_common()}, seconds / share, share


def _list(counts: dict) -> str:
    """Return numbers and what they are of, with their sum."""
    parts = ', '.join(f'{name} {count}' for name, count in counts.items() if count)
    return f'{sum(counts.values())}: {clipped(parts, 300)}' if parts else 'none'


def _size(size: int) -> str:
    for unit in ('bytes', 'kB', 'MB'):
        if size < 1000:
            break
        size /= 1000
    else:
        unit = 'GB'
    return f'{size:.3g} {unit}' if unit != 'bytes' else f'{size} bytes'


if __name__ == '__main__':
    sys.exit(main())
