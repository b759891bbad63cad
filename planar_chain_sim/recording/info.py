"""The executable `info`: what a log holds, in ten lines, without reading all of it."""
from __future__ import annotations

from collections import Counter
from datetime import datetime, timezone
from pathlib import Path
import sys
from typing import Any, Iterator, Optional

import numpy as np

from .events import EVENTS, KIND
from .log_index import LogIndex, read_index
from .mcap_records import content_of, open_mcap
from .message_types import INPUT_TYPES
from .run_settings import simulation_of
from .seekable_log import SeekableLog
from ..chain.section import clipped, counted
from ..command_line import Parser, print_line, run_command

MOST_CHUNKS = 5000   # whose events are counted; of more, this many samples
EPOCH = 10**17       # ns: a log time beyond this is wall time, three years after 1970


def main(arguments=None) -> int:
    """Exit 0: printed; 2: the log cannot be read, a mistake, or a bug."""
    return run_command('info', _print_info, arguments)


def _print_info(arguments) -> int:
    parser = Parser('info', 'Print what a log holds, in ten lines: size, duration, ticks, joints, method, messages, '
                    'changes, events, gaps. A log of 10 GB takes a second or two.', 'info run.mcap')
    parser.add_argument('log', help='MCAP log of the simulator or of rollout')
    for label, text in log_info(parser.parse_args(arguments).log):
        print_line(f'{label + ":":<11}{text}')
    return 0


def log_info(path: Any) -> Iterator[tuple[str, str]]:
    """Yield ten lines on a log, each a label and a text; LogError: it cannot be read."""
    path = Path(path)
    index = read_index(path)
    simulation, settings = simulation_of(index.log), index.log.settings
    states = int(index.count_of(settings['state_topic']).sum())
    log = SeekableLog(path, index) if states else None
    ticks = log.tick_count if log else 0

    end = 'finished' if index.log.complete else 'cut short: `repair` finishes it'
    yield 'log', f'{clipped(str(path), 200)} of {clipped(simulation.chain.name, 100)}, {end}'
    each = f', {index.size / ticks:.0f} bytes a tick' if ticks else ''
    version = settings.get('version', 'unknown')
    yield 'size', f'{_size(index.size)} in {counted(len(index.start), "chunk")}{each}; version {version:.40}'
    yield 'duration', _duration(index, log)
    yield 'ticks', (f'{ticks} of {simulation.step:g} s, {log.first_tick} to {log.last_tick}; '
                    f'{counted(states, "state")}' if log else f'no state is whole; {simulation.step:g} s each')
    tolerance = '' if simulation.tolerance is None else f', tolerance {simulation.tolerance:g}'
    yield 'method', f'{simulation.method}{tolerance}, form {simulation.form_asked}'
    yield 'joints', f'{simulation.chain.joint_count}: {clipped(", ".join(simulation.chain.joint_names), 200)}'
    own = settings['state_topic'], settings['events_topic']
    yield 'received', _list({topic: int(index.count_of(topic).sum()) for topic, type_name in sorted(
        set(index.channels.values())) if type_name in INPUT_TYPES and topic not in own})
    kinds, seconds, share = _kinds(index)
    about = '' if share == 1.0 else 'about '
    changes = {kind: count for kind, count in kinds.items() if kind in EVENTS and EVENTS[kind].changes_run}
    yield 'changes', about + _list(changes)
    yield 'events', about + _list({kind: count for kind, count in kinds.items() if kind not in changes})
    gaps = [f'{about}{seconds:.3g} s of wall time dropped'] if seconds else []
    gaps += [f'at least {ticks + 1 - states} ticks are missing'] if states and states < ticks + 1 else []
    yield 'gaps', ', '.join(gaps) or ('none' if share == 1.0 else f'none seen in {100 * share:.2g} % of the events')


def _duration(index: LogIndex, log: Optional[SeekableLog]) -> str:
    if not log:
        return '0 s'
    first, last = int(index.first_time[0]), int(index.last_time[-1])
    text = f'{log.last_time - log.first_time:g} s simulated, t = {log.first_time:g} to {log.last_time:g} s'
    if first < EPOCH:
        return text
    begin = datetime.fromtimestamp(first * 1e-9, timezone.utc)
    return f'{text}; recorded in {(last - first) * 1e-9:.6g} s from {begin:%Y-%m-%d %H:%M:%S} UTC'


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
