"""The node as its users see it: from another process, over real DDS."""
import json
from pathlib import Path
import re
import signal
import sys
import time

from live import CONFIG, PATIENCE, Peer, run, simulator, stamp_ns
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from planar_chain_sim import load_chain
from planar_chain_sim.recording.cdr import decode_joint_state
from planar_chain_sim.recording.log_reader import read_log

CHAIN = load_chain(CONFIG / 'four_link_robot.yaml')
JOINTS = list(CHAIN.joint_names)
START = [joint.position for joint in CHAIN.joints]


@pytest.fixture(scope='module')
def live():
    """Yield one node for all tests of this file, and one peer."""
    with simulator() as process, Peer() as peer:
        peer.process = process
        yield peer.meet()


@pytest.fixture
def peer(live):
    """Yield the peer, with the node running from its initial state and no message on its way."""
    live.call('pause', False)
    live.call('reset')
    live.events.clear()
    live.states.clear()
    return live


def events(peer, kind):
    return [event for event in map(json.loads, (message.data for message in peer.events)) if event['kind'] == kind]


def efforts(values):
    return Float64MultiArray(data=[float(value) for value in values])


def test_states_have_the_joints_of_the_file_in_order_and_are_finite(peer):
    peer.until(lambda: len(peer.states) >= 50)
    for state in peer.states:
        assert list(state.name) == JOINTS
        assert state.header.frame_id == ''
        for values in (state.position, state.velocity, state.effort):
            assert len(values) == len(JOINTS) and np.isfinite(values).all()


def test_stamps_are_a_tick_apart(peer):
    peer.until(lambda: len(peer.states) >= 200)
    apart = np.diff([stamp_ns(state) for state in peer.states])
    assert (apart >= 0).all()
    # Between a reset's state and the next, and where time was dropped, they are not.
    assert np.median(apart) == 1_000_000


def test_the_arm_moves_as_the_simulation_says(peer):
    from planar_chain_sim import Simulation
    peer.call('pause', True)
    peer.call('reset')
    simulation = Simulation(CHAIN)
    command = np.arange(1.0, len(JOINTS) + 1.0)
    peer.commands.publish(efforts(command))
    peer.until(lambda: events(peer, 'command'))
    for _ in range(3):
        peer.call('step')
        simulation.advance(1, command)
        state = peer.new_state(lambda state: list(state.position) == simulation.position.tolist())
        assert list(state.velocity) == simulation.velocity.tolist()
        assert list(state.effort) == command.tolist()


def test_a_command_acts_until_the_next(peer):
    peer.commands.publish(efforts(range(1, 6)))
    peer.new_state(lambda state: list(state.effort) == [1, 2, 3, 4, 5])
    peer.commands.publish(efforts(range(5)))
    peer.new_state(lambda state: list(state.effort) == [0, 1, 2, 3, 4])
    peer.until(lambda: len(events(peer, 'command')) > 1, 'the event, which comes after the state')
    assert [event['data']['effort'] for event in events(peer, 'command')] == [[1, 2, 3, 4, 5], [0, 1, 2, 3, 4]]
    assert {event['data']['topic'] for event in events(peer, 'command')} == {'/simulator/commands'}


def test_the_newest_of_many_acts(peer):
    for k in range(40):
        peer.commands.publish(efforts([k] * 5))
    peer.new_state(lambda state: state.effort[0] == 39)
    told = peer.until(lambda: (told := events(peer, 'command')) and told[-1]['data']['effort'][0] == 39 and told)
    ticks = [event['tick'] for event in told]
    assert len(set(ticks)) == len(ticks), 'one command acts per tick'


def test_a_command_by_name_leaves_the_others(peer):
    peer.commands.publish(efforts([1, 2, 3, 4, 5]))
    peer.new_state(lambda state: state.effort[4] == 5)
    peer.joint_commands.publish(JointState(name=[JOINTS[3], JOINTS[0]], effort=[-4.0, -1.0]))
    peer.new_state(lambda state: list(state.effort) == [-1, 2, 3, -4, 5])


def test_two_controllers_of_one_tick_are_both_heard(peer):
    peer.call('pause', True)  # the node looks at commands all the same; here both come between two looks or not
    for k in range(1, 30):
        peer.joint_commands.publish(JointState(name=[JOINTS[1]], effort=[float(k)]))
        peer.joint_commands.publish(JointState(name=[JOINTS[2]], effort=[float(-k)]))
    peer.until(lambda: any(event['data']['effort'] == [0, 29, -29, 0, 0] for event in events(peer, 'command')))


def test_of_two_topics_the_later_message_wins(peer):
    for k in range(1, 30):
        peer.joint_commands.publish(JointState(name=JOINTS, effort=[-1.0] * 5))
        peer.commands.publish(efforts([k] * 5))
        peer.new_state(lambda state: list(state.effort) == [k] * 5)


def test_an_unknown_name_is_ignored_with_one_warning(peer):
    for _ in range(20):
        peer.joint_commands.publish(JointState(name=['elbow', JOINTS[0]], effort=[9.0, 7.0]))
    peer.new_state(lambda state: list(state.effort) == [7, 0, 0, 0, 0])
    peer.process.wait_for("names 'elbow'")
    assert not events(peer, 'rejected')
    warnings = [line for line in peer.process.lines if "names 'elbow'" in line]
    assert len(warnings) <= 2 and JOINTS[0] in warnings[0]


@pytest.mark.parametrize('message, reason', [
    (efforts([1, 2]), 'it has 2 efforts, must have 5, one for every joint'),
    (efforts([1] * 6), 'it has 6 efforts, must have 5, one for every joint'),
    (efforts([1, 1, float('nan'), 1, 1]), 'its effort 2 is nan, must be finite'),
    (efforts([1, 1, 1, 1, float('-inf')]), 'its effort 4 is -inf, must be finite'),
    (JointState(name=[JOINTS[0], 'x'], effort=[1.0, float('inf')]), 'its effort 1 is inf, must be finite'),
    (JointState(name=[JOINTS[0], JOINTS[0]], effort=[1.0, 2.0]),
     f'it names joint {JOINTS[0]!r} more than once, must name each once'),
    (JointState(name=JOINTS, effort=[1.0]), 'it has 1 efforts for 5 names, must have as many, or the parameter '
     'commanded_joints must name the joints that the efforts are for, in order')])
def test_a_bad_command_is_refused_as_a_whole(peer, message, reason):
    peer.commands.publish(efforts([5, 4, 3, 2, 1]))
    peer.new_state(lambda state: state.effort[0] == 5)
    topic = 'joint_commands' if isinstance(message, JointState) else 'commands'
    for _ in range(3):
        getattr(peer, topic).publish(message)
    peer.until(lambda: sum(event['data']['count'] for event in events(peer, 'rejected')) == 3)
    assert {event['data']['reason'] for event in events(peer, 'rejected')} == {reason}
    assert {event['data']['topic'] for event in events(peer, 'rejected')} == {f'/simulator/{topic}'}
    assert list(peer.new_state().effort) == [5, 4, 3, 2, 1]
    assert len(peer.until(lambda: events(peer, 'command'))) == 1
    peer.process.wait_for(f'command on /simulator/{topic} rejected')


def test_paused_time_stands_and_the_state_is_still_published(peer):
    assert peer.call('pause', True)[0]
    first = peer.standing_state()
    peer.states.clear()
    peer.until(lambda: len(peer.states) >= 20)
    assert {stamp_ns(state) for state in peer.states} == {stamp_ns(first)}
    assert {tuple(state.position) for state in peer.states} == {tuple(first.position)}
    success, sentence = peer.call('pause', True)
    assert success and 'already paused' in sentence
    assert peer.call('pause', False)[0]
    running = peer.until(lambda: next((s for s in peer.states if s.position != first.position), None))
    assert stamp_ns(running) > stamp_ns(first) + 10_000_000, 'stamps are of now again, not of before the pause'
    (resumed,), (paused,) = peer.until(lambda: events(peer, 'resume')), events(peer, 'pause')
    assert paused['tick'] == resumed['tick']
    assert resumed['tick'] not in [event['tick'] for event in events(peer, 'dropped_time')], 'a pause is no lost time'


def test_step_is_one_period_and_only_while_paused(peer):
    success, sentence = peer.call('step')
    assert not success and sentence == 'not stepped: the simulation is running, pause it first'
    peer.call('pause', True)
    before = peer.standing_state()
    assert peer.call('step')[0]
    after = peer.new_state(lambda state: stamp_ns(state) > stamp_ns(before))
    assert stamp_ns(after) == stamp_ns(before) + 1_000_000
    assert after.position != before.position
    assert stamp_ns(peer.standing_state()) == stamp_ns(after)


def test_reset_puts_back_the_initial_state_and_clears_commands(peer):
    peer.commands.publish(efforts([50, 0, 0, 0, 0]))
    peer.new_state(lambda state: state.effort[0] == 50 and list(state.position) != START)
    peer.call('pause', True)
    before = peer.standing_state()
    assert peer.call('reset')[0]
    after = peer.new_state(lambda state: list(state.position) == START)
    assert stamp_ns(after) == stamp_ns(before), 'time is not reset'
    assert list(after.velocity) == [joint.velocity for joint in CHAIN.joints]
    peer.call('step')
    assert list(peer.new_state(lambda state: list(state.position) != START).effort) == [0] * 5


def test_a_state_that_runs_away_is_told_held_and_reset(peer):
    peer.commands.publish(efforts([0, 1e306, 0, 0, 0]))
    peer.until(lambda: events(peer, 'divergence'))
    event, = events(peer, 'divergence')
    assert event['data']['joint'] in JOINTS and event['data']['joint'] in event['data']['message']
    peer.process.wait_for('[ERROR]')
    held = peer.standing_state()
    assert np.isfinite([*held.position, *held.velocity, *held.effort]).all()
    assert list(held.position) == event['data']['position'] and list(held.velocity) == event['data']['velocity']
    success, sentence = peer.call('step')
    assert not success and event['data']['message'] in sentence
    assert peer.call('reset')[0]
    peer.new_state(lambda state: stamp_ns(state) > stamp_ns(held) and list(state.position) != START)


def test_the_last_publisher_gone_means_zero_effort(peer):
    with Peer() as controller:
        controller.meet()
        controller.commands.publish(efforts([3, 3, 3, 3, 3]))
        peer.new_state(lambda state: state.effort[0] == 3)
        peer.node.destroy_publisher(peer.commands)
        peer.node.destroy_publisher(peer.joint_commands)
        peer.until(lambda: controller.states_in.get_publisher_count())
        assert list(peer.new_state().effort) == [3] * 5
    peer.new_state(lambda state: list(state.effort) == [0] * 5)
    assert peer.until(lambda: events(peer, 'controller_loss'))[0]['data']['effort'] == [0] * 5
    peer.commands = peer.node.create_publisher(Float64MultiArray, '/simulator/commands', 64)
    peer.joint_commands = peer.node.create_publisher(JointState, '/simulator/joint_commands', 64)
    peer.meet()


def test_hold_keeps_the_last_command():
    with simulator('__ns:=/held', on_controller_loss='hold') as process, Peer(namespace='/held') as peer:
        with Peer(namespace='/held') as controller:
            controller.meet()
            peer.meet()
            peer.node.destroy_publisher(peer.commands)
            peer.node.destroy_publisher(peer.joint_commands)
            controller.commands.publish(efforts([3, 3, 3, 3, 3]))
            peer.new_state(lambda state: state.effort[0] == 3)
        peer.until(lambda: not peer.node.count_publishers('/held/simulator/commands'))
        begun = stamp_ns(peer.new_state())
        later = peer.new_state(lambda state: stamp_ns(state) > begun + 300_000_000)
        assert list(later.effort) == [3] * 5 and not events(peer, 'controller_loss')
        assert process.stop() == 0


def test_time_that_cannot_be_caught_up_is_dropped_and_told(tmp_path):
    with simulator('__ns:=/late', record=tmp_path / 'run.mcap') as process, Peer(namespace='/late') as peer:
        peer.meet()
        for _ in range(20):   # where it stops in a publication, that explains the time, which is then made up for
            process.send(signal.SIGSTOP)
            time.sleep(0.8)  # what is lost
            process.send(signal.SIGCONT)
            peer.new_state(lambda state: abs(time.time_ns() - stamp_ns(state)) < 400_000_000)  # of now again
            if dropped := [event for event in events(peer, 'dropped_time') if event['data']['seconds'] > 0.5]:
                break
        assert process.stop() == 0
    assert 's late and dropped, the machine cannot keep up' in process.output
    log = [message for message in read_log(tmp_path / 'run.mcap').messages if message.topic == '/late/joint_states']
    stamps = {message.sequence: decode_joint_state(message.data).stamp for message in log}
    assert list(stamps) == list(range(len(stamps))), 'no tick is lost with the time'
    tick = dropped[0]['tick']
    assert stamps[tick + 1] - stamps[tick] == pytest.approx(dropped[0]['data']['seconds'] * 1e9 + 1_000_000, abs=2)
    code, output = run('planar_chain_sim.resimulation.command_line', tmp_path / 'run.mcap')
    assert code == 0, output


@pytest.mark.skipif(sys.platform != 'linux', reason='threads are looked at in /proc')
def test_the_middleware_wakes_no_thread_for_each_state():
    """The profile that the package gives to Fast DDS acts: without it, its event thread wakes up twice a state."""
    def wakes():
        threads = [thread for thread in Path(f'/proc/{process.popen.pid}/task').iterdir()
                   if (thread / 'comm').read_text().startswith('dds.ev')]
        assert threads, 'the middleware is another one'
        return sum(int(re.search(r'\nvoluntary_ctxt_switches:\s*(\d+)', (thread / 'status').read_text())[1])
                   for thread in threads)
    with simulator() as process, Peer() as peer:
        peer.meet().new_state()
        end, calm = time.monotonic() + PATIENCE, False
        while not calm:   # on a busy machine messages are late, and it wakes up for those
            assert time.monotonic() < end
            before, seen = wakes(), len(peer.states)
            peer.until(lambda: len(peer.states) >= seen + 500)
            calm = wakes() - before < 0.5 * (len(peer.states) - seen)


def once(data, seconds=0.1):
    """Do what `ros2 topic pub --once` does: wait for a listener, publish, and leave a tenth of a second later."""
    with Peer(namespace='/once') as sender:
        sender.until(sender.commands.get_subscription_count, 'a match')
        sender.commands.publish(Float64MultiArray(data=data))
        time.sleep(seconds)


def test_efforts_sent_once_by_hand_last_with_hold():
    with simulator('__ns:=/once') as process, Peer(namespace='/once') as peer:   # the module's own peer sends elsewhere
        peer.meet()
        peer.node.destroy_publisher(peer.commands)   # no publisher but the one that comes and goes
        peer.node.destroy_publisher(peer.joint_commands)

        def sent(value):   # again where the node had not matched the sender yet when that left
            once([value] * 5)
            return [state for state in peer.states if state.effort[0] == value]

        peer.until(lambda: sent(2.0) and events(peer, 'controller_loss'))
        peer.new_state(lambda state: list(state.effort) == [0.0] * 5)
        assert peer.set(on_controller_loss='hold') == [(True, '')]
        first = peer.until(lambda: sent(3.0))[0]
        later = peer.new_state(lambda state: stamp_ns(state) > stamp_ns(first) + 1_000_000_000)
        assert list(later.effort) == [3.0] * 5
        assert process.stop() == 0, process.output
