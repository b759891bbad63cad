"""load_log: the arrays of a run, from every kind of log, LogError for bad ones; OfflineLog; other public names."""
from dataclasses import replace
from importlib.util import find_spec
import json
import os
from random import Random
import warnings

import numpy as np
from oracles.random_trees import random_state, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.recording.cdr import (
    decode_joint_state,
    encode_float64_multi_array,
    encode_string,
    JointStateLayout,
)
from planar_chain_sim.recording.events import encode_event
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.log_writer import LogWriter
from planar_chain_sim.recording.rosbag2_profile import Channel
from planar_chain_sim.recording.run_settings import settings_of
from planar_chain_sim.resimulation.bits import resimulate

ROBOT = pcs.load_chain('four_link_robot.yaml')
JOINTS = ROBOT.joint_count
EVENT = '{"tick": 0, "kind": "pause", "data": {}}'


def copied(path, copy, change=lambda message: message.data, keep=lambda message: True):
    """Return a copy of a log with other messages."""
    old = read_log(path)
    topics = {message.topic: message.type_name for message in old.messages}
    with LogWriter(copy, [Channel(*item) for item in topics.items()], {'chain.yaml': old.chain_text.encode()},
                   {'planar_chain_sim': old.settings}) as writer:
        for message in filter(keep, old.messages):
            writer.write(message.topic, change(message), message.log_time, message.publish_time, message.sequence)
    return copy


@pytest.fixture(scope='module')
def path(tmp_path_factory):
    """Return a log of 1500 ticks, several chunks, with efforts that change every tenth tick."""
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    efforts = np.repeat(np.random.default_rng(2).normal(size=(150, JOINTS)), 10, axis=0)
    with pcs.OfflineLog(path, pcs.Simulation(ROBOT)) as log:
        log.advance(1500, efforts)
    return path


def test_the_arrays_are_those_of_the_run(path):
    log = pcs.load_log(path)
    efforts = np.repeat(np.random.default_rng(2).normal(size=(150, JOINTS)), 10, axis=0)
    run = pcs.rollout(ROBOT, 1.5, effort=efforts)
    for name in ('time', 'position', 'velocity', 'effort'):
        assert getattr(log, name).tobytes() == getattr(run, name).tobytes(), name
        assert getattr(log, name).shape == getattr(run, name).shape and getattr(log, name).dtype == np.float64
    assert [event['tick'] for event in log.events] == list(range(0, 1500, 10))
    assert log.events[3] == {'tick': 30, 'kind': 'command', 'data': {'topic': '', 'effort': efforts[30].tolist()}}
    assert log.chain == ROBOT and log.commands == [] and log.complete
    assert {key: log.settings[key] for key in ('method', 'step', 'tolerance', 'form', 'tick')} == {
        'method': 'taylor', 'step': 1e-3, 'tolerance': 1e-9, 'form': 'auto', 'tick': 0}
    assert repr(log) == 'Log of four_link_robot: 1501 states of 5 joints, t = 0 to 1.5 s, 150 events, 0 commands'


@pytest.mark.parametrize('seed', range(20))
def test_random_runs_are_read_as_message_by_message(tmp_path, seed):
    """Twin: the slow decoder of one message. Random trees, steps, compressions, resets and other changes."""
    random, rng, file = Random(seed), np.random.default_rng(seed), tmp_path / 'run.mcap'
    chain = random_tree(seed, 1 + seed % 6)
    simulation = pcs.Simulation(chain, random.choice(['auto', 'rk4']), random.choice([1e-3, 0.01, 1 / 3000]))
    simulation.restore(replace(simulation.checkpoint(), tick=random.choice([0, 2**32 - 30, 7])))
    with pcs.OfflineLog(file, simulation, random.choice(['none', 'lz4', 'zstd'])) as log:
        for _ in range(random.randrange(6)):
            if random.random() < 0.5:
                log.change('reset')
            elif random.random() < 0.5:
                position, velocity, _ = random_state(chain, seed)
                log.change('state', position=position, velocity=velocity)
            log.advance(random.randrange(40), rng.normal(size=chain.joint_count))
    expected = {}   # tick -> position and velocity of its last state, effort of its first
    for message in read_log(file).messages:
        if message.topic == '/joint_states':
            state, tick = decode_joint_state(message.data), message.sequence + 2**32 * (
                message.sequence < 2**31 < simulation.tick)
            expected[tick] = state.position, state.velocity, expected.get(tick, (0, 0, state.effort))[2]
    log = pcs.load_log(file)
    assert log.time.tolist() == [tick * simulation.step for tick in expected]
    rows = list(expected.values())
    assert log.position.tolist() == [row[0].tolist() for row in rows]
    assert log.velocity.tolist() == [row[1].tolist() for row in rows]
    assert log.effort.tolist() == [row[2].tolist() for row in rows[1:]]
    assert log.effort.shape == (len(rows) - 1, chain.joint_count)


def live_log(folder, ticks=300, frame_id='base', close=True):
    """Write a log as the node does: commands as received, events, states and clock by turns; return its path."""
    simulation, path = pcs.Simulation(ROBOT), folder / 'live.mcap'
    types = {'/arm/joint_states': 'sensor_msgs/msg/JointState', '/arm/simulator/events': 'std_msgs/msg/String',
             '/arm/simulator/commands': 'std_msgs/msg/Float64MultiArray', '/clock': 'rosgraph_msgs/msg/Clock',
             '/arm/simulator/joint_commands': 'sensor_msgs/msg/JointState',
             '/arm/simulator/wrench': 'geometry_msgs/msg/WrenchStamped'}
    layout, command = JointStateLayout(ROBOT.joint_names, frame_id), JointStateLayout(ROBOT.joint_names[:1])
    writer = LogWriter(path, [Channel(*item) for item in types.items()], {'chain.yaml': ROBOT.source.encode()},
                       {'planar_chain_sim': settings_of(simulation, '/arm/joint_states', '/arm/simulator/events')})
    start = 1_700_000_000_000_000_000
    for tick in range(ticks + 1):
        now = start + 2_000_000 * tick   # the wall at half pace, as after dropped time
        layout.position[:], layout.velocity[:] = simulation.position, simulation.velocity
        layout.effort[:] = simulation.effort
        writer.write('/clock', bytes(12), now, now)
        writer.write('/arm/joint_states', layout.stamped(now), now, now, tick)
        effort = np.full(JOINTS, 0.01 * tick)
        if tick % 3 == 0:
            writer.write('/arm/simulator/commands', encode_float64_multi_array(effort), now, now)
            writer.write('/arm/simulator/events', encode_event(tick, 'command', {
                'topic': '/arm/simulator/commands', 'effort': effort.tolist()}), now + 1, now + 1)
        elif tick % 50 == 1:
            command.effort[:] = tick
            writer.write('/arm/simulator/joint_commands', command.stamped(tick), now, now)
            writer.write('/arm/simulator/commands', b'nonsense', now + 5, now)
        if tick < ticks:
            simulation.advance(1, np.full(JOINTS, 0.01 * (tick - tick % 3)))
    if close:
        writer.close()
    else:
        writer.flush()
    return path, simulation


def test_a_log_with_commands_as_received_and_a_clock(tmp_path):
    path, simulation = live_log(tmp_path, frame_id='größe')
    log = pcs.load_log(path)
    assert resimulate(read_log(path)).difference is None
    assert log.time.tolist() == [tick * 1e-3 for tick in range(301)]
    assert log.position[-1].tolist() == simulation.position.tolist()
    assert log.effort[:6, 0].tolist() == [0.0, 0.0, 0.0, 0.03, 0.03, 0.03]
    assert len(log.events) == 101 and log.events[5]['tick'] == 15
    first, *_, last = log.commands
    assert first == {'topic': '/arm/simulator/commands', 'received': 1_700_000_000_000_000_000, 'effort': [0.0] * 5}
    assert last['effort'] == [3.0] * 5
    by_name = [command for command in log.commands if 'names' in command]
    assert [command['names'] for command in by_name] == 4 * [[ROBOT.joint_names[0]]]
    assert by_name[1]['effort'] == [151.0] or by_name[1]['stamp'] == 101
    assert sum('error' in command for command in log.commands) == len(by_name) == 4
    assert [command['received'] for command in log.commands] == sorted(c['received'] for c in log.commands)


def test_a_log_that_was_not_closed_or_is_cut_anywhere_is_read_as_far_as_it_is_whole(tmp_path):
    """Prefix: whatever is read is the beginning of the whole run."""
    whole, _ = live_log(tmp_path, close=False)
    with pytest.warns(RuntimeWarning, match='it was not closed properly, 301 whole states could be read'):
        log, content = pcs.load_log(whole), whole.read_bytes()
    assert not log.complete and repr(log).endswith('not closed properly')
    cut, lengths, random = tmp_path / 'cut.mcap', set(), Random(4)
    for size in [len(content) - 1, *(random.randrange(len(content)) for _ in range(60))]:
        cut.write_bytes(content[:size])
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter('always')
            try:
                part = pcs.load_log(cut)
            except pcs.LogError as error:   # before the settings, which lie at the beginning
                assert str(error).startswith(f'log {str(cut)!r}: it is no ') and size < 20_000
                continue
        assert len(told) == 1 and str(told[0].message).startswith(
            f'log {str(cut)!r}: it was not closed properly, {len(part.time)} whole state')
        lengths.add(len(part.time))
        assert part.position.tobytes() == log.position[:len(part.time)].tobytes()
        assert part.effort.shape == (max(len(part.time) - 1, 0), JOINTS)
        assert part.events == log.events[:len(part.events)]
    assert 0 in lengths and len(lengths) > 1


def test_where_a_tick_has_two_states_the_last_counts_and_the_effort_that_led_there(tmp_path):
    simulation, path, layout = pcs.Simulation(ROBOT), tmp_path / 'run.mcap', JointStateLayout(ROBOT.joint_names)
    with LogWriter(path, [Channel('/joint_states', 'sensor_msgs/msg/JointState')],
                   {'chain.yaml': ROBOT.source.encode()},
                   {'planar_chain_sim': settings_of(simulation, '/joint_states', '/simulator/events')}) as writer:
        for number, tick in enumerate([0, 1, 1, 1, 2]):
            layout.position[:], layout.effort[:] = number, 10 + number
            writer.write('/joint_states', layout.stamped(number), number, number, tick)
    log = pcs.load_log(path)
    assert log.time.tolist() == [0.0, 1e-3, 2e-3]
    assert log.position[:, 0].tolist() == [0.0, 3.0, 4.0] and log.effort[:, 0].tolist() == [11.0, 14.0]


def test_a_log_without_states_has_no_rows(tmp_path):
    simulation, path = pcs.Simulation(ROBOT), tmp_path / 'empty.mcap'
    with LogWriter(path, [Channel('/joint_states', 'sensor_msgs/msg/JointState')],
                   {'chain.yaml': ROBOT.source.encode()},
                   {'planar_chain_sim': settings_of(simulation, '/joint_states', '/simulator/events')}):
        pass
    log = pcs.load_log(path)
    assert log.time.shape == (0,) and log.position.shape == log.velocity.shape == log.effort.shape == (0, JOINTS)
    assert log.events == log.commands == [] and log.complete
    assert repr(log) == 'Log of four_link_robot: 0 states of 5 joints, 0 events, 0 commands'


def test_what_the_log_holds_stays_when_the_file_is_gone(tmp_path):
    path, _ = live_log(tmp_path)
    log = pcs.load_log(path)
    os.remove(path)
    assert len(log.events) == 101 and len(log.commands) > 101


@pytest.mark.parametrize('name, options, message', [
    ('lost tick', {'keep': lambda m: not (m.topic == '/joint_states' and m.sequence == 700)},
     'its state of tick 701 does not follow tick 699'),
    ('torn state', {'change': lambda m: m.data[:-9] if m.sequence == 700 else m.data}, 'its state of tick 700 cannot'),
    ('other joints', {'change': lambda m: m.data.replace(b'upper_arm', b'lower_arm') if m.sequence == 3 else m.data},
     'its state of tick 3 names other joints than its chain'),
    ('no efforts', {'change': lambda m: m.data[:-48] + bytes(4) if m.sequence == 3 else m.data},
     'its state of tick 3 lacks values of effort'),
    ('bad event', {'change': lambda m: encode_string('{]') if m.topic != '/joint_states' else m.data}, 'is no event'),
    ('two in one', {'change': lambda m: encode_string(f'{EVENT}, {EVENT}') if m.topic != '/joint_states' else m.data},
     'is no event'),
    ('event without data', {'change': lambda m: encode_string('[]') if m.topic != '/joint_states' else m.data},
     'is no event'),
])
def test_a_log_that_cannot_be_understood_is_one_sentence(path, tmp_path, name, options, message):
    bad = copied(path, tmp_path / 'bad.mcap', **options)
    with pytest.raises(pcs.LogError, match=message) as said:
        pcs.load_log(bad)
    assert str(said.value).startswith(f'log {str(bad)!r}: ') and '\n' not in str(said.value)


def test_states_written_by_another_tool_are_read_too(path, tmp_path):
    """With spare bytes at the end, as rmw_fastrtps sends them."""
    def change(message):
        if message.topic != '/joint_states' or message.sequence % 3:
            return message.data
        return message.data + b'spare'
    assert pcs.load_log(copied(path, tmp_path / 'spare.mcap', change)).position.tobytes() == pcs.load_log(
        path).position.tobytes()


def test_a_flipped_byte_is_read_or_one_sentence(path, tmp_path):
    """Never a traceback of another kind, whatever was damaged."""
    content, random, damaged, refused = path.read_bytes(), Random(7), tmp_path / 'damaged.mcap', 0
    for _ in range(200):
        copy = bytearray(content)
        place = random.choice([random.randrange(len(copy)), random.randrange(20_000)])
        copy[place] ^= 1 << random.randrange(8)
        damaged.write_bytes(copy)
        try:
            log = pcs.load_log(damaged)
            assert log.position.shape == (len(log.time), JOINTS) and isinstance(log.events, list)
        except pcs.LogError as error:
            refused += 1
            assert str(error).startswith('log ') and '\n' not in str(error)
    assert 10 < refused < 190


@pytest.mark.parametrize('make, message', [
    (lambda path: None, 'it cannot be read'), (lambda path: path.mkdir(), 'it is no file'),
    (lambda path: path.write_bytes(b''), 'no MCAP file'), (lambda path: path.write_text('x' * 99), 'no MCAP file'),
])
def test_what_is_no_log_is_one_sentence(tmp_path, make, message):
    make(tmp_path / 'odd.mcap')
    with pytest.raises(pcs.LogError, match=message):
        pcs.load_log(tmp_path / 'odd.mcap')


@pytest.mark.skipif(find_spec('pandas') is None, reason='pandas is not installed')
def test_to_pandas_has_a_column_for_each_quantity_of_each_joint(path):
    log = pcs.load_log(path)
    frame = log.to_pandas()
    assert frame.shape == (1501, 3 * JOINTS) and frame.index.name == 'time' and frame.index[-1] == 1.5
    joint = ROBOT.joint_names[2]
    assert (frame['position'][joint] == log.position[:, 2]).all()
    assert (frame['effort'][joint][:-1] == log.effort[:, 2]).all() and np.isnan(frame['effort'].iloc[-1]).all()


@pytest.mark.skipif(find_spec('pandas') is not None, reason='pandas is installed')
def test_to_pandas_says_what_is_missing(path):
    with pytest.raises(ImportError, match='^Log.to_pandas needs pandas, which is not installed: pip install pandas$'):
        pcs.load_log(path).to_pandas()


def test_changes_of_an_offline_log_that_cannot_be_leave_nothing_in_it(tmp_path):
    simulation, path = pcs.Simulation(ROBOT), tmp_path / 'run.mcap'
    with pcs.OfflineLog(path, simulation) as log:
        for kind, data, message in (
                ('restart', {}, "the change is 'restart', must be one of 'reset', 'state', 'parameter', 'payload'"),
                ('command', {'effort': [0.0] * 5}, "the change is 'command', must be one of"),
                ('wrench', {'force': [1.0, 0.0]}, "the event 'wrench' lacks 'body'"),
                ('wrench', {'body': 'elbow'}, "body is 'elbow', must be one of column"),
                ('wrench', {'body': 'column', 'torque': 1.0}, "the change 'wrench' has 'torque', must have body"),
                ('wrench', {'body': 'column', 'force': [np.inf, 0.0]}, 'force'),
                ('parameter', {'name': 'damping', 'value': [-1.0] * 5}, "'damping' is -1.0 in one place"),
                ('parameter', {'name': 'gravitiy', 'value': [0.0, 0.0]}, "^the parameter is 'gravitiy', must be"),
                ('parameter', {'name': 'rate', 'value': 500.0}, "^the parameter is 'rate', must be one of 'gravity', "),
                ('parameter', {'name': 'effort_limit', 'value': ['much'] * 5}, 'must be a list of numbers'),
                ('parameter', {'name': 'effort_limit', 'value': [[1.0]] * 5}, 'must be a list of numbers'),
                ('state', {'position': [0.0], 'velocity': [0.0] * 5}, 'position has shape'),
                ('payload', {'name': 'p', 'body': 'column', 'mass': -1.0, 'position': [0.0, 0.0]}, 'must be > 0'),
                ('state', {'position': object(), 'velocity': 1}, 'cannot be written as JSON')):
            with pytest.raises(ValueError, match=message):
                log.change(kind, **data)
        for ticks, effort, message in ((-1, None, 'ticks is -1'), (2.5, None, 'ticks is 2.5'), (2, [1.0], 'effort has'),
                                       (2, np.zeros((3, 5)), 'effort has'), (2, [np.nan] * 5, 'effort')):
            with pytest.raises(ValueError, match=message):
                log.advance(ticks, effort)
        log.advance(2)
        simulation.advance(1)
        with pytest.raises(ValueError, match='must be moved by advance\\(\\) of the log'):
            log.advance(1)
    assert pcs.load_log(path).events == [] and len(pcs.load_log(path).time) == 3


@pytest.mark.parametrize('change, what', [
    (lambda simulation: simulation.set_wrench('forearm', [5.0, 0.0]), 'wrenches'),
    (lambda simulation: simulation.attach('side_arm', 2.0, (0.4, 0.0)), 'chain or payloads'),
    (lambda simulation: simulation.set_state(np.zeros(JOINTS), np.zeros(JOINTS)), 'state'),
    (lambda simulation: simulation.replace_chain(ROBOT.with_parameters({'gravity.y': -1.62})), 'chain or payloads')])
def test_what_an_offline_log_was_not_told_is_refused(tmp_path, change, what):
    """Such a log would not run again, and nobody would know why."""
    simulation, path = pcs.Simulation(ROBOT), tmp_path / 'run.mcap'
    with pcs.OfflineLog(path, simulation) as log:
        log.advance(20)
        change(simulation)
        for call in (lambda: log.advance(1), lambda: log.change('reset')):
            with pytest.raises(ValueError, match=f"^the simulation's {what} changed at tick 20, but not in its log"):
                call()
    assert resimulate(read_log(path)).difference is None


def test_a_limit_of_none_is_no_limit(tmp_path):
    """As the events' table says."""
    simulation, path = pcs.Simulation(ROBOT), tmp_path / 'run.mcap'
    with pcs.OfflineLog(path, simulation) as log:
        log.change('parameter', name='effort_limit', value=[None, 2.0, np.inf, 3.0, None])
        log.advance(5, [9.0] * JOINTS)
    assert [joint.effort_limit for joint in simulation.chain.joints] == [np.inf, 2.0, np.inf, 3.0, np.inf]
    assert pcs.load_log(path).events[0]['data']['value'] == [None, 2.0, None, 3.0, None]
    assert resimulate(read_log(path)).difference is None


def test_an_offline_log_of_what_is_no_simulation_is_refused(tmp_path):
    with pytest.raises(TypeError, match=r'must be a Simulation: Simulation\(chain\) makes one$'):
        pcs.OfflineLog(tmp_path / 'run.mcap', ROBOT)
    assert not (tmp_path / 'run.mcap').exists()


def test_a_log_that_begins_in_the_middle_runs_again(tmp_path):
    """After efforts, with a payload on a payload, a wrench, hidden round-off terms and steps under way."""
    simulation, path = pcs.Simulation(ROBOT), tmp_path / 'run.mcap'
    simulation.advance(137, np.full(JOINTS, 0.3))
    simulation.attach('forearm', 0.4, (0.1, 0.0), 0.01, 'tray')
    simulation.attach('tray', 0.2, (0.0, 0.1), 0.0, 'cup')
    simulation.set_wrench('cup', (1.0, 2.0), 0.1, 'world')
    with pcs.OfflineLog(path, simulation) as log:
        log.advance(50, np.full(JOINTS, 0.2))
        log.change('payload', name='cup', body='tray', mass=0.0, position=[0.0, 0.0])
        log.advance(50)
    verdict = resimulate(read_log(path))
    assert verdict.difference is None and verdict.ticks == 100 and verdict.states == 101
    read = pcs.load_log(path)
    assert read.time[0] == 137e-3 and [event['kind'] for event in read.events] == [
        'payload', 'payload', 'wrench', 'command', 'payload', 'command']
    simulation.advance_to(simulation.time + 0.5e-3)
    with pytest.raises(ValueError, match='between two ticks'):
        pcs.OfflineLog(tmp_path / 'other.mcap', simulation)
    assert not (tmp_path / 'other.mcap').exists()


@pytest.mark.parametrize('given', [None, 3, [], {}, ['name: one'], bytearray(b'name: one')])
def test_what_is_no_text_of_a_chain_is_refused(given):
    with pytest.raises(TypeError, match='must be the text of a chain: load_chain reads a file, chain_from_dict data$'):
        pcs.chain_from_text(given)


@pytest.mark.parametrize('topic', ['', 'a b', '/a"b', None, 3])
def test_a_topic_that_cannot_be_is_refused(topic):
    for name in ('commands', 'states'):
        with pytest.raises(ValueError, match=f'^{name} is .*, must be a topic such as /joint_states$'):
            pcs.urdf_of(ROBOT, **{name: topic})


def test_the_other_public_names():
    text = 'name: one\nbodies:\n- {name: b, carrier: base, mass: 1, inertia_com: 1, rotation: {joint: j}}\n'
    chain = pcs.chain_from_text(text)
    assert chain.joint_names == ('j',) and '<robot name="one"' in pcs.urdf_of(chain)
    with pytest.raises(pcs.ChainError, match='^my text line 1: '):
        pcs.chain_from_text('nam: x', 'my text')
    simulation = pcs.Simulation(chain)
    simulation.set_wrench('b', (1.0, 2.0), 3.0, 'world')
    assert simulation.wrenches['b'] == pcs.Wrench(1.0 + 2.0j, 3.0, 'world')
    assert pcs.JointEvent._fields == ('tick', 'time', 'kind', 'joint', 'speed')
    assert issubclass(pcs.LogError, Exception) and json.dumps(pcs.Wrench._fields) == '["force", "moment", "axes"]'
