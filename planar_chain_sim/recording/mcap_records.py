"""
The records of an MCAP file, in file order, whether the file is finished or was cut short by a kill -9.

This module reads the frames of the records (one byte of kind, eight of length) and gives only whole records to the mcap
library, whose own stream reader takes a record that the end of the file cuts for a complete one. Every allocation is
bounded by MAX_RECORD_SIZE. Check sums of chunks are not checked: the reader of the messages can
then name the flipped bit.
"""
from __future__ import annotations

import io
import os
from pathlib import Path
from struct import error as StructError, Struct
from typing import Iterator
from zlib import crc32

from ..errors import LogError

try:
    import lz4.frame
    from mcap import records
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError
    from mcap.opcode import Opcode
    import zstandard
except ImportError:
    pass   # require_mcap() says so in words

MAX_CHUNK_SIZE = 2 ** 26    # bytes after decompression; ours are 256 KiB, those of other tools a few MiB
MAX_RECORD_SIZE = 2 * MAX_CHUNK_SIZE
PACKED_SIZE = 2 ** 18       # bytes of a compressed chunk that are read for its beginning
MESSAGE = Struct('<HIQQ')   # channel, sequence, log time, publish time: the head of a message
MAGIC = b'\x89MCAP0\r\n'
FRAME = Struct('<BQ')        # kind of a record, bytes that follow
INDEX = Struct('<HI')        # channel, bytes of its entries: the head of a message index
CHUNK = Struct('<QQQII')     # first and last log time, size, check sum, length of the compression's name


def open_mcap(path: Path):
    """Open an MCAP file for reading, behind its magic bytes; LogError: it is none, or it cannot be read."""
    try:
        if path.exists() and not path.is_file():
            raise LogError(f'log {str(path)!r}: it is no file')
        file = open(path, 'rb')
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise LogError(f'log {str(path)!r}: it cannot be read ({reason})') from None
    if file.read(len(MAGIC)) != MAGIC:
        file.close()
        raise LogError(f'log {str(path)!r}: it is no MCAP file')
    return file


def frames(file, start: int = len(MAGIC)) -> Iterator[tuple]:
    """Walk the records: (opcode, start of payload, length) up to the footer or to the first that is not whole."""
    number, size, read, unpack = file.fileno(), os.fstat(file.fileno()).st_size, os.pread, FRAME.unpack
    while start + FRAME.size <= size:
        head = read(number, FRAME.size, start)
        if len(head) < FRAME.size:   # the file has been cut meanwhile
            return
        opcode, length = unpack(head)
        start += FRAME.size
        # No record has the opcode 0: a crashed file system leaves zeros where it had promised data.
        if opcode == 0 or start + length > size:
            return
        yield opcode, start, length
        if opcode == Opcode.FOOTER:
            return
        start += length


def payload_of(path: Path, file, start: int, length: int) -> bytes:
    """Read the payload of a record; LogError: it is longer than any of a log, or has gone meanwhile."""
    if length > MAX_RECORD_SIZE:
        raise LogError(f'log {str(path)!r}: the record at byte {start - FRAME.size} has {length} bytes, must have '
                       f'{MAX_RECORD_SIZE} at most')
    payload = os.pread(file.fileno(), length, start)
    if len(payload) < length:
        raise LogError(f'log {str(path)!r}: it ends in the record at byte {start - FRAME.size}, it was cut meanwhile')
    return payload


def parse(path: Path, record_type, payload: bytes):
    """Return the record of this type of the library mcap that a payload holds; LogError: it is damaged."""
    try:
        return record_type.read(ReadDataStream(io.BytesIO(payload)))
    except (McapError, StructError, ValueError, OverflowError):
        raise LogError(f'log {str(path)!r}: a {record_type.__name__} record is damaged') from None


def content_of(path: Path, file, start: int, length: int, check: bool = False) -> bytes:
    """Read the records of the chunk whose payload is there; `check` its check sum too; LogError: it is damaged."""
    chunk = parse(path, records.Chunk, payload_of(path, file, start, length))
    content = decompressed(path, start, chunk)
    if check and length != CHUNK.size + len(chunk.compression.encode()) + 8 + len(chunk.data):
        raise LogError(f'log {str(path)!r}: the chunk at byte {start} is damaged, its lengths do not agree')
    if check and chunk.uncompressed_crc and crc32(content) != chunk.uncompressed_crc:
        raise LogError(f'log {str(path)!r}: the chunk at byte {start} does not match its check sum')
    return content


def beginning_of(file, start: int, length: int, size: int) -> bytes:
    """Read the first `size` bytes of the records of a chunk, or fewer; their check sum is not compared."""
    payload = os.pread(file.fileno(), min(length, CHUNK.size + 16 + size), start)
    if len(payload) < CHUNK.size:
        return b''
    name_length = CHUNK.unpack_from(payload)[-1]
    name, data = payload[CHUNK.size:CHUNK.size + name_length], CHUNK.size + name_length + 8
    if not name:
        return payload[data:data + size]
    packed = os.pread(file.fileno(), min(length, PACKED_SIZE), start)[data:]
    try:
        if name == b'lz4':
            return lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size)
        if name == b'zstd':
            return zstandard.ZstdDecompressor().stream_reader(packed).read(size)
    except (RuntimeError, EOFError, zstandard.ZstdError, MemoryError):
        pass
    return b''


def attachment_of(path: Path, payload: bytes) -> records.Attachment:
    """Return the attachment in the payload of its record; LogError: it is damaged."""
    attachment = parse(path, records.Attachment, payload)
    stored = int.from_bytes(payload[-4:], 'little')
    if stored and stored != crc32(memoryview(payload)[:-4]):
        raise LogError(f'log {str(path)!r}: the attachment {attachment.name!r} does not match its check sum')
    return attachment


def whole_records(content: bytes) -> Iterator[tuple]:
    """Yield the opcode and the place, from start to end, of each record up to the first that is not whole."""
    start = FRAME.size
    while start <= len(content):
        opcode, length = FRAME.unpack_from(content, start - FRAME.size)
        if opcode == 0 or start + length > len(content):
            return
        yield opcode, start, start + length
        start += length + FRAME.size


def read_records(path: Path, where: int, content: bytes, schemas: dict, channels: dict) -> list:
    """Return the places of the messages in a chunk and learn its schemas and channels; LogError where it is damaged."""
    not_whole = f'log {str(path)!r}: the chunk at byte {where} is damaged, a record in it is not whole'
    start, size, places, unpack, message = 0, len(content), [], FRAME.unpack_from, int(Opcode.MESSAGE)
    while start < size:
        if start + FRAME.size > size:
            raise LogError(not_whole)
        opcode, length = unpack(content, start)
        start += FRAME.size
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
            schema = parse(path, records.Schema, content[start:end])
            schemas[schema.id] = schema.name
        elif opcode == Opcode.CHANNEL:
            channel = parse(path, records.Channel, content[start:end])
            channels[channel.id] = (channel.topic, schemas.get(channel.schema_id, ''))
        start = end
    return places


def decompressed(path: Path, where: int, chunk: records.Chunk) -> bytes:
    """Return the records of the chunk at byte `where`; LogError: they cannot be decompressed or are of another size."""
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
