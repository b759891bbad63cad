"""TornLog: what is whole of a log that was cut short, by a kill, a full disk or a power cut."""
from __future__ import annotations

import os
from pathlib import Path
from typing import Callable, Iterator, NamedTuple, Optional

import numpy as np

from .cdr import decode_joint_state
from .events import decode_event
from .log_index import TIMES
from .log_reader import LogFile, LogHead
from .mcap_records import (
    attachment_of,
    CHUNK,
    content_of,
    FRAME,
    frames,
    INDEX,
    MAGIC,
    MAX_CHUNK_SIZE,
    MESSAGE,
    parse,
    payload_of,
    read_records,
    whole_records,
)
from .run_settings import simulation_of
from .states import message_heads
from ..errors import LogError

try:
    from mcap import records
    from mcap.opcode import Opcode

    from .mcap_file import encoded
except ImportError:
    pass   # who opens a log says so in words

SECTOR = 512     # bytes: a disk that loses its power has written a sector or has not
LONGEST = 1e7    # s of a recording that can be lost; more is a damaged number


class Found(NamedTuple):
    """
    What a log holds that is whole.

    states: how many; time: s, simulated time of the last. lost: bytes of the file that are not used; lost_time: s of
    the recording in them, None where they do not tell. damage: what is wrong with the first damaged record, ''
    where the file just ends.
    """

    states: int
    time: float
    lost: int
    lost_time: Optional[float]
    damage: str


class TornLog:
    """
    The whole beginning of a log: its records up to the first damage, in order.

    end: byte where it ends. damage: what is wrong with the record there, '' for nothing. chunks: how many came.
    channels: number -> (topic, type name). explained: schemas and channels, (opcode, record).
    """

    def __init__(self, path: Path, file, progress: Callable) -> None:
        self._path, self._file, self._progress = path, file, progress
        self.end = self._cut = len(MAGIC)   # _cut: where the walk ended
        self.damage, self.chunks, self.channels, self.explained = '', 0, {}, []
        self._size = os.fstat(file.fileno()).st_size
        self._schemas: dict = {}
        self._head, self._finished = LogHead(path, file), False   # _finished: all messages came
        self._log: Optional[LogFile] = None
        self._tally: dict = {}    # channel -> number of messages, sequence and log time of the last
        self._log_time = 0        # of the last message

    def __iter__(self) -> Iterator[tuple]:
        """Yield the opcode and the place of each record but indexes, and of a chunk what McapFile.add_chunk() takes."""
        for opcode, start, length in frames(self._file):
            try:
                chunk = self._checked(opcode, start, length)
            except LogError as error:
                if not self.chunks:   # the beginning, without which there is no log
                    raise
                self.damage = str(error)
                return
            if not self._finished and opcode != Opcode.MESSAGE_INDEX:
                yield opcode, start, length, chunk
            self._finished = self._finished or opcode == Opcode.DATA_END
            self._progress(start + length - self.end)
            self.end = self._cut = start + length

    def _checked(self, opcode: int, start: int, length: int) -> Optional[tuple]:
        """Check a record; return of a chunk what add_chunk() takes, else None; LogError: it is damaged."""
        self._head.take(opcode, start, length)
        if opcode == Opcode.CHUNK:
            if not self.chunks:
                self._log = self._head.log(part=True)   # LogError for the files of others
            self.chunks += 1
            return self._chunk(start, content_of(self._path, self._file, start, length, check=True))
        if opcode == Opcode.MESSAGE_INDEX:
            head = os.pread(self._file.fileno(), INDEX.size, start)
            whole = len(head) == INDEX.size and length == INDEX.size + INDEX.unpack(head)[1]
        elif opcode == Opcode.METADATA:
            whole = len(encoded(self.metadata(start, length))) == FRAME.size + length
        else:
            whole = opcode != Opcode.MESSAGE and not 0x0f < opcode < 0x80   # where the specification has none
        if not whole:
            raise LogError(f'log {str(self._path)!r}: the record at byte {start} is damaged or in no chunk')
        return None

    def rest(self) -> Optional[tuple]:
        """Return, of the damaged or cut chunk at the end, the messages that are whole for certain, None for none."""
        head = os.pread(self._file.fileno(), FRAME.size + CHUNK.size + 8, self.end)   # of a chunk without compression
        if not self.chunks:
            self._log = self._head.log(part=True)
        if self._finished or len(head) < FRAME.size + CHUNK.size + 8 or head[0] != Opcode.CHUNK:
            return None
        start = self.end + len(head)
        name_length, size = CHUNK.unpack_from(head, FRAME.size)[-1], int.from_bytes(head[-8:], 'little')
        if name_length:   # of a compression, whose beginning cannot be checked
            return None
        content = os.pread(self._file.fileno(), min(size, MAX_CHUNK_SIZE), start)
        written = content[:before_hole(content, start)]
        behind = os.pread(self._file.fileno(), SECTOR, start + len(content))
        if self.damage and len(written) == len(content) and (written[-1:] != b'\0' or behind.strip(b'\0')):
            return None                   # all is there, but wrong somewhere
        written = written.rstrip(b'\0')   # zeros at the end of a file can be made up too
        end = max((place for _, _, place in whole_records(written)), default=0)
        try:
            end = self._usable(start, written[:end])
            chunk = self._chunk(start, written[:end])
        except LogError:
            return None
        self._progress(start + end - self.end)
        self.end = start + end
        return chunk

    def found(self) -> Found:
        """Return what was found; LogError: no state."""
        log = self._head.log(part=True)
        simulation = simulation_of(log)
        states, sequence = 0, 0
        for channel, (messages, last) in self._tally.items():
            if self.channels[channel][0] == log.settings['state_topic']:
                states, sequence = states + messages, last
        if not states:
            raise LogError(f'log {str(self._path)!r}: it holds no whole state, there is nothing to repair')
        tick = simulation.tick + (sequence - simulation.tick) % 2**32
        lost = 0 if self._finished else self._size - self.end
        return Found(states, tick * simulation.step, lost, self._lost_time(lost), self.damage)

    def compression(self) -> str:
        """Return the compression of the first chunk."""
        for opcode, start, length in frames(self._file):
            if opcode == Opcode.CHUNK:
                head = os.pread(self._file.fileno(), CHUNK.size + 4, start)
                length = CHUNK.unpack_from(head)[-1] if len(head) >= CHUNK.size else 0
                return head[CHUNK.size:CHUNK.size + min(length, 4)].decode(errors='replace')
        return ''

    def metadata(self, start: int, length: int) -> records.Metadata:
        """Return the metadata record whose payload of `length` bytes is at byte `start`; LogError: it is damaged."""
        return parse(self._path, records.Metadata, payload_of(self._path, self._file, start, length))

    def attachment(self, start: int, length: int) -> records.Attachment:
        """Return the attachment whose payload of `length` bytes is at byte `start`; LogError: it is damaged."""
        return attachment_of(self._path, payload_of(self._path, self._file, start, length))

    def _chunk(self, start: int, content: bytes) -> tuple:
        """Return the chunk of these records as add_chunk() takes it; LogError: they are damaged."""
        known = len(self._schemas), len(self.channels)
        places = read_records(self._path, start, content, self._schemas, self.channels)
        if known != (len(self._schemas), len(self.channels)):
            self.explained += [(opcode, content[begin - FRAME.size:end]) for opcode, begin, end in
                               whole_records(content) if opcode in (Opcode.SCHEMA, Opcode.CHANNEL)]
        if not places:
            return content, 0, 0, {}
        heads, begin, _ = message_heads(content, places)
        self._check_ticks(heads)
        entries = np.stack((heads['log_time'], (begin - MESSAGE.size - FRAME.size).astype(np.uint64)), axis=1)
        index = {}
        for channel in np.unique(heads['channel']).tolist():
            mine = heads['channel'] == channel
            index[channel] = entries[mine].astype('<u8').tobytes()
            messages, _ = self._tally.get(channel, (0, 0))
            self._tally[channel] = messages + int(mine.sum()), int(heads['sequence'][mine][-1])
        first, self._log_time = int(heads['log_time'].min()), int(heads['log_time'].max())
        return content, first, self._log_time, index

    def _usable(self, start: int, content: bytes) -> int:
        """Return where the first state or event in a cut chunk begins that cannot be decoded, else the end."""
        assert self._log is not None
        settings, channels = self._log.settings, dict(self.channels)
        names = simulation_of(self._log).chain.joint_names
        for begin, end in read_records(self._path, start, content, dict(self._schemas), channels):
            topic, _ = channels[content[begin] | content[begin + 1] << 8]
            try:
                if topic == settings['events_topic']:
                    decode_event(content[begin + MESSAGE.size:end])
                elif topic == settings['state_topic'] and decode_joint_state(
                        content[begin + MESSAGE.size:end]).names != names:
                    return begin - FRAME.size
            except ValueError:   # CdrError too
                return begin - FRAME.size
        return len(content)

    def _check_ticks(self, heads: np.ndarray) -> None:
        """Raise LogError where the states among these messages do not follow those before, tick by tick."""
        for channel, (topic, _) in self.channels.items():
            if self._log and topic == self._log.settings.get('state_topic'):
                ticks = heads['sequence'][heads['channel'] == channel]
                last = [self._tally[channel][1]] if channel in self._tally else ticks[:1]
                ticks = np.append(np.array(last, np.uint32), ticks)
                wrong = np.flatnonzero(np.diff(ticks) > 1).tolist()   # modulo 2^32, as the log keeps ticks
                if wrong:
                    before, after = ticks[wrong[0]:wrong[0] + 2].tolist()
                    raise LogError(f'log {str(self._path)!r}: its state of tick {after} does not follow tick {before}')

    def _lost_time(self, lost: int) -> Optional[float]:
        """Return the s of the recording in the rest of the file, by the heads of its chunks; None: they do not tell."""
        number, size = self._file.fileno(), FRAME.size + TIMES.size
        first = os.pread(number, size, self._cut)
        if not lost or first and first[0] in (Opcode.MESSAGE_INDEX, Opcode.METADATA, Opcode.DATA_END):
            return 0.0   # what stands behind the messages
        heads = [first, *(os.pread(number, size, start - FRAME.size) for opcode, start, _ in
                          frames(self._file, self._cut) if opcode == Opcode.CHUNK)]
        times = [(TIMES.unpack_from(head, FRAME.size)[1] - self._log_time) * 1e-9 for head in heads
                 if len(head) == size and head[0] == Opcode.CHUNK]
        return max((time for time in times if 0.0 <= time < LONGEST), default=None)


def before_hole(content: bytes, place: int) -> int:
    """
    Return how many bytes come before the first sector of zeros; the content lies at `place` in a file.

    A disk or a file system that was stopped leaves such sectors where it had promised data.
    """
    octets, begin = np.frombuffer(content, np.uint8), -place % SECTOR
    sectors = octets[begin:begin + max(len(octets) - begin, 0) // SECTOR * SECTOR].reshape(-1, SECTOR)
    empty = np.flatnonzero(~sectors.any(axis=1)).tolist()
    return begin + SECTOR * empty[0] if empty else len(octets)
