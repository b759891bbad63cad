"""
read_log: reads a log in file order, whether the file is finished or was cut short by a kill -9.

This module reads the frames of the records (one byte of kind, eight of length) and gives only whole records to the mcap
library, whose own stream reader takes a record that the end of the file cuts for a complete one. Every allocation is
bounded by the file's size or by MAX_CHUNK_SIZE. Check sums of chunks are not checked: the reader of the messages can
then name the flipped bit.
"""
from __future__ import annotations

from dataclasses import dataclass, field
import io
from pathlib import Path
from struct import error as StructError, Struct
from typing import Iterator, NamedTuple
from zlib import crc32

from .mcap_library import require_mcap
from ..errors import LogError

try:
    import lz4.frame
    from mcap import records
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError
    from mcap.opcode import Opcode
    import zstandard
except ImportError:
    pass   # read_log() says so in words

MAX_CHUNK_SIZE = 2 ** 26    # bytes after decompression; ours are 256 KiB, those of other tools a few MiB
MESSAGE = Struct('<HIQQ')   # channel, sequence, log time, publish time: the head of a message

_MAGIC = b'\x89MCAP0\r\n'
_FRAME = Struct('<BQ')


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
    attachments, metadata, complete = {}, {}, False
    with _open(path) as file:
        for opcode, start, length in _frames(file):
            if opcode == Opcode.ATTACHMENT:
                attachment = _attachment(path, _payload(file, start, length))
                attachments.setdefault(attachment.name, attachment.data)
            elif opcode == Opcode.METADATA:
                record = _parse(path, records.Metadata, _payload(file, start, length))
                metadata.setdefault(record.name, record.metadata)
            elif opcode == Opcode.FOOTER:
                file.seek(start + length)
                complete = file.read(len(_MAGIC)) == _MAGIC
        file.seek(-len(_MAGIC), io.SEEK_END)
        if not complete and file.tell() > 0 and file.read() == _MAGIC:
            raise LogError(f'log {str(path)!r}: it is damaged, its records do not lead to its end')
    if 'chain.yaml' not in attachments or 'planar_chain_sim' not in metadata:
        raise LogError(f"log {str(path)!r}: it is no log of planar_chain_sim, which has the attachment 'chain.yaml' "
                       "and the metadata 'planar_chain_sim'")
    try:
        chain_text = attachments['chain.yaml'].decode()
    except UnicodeDecodeError:
        raise LogError(f"log {str(path)!r}: the attachment 'chain.yaml' is not UTF-8") from None
    return LogFile(path, chain_text, metadata['planar_chain_sim'], complete)


def _open(path: Path):
    try:
        if path.exists() and not path.is_file():
            raise LogError(f'log {str(path)!r}: it is no file')
        file = open(path, 'rb')
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise LogError(f'log {str(path)!r}: it cannot be read ({reason})') from None
    if file.read(len(_MAGIC)) != _MAGIC:
        file.close()
        raise LogError(f'log {str(path)!r}: it is no MCAP file')
    return file


def _frames(file) -> Iterator[tuple]:
    """Walk the records: (opcode, start of payload, length) up to the footer or to the first that is not whole."""
    size = file.seek(0, io.SEEK_END)
    start = len(_MAGIC)
    while start + _FRAME.size <= size:
        file.seek(start)
        opcode, length = _FRAME.unpack(file.read(_FRAME.size))
        start += _FRAME.size
        # No record has the opcode 0: a crashed file system leaves zeros where it had promised data.
        if opcode == 0 or start + length > size:
            return
        yield opcode, start, length
        if opcode == Opcode.FOOTER:
            return
        start += length


def _payload(file, start: int, length: int) -> bytes:
    file.seek(start)
    return file.read(length)


def _parse(path: Path, record_type, payload: bytes):
    try:
        return record_type.read(ReadDataStream(io.BytesIO(payload)))
    except (McapError, StructError, ValueError, OverflowError):
        raise LogError(f'log {str(path)!r}: a {record_type.__name__} record is damaged') from None


def _attachment(path: Path, payload: bytes) -> records.Attachment:
    attachment = _parse(path, records.Attachment, payload)
    stored = int.from_bytes(payload[-4:], 'little')
    if stored and stored != crc32(payload[:-4]):
        raise LogError(f'log {str(path)!r}: the attachment {attachment.name!r} does not match its check sum')
    return attachment


def _blocks(path: Path) -> Iterator[tuple[bytes, list, dict]]:
    schemas, channels = {}, {}   # schema id -> type name; channel id -> (topic, type name)
    with _open(path) as file:
        for opcode, start, length in _frames(file):
            if opcode == Opcode.DATA_END:
                return
            if opcode == Opcode.CHUNK:
                chunk = _parse(path, records.Chunk, _payload(file, start, length))
                content = _decompress(path, start, chunk)
                yield content, _read_records(path, start, content, schemas, channels), channels
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                content = _FRAME.pack(opcode, length) + _payload(file, start, length)
                yield content, _read_records(path, start, content, schemas, channels), channels


def _read_records(path: Path, where: int, content: bytes, schemas: dict, channels: dict) -> list:
    """Return the places of the messages in a chunk and learn its schemas and channels; LogError where it is damaged."""
    not_whole = f'log {str(path)!r}: the chunk at byte {where} is damaged, a record in it is not whole'
    start, size, places, unpack, message = 0, len(content), [], _FRAME.unpack_from, int(Opcode.MESSAGE)
    while start < size:
        if start + _FRAME.size > size:
            raise LogError(not_whole)
        opcode, length = unpack(content, start)
        start += _FRAME.size
        end = start + length
        if opcode == 0 or end > size:
            raise LogError(not_whole)
        if opcode == message:
            if length < MESSAGE.size:
                raise LogError(not_whole)
            channel_id = content[start] | content[start + 1] << 8
            if channel_id not in channels:
                raise LogError(f'log {str(path)!r}: the chunk at byte {where} has a message of the unknown channel '
                               f'{channel_id}')
            places.append((start, end))
        elif opcode == Opcode.SCHEMA:
            schema = _parse(path, records.Schema, content[start:end])
            schemas[schema.id] = schema.name
        elif opcode == Opcode.CHANNEL:
            channel = _parse(path, records.Channel, content[start:end])
            channels[channel.id] = (channel.topic, schemas.get(channel.schema_id, ''))
        start = end
    return places


def _decompress(path: Path, where: int, chunk: records.Chunk) -> bytes:
    size = chunk.uncompressed_size
    try:
        if chunk.compression == '':
            content = chunk.data
        elif size > MAX_CHUNK_SIZE:
            content = b''
        elif chunk.compression == 'lz4':
            content = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size)
        elif chunk.compression == 'zstd':
            content = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size)
        else:
            raise LogError(f'log {str(path)!r}: the chunk at byte {where} has the unknown compression '
                           f'{chunk.compression!r}')
    except (RuntimeError, ValueError, EOFError, zstandard.ZstdError, MemoryError):
        content = b''
    if len(content) != size:
        raise LogError(f'log {str(path)!r}: the chunk at byte {where} is damaged, its content is not the {size} bytes '
                       'announced')
    return content
