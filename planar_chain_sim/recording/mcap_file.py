"""
McapFile: an MCAP file with chunks, indexes and summary (mcap.dev/spec); its records are written by the mcap library.

The kernel puts messages into their chunk: the library's own writer takes a hundred times as long for a message, and
keeps a kilobyte in memory for every chunk.
"""
from __future__ import annotations

from struct import Struct
from typing import Mapping
from zlib import crc32

from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import LIBRARY_IDENTIFIER

from .mcap_records import CHUNK, FRAME, MAGIC
from .._kernel import LogChunk

CHUNK_SIZE = 256 * 1024     # bytes before compression, and about what is written in one go
_INDEX = Struct('<HI')         # channel, bytes of its index
_TIME = Struct('<Q')
_FOOTER = Struct('<BQQQ')      # what the summary's check sum takes in


def encoded(record) -> bytes:
    """Return a record of the mcap library with its frame."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def _compression(name: str):
    """Return the function bytes -> bytes of 'lz4', 'zstd' or '', by the libraries that mcap depends on."""
    if name == 'lz4':
        from lz4.frame import compress
    elif name == 'zstd':
        from zstandard import compress
    else:
        return lambda data: data
    return compress


class McapFile:
    """
    Writes into a binary stream that begins here; `compression` of chunks: '', 'lz4' or 'zstd'.

    Channels are numbered from 1, as they are added. chunk: LogChunk in the making, to which messages are added; any
    thread may do that. counts: channel -> messages in closed chunks, first_time, last_time: log times of the first and
    the last of them.
    """

    def __init__(self, stream, profile: str, library: str, compression: str = ''):
        self._stream, self._compression, self._compress = stream, compression, _compression(compression)
        self._schemas, self._channels, self._side_indexes = [], [], {Opcode.ATTACHMENT_INDEX: [],
                                                                     Opcode.METADATA_INDEX: []}
        self._chunk_indexes, self._chunk_count = bytearray(), 0
        self.counts, self.first_time, self.last_time = {}, 0, 0
        self.chunk = LogChunk()
        stream.write(MAGIC + encoded(records.Header(profile, f'{library} {LIBRARY_IDENTIFIER}')))

    def add_attachment(self, name: str, media_type: str, data: bytes, create_time: int = 0, log_time: int = 0) -> None:
        """Write an attachment, between two chunks; times in ns, 0 for unknown."""
        self.close_chunk()
        record = encoded(records.Attachment(create_time, log_time, name, media_type, data))
        self._side_indexes[Opcode.ATTACHMENT_INDEX].append(encoded(records.AttachmentIndex(
            self._stream.tell(), len(record), create_time, log_time, len(data), name, media_type)))
        self._stream.write(record)

    def add_metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a metadata record, between two chunks."""
        self.close_chunk()
        record = encoded(records.Metadata(name, dict(entries)))
        self._side_indexes[Opcode.METADATA_INDEX].append(encoded(records.MetadataIndex(
            self._stream.tell(), len(record), name)))
        self._stream.write(record)

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Explain a message type, in the chunk in the making; return its number."""
        self._schemas.append(encoded(records.Schema(len(self._schemas) + 1, data, encoding, name)))
        self.chunk.add_record(self._schemas[-1])
        return len(self._schemas)

    def add_channel(self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str]) -> int:
        """Announce a topic, in the chunk in the making; return its number."""
        self._channels.append(encoded(records.Channel(len(self._channels) + 1, topic, encoding, dict(metadata),
                                                      schema)))
        self.chunk.add_record(self._channels[-1])
        return len(self._channels)

    def flush(self) -> None:
        """Close the chunk in the making and hand all to the system."""
        self.close_chunk()
        self._stream.flush()

    def finish(self) -> None:
        """Write the end of the data, the summary and the end of the file; the stream stays open."""
        self.close_chunk()
        self._stream.write(encoded(records.DataEnd(0)))
        counts = self.counts
        statistics = records.Statistics(
            len(self._side_indexes[Opcode.ATTACHMENT_INDEX]), len(self._channels), counts, self._chunk_count,
            sum(counts.values()), self.last_time, self.first_time, len(self._side_indexes[Opcode.METADATA_INDEX]),
            len(self._schemas))
        groups = {Opcode.SCHEMA: b''.join(self._schemas), Opcode.CHANNEL: b''.join(self._channels),
                  Opcode.STATISTICS: encoded(statistics), Opcode.CHUNK_INDEX: bytes(self._chunk_indexes),
                  **{opcode: b''.join(indexes) for opcode, indexes in self._side_indexes.items()}}
        start = place = self._stream.tell()
        offsets = []
        for opcode, group in groups.items():
            if group:
                offsets.append(encoded(records.SummaryOffset(opcode, place, len(group))))
            place += len(group)
        summary = b''.join([*groups.values(), *offsets])
        footer = _FOOTER.pack(Opcode.FOOTER, 20, start, place)
        self._stream.write(summary)
        self._stream.write(encoded(records.Footer(start, place, crc32(footer, crc32(summary)))))
        self._stream.write(MAGIC)

    def close_chunk(self) -> None:
        """Write the chunk in the making with its index, if it has a message."""
        if self.chunk.messages:
            data, first, last, places = self.chunk.take()
            self._write_chunk(data, first, last, places)

    def explain(self, opcode: int, record: bytes) -> None:
        """Note a schema or a channel, a whole record, that a chunk of add_chunk() explains."""
        known = self._schemas if opcode == Opcode.SCHEMA else self._channels
        if record not in known:
            known.append(record)

    def add_chunk(self, data: bytes, first: int, last: int, places: Mapping[int, bytes]) -> None:
        """Write a chunk that another file had: as LogChunk.take() gives it, its channels numbered as there."""
        self.close_chunk()
        self._write_chunk(data, first, last, places)

    def _write_chunk(self, data: bytes, first: int, last: int, places: Mapping[int, bytes]) -> None:
        stream = self._stream
        compression, stored, start = self._compression.encode(), self._compress(data), stream.tell()
        body = CHUNK.pack(first, last, len(data), crc32(data), len(compression)) + compression
        body += _TIME.pack(len(stored))
        stream.write(FRAME.pack(Opcode.CHUNK, len(body) + len(stored)) + body)
        stream.write(stored)
        end = stream.tell()
        indexes, offsets = bytearray(), {}
        for channel, entries in places.items():
            offsets[channel] = end + len(indexes)
            indexes += FRAME.pack(Opcode.MESSAGE_INDEX, _INDEX.size + len(entries))
            indexes += _INDEX.pack(channel, len(entries)) + entries
            self.counts[channel] = self.counts.get(channel, 0) + len(entries) // 16
        stream.write(indexes)
        self._chunk_indexes += encoded(records.ChunkIndex(
            end - start, start, self._compression, len(stored), last, len(indexes), offsets, first, len(data)))
        self.first_time = self.first_time if self._chunk_count else first
        self.last_time = last
        self._chunk_count += 1
