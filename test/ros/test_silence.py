"""Input without effect leaves a trace: a warning, an event or a line in diagnostics. One test for each way."""
import json
from math import nan
import signal

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from live import CONFIG, Peer, Process, run, simulator, stamp_ns
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from planar_chain_sim import load_chain
from planar_chain_sim.recording.cdr import decode_joint_state
from planar_chain_sim.recording.log_reader import read_log

JOINTS = list(load_chain(CONFIG / 'four_link_robot.yaml').joint_names)
BODY = 'forearm'


def start_peer(process, namespace):
    """Return a peer that listens to diagnostics and has a publisher of wrenches."""
    peer = Peer(namespace=namespace)
    peer.process, peer.namespace = process, namespace
    peer.diagnostics = peer.listen(DiagnosticArray, '/diagnostics')
    peer.wrench = peer.node.create_publisher(WrenchStamped, f'{namespace}/simulator/wrench', 10)
    peer.meet()
    peer.until(lambda: peer.wrench.get_subscription_count(), 'a match')
    return peer


@pytest.fixture(scope='module')
def peer():
    """Yield a peer of one node for the tests of what comes while it runs."""
    with simulator('__ns:=/quiet', rate=200) as process, start_peer(process, '/quiet') as peer:
        yield peer
        assert process.stop() == 0, process.output


def events(peer, kind):
    return [event for event in map(json.loads, (message.data for message in peer.events)) if event['kind'] == kind]


def warnings(process):
    """Return its lines but for those that a busy machine may add."""
    return [line for line in process.lines if 'late and dropped' not in line and 'held up' not in line]


def status(peer, part):
    """Return the newest status of a part as (level, message, {key: value}), empty before the first."""
    statuses = [status for message in peer.diagnostics for status in message.status
                if status.name.endswith(f': {part}')]
    return (statuses[-1].level[0], statuses[-1].message,
            {value.key: value.value for value in statuses[-1].values}) if statuses else (0, '', {})


def expect_trace(peer, kind, reason, words, topic, again=None):
    """
    Wait for the event, the warning and the line in diagnostics of what was refused (rejected) or ignored.

    `again` sends it, more than once where it must: what was told of for the same reason within the last second is only
    counted.
    """
    def told():
        found = [event['data'] for event in events(peer, kind) if event['data']['topic'] == topic
                 and words in event['data']['message' if kind == 'ignored' else 'reason']]
        return any(words in line for line in peer.process.lines) and found
    assert peer.until(told, 'the event and the warning', again)[0]['count'] > 0
    peer.until(lambda: int(status(peer, 'commands')[2].get(f'{kind}, {reason}', 0)) > 0, 'the line in diagnostics')


def by_name(**arrays):
    return JointState(**arrays)


def in_order(*values):
    return Float64MultiArray(data=[float(value) for value in values])


def wrench(frame_id, **force_and_torque):
    message = WrenchStamped()
    message.header.frame_id = frame_id
    for name, value in force_and_torque.items():
        setattr(getattr(message.wrench, name[:-2]), name[-1], value)
    return message


WAYS = {
    'positions': (by_name(name=JOINTS, position=[1.0] * 5), 'ignored', 'no effort', 'has a position without an effort'),
    'velocities': (by_name(name=JOINTS, velocity=[1.0] * 5), 'ignored', 'no effort',
                   'has a velocity without an effort'),
    'a position where the effort is NaN': (by_name(name=JOINTS[:1], position=[1.0], effort=[nan]), 'ignored',
                                           'no effort', f"a position without an effort for '{JOINTS[0]}'"),
    'names alone': (by_name(name=JOINTS), 'ignored', 'no effort', 'has no effort for'),
    'an empty message': (by_name(), 'ignored', 'empty', 'names no joint'),
    'an unknown joint': (by_name(name=['elbow'], effort=[1.0]), 'ignored', 'unknown joint', "names 'elbow'"),
    'a joint named twice': (by_name(name=[JOINTS[1]] * 2, effort=[1.0, 1.0]), 'rejected', 'named twice',
                            f"names joint '{JOINTS[1]}' more than once"),
    'fewer efforts than names': (by_name(name=JOINTS, effort=[1.0]), 'rejected', 'wrong length',
                                 'parameter commanded_joints'),
    'more efforts than names': (by_name(name=JOINTS[:1], effort=[1.0, 2.0]), 'rejected', 'wrong length',
                                'it has 2 efforts for 1 names'),
    'an infinite effort': (by_name(name=JOINTS[:1], effort=[float('inf')]), 'rejected', 'not finite',
                           'effort 0 is inf, must be finite'),
    'too few in order': (in_order(1, 2), 'rejected', 'wrong length', 'it has 2 efforts, must have 5'),
    'NaN in order': (in_order(0, 0, 0, nan, 0), 'rejected', 'not finite', 'its effort 3 is nan'),
    'too long': (in_order(*[0.0] * 2**17), 'rejected', 'too long', 'bytes, must have at most 1048576'),
    'a wrench on no body': (wrench('elbow', force_x=1.0), 'rejected', 'unknown body', "its frame_id is 'elbow'"),
    'a wrench that is not finite': (wrench(BODY, torque_z=nan), 'rejected', 'not finite', 'has the value nan'),
    'a wrench across the plane': (wrench(BODY, force_z=1.0), 'ignored', 'out of plane', 'which has no effect')}


@pytest.mark.parametrize('way', WAYS)
def test_what_has_no_effect_leaves_a_trace(peer, way):
    message, kind, reason, words = WAYS[way]
    peer.events.clear()
    topic = {JointState: 'joint_commands', Float64MultiArray: 'commands', WrenchStamped: 'wrench'}[type(message)]
    expect_trace(peer, kind, reason, words, f'/quiet/simulator/{topic}', lambda: getattr(peer, topic).publish(message))
    assert not events(peer, 'command') and not events(peer, 'wrench')


def test_what_comes_a_thousand_times_is_warned_of_once_a_second(peer):
    for _ in range(200):
        peer.joint_commands.publish(by_name(name=['shoulder'], effort=[1.0]))
    peer.joint_commands.publish(by_name(name=JOINTS[:1], effort=[0.0]))
    peer.until(lambda: events(peer, 'command'))
    peer.process.wait_for("names 'shoulder'")
    lines = [line for line in peer.process.lines if "names 'shoulder'" in line]
    assert len(lines) <= 1 + (stamp_ns(peer.states[-1]) - stamp_ns(peer.states[0])) / 1e9


def test_nan_for_all_joints_is_normal_and_told_by_nobody(peer):
    peer.events.clear()
    before = len(warnings(peer.process))
    for _ in range(20):
        peer.joint_commands.publish(by_name(name=JOINTS, position=[nan] * 5, effort=[nan] * 5))
        peer.joint_commands.publish(by_name(name=JOINTS, effort=[nan] * 5))
    peer.joint_commands.publish(by_name(name=JOINTS, effort=[nan, 2.0, nan, nan, nan]))   # one joint is claimed
    state = peer.new_state(lambda state: state.effort[1] == 2.0)
    assert list(state.effort) == [0.0, 2.0, 0.0, 0.0, 0.0]
    seen = len(peer.diagnostics)
    peer.until(lambda: len(peer.diagnostics) >= seen + 2)
    assert not [event for event in events(peer, 'ignored') + events(peer, 'rejected')]
    assert warnings(peer.process)[before:] == []
    assert status(peer, 'commands')[:2] == (0, 'none rejected')


def test_commands_that_are_overtaken_are_counted(peer):
    peer.call('pause', True)
    peer.call('reset')
    before = int(status(peer, 'commands')[2].get('superseded', 0))
    for k in range(60):
        peer.commands.publish(in_order(*[k] * 5))
    peer.until(lambda: events(peer, 'command') and events(peer, 'command')[-1]['data']['effort'] == [59.0] * 5)
    told = {event['data']['effort'][0] for event in events(peer, 'command')}
    wanted = before + 60 - len(told & set(map(float, range(60))))
    peer.until(lambda: int(status(peer, 'commands')[2]['superseded']) >= wanted, 'the count')
    peer.call('pause', False)


def test_a_command_while_paused_is_told_and_acts_when_time_goes_on(peer):
    peer.call('pause', True)
    peer.call('reset')
    peer.events.clear()
    peer.commands.publish(in_order(3, 0, 0, 0, 0))
    told = peer.until(lambda: events(peer, 'command'))[-1]
    assert told['data']['effort'] == [3.0, 0.0, 0.0, 0.0, 0.0]
    peer.until(lambda: status(peer, 'simulation')[1].startswith('paused'), 'that it is paused')
    assert peer.new_state().effort[0] != 3.0
    peer.call('pause', False)
    peer.new_state(lambda state: state.effort[0] == 3.0)
    peer.call('reset')


def test_a_best_effort_publisher_is_told_what_to_do(peer):
    offered = peer.node.create_publisher(Float64MultiArray, '/quiet/simulator/commands',
                                         QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
    expect_trace(peer, 'ignored', 'other QoS', 'qos_overrides./quiet/simulator/commands.subscription.reliability'
                 ':=best_effort', '/quiet/simulator/commands')
    peer.until(lambda: status(peer, 'network')[0] == 1 and 'best_effort' in status(peer, 'network')[1], 'the status')
    peer.node.destroy_publisher(offered)
    peer.until(lambda: status(peer, 'network')[:2] == (0, 'no faults'), 'the end of the fault')


def test_what_the_sentence_says_makes_a_best_effort_publisher_heard():
    parameter = {'qos_overrides./best/simulator/commands.subscription.reliability': 'best_effort'}
    with simulator('__ns:=/best', **parameter) as process, Peer(namespace='/best') as peer:
        peer.meet()
        peer.node.destroy_publisher(peer.commands)
        peer.commands = peer.node.create_publisher(Float64MultiArray, '/best/simulator/commands', QoSProfile(
            depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
        peer.meet()

        def heard():   # what is sent before the node has matched is lost: best effort
            peer.commands.publish(in_order(1, 2, 3, 4, 5))
            return [state for state in peer.states if list(state.effort) == [1, 2, 3, 4, 5]]

        peer.until(heard)
        assert process.stop() == 0, process.output


@pytest.mark.parametrize('topic, wanted', [
    ('simulator/commands', 'std_msgs/msg/Float64MultiArray'), ('joint_states', 'sensor_msgs/msg/JointState'),
    ('simulator/joint_commands', 'sensor_msgs/msg/JointState'),
    ('simulator/wrench', 'geometry_msgs/msg/WrenchStamped')])
def test_a_publisher_of_another_type_is_told(peer, topic, wanted):
    with Peer('elsewhere', '/elsewhere') as other:   # a process has one type for a topic
        other.node.create_publisher(String, f'/quiet/{topic}', 1)
        expect_trace(peer, 'ignored', 'other type', f'on /quiet/{topic} has the type std_msgs/msg/String, must be '
                     f'{wanted}', f'/quiet/{topic}')


def test_a_second_simulator_of_the_same_name_is_told_by_both():
    with simulator('__ns:=/twin') as first, simulator('__ns:=/twin') as second:
        for process in (first, second):
            process.wait_for('another node is called /twin/simulator too')
        assert [second.stop(), first.stop()] == [0, 0], first.output


def test_a_second_clock_is_told():
    with simulator('__ns:=/one', publish_clock=True) as first, simulator('__ns:=/two', publish_clock=True) as second:
        for process in (first, second):
            process.wait_for('2 nodes publish /clock')
        assert [second.stop(), first.stop()] == [0, 0], first.output


def test_a_command_to_a_motion_that_has_ended_is_told():
    with simulator('__ns:=/ended') as process, start_peer(process, '/ended') as peer:
        peer.commands.publish(in_order(0, 1e306, 0, 0, 0))
        peer.until(lambda: events(peer, 'divergence'))
        peer.commands.publish(in_order(0, 0, 0, 0, 0))
        expect_trace(peer, 'ignored', 'motion ended', 'has no effect, as the motion has ended',
                     '/ended/simulator/commands')
        before = len(process.lines)
        peer.commands.publish(in_order(0, 0))
        expect_trace(peer, 'rejected', 'wrong length', 'it has 2 efforts, must have 5', '/ended/simulator/commands')
        peer.events.clear()
        peer.joint_commands.publish(by_name(name=JOINTS, effort=[0.0] * 5))   # which is looked at after that one
        expect_trace(peer, 'ignored', 'motion ended', 'has no effect', '/ended/simulator/joint_commands')
        told = [line for line in process.lines[before:] if '/ended/simulator/commands' in line]
        assert len(told) == 1 and 'rejected' in told[0], 'one warning of a command that is refused'
        assert process.stop() == 0, process.output


def test_a_command_whose_tick_is_far_off_is_told_at_once():
    """At 1 Hz and a factor of 1e-4 the first tick comes after hours."""
    with simulator('__ns:=/slow', rate=1.0, real_time_factor=1e-4) as process, start_peer(process, '/slow') as peer:
        peer.commands.publish(in_order(1, 2, 3, 4, 5))
        told = peer.until(lambda: events(peer, 'command'))[-1]
        assert (told['tick'], told['data']['effort']) == (0, [1, 2, 3, 4, 5])
        peer.commands.publish(in_order(1, 2))
        expect_trace(peer, 'rejected', 'wrong length', 'it has 2 efforts, must have 5', '/slow/simulator/commands')
        assert process.stop() == 0, process.output


@pytest.fixture(scope='module')
def lockstep():
    with simulator('__ns:=/wait', lockstep=True) as process, start_peer(process, '/wait') as peer:
        yield peer
        assert process.stop() == 0, process.output


def test_lockstep_says_what_it_waits_for_by_default(lockstep):
    lockstep.process.wait_for(f'lockstep waits at tick 0: no command for {", ".join(JOINTS)} within ')
    lockstep.until(lambda: status(lockstep, 'simulation')[0] == 1 and status(lockstep, 'simulation')[1].startswith(
        f'waiting for a command for {", ".join(JOINTS)}, for'), 'the status')


def test_lockstep_says_which_joint_is_missing(lockstep):
    state = lockstep.new_state()
    lockstep.joint_commands.publish(by_name(header=state.header, name=JOINTS[:4], effort=[1.0] * 4))
    lockstep.until(lambda: status(lockstep, 'simulation')[1].startswith(f'waiting for a command for {JOINTS[4]}, for'))
    assert status(lockstep, 'simulation')[2]['waiting for commands for'] == JOINTS[4]
    lockstep.joint_commands.publish(by_name(header=state.header, name=JOINTS, effort=[nan] * 4 + [2.0]))
    after = lockstep.new_state(lambda new: stamp_ns(new) > stamp_ns(state))
    assert list(after.effort) == [1.0] * 4 + [2.0], 'NaN is no second answer'


@pytest.mark.parametrize('seconds, reason, words', [
    (1_800_000_000, 'other stamp', 'has the stamp 1.8e+09 s, which is that of no state that was published'),
    (0, 'no stamp', 'has no stamp, in lockstep it must repeat that of the state it answers')])
def test_a_lockstep_command_with_a_stamp_of_its_own_is_told(lockstep, seconds, reason, words):
    state = lockstep.new_state()
    if stamp_ns(state) == 0:   # that stamp would be an answer
        lockstep.commands.publish(in_order(*[0.0] * 5))
        state = lockstep.new_state(lambda new: stamp_ns(new) > 0)
    command = by_name(name=JOINTS, effort=[1.0] * 5)
    command.header.stamp.sec = seconds
    expect_trace(lockstep, 'ignored', reason, words, '/wait/simulator/joint_commands',
                 lambda: lockstep.joint_commands.publish(command))
    assert stamp_ns(lockstep.new_state()) == stamp_ns(state), 'it answers nothing'


def test_a_second_and_a_late_answer_are_told(lockstep):
    first = lockstep.new_state()   # whose stamp may be 0, which later is no stamp
    lockstep.joint_commands.publish(by_name(header=first.header, name=JOINTS, effort=[0.0] * 5))
    state = lockstep.new_state(lambda new: stamp_ns(new) > stamp_ns(first))
    for value in (1.0, 9.0):
        lockstep.joint_commands.publish(by_name(header=state.header, name=JOINTS[:1], effort=[value]))
    expect_trace(lockstep, 'ignored', 'second answer', 'the first one counts', '/wait/simulator/joint_commands')
    lockstep.joint_commands.publish(by_name(header=state.header, name=JOINTS[1:], effort=[0.0] * 4))
    after = lockstep.new_state(lambda new: stamp_ns(new) > stamp_ns(state))
    assert after.effort[0] == 1.0
    lockstep.events.clear()
    lockstep.joint_commands.publish(by_name(header=state.header, name=JOINTS, effort=[9.0] * 5))
    expect_trace(lockstep, 'ignored', 'other stamp', 'which is that of an earlier state',
                 '/wait/simulator/joint_commands')


def test_nan_and_a_short_effort_are_logged_as_received_and_repeat_bit_for_bit(tmp_path):
    path = tmp_path / 'run.mcap'
    with simulator('__ns:=/ragged', record=path, commanded_joints=f'[{JOINTS[1]},{JOINTS[3]}]') as process, \
            start_peer(process, '/ragged') as peer:
        sent = [by_name(name=JOINTS, position=[nan] * 5, effort=[nan, nan]),
                by_name(name=JOINTS, effort=[4.0, nan]), by_name(name=JOINTS, effort=[nan, -3.0]),
                by_name(name=JOINTS, effort=[nan, nan, 1.0, nan, 0.5])]
        efforts = [None, [0, 4, 0, 0, 0], [0, 4, 0, -3, 0], [0, 4, 1, -3, 0.5]]
        for message, wanted in zip(sent, efforts):
            peer.joint_commands.publish(message)
            if wanted:
                peer.new_state(lambda state: list(state.effort) == wanted)
        assert process.stop(signal.SIGTERM) == 0, process.output
    logged = [decode_joint_state(m.data) for m in read_log(path).messages if m.topic.endswith('/joint_commands')]
    assert [str(message.effort.tolist()) for message in logged] == [str(list(message.effort)) for message in sent]
    code, output = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, output


def test_a_controller_of_ours_that_is_killed_is_missed_after_its_lease_of_five_seconds():
    with simulator('__ns:=/killed', rate=100) as process, \
            Process('planar_chain_sim.ros.example_controller', '--ros-args', '-r', '__ns:=/killed') as controller, \
            Peer(namespace='/killed') as peer:
        peer.meet()
        peer.node.destroy_publisher(peer.commands)
        peer.node.destroy_publisher(peer.joint_commands)
        peer.new_state(lambda state: any(state.effort))
        controller.send(signal.SIGKILL)
        tick = peer.until(lambda: events(peer, 'command'))[-1]['tick']
        lost = peer.until(lambda: events(peer, 'controller_loss'))[-1]
        assert lost['tick'] - tick < 1200, 'of Fast DDS itself it is 20 s'
        assert process.stop() == 0, process.output
