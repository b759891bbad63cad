"""A short run and its log, for the tests of the log."""
from planar_chain_sim.recording.cdr import encode_float64_multi_array, encode_string, JointStateLayout
from planar_chain_sim.recording.log_reader import LogMessage
from planar_chain_sim.recording.log_writer import Channel, LogWriter

CHANNELS = (Channel('/joint_states', 'sensor_msgs/msg/JointState'),
            Channel('/simulator/commands', 'std_msgs/msg/Float64MultiArray', depth=64),
            Channel('/simulator/events', 'std_msgs/msg/String'),
            Channel('/clock', 'rosgraph_msgs/msg/Clock', depth=1, reliability='best_effort'))
TYPE_NAMES = {channel.topic: channel.type_name for channel in CHANNELS}
CHAIN_TEXT = 'name: größer\n'
SETTINGS = {'format': '1', 'method': 'rk4', 'joint_names': '["a", "b"]'}
EXTRAS = {'attachments': {'chain.yaml': CHAIN_TEXT.encode()}, 'metadata': {'planar_chain_sim': SETTINGS}}
START = 1_700_000_000_000_000_000


def recorded(ticks):
    """Return the messages of a short run, as the log must give them back."""
    layout = JointStateLayout(['a', 'b'], 'base')
    run = []
    for tick in range(ticks):
        stamp = START + tick * 1_000_000
        layout.position[:] = tick, -tick
        run.append(('/joint_states', layout.stamped(stamp), stamp, stamp - 5, tick))
        if tick % 3 == 0:
            run.append(('/simulator/commands', encode_float64_multi_array([tick, 0.5]), stamp + 7, stamp, 0))
            run.append(('/simulator/events', encode_string(f'{{"tick": {tick}}}'), stamp + 7, stamp + 7, 2 ** 32 - 1))
    return [LogMessage(topic, TYPE_NAMES[topic], log_time, publish_time, sequence, data)
            for topic, data, log_time, publish_time, sequence in run]


def write(writer, messages):
    for message in messages:
        writer.write(message.topic, message.data, message.log_time, message.publish_time, message.sequence)


def write_log(path, messages, **options):
    with LogWriter(path, CHANNELS, **EXTRAS, **options) as writer:
        write(writer, messages)
    return path
