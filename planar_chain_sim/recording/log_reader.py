"""read_log: reads a log in file order, whether the file is finished or was cut short by a kill -9."""
from __future__ import annotations

from dataclasses import dataclass, field
import io
import os
from pathlib import Path
from typing import Iterator, NamedTuple, Optional

from .mcap_library import require_mcap
from .mcap_records import (
    attachment_of,
    content_of,
    FRAME,
    frames,
    MAGIC,
    MAX_RECORD_SIZE,
    MESSAGE,
    open_mcap,
    parse,
    payload_of,
    read_records,
)
from ..errors import LogError

try:
    from mcap import records
    from mcap.opcode import Opcode
except ImportError:
    pass   # read_log() says so in words


class NoLog(LogError):
    """A file that is whole, but no log of this package."""


class LogMessage(NamedTuple):
    """One message of a log: times in ns, data as CDR with encapsulation."""

    topic: str
    type_name: str
    log_time: int
    publish_time: int
    sequence: int
    data: bytes


@dataclass(frozen=True)
class LogFile:
    """
    A log of this package.

    chain_text: the chain file; settings: what the run was made with; complete: the file was closed properly.
    """

    path: Path
    chain_text: str = field(repr=False)
    settings: dict = field(repr=False)
    complete: bool

    @property
    def messages(self) -> Iterator[LogMessage]:
        """The messages in file order, from the start each time; LogError at a place that cannot be read."""
        for content, places, channels in self.blocks():
            for start, end in places:
                channel, sequence, log_time, publish_time = MESSAGE.unpack_from(content, start)
                topic, type_name = channels[channel]
                yield LogMessage(topic, type_name, log_time, publish_time, sequence, content[start + MESSAGE.size:end])

    def blocks(self) -> Iterator[tuple[bytes, list, dict]]:
        """
        Yield chunk after chunk, to read many messages at once; LogError as `messages`.

        Each chunk gives its bytes, the (start, end) of each message in it (a MESSAGE and its data), and channel ->
        (topic, type name).
        """
        return _blocks(self.path)


def read_log(path) -> LogFile:
    """
    Open a log and read all but its messages.

    LogError if the file cannot be read, is no MCAP file or is no log of this package. A file torn by a kill or a full
    disk is read up to its last whole chunk.
    """
    require_mcap(path)
    path = Path(path)
    with open_mcap(path) as file:
        head = LogHead(path, file)
        for opcode, start, length in frames(file):
            head.take(opcode, start, length)
    return head.log()


class LogHead:
    """What a log holds beside its messages, gathered from its records; LogError: it is damaged."""

    def __init__(self, path: Path, file) -> None:
        self._path, self._file = path, file
        self._chain: Optional[bytes] = None
        self._settings: Optional[dict] = None
        self._complete = False
        size = file.seek(0, io.SEEK_END)
        self._ends = size > len(MAGIC) and os.pread(file.fileno(), len(MAGIC), size - len(MAGIC)) == MAGIC

    def take(self, opcode: int, start: int, length: int) -> None:
        """Take a record, given by the place of its payload."""
        if opcode == Opcode.ATTACHMENT and length <= MAX_RECORD_SIZE:
            attachment = attachment_of(self._path, payload_of(self._path, self._file, start, length))
            if attachment.name == 'chain.yaml' and self._chain is None:
                self._chain = attachment.data
        elif opcode == Opcode.METADATA:
            record = parse(self._path, records.Metadata, payload_of(self._path, self._file, start, length))
            if record.name == 'planar_chain_sim' and self._settings is None:
                self._settings = record.metadata
        elif opcode == Opcode.FOOTER:
            self._complete = os.pread(self._file.fileno(), len(MAGIC), start + length) == MAGIC

    def log(self, part: bool = False) -> LogFile:
        """Return the log after its last record, or after a part of them; LogError: it is none of this package."""
        if self._ends and not self._complete and not part:
            raise LogError(f'log {str(self._path)!r}: it is damaged, its records do not lead to its end')
        if self._chain is None or self._settings is None:
            raise NoLog(f"log {str(self._path)!r}: it is no log of planar_chain_sim, which has the attachment "
                        "'chain.yaml' and the metadata 'planar_chain_sim'")
        try:
            return LogFile(self._path, self._chain.decode(), self._settings, self._complete)
        except UnicodeDecodeError:
            raise LogError(f"log {str(self._path)!r}: the attachment 'chain.yaml' is not UTF-8") from None


def _blocks(path: Path) -> Iterator[tuple[bytes, list, dict]]:
    schemas, channels = {}, {}   # schema id -> type name; channel id -> (topic, type name)
    with open_mcap(path) as file:
        for opcode, start, length in frames(file):
            if opcode == Opcode.DATA_END:
                return
            if opcode == Opcode.CHUNK:
                content = content_of(path, file, start, length)
                yield content, read_records(path, start, content, schemas, channels), channels
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                content = FRAME.pack(opcode, length) + payload_of(path, file, start, length)
                yield content, read_records(path, start, content, schemas, channels), channels
