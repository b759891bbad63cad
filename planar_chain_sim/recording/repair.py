"""
The executable `repair`: writes what is whole of a log that was cut short, by a kill or a full disk, as a finished log.

What is kept is one piece from the beginning: all chunks up to the first damage, and the messages of a chunk that was
cut which are whole for certain. A log with a gap could not be computed again.
"""
from __future__ import annotations

import errno
from pathlib import Path
import sys
from typing import Any, Callable, NamedTuple, Optional

from .log_index import summary_index
from .mcap_library import require_mcap
from .mcap_records import open_mcap
from .rosbag2_profile import filled_bag_information
from .torn_log import Found, TornLog
from ..chain.section import counted
from ..command_line import Parser, print_line, run_command
from ..errors import LogError

try:
    from mcap.opcode import Opcode

    from .mcap_file import McapFile
except ImportError:
    pass   # repair_log() says so in words


FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)   # of a write


class Repaired(NamedTuple):
    """What was found in a log, and whether a new one was written: not where it is finished and whole."""

    found: Found
    written: bool


def repair_log(path: Any, output: Any, progress: Callable[[int], object] = lambda size: None) -> Repaired:
    """
    Write what is whole of the log at `path` as a finished log at `output`; nothing where it is finished and whole.

    progress(n) is called after n more bytes of the file. LogError: the file cannot be read, there is no whole state
    in it, or the output exists or cannot be written.
    """
    require_mcap(path)
    path, output = Path(path), Path(output)
    try:
        with open_mcap(path) as file:
            index = summary_index(path, file)
            if index:
                torn = TornLog(path, file, progress)
                for _ in torn:
                    pass
                if not torn.damage and torn.chunks == len(index.start):
                    return Repaired(torn.found(), False)
            return Repaired(_written(TornLog(path, file, progress), output), True)
    except OSError as error:
        raise LogError(f'log {str(path)!r}: it cannot be repaired ({error.strerror or error})') from None


def _written(torn: TornLog, output: Path) -> Found:
    """Write what is whole; a file that cannot be finished is deleted."""
    try:
        stream = open(output, 'xb')
    except FileExistsError:
        raise LogError(f'log {str(output)!r}: the file exists and is not overwritten, give a new name') from None
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise LogError(f'log {str(output)!r}: the file cannot be made ({reason})') from None
    try:
        with stream:
            writing = _Writing(stream, torn)
            for part in torn:
                writing.add(*part)
            rest = torn.rest()
            if rest:
                writing.add_chunk(*rest)
            found = torn.found()
            writing.finish(output.name)
        return found
    except BaseException as error:
        output.unlink()
        if isinstance(error, OSError) and error.errno in FULL:
            raise LogError(f'log {str(output)!r}: it cannot be written ({error.strerror})') from None
        raise


class _Writing:
    """The finished log of what a TornLog yields, written into a stream."""

    def __init__(self, stream, torn: TornLog) -> None:
        self._torn, self._mcap = torn, McapFile(stream, 'ros2', 'planar_chain_sim', torn.compression())
        self._bag_information = ''

    def add(self, opcode: int, start: int, length: int, chunk: Optional[tuple]) -> None:
        """Add a record."""
        if chunk:
            self.add_chunk(*chunk)
        elif opcode == Opcode.ATTACHMENT:
            each = self._torn.attachment(start, length)
            self._mcap.add_attachment(each.name, each.media_type, each.data, each.create_time, each.log_time)
        elif opcode == Opcode.METADATA:
            record = self._torn.metadata(start, length)
            if record.name == 'rosbag2':
                if self._bag_information:   # the totals at the end, which finish() writes anew
                    return
                try:
                    text = record.metadata['serialized_metadata']
                    filled_bag_information(text, '', {}, 0, 0)
                except (KeyError, ValueError):   # damaged; readers can do without
                    return
                self._bag_information = text
            self._mcap.add_metadata(record.name, record.metadata)

    def add_chunk(self, content: bytes, first: int, last: int, index: dict) -> None:
        """Add a chunk."""
        for opcode, record in self._torn.explained:
            self._mcap.explain(opcode, record)
        if index:
            self._mcap.add_chunk(content, first, last, index)

    def finish(self, file_name: str) -> None:
        """Write the end of the file, which has this name."""
        mcap, counts = self._mcap, {}
        for channel, (topic, _) in self._torn.channels.items():
            counts[topic] = counts.get(topic, 0) + mcap.counts.get(channel, 0)
        if self._bag_information:
            mcap.add_metadata('rosbag2', {'serialized_metadata': filled_bag_information(
                self._bag_information, file_name, counts, mcap.first_time, mcap.last_time)})
        mcap.finish()


def main(arguments=None) -> int:
    """Exit 0: a finished log is there; 2: nothing can be repaired, a mistake, or a bug."""
    return run_command('repair', _repair_file, arguments)


def _repair_file(arguments) -> int:
    parser = Parser('repair', 'Write what is whole of a log that was cut short, by a kill -9, a full disk or a power '
                    'cut, as a finished log.\n\nThe log itself is left as it is. Nothing is written where it is '
                    'finished and whole.', 'repair run.mcap --output whole.mcap')
    parser.add_argument('log', help='MCAP log of the simulator or of rollout')
    parser.add_argument('--output', metavar='LOG', help='new MCAP file (default: beside the log, with its name and '
                        '.repaired.mcap)')
    options = parser.parse_args(arguments)
    path = Path(options.log)
    beside = path.parent / f'{path.name.removesuffix(".mcap")}.repaired.mcap'
    output = beside if options.output is None else options.output
    from tqdm import tqdm  # the progress bar; not needed where repair_log is a function
    with tqdm(unit='B', unit_scale=True, disable=None, leave=False, delay=1.0) as bar:
        found, written = repair_log(path, output, bar.update)
    if not written:
        print_line(f'{path}: nothing to repair, it is finished and its {counted(found.states, "state")} are whole')
        return 0
    seconds = '' if found.lost_time is None else f', {found.lost_time:.3g} s of the recording'
    part = f'the last {counted(found.lost, "byte")}' if found.lost else 'nothing'
    lost = f'{part} of {path.name}{seconds if found.lost else ""}'
    print_line(f'{output}: {counted(found.states, "state")} up to t = {found.time:g} s; lost: {lost}')
    if found.damage:
        print_line(f'what follows the first damage is not used: {found.damage}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
