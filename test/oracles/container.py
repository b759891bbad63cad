"""The container of a log: checked by the mcap library and in all that `mcap doctor` looks at; and its damage."""
import struct
import zlib

from hypothesis import strategies as st
import lz4.frame
from mcap import records
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
import zstandard

MAGIC = b'\x89MCAP0\r\n'


def check_container(path):
    """Check a finished log; return the topic and log time of each message in file order."""
    with open(path, 'rb') as file:
        outer = [type(record).__name__ for record in StreamReader(file, emit_chunks=True).records]
        # All that is needed to read the rest comes first, every message is in a chunk, the end is whole.
        assert outer[:4] == ['Header', 'Attachment', 'Metadata', 'Metadata']
        assert 'Message' not in outer
        assert outer.count('DataEnd') == outer.count('Statistics') == outer.count('Footer') == 1

        file.seek(0)
        reader = make_reader(file)
        header, summary = reader.get_header(), reader.get_summary()
        assert (header.profile, bool(header.library)) == ('ros2', True)
        assert len(summary.chunk_indexes) == outer.count('Chunk') > 0
        log_times = sum((check_chunk(file, index) for index in summary.chunk_indexes), [])
        for index in summary.attachment_indexes:
            attachment, length = read_record(file, index.offset, records.Attachment)
            assert (attachment.name, length) == (index.name, index.length)
        for index in summary.metadata_indexes:
            metadata, length = read_record(file, index.offset, records.Metadata)
            assert (metadata.name, length) == (index.name, index.length)

        file.seek(0)
        found = list(StreamReader(file, validate_crcs=True).records)
    check_summary(path.read_bytes(), found)
    messages = check_explanations(found, summary)
    assert sorted(log_times) == [log_time for _, log_time in messages]
    statistics = summary.statistics
    assert (statistics.message_count, statistics.chunk_count) == (len(messages), len(summary.chunk_indexes))
    assert (statistics.attachment_count, statistics.metadata_count) == (
        len(summary.attachment_indexes), len(summary.metadata_indexes))
    assert (statistics.channel_count, statistics.schema_count) == (len(summary.channels), len(summary.schemas))
    assert (statistics.message_start_time, statistics.message_end_time) == (log_times[0], max(log_times))
    return messages


def check_summary(data, found):
    """Check what the summary says of itself: where its groups are, and its sum."""
    footer = found[-1]
    assert footer.summary_crc == zlib.crc32(data[footer.summary_start:-len(MAGIC) - 4])
    groups = [record for record in found if isinstance(record, records.SummaryOffset)]
    assert [group.group_opcode for group in groups] == [data[group.group_start] for group in groups]
    ends = [group.group_start + group.group_length for group in groups]
    assert [footer.summary_start, *ends] == [*(group.group_start for group in groups), footer.summary_offset_start]


def check_explanations(found, summary):
    """Check that each channel comes once and before its messages; return topic and log time of the messages."""
    end = [type(record) for record in found].index(records.DataEnd)
    schemas, channels, messages = {}, {}, []
    for record in found[:end]:
        if isinstance(record, records.Schema):
            assert record.id not in schemas
            schemas[record.id] = record
        elif isinstance(record, records.Channel):
            assert record.id not in channels and record.schema_id in schemas
            channels[record.id] = record
        elif isinstance(record, records.Message):
            messages.append((channels[record.channel_id].topic, record.log_time))
    assert (schemas, channels) == (summary.schemas, summary.channels)
    times = [time for _, time in messages]
    assert times == sorted(times)
    return messages


def read_record(file, offset, record_type):
    """Read the one record at an offset and return it with its length in the file."""
    file.seek(offset)
    record = next(StreamReader(file, skip_magic=True, emit_chunks=True).records)
    assert type(record) is record_type
    file.seek(offset + 1)
    return record, 9 + struct.unpack('<Q', file.read(8))[0]


def check_chunk(file, index):
    """Compare a chunk with its index in the summary and its message indexes with its messages."""
    chunk, length = read_record(file, index.chunk_start_offset, records.Chunk)
    assert length == index.chunk_length
    content = {'': bytes, 'lz4': lz4.frame.decompress, 'zstd': zstandard.decompress}[chunk.compression](chunk.data)
    assert (len(chunk.data), chunk.uncompressed_size, chunk.compression) == (
        index.compressed_size, index.uncompressed_size, index.compression)
    assert (len(content), zlib.crc32(content)) == (chunk.uncompressed_size, chunk.uncompressed_crc)
    log_times, indexes_length = [], 0
    for channel_id, offset in index.message_index_offsets.items():
        message_index, length = read_record(file, offset, records.MessageIndex)
        indexes_length += length
        assert message_index.channel_id == channel_id
        for log_time, message_offset in message_index.records:
            assert struct.unpack_from('<BQHIQ', content, message_offset)[::2] == (5, channel_id, log_time)
            log_times.append(log_time)
    assert indexes_length == index.message_index_length
    assert (min(log_times), max(log_times)) == (index.message_start_time, index.message_end_time) == (
        chunk.message_start_time, chunk.message_end_time)
    return log_times


def drawn_damage(draw, log):
    """Return the bytes of a log with one to four others in them, perhaps cut short; `draw` is that of hypothesis."""
    damaged = bytearray(log)
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.integers(0, len(damaged) - 1))
        damaged[place] = draw(st.integers(0, 255))
    del damaged[draw(st.one_of(st.just(len(damaged)), st.integers(0, len(damaged)))):]
    return damaged
