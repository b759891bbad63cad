"""Commands rollout and resimulate: equal bits, a flipped bit found, one sentence for a mistake, all without ROS."""
from dataclasses import replace
import json
from pathlib import Path
from random import Random
import struct
import subprocess
import sys

import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.pictures import plot
from planar_chain_sim.recording import rollout
from planar_chain_sim.recording.cdr import decode_joint_state, encode_string, JointStateLayout
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.log_writer import LogWriter
from planar_chain_sim.recording.rosbag2_profile import Channel
from planar_chain_sim.resimulation import command_line as resimulation
from planar_chain_sim.symbolic import command_line as equations

ROBOT = 'four_link_robot.yaml'


@pytest.fixture(scope='module')
def efforts(tmp_path_factory):
    path = tmp_path_factory.mktemp('efforts') / 'efforts.csv'
    np.savetxt(path, np.random.default_rng(0).normal(size=(300, 5)).repeat(5, axis=0), delimiter=',')
    return path


@pytest.fixture(scope='module')
def log(tmp_path_factory, efforts):
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    assert rollout.main([ROBOT, '--output', str(path), '--effort', str(efforts)]) == 0
    return path


def rewritten(log, path, change=lambda message: message.data, chain_text=None, settings=None,
              keep=lambda message: True):
    """Return a copy of the log with messages, chain or settings changed."""
    old = read_log(log)
    topics = {message.topic: message.type_name for message in old.messages}
    with LogWriter(path, [Channel(*item) for item in topics.items()],
                   {'chain.yaml': (old.chain_text if chain_text is None else chain_text).encode()},
                   {'planar_chain_sim': {**old.settings, **(settings or {})}}) as writer:
        for message in filter(keep, old.messages):
            writer.write(message.topic, change(message), message.log_time, message.publish_time, message.sequence)
    return path


def test_log_holds_every_tick_and_the_run_of_the_python_function(log, efforts):
    rows = np.loadtxt(efforts, delimiter=',')
    run = pcs.rollout(pcs.load_chain(ROBOT), 1.5, effort=rows)
    states = [message for message in read_log(log).messages if message.topic == '/joint_states']
    decoded = [decode_joint_state(message.data) for message in states]
    assert [message.sequence for message in states] == list(range(1501))
    times = [k * 1_000_000 for k in range(1501)]
    assert [message.log_time for message in states] == times == [state.stamp for state in decoded]
    assert np.array([d.position for d in decoded]).tobytes() == run.position.tobytes()
    assert np.array([d.velocity for d in decoded]).tobytes() == run.velocity.tobytes()
    assert np.array([d.effort for d in decoded[1:]]).tobytes() == run.effort.tobytes()
    events = [message for message in read_log(log).messages if message.topic == '/simulator/events']
    assert len(events) == 300      # one where the effort changes, none where it is held


def test_resimulate_says_equal(log, capsys):
    assert resimulation.main([str(log)]) == 0
    assert capsys.readouterr().out == 'equal: 1501 states over 1500 ticks, bit for bit\n'


@pytest.mark.parametrize('quantity, joint, tick', [('position', 0, 0), ('velocity', 3, 700), ('effort', 4, 1500)])
def test_one_flipped_bit_in_the_file_is_named(log, tmp_path, capsys, quantity, joint, tick):
    """The lowest bit of one number, changed in the file itself: the chunk's check sum doesn't hide which one it was."""
    chain, found = pcs.load_chain(ROBOT), None
    for message in read_log(log).messages:
        if message.topic == '/joint_states' and message.sequence == tick:
            found = message.data
    content = bytearray(log.read_bytes())
    layout = JointStateLayout(chain.joint_names)
    start = content.index(found)
    assert content.find(found, start + 1) == -1
    clean = layout.stamped(0)
    getattr(layout, quantity)[joint] = struct.unpack('<d', b'\xff' * 6 + b'\xef\x3f')[0]     # all bits of the mantissa
    offset = next(k for k, (a, b) in enumerate(zip(clean, layout.stamped(0))) if a != b)
    content[start + offset] ^= 1
    flipped = tmp_path / 'flipped.mcap'
    flipped.write_bytes(content)
    assert resimulation.main([str(flipped)]) == 1
    said = capsys.readouterr().out
    name = chain.joint_names[joint]
    assert said.startswith(f"different: t = {tick * 1e-3:.12g} s, tick {tick}, joint '{name}': {quantity} is ")


def test_another_chain_or_method_setting_is_a_difference(log, tmp_path, capsys):
    text = read_log(log).chain_text.replace('mass: 2.0', 'mass: 2.0000000000000004')
    assert resimulation.main([str(rewritten(log, tmp_path / 'heavier.mcap', chain_text=text))]) == 1
    step = (1.0000001e-3).hex()
    assert resimulation.main([str(rewritten(log, tmp_path / 'faster.mcap', settings={'step': step}))]) == 1
    assert 'different: t = 0.001' in capsys.readouterr().out


def test_reset_and_repeated_events_act_at_their_tick(tmp_path, capsys):
    """As the node writes it: commands, a reset between two ticks and its state once more, a pause that does nothing."""
    chain = pcs.load_chain(ROBOT)
    simulation = pcs.Simulation(chain)
    path = tmp_path / 'live.mcap'
    with pcs.OfflineLog(path, simulation) as log:
        for k in range(50):
            log._write_command(simulation.tick, np.full(5, 0.1 * k - 1.0))   # overtaken at the same tick by the next
            log.advance(1, np.full(5, 0.1 * k))
        log._write_event(49, 'pause', {})                         # no matter when: it moves nothing
        log.change('reset')
        log.advance(1)
    assert resimulation.main([str(path)]) == 0
    assert capsys.readouterr().out == 'equal: 53 states over 51 ticks, bit for bit\n'
    # without the reset the same states cannot come about
    without = rewritten(path, tmp_path / 'no_reset.mcap',
                        keep=lambda message: message.topic != '/simulator/events' or b'reset' not in message.data)
    assert resimulation.main([str(without)]) == 1


def test_ticks_beyond_32_bits_are_followed(tmp_path, capsys):
    """The file keeps the lowest 32 bits of a tick; the run's own tick is in the settings."""
    simulation = pcs.Simulation(pcs.load_chain(ROBOT))
    simulation.restore(replace(simulation.checkpoint(), tick=2**32 - 2))
    path = tmp_path / 'late.mcap'
    with pcs.OfflineLog(path, simulation) as log:
        log.advance(4)
    assert [message.sequence for message in read_log(path).messages] == [2**32 - 2, 2**32 - 1, 0, 1, 2]
    assert resimulation.main([str(path)]) == 0
    assert capsys.readouterr().out == 'equal: 5 states over 4 ticks, bit for bit\n'


@pytest.mark.parametrize('name, options, message', [
    ('lost tick', {'keep': lambda m: not (m.topic == '/joint_states' and m.sequence == 17)},
     'tick 18 does not follow tick 16'),
    ('no state', {'keep': lambda m: m.topic != '/joint_states'}, "event 'command' of tick 5 comes at tick 0"),
    ('nothing', {'keep': lambda m: False}, 'it holds no state to compare with'),
    ('bad event', {'change': lambda m: encode_string('{]') if m.topic != '/joint_states' else m.data},
     'cannot be used'),
    ('event without data', {'change': lambda m: encode_string('[]') if m.topic != '/joint_states' else m.data},
     'cannot be used'),
    ('torn state', {'change': lambda m: m.data[:-9] if m.topic == '/joint_states' else m.data},
     'cannot be used'),
    ('other joints', {'change': lambda m: m.data.replace(b'upper_arm', b'lower_arm') if m.sequence == 3 else m.data},
     'names other joints than its chain'),
    ('no efforts', {'change': lambda m: m.data[:-48] + bytes(4) if m.sequence == 3 else m.data},
     'its state of tick 3 lacks values of effort'),
    ('bad chain', {'chain_text': 'bodies: 3'}, 'chain.yaml'),
    ('bad method', {'settings': {'method': 'magic'}}, "method is 'magic'"),
    ('bad format', {'settings': {'format': '7'}}, "format is '7', must be '1'"),
    ('bad step', {'settings': {'step': 'x'}}, 'x'),
    ('bad names', {'settings': {'joint_names': json.dumps(['a'])}}, 'joint_names are not those'),
    ('bad start', {'settings': {'position': '["0x1p0"]'}}, 'position has shape'),
])
def test_logs_that_cannot_be_followed_exit_2_with_one_sentence(log, tmp_path, capsys, name, options, message):
    assert resimulation.main([str(rewritten(log, tmp_path / 'bad.mcap', **options))]) == 2
    said = capsys.readouterr()
    assert said.out == '' and said.err.count('\n') == 1 and said.err.startswith('resimulate: log ')
    assert message in said.err


@pytest.mark.parametrize('arguments, message', [
    ([], 'the following arguments are required: chain'),
    (['missing.yaml'], 'missing.yaml'),
    ([ROBOT, '--effort', '1,2'], r'has shape (2,), must have (5,)'),
    ([ROBOT, '--effort', '1,2,3,nan,5'], '[3] is nan, must be finite'),
    ([ROBOT, '--effort', 'missing.csv'], "--effort 'missing.csv'"),
    ([ROBOT, '--duration', '0.00001'], 'must be a whole number >= 0 of steps'),
    ([ROBOT, '--duration', '0.1', '--step', '1e-308'], 'no more ticks of 1e-308 s can be counted'),
    ([ROBOT, '--duration', 'nan'], 'duration is nan'),
    ([ROBOT, '--step', '0'], 'step is 0.0, must be a positive'),
    ([ROBOT, '--method', 'rk5'], 'rk5'),
    ([ROBOT, '--output', 'no/such/folder/run.mcap'], 'does not exist'),
    ([ROBOT, '--output', '.'], 'directory'),
])
def test_mistakes_of_rollout_exit_2_with_one_sentence(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert rollout.main(arguments) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1 and said.startswith('rollout: ') and message in said
    assert list(tmp_path.iterdir()) == []


def test_rollout_does_not_overwrite(log, capsys):
    assert rollout.main([ROBOT, '--output', str(log)]) == 2
    assert 'not overwritten' in capsys.readouterr().err


def test_a_run_that_runs_away_is_logged_up_to_there(tmp_path, capsys):
    path, output = tmp_path / 'stiff.yaml', tmp_path / 'stiff.mcap'
    path.write_text('name: stiff\nbodies:\n- {name: b, carrier: base, mass: 1, inertia_com: 1,\n'
                    '   rotation: {joint: j, stiffness: 1e8, position: 1}}\n')
    assert rollout.main([str(path), '--method', 'rk4', '--output', str(output)]) == 2
    assert 'of stiff at tick ' in capsys.readouterr().err
    last = list(read_log(output).messages)[-1]
    assert json.loads(last.data[8:-1])['kind'] == 'divergence'
    assert resimulation.main([str(output)]) == 0


WITHOUT_ROS = """
import sys

class NoRos:
    def find_spec(self, name, path=None, target=None):
        if name.split('.')[0] in {'rclpy', 'ament_index_python', 'sensor_msgs', 'std_msgs', 'std_srvs',
                                  'builtin_interfaces', 'rosidl_runtime_py', 'rosgraph_msgs'}:
            raise ImportError(f'{name} is blocked')

sys.meta_path.insert(0, NoRos())
try:
    import rclpy
except ImportError:
    pass
else:
    raise SystemExit('rclpy is not blocked')
import planar_chain_sim as pcs
from planar_chain_sim.recording import rollout
from planar_chain_sim.resimulation import command_line as resimulation
for name in pcs.__all__:
    getattr(pcs, name)
run = pcs.rollout(pcs.load_chain('four_link_robot.yaml'), 0.1)
assert rollout.main(['four_link_robot.yaml', '--duration', '0.5', '--output', sys.argv[1]]) == 0
assert resimulation.main([sys.argv[1]]) == 0
assert not {name for name in sys.modules if name.split('.')[0] == 'rclpy'}
from planar_chain_sim.ros.node import main
raise SystemExit(main([]))
"""


def test_without_ros_everything_but_the_node_works(tmp_path):
    done = subprocess.run([sys.executable, '-c', WITHOUT_ROS, str(tmp_path / 'run.mcap')],
                          capture_output=True, text=True, timeout=600)
    assert done.returncode == 2, done.stderr
    assert 'equal: 501 states' in done.stdout
    assert done.stderr.count('\n') == 1 and done.stderr.startswith('simulator: ') and 'ROS 2' in done.stderr
    assert Path(tmp_path / 'run.mcap').exists()


def test_a_tolerance_is_kept_with_the_log(tmp_path, capsys):
    path = tmp_path / 'run.mcap'
    assert rollout.main([ROBOT, '--duration', '0.2', '--tolerance', '1e-5', '--output', str(path)]) == 0
    assert float.fromhex(read_log(path).settings['tolerance']) == 1e-5
    assert resimulation.main([str(path)]) == 0
    assert rollout.main([ROBOT, '--method', 'rk4', '--tolerance', '1e-5', '--output', str(tmp_path / 'no')]) == 2
    assert "method 'rk4' has a fixed step" in capsys.readouterr().err


def test_events_that_say_nonsense_are_one_sentence(log, tmp_path, capsys):
    """Whatever JSON an event's data is: followed or one sentence, and no traceback, which is for mistakes of ours."""
    random, refused = Random(8), 0
    odd = [None, 'x', '', [], [1], [1.0, 2.0], {}, {'a': 1}, True, -1, 0, 3, 1e308, 10**400, float('nan'), [None],
           [10**400], [[1, 2]], 'column', 'forearm', 'gravity', 'damping', 'payload', 5 * [1.0], 5 * [None], 5 * [-1.0]]
    keys = ['name', 'value', 'body', 'force', 'moment', 'axes', 'mass', 'position', 'inertia_com', 'effort', 'plan']
    starts = {'tick': 5, 'kind': 'command', 'data': {}}
    done = False
    for k in range(150):
        event = {**starts, 'kind': random.choice(['reset', 'parameter', 'wrench', 'payload', 'command', 'nothing'])}
        event['data'] = {key: random.choice(odd) for key in random.sample(keys, random.randrange(len(keys)))}
        if random.random() < 0.2:
            event[random.choice(['tick', 'kind', 'data', 'more'])] = random.choice(odd)
        if random.random() < 0.05:
            event = random.choice(odd)
        done = False

        def change(message):
            nonlocal done
            if message.topic == '/joint_states' or done:
                return message.data
            done = True     # the first event of the log, at tick 5
            return encode_string(json.dumps(event))
        path = tmp_path / f'{k}.mcap'
        rewritten(log, path, change, keep=lambda message: message.sequence < 12 and message.log_time < 12e6)
        code = resimulation.main([str(path)])
        said = capsys.readouterr()
        path.unlink()
        assert code in (0, 1, 2) and 'Traceback' not in said.err, (event, said.err)
        refused += code == 2
        assert said.err.count('\n') == (code == 2), (event, said.err)
    assert 30 < refused < 140


def test_settings_that_are_missing_or_odd_are_one_sentence_at_every_door(log, tmp_path, capsys):
    """Each key away or with another name, and random values; by resimulate, plot, equations."""
    random, short = Random(3), tmp_path / 'short.mcap'
    rewritten(log, short, keep=lambda message: message.log_time < 5e6)
    known = read_log(short).settings
    needed = sorted(set(known) - {'version', 'build'})
    doors = {'resimulate': lambda path: resimulation.main([path]),
             'plot': lambda path: plot.main([path, '--output', str(tmp_path / 'drawn.svg')]),
             'equations': lambda path: equations.main([path, '--time', '0.002'])}
    odd = ['', ' ', '0', '-1', 'nan', 'inf', '1e400', '[]', '{}', 'null', '[1]', '["x"]', 3000 * '[', 'x', '\x00',
           '{"a": 1}', '["nan"]', '9' * 30, '0x1p-1074', '0x1p9999', 5000 * '9']

    def ends(path, certain):
        for name, door in doors.items():
            code, said = door(str(path)), capsys.readouterr().err
            assert code == 2 if certain else code in (0, 1, 2), (name, code, said)
            if code == 2:
                assert said.startswith(f'{name}: ') and said.count('\n') == 1 and 'Traceback' not in said, said[-500:]

    content = short.read_bytes()
    for key in needed:
        path = tmp_path / 'renamed.mcap'
        size = len(key).to_bytes(4, 'little')
        path.write_bytes(content.replace(size + key.encode(), size + b'Z' + key.encode()[1:]))
        assert key not in read_log(path).settings
        ends(path, True)
    for _ in range(60):
        key = random.choice(needed)
        path = tmp_path / 'odd.mcap'
        path.unlink(missing_ok=True)
        ends(rewritten(short, path, settings={key: random.choice(odd)}), False)
