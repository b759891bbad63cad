"""
LogIndex: where the chunks of a log lie and how many messages of each topic they hold, found without reading them.

A finished log says so in its summary. In one that was cut short the heads of chunks and message indexes are walked.
"""
from __future__ import annotations

from array import array
from dataclasses import dataclass
import os
from pathlib import Path
from struct import error as StructError, Struct
from typing import Optional
from zlib import crc32

import numpy as np

from .log_reader import LogFile, LogHead
from .mcap_library import require_mcap
from .mcap_records import content_of, FRAME, frames, INDEX, MAGIC, open_mcap, read_records
from ..errors import LogError

try:
    from mcap.opcode import Opcode
except ImportError:
    pass   # read_index() says so in words

_FOOTER = Struct('<BQQQI')           # opcode, length, start of the summary, of its offsets, check sum
_CHUNK_INDEX = Struct('<QQQQI')      # first and last log time, place and length of the chunk, bytes of the offsets
_OFFSET = Struct('<HQ')              # channel, place of its message index
_COUNT = Struct('<Q')
TIMES = Struct('<QQ')               # first and last log time: the head of a chunk
_ENTRY = 16                          # bytes of an entry of a message index
_LONGEST_SUMMARY = 2**27             # bytes, of a log of about 200 GB; a longer one is walked


@dataclass(frozen=True, eq=False)
class LogIndex:
    """
    The chunks of a log in file order, one row each.

    start: byte of the chunk's payload; length: its bytes; first_time, last_time: log times, ns; all (chunks,).
    counts: channel -> messages in each chunk, (chunks,). channels: channel -> (topic, type name). size: of the file.
    end: where the last whole chunk, with its indexes, ends.
    """

    log: LogFile
    size: int
    end: int
    channels: dict
    start: np.ndarray
    length: np.ndarray
    first_time: np.ndarray
    last_time: np.ndarray
    counts: dict

    def count_of(self, topic: str) -> np.ndarray:
        """Return the number of messages of a topic in each chunk (chunks,)."""
        return sum((rows for number, rows in self.counts.items() if self.channels.get(number, ('',))[0] == topic),
                   np.zeros(len(self.start), np.int64))


def read_index(path) -> LogIndex:
    """Return the index of a log; LogError as read_log, and for messages outside of chunks."""
    require_mcap(path)
    path = Path(path)
    try:
        with open_mcap(path) as file:
            return summary_index(path, file) or _from_records(path, file)
    except OSError as error:
        raise LogError(f'log {str(path)!r}: it cannot be read ({error.strerror or error})') from None


class _Rows:
    """The rows of an index in the making."""

    def __init__(self) -> None:
        self.start, self.length, self.first_time, self.last_time = (array(kind) for kind in 'qqQQ')
        self._counts: dict = {}

    def add(self, start: int, length: int, first_time: int, last_time: int) -> None:
        self.start.append(start)
        self.length.append(length)
        self.first_time.append(first_time)
        self.last_time.append(last_time)

    def count(self, channel: int, messages: int) -> None:
        """Note that the last chunk has these messages."""
        rows, counts = self._counts.setdefault(channel, (array('q'), array('q')))
        rows.append(len(self.start) - 1)
        counts.append(messages)

    def index(self, log: LogFile, size: int, end: int, channels: dict) -> LogIndex:
        counts = {}
        for channel, (rows, numbers) in self._counts.items():
            counts[channel] = np.zeros(len(self.start), np.int64)
            np.add.at(counts[channel], np.frombuffer(rows, np.int64), np.frombuffer(numbers, np.int64))
        start, length, first, last = map(np.array, (self.start, self.length, self.first_time, self.last_time))
        return LogIndex(log, size, end, channels, start, length, first, last, counts)


def summary_index(path: Path, file) -> Optional[LogIndex]:
    """Return the index of an open log by its summary; None: there is none, or it is damaged."""
    size = os.fstat(file.fileno()).st_size
    footer_start = size - len(MAGIC) - _FOOTER.size
    if footer_start < len(MAGIC):
        return None
    tail = os.pread(file.fileno(), size - footer_start, footer_start)
    if len(tail) < size - footer_start or tail[-len(MAGIC):] != MAGIC:
        return None
    opcode, length, start, _, stored = _FOOTER.unpack_from(tail)
    if (opcode, length) != (Opcode.FOOTER, 20) or not len(MAGIC) < start <= footer_start:
        return None
    if footer_start - start > _LONGEST_SUMMARY:
        return None
    summary = os.pread(file.fileno(), footer_start - start, start)
    if stored and stored != crc32(tail[:_FOOTER.size - 4], crc32(summary)):
        return None
    try:
        return _read_summary(path, file, size, start, summary)
    except (StructError, LogError):
        return None   # walking the records will say what is wrong


def _read_summary(path: Path, file, size: int, data_end: int, summary: bytes) -> Optional[LogIndex]:
    """Return the index by the summary's records; None, StructError, LogError: they are damaged."""
    rows, head, schemas, channels = _Rows(), LogHead(path, file), {}, {}
    place, end = 0, len(MAGIC)
    while place < len(summary):
        opcode, length = FRAME.unpack_from(summary, place)
        begin = place + FRAME.size
        place = begin + length
        if opcode == Opcode.CHUNK_INDEX:
            end = _take_chunk_index(rows, summary, begin, end)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            read_records(path, data_end, summary[begin - FRAME.size:place], schemas, channels)
        elif opcode in (Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX):
            where, whole = TIMES.unpack_from(summary, begin)   # place and length of the record
            kind, length = FRAME.unpack(os.pread(file.fileno(), FRAME.size, where))
            if length + FRAME.size != whole or where + whole > data_end:
                return None
            head.take(kind, where + FRAME.size, length)
    if place != len(summary) or end > data_end or end < 0:
        return None
    head.take(Opcode.FOOTER, size - len(MAGIC) - 20, 20)
    return rows.index(head.log(), size, end, channels)


def _take_chunk_index(rows: _Rows, summary: bytes, begin: int, end: int) -> int:
    """Add the chunk of an index in the summary, after a chunk that ends at `end`; return where it ends, or LogError."""
    first, last, start, length, size = _CHUNK_INDEX.unpack_from(summary, begin)
    begin += _CHUNK_INDEX.size
    offsets = [_OFFSET.unpack_from(summary, place)[::-1] for place in range(begin, begin + size, _OFFSET.size)]
    offsets.sort()
    chunk_end = start + length
    whole_end = chunk_end + _COUNT.unpack_from(summary, begin + size)[0]
    if start < end or length < FRAME.size or whole_end >= 2**63 or not offsets or offsets[0][0] != chunk_end:
        raise LogError('the indexes of chunks are not in order')
    rows.add(start + FRAME.size, length - FRAME.size, first, last)
    for (place, channel), (after, _) in zip(offsets, [*offsets[1:], (whole_end, 0)]):
        messages, rest = divmod(after - place - FRAME.size - INDEX.size, _ENTRY)
        if rest or messages < 0:
            raise LogError('the index of a chunk is not whole')
        rows.count(channel, messages)
    return whole_end


def _from_records(path: Path, file) -> LogIndex:
    """Return the index by the records of the file, of which only the heads are read."""
    walk, head, number, in_data, outside = _Walk(path, file), LogHead(path, file), file.fileno(), True, 0
    for opcode, start, length in frames(file):
        if in_data and opcode == Opcode.CHUNK:
            walk.begin_chunk(start, length, os.pread(number, TIMES.size, start))
        elif in_data and opcode == Opcode.MESSAGE_INDEX and length >= INDEX.size:
            walk.take_index(start + length, *INDEX.unpack(os.pread(number, INDEX.size, start)))
        elif opcode == Opcode.MESSAGE:
            outside = outside or start
        else:
            in_data = in_data and opcode != Opcode.DATA_END
            head.take(opcode, start, length)
    log = head.log()
    if outside:
        raise LogError(f'log {str(path)!r}: the message at byte {outside} is in no chunk, must be in one')
    walk.end_chunk(torn=not log.complete)
    return walk.rows.index(log, os.fstat(number).st_size, walk.end, walk.channels)


class _Walk:
    """A walk over the records of a log: its chunks so far, and where the last of them ends."""

    def __init__(self, path: Path, file) -> None:
        self._path, self._file = path, file
        self.rows, self.end, self.channels = _Rows(), len(MAGIC), {}
        self._schemas: dict = {}
        self._chunk: Optional[tuple] = None   # the present chunk's row, and its messages by their channel
        self._counts: dict = {}
        self._chunk_end = 0

    def begin_chunk(self, start: int, length: int, times: bytes) -> None:
        self.end_chunk(torn=False)
        if length < TIMES.size or len(times) < TIMES.size:
            raise LogError(f'log {str(self._path)!r}: the chunk at byte {start} is damaged, it is too short')
        self._chunk, self._counts, self._chunk_end = (start, length, *TIMES.unpack(times)), {}, start + length

    def take_index(self, end: int, channel: int, size: int) -> None:
        self._counts[channel], self._chunk_end = size // _ENTRY, end

    def end_chunk(self, torn: bool) -> None:
        """Add the present chunk, if there is one; `torn`: the file ends here, perhaps before its last index."""
        if not self._chunk:
            return
        start, length = self._chunk[:2]
        try:
            if not self.channels or not self._counts or torn:   # the first chunk of a log of ours explains all channels
                content = content_of(self._path, self._file, start, length, check=torn)
                places = read_records(self._path, start, content, self._schemas, self.channels)
                numbers = [content[place] | content[place + 1] << 8 for place, _ in places]
                self._counts = {number: numbers.count(number) for number in set(numbers)}
        except LogError:
            if torn:   # as after a power cut: promised, and not on the disk
                return
            raise
        self.rows.add(*self._chunk)
        for channel, messages in self._counts.items():
            self.rows.count(channel, messages)
        self._chunk, self.end = None, self._chunk_end
