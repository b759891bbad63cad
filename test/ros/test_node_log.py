"""The log of a live run: every tick, the commands and the changes, so that the run can be repeated."""
from contextlib import suppress
import json
import os
import re
import resource
import signal
import subprocess
import sys

from diagnostic_msgs.msg import DiagnosticArray
from live import PATIENCE, Peer, run, simulator, stamp_ns
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
from oracles.container import check_container
from oracles.log_frames import check_frames
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
import yaml

from planar_chain_sim import load_chain, rollout
from planar_chain_sim.recording.cdr import decode_joint_state, decode_string
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.mcap_file import CHUNK_SIZE

POSE = [0.3, 0.8, -0.6, 1.0, -0.5]  # m, rad: far from where the springs and gravity want the four-link robot
STATES, COMMANDS, EVENTS = '/joint_states', '/simulator/commands', '/simulator/events'


def messages(path, topic):
    return [message for message in read_log(path).messages if message.topic == topic]


def events(path):
    return [json.loads(decode_string(message.data)) for message in messages(path, EVENTS)]


def resimulate(path):
    return run('planar_chain_sim.resimulation.command_line', path)


@pytest.fixture(scope='module')
def held(tmp_path_factory):
    """Return the log of 10 s at 1 kHz in which another process holds POSE, and what that printed last."""
    path = tmp_path_factory.mktemp('held') / 'run.mcap'
    with simulator(record=path) as process:
        code, words = run('hold_controller', 'four_link_robot.yaml', 10, *POSE)
        assert code == 0, words
        assert process.stop() == 0, process.output
    return path, words


def test_a_controller_in_another_process_holds_the_pose(held):
    path, words = held
    published, worst = re.fullmatch(r'published (\d+) commands, worst error (\S+)', words).groups()
    assert float(worst) < 1e-3
    # How many come in time is a matter of the machine; that all are recorded is not, but for what a stall overwrote.
    assert 0.9 * int(published) <= len(messages(path, COMMANDS)) <= int(published)
    last = [decode_joint_state(message.data).position for message in messages(path, STATES)[8000:10000]]
    np.testing.assert_allclose(last, np.tile(POSE, (2000, 1)), atol=1e-3)


def test_every_tick_is_in_the_log(held):
    states = messages(held[0], STATES)
    assert [message.sequence for message in states] == list(range(len(states)))
    assert len(states) > 10_000
    stamps = [decode_joint_state(message.data).stamp for message in states]
    dropped = sum(event['data']['seconds'] for event in events(held[0]) if event['kind'] == 'dropped_time')
    assert stamps[-1] - stamps[0] == pytest.approx((len(states) - 1) * 1_000_000 + dropped * 1e9, abs=len(states))
    assert (np.diff(stamps) >= 1_000_000).all()
    assert (np.diff([message.log_time for message in read_log(held[0]).messages]) >= 0).all()


def test_the_first_state_is_the_initial_one(held):
    first = decode_joint_state(messages(held[0], STATES)[0].data)
    joints = load_chain('four_link_robot.yaml').joints
    assert first.position.tolist() == [joint.position for joint in joints]
    assert first.velocity.tolist() == [joint.velocity for joint in joints]
    assert first.effort.tolist() == [0.0] * 5


def test_independent_readers_take_it(held):
    path, _ = held
    states = messages(path, STATES)
    last = decode_joint_state(states[-1].data)
    with open(path, 'rb') as stream:
        decoded = [message for _, _, _, message in
                   make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages([STATES])]
    assert len(decoded) == len(states)
    assert list(decoded[-1].position) == last.position.tolist() and list(decoded[-1].name) == list(last.names)
    types = get_typestore(Stores.ROS2_JAZZY)
    with Reader(path) as reader:
        for connection, _, data in reader.messages():
            message = types.deserialize_cdr(data, connection.msgtype)
            if connection.topic == STATES:
                newest = message
        assert {connection.topic: connection.msgcount for connection in reader.connections}[STATES] == len(states)
    assert newest.position.tolist() == last.position.tolist()


def test_it_gives_its_states_back_bit_for_bit(held):
    code, output = resimulate(held[0])
    assert code == 0, output
    assert f'{len(messages(held[0], STATES))} states' in output


def test_one_flipped_bit_is_found(held, tmp_path):
    state = messages(held[0], STATES)[7000]
    position = decode_joint_state(state.data).position
    data = bytearray(held[0].read_bytes())
    place = data.index(state.data) + state.data.index(position.tobytes()) + 8 * 2  # the third joint's position
    data[place] ^= 1
    (tmp_path / 'flipped.mcap').write_bytes(data)
    code, output = resimulate(tmp_path / 'flipped.mcap')
    assert code == 1, output
    assert "different: t = 7 s, tick 7000, joint 'upper_arm_joint': position is " in output


def test_frames_are_recorded_as_the_node_would_publish_them(tmp_path):
    path = tmp_path / 'run.mcap'
    with simulator(record=path, record_tf=True, rate=200) as process, Peer() as peer:
        texts = peer.listen(String, '/robot_description', latched=True)
        peer.until(lambda: texts and peer.states)
        begun = stamp_ns(peer.states[-1])
        peer.new_state(lambda state: stamp_ns(state) > begun + 200_000_000)
        assert process.stop() == 0, process.output
    assert [decode_string(message.data) for message in messages(path, '/robot_description')] == [texts[0].data]
    ticks = {decode_joint_state(message.data).stamp: message.sequence for message in messages(path, STATES)}
    assert [ticks[stamp] for stamp in check_frames(path, load_chain('four_link_robot.yaml'))] == [
        *range(0, len(ticks), 4)], 'every 20 ms'
    code, output = resimulate(path)
    assert code == 0, output


def test_a_killed_node_leaves_a_log_that_runs_again(tmp_path):
    path = tmp_path / 'run.mcap'
    # So slow that a chunk is full after many flush periods only.
    with simulator(record=path, rate=20, record_flush_period=0.1) as process, Peer() as peer:
        peer.meet()
        peer.commands.publish(Float64MultiArray(data=[9.0, 1.0, 0.0, -1.0, 0.5]))
        state = peer.new_state(lambda state: state.effort[0] == 9.0)
        peer.until(lambda: decode_joint_state(messages(path, STATES)[-1].data).stamp >= stamp_ns(state), 'a flush')
        assert process.stop(signal.SIGKILL) == -signal.SIGKILL
    assert path.stat().st_size < CHUNK_SIZE, 'what is lost is no chunk but what came after the flush'
    assert not read_log(path).complete
    code, output = resimulate(path)
    assert code == 0, output
    stamps = [decode_joint_state(message.data).stamp for message in messages(path, STATES)]
    again = tmp_path / 'again.mcap'
    code, output = run('planar_chain_sim.recording.repair', path, '--output', again)
    assert code == 0, output
    check_container(again)
    assert [decode_joint_state(message.data).stamp for message in messages(again, STATES)][:len(stamps)] == stamps
    code, output = resimulate(again)
    assert code == 0, output


def test_every_kind_of_change_runs_again(tmp_path):
    path = tmp_path / 'run.mcap'
    with simulator(record=path, start_paused=True) as process, Peer() as peer:
        peer.meet()
        joints = list(peer.new_state().name)
        for _ in range(3):
            assert peer.call('step')[0]
        peer.commands.publish(Float64MultiArray(data=[9.0, 1.0, 0.0, -1.0, 0.5]))
        peer.call('pause', False)
        peer.new_state(lambda state: state.effort[0] == 9.0)
        peer.joint_commands.publish(JointState(name=[joints[0], 'x'], effort=[-3.0, 1.0]))
        peer.new_state(lambda state: state.effort[0] == -3.0)
        peer.commands.publish(Float64MultiArray(data=[1.0]))
        peer.call('reset')
        peer.call('pause', True)
        peer.commands.publish(Float64MultiArray(data=[0.0, 1e306, 0.0, 0.0, 0.0]))
        peer.call('pause', False)
        peer.until(lambda: any('divergence' in event.data for event in peer.events))
        peer.call('reset')
        peer.commands.publish(Float64MultiArray(data=[2.0, 1.0, 0.0, -1.0, 0.5]))
        peer.new_state(lambda state: state.effort[0] == 2.0)
        assert process.stop() == 0, process.output
    code, output = resimulate(path)
    assert code == 0, output
    kinds = [event['kind'] for event in events(path) if event['kind'] != 'dropped_time']
    assert kinds[:4] == ['pause', 'step', 'step', 'step']
    assert set(kinds) >= {'command', 'rejected', 'reset', 'resume', 'divergence'}
    ticks = [message.sequence for message in messages(path, STATES)]
    assert ticks == sorted(ticks) and len(ticks) - len(set(ticks)) == 2, 'one state more for each of two resets'
    assert len(set(ticks)) == ticks[-1] + 1
    assert len(messages(path, '/simulator/joint_commands')) == 1


def test_decimated_publishing_still_logs_every_tick(tmp_path):
    path = tmp_path / 'run.mcap'
    with simulator('__ns:=/left', '__node:=arm', record=path, rate=500, publish_rate=50, frame_id='world',
                   record_compression='zstd', chain_file='double_pendulum.yaml') as process, \
            Peer('arm', '/left') as peer:
        peer.meet()
        peer.until(lambda: len(peer.states) >= 20)
        assert process.stop() == 0
    assert peer.states[0].header.frame_id == 'world'
    states = messages(path, '/left/joint_states')
    ticks = [message.sequence for message in states]
    assert ticks == list(range(len(ticks))) and len(ticks) >= 190
    stamps = {decode_joint_state(message.data).stamp: message.sequence for message in states}
    assert {stamps[stamp_ns(state)] % 10 for state in peer.states} == {0}
    code, output = resimulate(path)
    assert code == 0, output


BOUNCING = """
name: bouncing
bodies:
  - {name: block, carrier: base, mass: 1.0, inertia_com: 0.1, slide: {joint: fall, axis: 1.5707963267948966, lower: 0.0,
     restitution: 0.5, position: 0.2}}
  - {name: arm, carrier: base, mass: 1.0, center_of_mass: [0.5, 0.0], inertia: 0.4, rotation: {joint: swing,
     friction: 6.0, velocity: 2.0}}
"""


def test_stops_and_sticking_are_events_of_the_log_that_runs_again(tmp_path):
    chain, path = tmp_path / 'bouncing.yaml', tmp_path / 'run.mcap'
    chain.write_text(BOUNCING)
    with simulator(chain_file=chain, record=path) as process, Peer() as peer:
        peer.until(lambda: len(peer.states) > 1500)
        assert process.stop() == 0, process.output
    told = [event for event in events(path) if event['kind'] == 'stop_touched']
    assert len(told) > 5 and {event['data']['joint'] for event in told} == {'fall'}
    assert abs(told[0]['data']['time'] - (0.4 / 9.81)**0.5) < 1e-9
    assert told[0]['tick'] == int(told[0]['data']['time'] * 1000.0)
    assert 'stuck' in {event['kind'] for event in events(path) if event['data'].get('joint') == 'swing'}
    code, words = resimulate(path)
    assert code == 0, words


@pytest.fixture
def small_disk(tmp_path):
    """Yield a folder that holds 600 kB, and what to do in a process that is to feel it: a real disk where we may."""
    folder = tmp_path / 'small'
    folder.mkdir()
    mounted = subprocess.run(['mount', '-t', 'tmpfs', '-o', 'size=600k', 'tmpfs', folder], capture_output=True)
    if mounted.returncode:   # not for everybody; a limit of the size of files fails in the same place
        yield folder, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (600_000, 600_000))
    else:
        yield folder, None
        subprocess.run(['umount', '--lazy', folder], check=True)


def test_a_full_disk_does_not_end_the_physics(small_disk):
    """An event, a line and diagnostics report it; the written part runs again; the motion goes on without a log."""
    folder, limit = small_disk
    path = folder / 'run.mcap'
    with simulator(chain_file='double_pendulum.yaml', rate=2000, publish_rate=500, publish_clock=True, record=path,
                   preexec_fn=limit) as process, Peer() as peer:
        diagnostics = peer.listen(DiagnosticArray, '/diagnostics')
        sentence = process.wait_for('writing stopped').partition(']: ')[2]
        assert sentence.startswith(f"log '{path}': writing stopped, ") and sentence.endswith(
            ('No space left on device', 'File too large'))
        peer.meet()
        peer.until(lambda: [status for message in diagnostics for status in message.status
                            if status.name == 'simulator: log' and status.level == status.ERROR
                            and status.message == sentence])
        last = peer.new_state()
        later = peer.new_state(lambda state: stamp_ns(state) > stamp_ns(last) + 500_000_000)
        assert process.stop() == 0, process.output
    assert process.lines[-1] == f'simulator: {sentence}' and 'Traceback' not in process.output
    code, words = resimulate(path)
    assert code == 0 and 'not closed properly' in words
    tick = round(stamp_ns(later) * 2e-6)   # simulated time, as the node is the clock
    alone = rollout(load_chain('double_pendulum.yaml'), tick / 2000, step=1 / 2000)
    assert alone.position[-1].tolist() == list(later.position)


def test_a_full_disk_ends_it_where_that_is_wanted(small_disk):
    folder, limit = small_disk
    path = folder / 'run.mcap'
    with simulator(rate=2000, record=path, on_log_failure='stop', preexec_fn=limit) as process:
        assert process.finish() == 2
    assert re.fullmatch(f"simulator: log '{path}': writing stopped, (No space left on device|File too large)",
                        process.lines[-1])


@pytest.mark.parametrize('harm, said', [
    (lambda path: path.unlink(), 'the file has been deleted, what is recorded will be lost'),
    (lambda path: os.truncate(path, 1000), 'the file has been cut short, the log is damaged')])
def test_a_lost_log_ends_it_where_that_is_wanted(harm, said, tmp_path):
    path = tmp_path / 'run.mcap'
    with simulator(record=path, on_log_failure='stop') as process, Peer() as peer:
        peer.new_state(lambda state: path.stat().st_size > 10_000)
        harm(path)
        assert process.finish() == 2, process.output
    assert f"log '{path}': {said}" in process.output and 'Traceback' not in process.output
    assert process.lines[-1].startswith(f"simulator: log '{path}': ")


def test_a_disk_that_is_full_when_the_log_is_closed_is_told(small_disk):
    """Nothing but the summary does not fit: the node hears of it when it ends."""
    folder, limit = small_disk
    if limit:
        pytest.skip('no disk of our own can be mounted here')
    path = folder / 'run.mcap'
    with simulator(chain_file='double_pendulum.yaml', rate=10, record=path, record_flush_period=3600.0) as process, \
            Peer() as peer:
        peer.until(lambda: len(peer.states) > 10)
        with open(folder / 'filler', 'wb', buffering=0) as filler, suppress(OSError):
            while True:
                filler.write(bytes(4096))
        assert process.stop() == 0
    assert process.lines[-1] == f"simulator: log '{path}': writing stopped, No space left on device"


@pytest.mark.parametrize('program, arguments', [
    ('recording.rollout', ['four_link_robot.yaml', '--duration', '20']),
    ('recording.rollout', ['four_link_robot.yaml', '--duration', '20', '--compression', 'zstd'])])
def test_rollout_on_a_full_disk_is_one_sentence(small_disk, program, arguments):
    folder, limit = small_disk
    code, words = run(f'planar_chain_sim.{program}', *arguments, '--output', folder / 'run.mcap', preexec_fn=limit)
    assert code == 2 and 'Traceback' not in words and 'Exception' not in words, words
    assert re.fullmatch(f"rollout: log '{folder / 'run.mcap'}': writing stopped, (No space left on device|File too "
                        'large)', words.splitlines()[-1])


def test_resimulate_with_its_output_on_a_full_disk_never_says_different(held):
    with open('/dev/full', 'wb') as full:
        ended = subprocess.run([sys.executable, '-m', 'planar_chain_sim.resimulation.command_line', held[0]],
                               stdout=full, stderr=subprocess.PIPE, text=True, timeout=PATIENCE)
    assert ended.returncode == 2 and ended.stderr.count('\n') == 1, ended.stderr
    assert ended.stderr.startswith('resimulate: ') and 'No space left on device' in ended.stderr


def replace_file(path):
    """Put another file in its place at once: at no time is there none of that name."""
    other = path.with_name('other.mcap')
    other.write_bytes(b'another')
    os.link(path, path.with_name('moved.mcap'))
    other.replace(path)


@pytest.mark.parametrize('harm, told, lost', [
    (lambda path: path.unlink(), 'the file has been deleted, what is recorded will be lost', True),
    (lambda path: path.rename(path.with_name('moved.mcap')), 'the file has been moved', False),
    (replace_file, 'another file has this name now', False),
    (lambda path: os.truncate(path, 1000), 'the file has been cut short', True)])
def test_a_log_that_somebody_takes_away_is_told_and_the_physics_goes_on(harm, told, lost, tmp_path):
    path = tmp_path / 'run.mcap'
    with simulator(record=path) as process, Peer() as peer:
        diagnostics = peer.listen(DiagnosticArray, '/diagnostics')
        peer.meet()
        peer.new_state(lambda state: path.stat().st_size > 10_000)
        harm(path)
        peer.until(lambda: any('"log_failure"' in event.data and told in event.data for event in peer.events))
        peer.until(lambda: [status for message in diagnostics for status in message.status
                            if status.name == 'simulator: log' and status.level != status.OK
                            and told in status.message])
        peer.new_state()
        assert process.stop() == 0, process.output
    assert told in process.output and 'Traceback' not in process.output
    if not lost:
        moved = tmp_path / 'moved.mcap'
        assert read_log(moved).complete
        code, words = resimulate(moved)
        assert code == 0, words


@pytest.mark.parametrize('program, arguments', [
    ('ros.node', ['--ros-args', '-p', 'record:=run.mcap']), ('recording.rollout', ['double_pendulum.yaml']),
    ('resimulation.command_line', ['run.mcap']), ('ros.replay', ['run.mcap'])])
def test_a_missing_mcap_is_one_sentence(program, arguments, tmp_path):
    blocked = (f"import sys; sys.modules['mcap'] = None; from planar_chain_sim.{program} import main; "
               f'sys.exit(main({arguments!r}))')
    ended = subprocess.run([sys.executable, '-c', blocked], capture_output=True, text=True, cwd=tmp_path,
                           timeout=PATIENCE)
    assert ended.returncode == 2 and ended.stderr.count('\n') == 1, ended.stderr
    assert "log 'run.mcap'" in ended.stderr or "log 'double_pendulum.mcap'" in ended.stderr
    assert 'logs need the Python package mcap, which is not installed' in ended.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('program, arguments', [('ros.node', []), ('symbolic.command_line', ['double_pendulum.yaml'])])
def test_who_needs_no_log_needs_no_mcap(program, arguments, tmp_path):
    blocked = (f"import sys; sys.modules['mcap'] = None; from planar_chain_sim.{program} import main; "
               f'sys.exit(main({arguments!r}))')
    with subprocess.Popen([sys.executable, '-c', blocked], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          cwd=tmp_path) as process:
        for line in process.stdout:
            assert 'mcap' not in line
            if 'running' in line:
                process.terminate()
    assert process.returncode == 0


def test_the_log_has_the_quality_of_service_of_the_publishers_overrides_included(tmp_path):
    path = tmp_path / 'run.mcap'
    overrides = {'/qos/joint_states.publisher.reliability': 'best_effort', '/qos/joint_states.publisher.depth': 3,
                 '/qos/simulator/events.publisher.history': 'keep_all',
                 '/qos/simulator/commands.subscription.depth': 200}
    with simulator('__ns:=/qos', record=path, **{f'qos_overrides.{name}': value
                                                 for name, value in overrides.items()}) as process:
        assert process.stop() == 0, process.output
    offered = {}
    with open(path, 'rb') as file:
        for channel in make_reader(file).get_summary().channels.values():
            qos, = yaml.safe_load(channel.metadata['offered_qos_profiles'])
            offered[channel.topic] = qos['reliability'], qos['durability'], qos['history'], qos['depth']
    assert offered['/qos/joint_states'] == ('best_effort', 'volatile', 'keep_last', 3)
    assert offered['/qos/simulator/events'][:3] == ('reliable', 'volatile', 'keep_all')
    assert offered['/qos/simulator/commands'] == ('reliable', 'volatile', 'keep_last', 200)
    assert offered['/qos/simulator/wrench'] == ('reliable', 'volatile', 'keep_last', 64)
