"""info: ten lines on a log, the numbers of which are those of the whole log."""
import os
import re

from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.recording import info
from planar_chain_sim.recording.cdr import encode_float64_multi_array, encode_string, JointStateLayout
from planar_chain_sim.recording.events import encode_command, encode_event
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.log_writer import LogWriter
from planar_chain_sim.recording.rosbag2_profile import Channel
from planar_chain_sim.recording.run_settings import settings_of

PENDULUM = pcs.load_chain('double_pendulum.yaml')
LABELS = ['log', 'size', 'duration', 'ticks', 'method', 'joints', 'received', 'changes', 'events', 'gaps']
START = 1_700_000_000_000_000_000   # ns


def lines(path, capsys):
    """Return label -> text of what the command prints."""
    assert info.main([str(path)]) == 0
    said = dict(line.split(':', 1) for line in capsys.readouterr().out.splitlines())
    assert list(said) == LABELS
    return {label: text.strip() for label, text in said.items()}


@pytest.fixture(scope='module')
def live(tmp_path_factory):
    """Return a log as of a node that received a command at every tick, did not keep up twice, and begins at tick 5."""
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    simulation = pcs.Simulation(PENDULUM, 'rk4', 1e-3)
    simulation.advance(5)
    layout, topics = JointStateLayout(PENDULUM.joint_names), ('/joint_states', '/simulator/events')
    channels = [Channel(topics[0], 'sensor_msgs/msg/JointState'), Channel(topics[1], 'std_msgs/msg/String'),
                Channel('/simulator/commands', 'std_msgs/msg/Float64MultiArray')]
    with LogWriter(path, channels, {'chain.yaml': PENDULUM.source.encode()},
                   {'planar_chain_sim': settings_of(simulation, *topics)}) as writer:
        for k in range(1001):
            stamp = START + 2_000_000 * k
            writer.write(topics[0], layout.stamped(stamp), stamp, stamp, 5 + k)
            writer.write('/simulator/commands', encode_float64_multi_array([k, 0.0]), stamp, stamp)
            writer.write(topics[1], encode_command(5 + k, '/simulator/commands', np.array([k, 0.0])), stamp, stamp)
            if k in (300, 700):
                writer.write(topics[1], encode_event(5 + k, 'dropped_time', {'seconds': 0.25}), stamp, stamp)
                writer.write(topics[1], encode_event(5 + k, 'held_up', {'seconds': 9.0}), stamp, stamp)
            if k % 100 == 50:
                writer.flush()
    return path


def test_ten_lines_on_a_live_log(live, capsys, monkeypatch):
    said = lines(live, capsys)
    assert said['log'] == f'{live} of double_pendulum, finished'
    assert re.fullmatch(r'\d+(\.\d)? kB in 11 chunks, \d+ bytes a tick; version ' + pcs.__version__, said['size'])
    assert said['duration'] == '1 s simulated, t = 0.005 to 1.005 s; recorded in 2 s from 2023-11-14 22:13:20 UTC'
    assert said['ticks'] == '1000 of 0.001 s, 5 to 1005; 1001 states'
    assert said['method'] == 'rk4, form auto' and said['joints'] == '2: upper_joint, lower_joint'
    assert said['received'] == '1001: /simulator/commands 1001' and said['changes'] == '1001: command 1001'
    assert said['events'] == '4: dropped_time 2, held_up 2' and said['gaps'] == '0.5 s of wall time dropped'
    monkeypatch.setattr(info, 'MOST_CHUNKS', 5)
    said = lines(live, capsys)
    assert re.fullmatch(r'about (\d+): command \1', said['changes'])
    assert abs(int(said['changes'].split()[-1]) - 1001) <= 5


def test_logs_without_ros_and_cut_logs(tmp_path, live, capsys):
    with pcs.OfflineLog(tmp_path / 'run.mcap', pcs.Simulation(PENDULUM), record_tf=True) as log:   # nothing received
        log.advance(100, [1.0, 0.0])
        log.change('reset')
    said = lines(tmp_path / 'run.mcap', capsys)
    assert said['duration'] == '0.1 s simulated, t = 0 to 0.1 s'
    assert said['method'] == 'taylor, tolerance 1e-09, form auto'
    assert said['changes'] == '2: command 1, reset 1'
    assert (said['received'], said['events'], said['gaps']) == ('none', 'none', 'none')
    data = live.read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(data[:len(data) // 2])
    said = lines(tmp_path / 'cut.mcap', capsys)
    assert said['log'].endswith('of double_pendulum, cut short: `repair` finishes it')
    assert 300 < int(said['ticks'].split()[0]) < 600
    begin = data.index(b'rosbag2') + 100
    (tmp_path / 'begun.mcap').write_bytes(data[:begin + 1000])
    assert lines(tmp_path / 'begun.mcap', capsys)['ticks'] == 'no state is whole; 0.001 s each'


@pytest.mark.parametrize('plugin', ['MCAP', 'SQLITE3'])
def test_ten_lines_on_a_bag(live, tmp_path, capsys, plugin):
    """It tells less: no chain, method or ticks."""
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    from oracles.bags import write_bag
    messages = list(read_log(live).messages)
    messages.append(messages[0]._replace(topic='/robot_description', type_name='std_msgs/msg/String',
                                         data=encode_string('<robot/>')))   # which the node publishes
    bag = write_bag(tmp_path / 'bag', {message.topic: message.type_name for message in messages},
                    [message[:1] + (message.log_time, message.data) for message in messages],
                    getattr(rosbag2.StoragePlugin, plugin), rosbag2.CompressionMode.NONE)
    said = lines(bag, capsys)
    assert said['log'] == f'{bag}, a bag, finished' and re.fullmatch(r'\d+(\.\d)? kB in 1 file', said['size'])
    assert said['duration'] == 'unknown; recorded in 2 s from 2023-11-14 22:13:20 UTC'
    assert said['ticks'] == 'unknown; states received: 1001: /joint_states 1001'
    assert said['joints'] == '2: upper_joint, lower_joint' and said['received'] == '1001: /simulator/commands 1001'
    assert (said['changes'], said['events']) == ('1001: command 1001', '4: dropped_time 2, held_up 2')
    assert said['gaps'] == '0.5 s of wall time dropped, 0.002 s at most between two states on /joint_states'
    file, = [file for file in bag.iterdir() if file.suffix != '.yaml']
    assert {**lines(file, capsys), 'log': said['log']} == said
    assert info.main([str(tmp_path)]) == 2
    assert 'the folder holds no' in capsys.readouterr().err


def test_files_that_are_neither(tmp_path, capsys):
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'empty.mcap').touch()
    (tmp_path / 'text').write_text('name: chain')
    (tmp_path / 'text.db3').write_text('name: chain')
    for name, reason in (('pipe', 'it is no file'), ('none', 'No such file'), ('empty.mcap', 'no MCAP file'),
                         ('text', 'no MCAP file'), ('text.db3', 'cannot be read as a bag of SQLite')):
        assert info.main([str(tmp_path / name)]) == 2
        said = capsys.readouterr().err
        assert said.startswith('info: ') and said.count('\n') == 1 and name in said and reason in said


@settings(max_examples=60, deadline=2000)   # ms
@given(data=st.data())
def test_any_damage_is_ten_lines_or_one_sentence(tmp_path_factory, live, data):
    damaged = bytearray(live.read_bytes()[:60_000])
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.one_of(st.integers(0, len(damaged) - 1), st.integers(0, 3000)))
        damaged[place] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.getbasetemp() / 'damaged.mcap'
    path.write_bytes(damaged)
    try:
        assert [label for label, _ in info.log_info(path)] == LABELS
    except pcs.LogError as error:
        assert str(path) in str(error) and '\n' not in str(error)
