"""Lockstep over plain topics: any controller, however slow, gives the bits of the same loop without ROS."""
from contextlib import ExitStack
import hashlib
import json
import random
import time

from live import PATIENCE, Peer, Process, run, simulator, stamp_ns
from lockstep_controller import effort
import numpy as np
import pytest
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

import planar_chain_sim as pcs
from planar_chain_sim.recording.cdr import decode_joint_state
from planar_chain_sim.recording.log import load_log
from planar_chain_sim.recording.log_reader import read_log

CHAIN = pcs.load_chain('four_link_robot.yaml')
JOINTS = list(CHAIN.joint_names)
MS = 1_000_000


def loop_without_ros(periods, ticks=1):
    """Return the positions (periods + 1, joints) of the same controller around the simulation itself."""
    simulation, positions = pcs.Simulation(CHAIN), []
    for _ in range(periods):
        positions.append(simulation.position)
        simulation.advance(ticks, [effort(q, v) for q, v in zip(simulation.position, simulation.velocity)])
    return np.array([*positions, simulation.position])


def events(peer, kind):
    return [event for event in map(json.loads, (message.data for message in peer.events)) if event['kind'] == kind]


def answer(peer, state, joints=JOINTS):
    values = dict(zip(state.name, map(effort, state.position, state.velocity)))
    peer.joint_commands.publish(JointState(header=state.header, name=joints, effort=[values[n] for n in joints]))


def next_state(peer, after):
    """Return the state of the tick behind this stamp."""
    return peer.until(lambda: next((state for state in peer.states if stamp_ns(state) > after), None), 'a state')


def test_a_hundred_runs_with_random_delays_have_one_hash():
    """A controller in this process, by name and in joint order in turn, with repeated and late answers thrown in."""
    periods, hashes = 20, set()
    wanted = loop_without_ros(periods)
    begin = wanted[0].tolist()
    with simulator('__ns:=/hundred', lockstep=True) as process, Peer(namespace='/hundred') as peer:
        peer.meet()
        for trial in range(100):
            generator = random.Random(trial)
            peer.call('reset')
            state = peer.until(lambda: next((state for state in peer.states if list(state.position) == begin), None))
            peer.states.clear()
            positions = []
            for _ in range(periods):
                positions.append(list(state.position))
                if trial % 10:
                    time.sleep(generator.random() * 0.002)
                if generator.random() < 0.2:
                    stale = JointState(name=JOINTS, effort=[99.0] * 5)
                    stale.header.stamp.sec = 2**31 - 1
                    peer.joint_commands.publish(stale)
                if trial % 2:
                    answer(peer, state)
                    if generator.random() < 0.2:
                        answer(peer, state)
                else:
                    peer.commands.publish(Float64MultiArray(data=list(map(effort, state.position, state.velocity))))
                state = next_state(peer, stamp_ns(state))
                peer.states.clear()
            positions.append(list(state.position))
            hashes.add(hashlib.sha256(np.array(positions).tobytes()).hexdigest())
        assert process.stop() == 0, process.output
    assert hashes == {hashlib.sha256(wanted.tobytes()).hexdigest()}


def test_two_controllers_of_different_joints_in_processes_of_their_own(tmp_path):
    path, periods = tmp_path / 'run.mcap', 150
    with ExitStack() as stack:
        node = stack.enter_context(simulator('__ns:=/two', lockstep=True, record=path))
        controllers = [stack.enter_context(Process('lockstep_controller', '/two', periods, 0.004, seed, *joints))
                       for seed, joints in enumerate((JOINTS[:2], JOINTS[2:]))]
        assert [controller.finish() for controller in controllers] == [0, 0], node.output
        assert node.stop() == 0, node.output
    states = [decode_joint_state(m.data) for m in read_log(path).messages if m.topic == '/two/joint_states']
    assert np.array([state.position for state in states]).tobytes() == loop_without_ros(periods).tobytes()
    assert [state.stamp for state in states] == [k * MS for k in range(periods + 1)]
    code, output = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, output


def test_a_control_period_of_several_ticks(tmp_path):
    path, periods = tmp_path / 'run.mcap', 30
    with simulator('__ns:=/slow', lockstep=True, publish_rate=100, record=path) as node, \
            Process('lockstep_controller', '/slow', periods, 0.002, 0) as controller:
        assert controller.finish() == 0, node.output
        assert node.stop() == 0, node.output
    states = [decode_joint_state(m.data) for m in read_log(path).messages if m.topic == '/slow/joint_states']
    assert len(states) == 10 * periods + 1
    assert np.array([s.position for s in states[::10]]).tobytes() == loop_without_ros(periods, 10).tobytes()


@pytest.fixture
def peer():
    with simulator('__ns:=/step', lockstep=True, lockstep_joints=f'[{JOINTS[0]},{JOINTS[3]}]', command_timeout=0.3,
                   publish_clock=True, use_sim_time=True) as process, Peer(namespace='/step') as peer:
        peer.process = process
        yield peer.meet()
        assert process.stop() == 0, process.output


def test_silence_is_reported_and_the_outstanding_state_repeated(peer):
    peer.call('reset')   # the silence of the start may have been told before anybody listened
    first = peer.new_state()
    answer(peer, first, JOINTS[:1])
    told = peer.until(lambda: events(peer, 'command_timeout'))[-1]
    assert told['tick'] == 0 and told['data']['effort'] is None
    assert told['data']['joints'] in ([JOINTS[3]], [JOINTS[0], JOINTS[3]])
    peer.process.wait_for('lockstep waits at tick 0: no command for')
    again = peer.new_state()
    assert (stamp_ns(again), again.position) == (0, first.position), 'silence never advances'
    answer(peer, again, JOINTS[3:])
    second = peer.new_state(lambda state: stamp_ns(state) > 0)
    assert stamp_ns(second) == MS
    assert second.effort[0] == effort(first.position[0], first.velocity[0]), 'what came before the silence counts'
    unstamped = JointState(name=JOINTS, effort=[9.0] * 5)
    peer.joint_commands.publish(unstamped)
    peer.process.wait_for('has no stamp, in lockstep it must repeat that of the state it answers')
    answer(peer, second, [JOINTS[0]])
    peer.until(lambda: [e for e in events(peer, 'command_timeout') if e['tick'] == 1 and e['data']['joints']
                        in ([JOINTS[3]], [JOINTS[0], JOINTS[3]])])   # the latter where it was told before the answer
    peer.new_state()   # a second later
    assert len([event for event in events(peer, 'command_timeout') if event['tick'] == 1]) == 1


def test_pause_step_and_reset_in_lockstep(peer):
    peer.new_state()
    assert peer.call('step') == (False, 'not stepped: the simulation is running, pause it first')
    assert peer.call('pause', True)[0]
    assert peer.call('step')[0]
    state = peer.new_state(lambda state: stamp_ns(state) == MS)
    answer(peer, state)
    peer.until(lambda: events(peer, 'command'))
    assert stamp_ns(peer.new_state()) == MS, 'answered, but paused'
    assert peer.call('pause', False)[0]
    state = peer.new_state(lambda state: stamp_ns(state) == 2 * MS)
    assert peer.call('reset')[0]
    state = peer.new_state(lambda state: list(state.position) == [joint.position for joint in CHAIN.joints])
    assert stamp_ns(state) == 2 * MS
    answer(peer, state)
    peer.new_state(lambda state: stamp_ns(state) == 3 * MS)


def test_a_controller_that_goes_is_followed_by_another(peer):
    with Peer(namespace='/step') as controller:
        controller.meet()
        peer.node.destroy_publisher(peer.commands)
        peer.node.destroy_publisher(peer.joint_commands)
        answer(controller, peer.new_state(), JOINTS[:1])
        assert controller.joint_commands.wait_for_all_acked(Duration(seconds=PATIENCE)), 'the answer has arrived'
    lost = peer.until(lambda: events(peer, 'controller_loss'))[-1]
    assert lost['data']['effort'] == [0.0] * 5
    peer.joint_commands = peer.node.create_publisher(JointState, '/step/simulator/joint_commands', 64)
    peer.until(lambda: peer.joint_commands.get_subscription_count())
    state = peer.new_state()
    assert stamp_ns(state) == 0
    answer(peer, state, JOINTS[3:])
    assert stamp_ns(peer.new_state()) == 0, 'the answer of the one that has gone does not count any more'
    answer(peer, state, JOINTS[:1])
    peer.new_state(lambda state: stamp_ns(state) == MS)


def test_a_step_with_a_part_of_the_answers_runs_again(tmp_path):
    """Paused, so that ~/step makes the tick that would wait: what has come acts, and the log says so."""
    path = tmp_path / 'run.mcap'
    with simulator('__ns:=/part', lockstep=True, start_paused=True, record=path) as process, \
            Peer(namespace='/part') as peer:
        peer.meet()
        for _ in range(10):
            answer(peer, peer.new_state(), JOINTS[:1])
            assert peer.call('step')[0]
        assert process.stop() == 0, process.output
    assert 'command' in {event['kind'] for event in load_log(path).events}
    code, output = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, output
