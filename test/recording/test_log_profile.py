"""The log as other tools see it: the MCAP container, the rosbag2 profile, readers by other authors."""
import os
from pathlib import Path
import re
import sys

from mcap.reader import make_reader
from oracles.container import check_container
import pytest
from recorded_run import CHANNELS, recorded, TYPE_NAMES, write_log
import yaml

from planar_chain_sim.recording.cdr import decode_joint_state
from planar_chain_sim.recording.log_writer import COMPRESSIONS
from planar_chain_sim.recording.message_types import MESSAGE_TYPES


@pytest.fixture(scope='module')
def finished(tmp_path_factory):
    """Return a finished log of several chunks and the messages in it."""
    messages = recorded(4000)
    return write_log(tmp_path_factory.mktemp('log') / 'run.mcap', messages), messages


def test_the_container_is_what_the_specification_wants(finished):
    path, messages = finished
    assert [(topic, log_time) for topic, log_time in check_container(path)] == [
        (message.topic, message.log_time) for message in messages]
    with open(path, 'rb') as file:
        summary = make_reader(file).get_summary()
    counts = {channel.topic: sum(message.topic == channel.topic for message in messages) for channel in CHANNELS}
    statistics = summary.statistics
    assert {channel.topic: statistics.channel_message_counts.get(channel.id, 0)
            for channel in summary.channels.values()} == counts
    assert len(summary.chunk_indexes) > 2
    assert (statistics.attachment_count, statistics.metadata_count, statistics.channel_count,
            statistics.schema_count) == (1, 3, 4, 4)


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
