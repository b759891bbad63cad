"""The log as other tools see it: the MCAP container, the rosbag2 profile, readers by other authors."""
import os
from pathlib import Path
import re
import struct
import sys
import zlib

from mcap import records
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
import pytest
from recorded_run import CHANNELS, recorded, TYPE_NAMES, write_log
import yaml

from planar_chain_sim.recording.cdr import decode_joint_state
from planar_chain_sim.recording.log_writer import COMPRESSIONS
from planar_chain_sim.recording.mcap_file import MAGIC
from planar_chain_sim.recording.message_types import MESSAGE_TYPES


@pytest.fixture(scope='module')
def finished(tmp_path_factory):
    """Return a finished log of several chunks and the messages in it."""
    messages = recorded(4000)
    return write_log(tmp_path_factory.mktemp('log') / 'run.mcap', messages), messages


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
    assert (len(chunk.data), chunk.uncompressed_size, chunk.compression) == (
        index.compressed_size, index.uncompressed_size, index.compression) == (len(chunk.data),) * 2 + ('',)
    assert zlib.crc32(chunk.data) == chunk.uncompressed_crc
    assert length <= 257 * 1024
    log_times, indexes_length = [], 0
    for channel_id, offset in index.message_index_offsets.items():
        message_index, length = read_record(file, offset, records.MessageIndex)
        indexes_length += length
        assert message_index.channel_id == channel_id
        for log_time, message_offset in message_index.records:
            assert struct.unpack_from('<BQHIQ', chunk.data, message_offset)[::2] == (5, channel_id, log_time)
            log_times.append(log_time)
    assert indexes_length == index.message_index_length
    assert (min(log_times), max(log_times)) == (index.message_start_time, index.message_end_time) == (
        chunk.message_start_time, chunk.message_end_time)
    return log_times


def test_the_container_is_what_the_specification_wants(finished):
    path, messages = finished
    with open(path, 'rb') as file:
        outer = [type(record).__name__ for record in StreamReader(file, emit_chunks=True).records]
        # All that is needed to read the rest comes first, every message is in a chunk, the end is whole.
        assert outer[:4] == ['Header', 'Attachment', 'Metadata', 'Metadata']
        assert 'Message' not in outer and outer.count('Chunk') > 2
        assert outer.count('DataEnd') == outer.count('Statistics') == outer.count('Footer') == 1

        file.seek(0)
        reader = make_reader(file)
        header, summary = reader.get_header(), reader.get_summary()
        assert (header.profile, bool(header.library)) == ('ros2', True)
        log_times = sum((check_chunk(file, index) for index in summary.chunk_indexes), [])
        assert sorted(log_times) == [message.log_time for message in messages]
        for index in summary.attachment_indexes:
            attachment, length = read_record(file, index.offset, records.Attachment)
            assert (attachment.name, length) == (index.name, index.length)
        for index in summary.metadata_indexes:
            metadata, length = read_record(file, index.offset, records.Metadata)
            assert (metadata.name, length) == (index.name, index.length)

        file.seek(0)
        found = list(StreamReader(file, validate_crcs=True).records)
        assert len(found) > len(messages)

    # The summary says of itself where its groups are, and sums itself up.
    data, footer = path.read_bytes(), found[-1]
    assert footer.summary_crc == zlib.crc32(data[footer.summary_start:-len(MAGIC) - 4])
    groups = [record for record in found if isinstance(record, records.SummaryOffset)]
    assert [group.group_opcode for group in groups] == [data[group.group_start] for group in groups]
    ends = [group.group_start + group.group_length for group in groups]
    assert [footer.summary_start, *ends] == [*(group.group_start for group in groups), footer.summary_offset_start]

    counts = {channel.topic: sum(message.topic == channel.topic for message in messages) for channel in CHANNELS}
    statistics = summary.statistics
    assert {channel.topic: statistics.channel_message_counts.get(channel.id, 0)
            for channel in summary.channels.values()} == counts
    assert (statistics.message_count, statistics.chunk_count, statistics.attachment_count, statistics.metadata_count,
            statistics.channel_count, statistics.schema_count) == (
                len(messages), len(summary.chunk_indexes), 1, 3, 4, 4)
    assert (statistics.message_start_time, statistics.message_end_time) == (
        messages[0].log_time, messages[-1].log_time)


def test_every_record_is_explained_before_it_is_needed(finished):
    with open(finished[0], 'rb') as file:
        summary = make_reader(file).get_summary()
        file.seek(0)
        stream = list(StreamReader(file).records)
    end = [type(record) for record in stream].index(records.DataEnd)
    schemas, channels = {}, {}
    for record in stream[:end]:
        if isinstance(record, records.Schema):
            assert record.id not in schemas
            schemas[record.id] = record
        elif isinstance(record, records.Channel):
            assert record.id not in channels and record.schema_id in schemas
            channels[record.id] = record
        elif isinstance(record, records.Message):
            assert record.channel_id in channels
    assert (schemas, channels) == (summary.schemas, summary.channels)


def test_channels_and_schemas_are_those_of_rosbag2(finished):
    with open(finished[0], 'rb') as file:
        summary = make_reader(file).get_summary()
    assert [channel.topic for channel in summary.channels.values()] == list(TYPE_NAMES)
    assert min(summary.schemas) >= 1
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        assert (schema.name, schema.encoding, channel.message_encoding) == (TYPE_NAMES[channel.topic], 'ros2msg', 'cdr')
        assert schema.data.decode() == MESSAGE_TYPES[schema.name].definition
        assert channel.metadata['topic_type_hash'] == MESSAGE_TYPES[schema.name].type_hash
        qos, = yaml.safe_load(channel.metadata['offered_qos_profiles'])
        forever = {'sec': 9223372036, 'nsec': 854775807}
        wanted = next(wanted for wanted in CHANNELS if wanted.topic == channel.topic)
        assert qos == {
            'history': 'keep_last', 'depth': wanted.depth, 'reliability': wanted.reliability, 'durability': 'volatile',
            'deadline': forever, 'lifespan': forever, 'liveliness': 'automatic', 'liveliness_lease_duration': forever,
            'avoid_ros_namespace_conventions': False}


def test_bag_information_at_open_and_at_close(finished):
    path, messages = finished
    with open(path, 'rb') as file:
        empty, full = [yaml.safe_load(record.metadata['serialized_metadata'])
                       for record in make_reader(file).iter_metadata() if record.name == 'rosbag2']
    for information, total in ((empty, 0), (full, len(messages))):
        assert (information['version'], information['storage_identifier']) == (9, 'mcap')
        assert information['message_count'] == information['files'][0]['message_count'] == total
        assert sum(topic['message_count'] for topic in information['topics_with_message_count']) == total
        assert information['relative_file_paths'] == [path.name]
    assert empty['duration']['nanoseconds'] == 0
    assert full['starting_time']['nanoseconds_since_epoch'] == messages[0].log_time
    assert full['duration']['nanoseconds'] == messages[-1].log_time - messages[0].log_time


@pytest.mark.parametrize('compression', COMPRESSIONS)
def test_rosbags_reads_it(tmp_path, compression):
    highlevel = pytest.importorskip('rosbags.highlevel')
    messages = recorded(400)
    path = write_log(tmp_path / 'run.mcap', messages, compression=compression)
    with highlevel.AnyReader([path]) as reader:
        assert {(connection.topic, connection.msgtype, connection.msgcount) for connection in reader.connections} == {
            (topic, type_name, sum(message.topic == topic for message in messages))
            for topic, type_name in TYPE_NAMES.items()}
        assert all(len(connection.ext.offered_qos_profiles) == 1 for connection in reader.connections)
        read = [(connection.topic, log_time, bytes(data)) for connection, log_time, data in reader.messages()]
        assert read == [(message.topic, message.log_time, message.data) for message in messages]
        last = [reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages()][-1]
        assert last.data == '{"tick": 399}'


def test_mcap_ros2_support_reads_it(finished):
    decoder = pytest.importorskip('mcap_ros2.decoder')
    path, messages = finished
    with open(path, 'rb') as file:
        decoded = list(make_reader(file, decoder_factories=[decoder.DecoderFactory()]).iter_decoded_messages())
    assert len(decoded) == len(messages)
    for (_, channel, record, read), message in zip(decoded, messages):
        assert (channel.topic, record.log_time, record.sequence) == (
            message.topic, message.log_time, message.sequence)
        if channel.topic == '/joint_states':
            ours = decode_joint_state(message.data)
            assert (read.name, read.position, read.header.frame_id) == (['a', 'b'], ours.position.tolist(), 'base')
            assert read.header.stamp.sec * 10 ** 9 + read.header.stamp.nanosec == ours.stamp


@pytest.mark.parametrize('type_name', MESSAGE_TYPES)
def test_type_hash_follows_from_the_definition(type_name):
    typesys = pytest.importorskip('rosbags.typesys')
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    store.register(typesys.get_types_from_msg(MESSAGE_TYPES[type_name].definition, type_name))
    assert store.hash_rihs01(type_name) == MESSAGE_TYPES[type_name].type_hash


def fields(definition):
    """Return a message definition's fields, without comments and with single spaces."""
    lines = (re.sub('#.*', '', line).split() for line in definition.splitlines())
    return [' '.join(words) for words in lines if words]


@pytest.mark.ros
@pytest.mark.parametrize('type_name', MESSAGE_TYPES)
def test_definitions_are_the_installed_ones(type_name):
    roots = [Path(root) for root in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) + [sys.prefix] if root]
    text = f'MSG: {type_name}\n' + MESSAGE_TYPES[type_name].definition
    for part in text.split('\n' + '=' * 80 + '\n'):
        title, definition = part.split('\n', 1)
        package, name = title.replace('MSG: ', '').replace('/msg/', '/').split('/')
        installed = [path for root in roots if (path := root / 'share' / package / 'msg' / f'{name}.msg').exists()]
        assert installed or package == 'tf2_msgs', 'which ROS from the package index does not have'
        assert all(fields(definition) == fields(path.read_text()) for path in installed[:1])
