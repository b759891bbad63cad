"""Others on the network: a DDS of another vendor, a second arm, remapped names, and clients that send harmful data."""
from datetime import datetime, timezone
import json
import os
import re
import signal

from live import CONFIG, Peer, Process, run, simulator, stamp_ns
import pytest
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from planar_chain_sim import load_chain
from planar_chain_sim.recording.cdr import decode_string
from planar_chain_sim.recording.log_reader import read_log

JOINTS = list(load_chain(CONFIG / 'four_link_robot.yaml').joint_names)


def events(path, topic='/simulator/events'):
    return [json.loads(decode_string(m.data)) for m in read_log(path).messages if m.topic == topic]


@pytest.mark.parametrize('year, kept', [(2026, True), (2065, False)])   # DDS counts seconds in 32 bits
def test_a_client_of_another_vendors_dds_commands_and_listens(tmp_path, year, kept):
    sent = round(datetime(year, 1, 1, tzinfo=timezone.utc).timestamp()) * 10**9
    path = tmp_path / 'run.mcap'
    with simulator(record=path) as process, \
            Process('cyclone_client', os.environ['ROS_DOMAIN_ID'], sent, 1, 2, 3, 4, 5) as client:
        assert client.finish() == 0, client.output
        assert client.output.endswith(f'states of {",".join(JOINTS)}')
        assert process.stop() == 0, process.output
    assert 'Traceback' not in process.output
    commands = [message for message in read_log(path).messages if message.topic == '/simulator/commands']
    assert commands
    for message in commands:
        assert message.publish_time == (sent if kept else message.log_time)


def test_two_arms_side_by_side():
    with simulator('__ns:=/left') as left, simulator('__ns:=/right', chain_file='double_pendulum.yaml') as right, \
            Peer(namespace='/left') as left_peer, Peer(namespace='/right') as right_peer:
        left_peer.meet()
        right_peer.meet()
        left_peer.commands.publish(Float64MultiArray(data=[1.0, 2.0, 3.0, 4.0, 5.0]))
        right_peer.commands.publish(Float64MultiArray(data=[6.0, 7.0]))
        left_peer.new_state(lambda state: list(state.effort) == [1.0, 2.0, 3.0, 4.0, 5.0])
        right_peer.new_state(lambda state: list(state.effort) == [6.0, 7.0])
        assert left_peer.call('pause', True)[0]
        stood = stamp_ns(left_peer.standing_state())
        moving = stamp_ns(right_peer.new_state())
        right_peer.new_state(lambda state: stamp_ns(state) > moving)
        assert stamp_ns(left_peer.new_state()) == stood
        assert (left.stop(), right.stop()) == (0, 0), left.output + right.output


def test_every_name_can_be_another():
    names = {'joint_states': 'arm/states', '~/commands': '/arm/efforts', '~/joint_commands': '/arm/named',
             '~/events': 'arm/events', '/clock': '/arm/clock', '/diagnostics': '/arm/diagnostics',
             'robot_description': 'arm/description', '~/markers': '/arm/markers', '~/reset': '/arm/home',
             '~/step': '/arm/step', '~/pause': '/arm/stop'}
    with simulator('__node:=elbow', *(f'{old}:={new}' for old, new in names.items()), publish_clock=True,
                   publish_markers=True) as process, Peer() as peer:
        commands = peer.node.create_publisher(Float64MultiArray, '/arm/efforts', 10)
        home = peer.node.create_client(Trigger, '/arm/home')
        states = peer.listen(JointState, '/arm/states')   # the newest: when it is known to the node, so is the client
        peer.until(lambda: states and commands.get_subscription_count() and home.service_is_ready())
        commands.publish(Float64MultiArray(data=[1.0] * 5))
        peer.until(lambda: list(states[-1].effort) == [1.0] * 5)
        assert peer.ask(home.call_async(Trigger.Request())).success
        wanted = {new if new.startswith('/') else f'/{new}' for new in names.values()}
        peer.until(lambda: 'elbow' in peer.node.get_node_names())

        def known():
            return {name for ask in (peer.node.get_publisher_names_and_types_by_node,
                                     peer.node.get_subscriber_names_and_types_by_node,
                                     peer.node.get_service_names_and_types_by_node) for name, _ in ask('elbow', '/')}
        peer.until(lambda: wanted <= known(), wanted)
        assert not {name for name in known() if 'simulator' in name}
        assert process.stop() == 0, process.output


def test_a_flood_of_every_kind_of_harm_costs_no_tick(tmp_path):
    """Commands as fast as possible, huge ones, another type on the topic, and a subscriber that takes no message."""
    path, count = tmp_path / 'run.mcap', 100_000 if 'SOAK' in os.environ else 20_000
    with simulator(record=path) as process, Peer() as peer, Peer('nobody') as other_peer:
        peer.meet()
        stalled = peer.node.create_subscription(JointState, '/joint_states', lambda message: None,
                                                QoSProfile(depth=1000))   # never taken from
        invalid_client = other_peer.node.create_publisher(String, '/simulator/commands', 10)
        huge_messages = [Float64MultiArray(data=[1.0] * size) for size in (50_000, 200_000)]
        with Process('flooding_client', count) as flooding:
            for _ in range(20):
                invalid_client.publish(String(data='full speed ahead'))
                for huge_message in huge_messages:
                    peer.commands.publish(huge_message)
                peer.new_state()
            flooding.wait_for('flooded')
            peer.new_state(lambda state: state.effort[0] == count - 1)
        peer.commands.publish(Float64MultiArray(data=[7.0] * 5))
        peer.new_state(lambda state: list(state.effort) == [7.0] * 5)
        peer.node.destroy_subscription(stalled)
        assert process.stop() == 0, process.output
    assert 'Traceback' not in process.output
    ticks = [message.sequence for message in read_log(path).messages if message.topic == '/joint_states']
    assert ticks == list(range(len(ticks)))
    rejected = [event['data'] for event in events(path) if event['kind'] == 'rejected']
    assert sum(data['count'] for data in rejected) > 0
    assert all(re.match(r'it has \d+ (efforts|bytes), must have', data['reason']) for data in rejected), rejected
    code, output = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, output


def test_a_command_that_nobody_renews_ends_after_the_timeout(tmp_path):
    path = tmp_path / 'run.mcap'
    with simulator(command_timeout=2.0, rate=100, record=path) as process, Peer() as peer:
        peer.meet()
        peer.joint_commands.publish(JointState(name=JOINTS[:2], effort=[5.0, 6.0]))
        peer.new_state(lambda state: list(state.effort)[:2] == [5.0, 6.0])
        peer.joint_commands.publish(JointState(name=JOINTS[1:2], effort=[7.0]))
        peer.new_state(lambda state: list(state.effort)[:2] == [0.0, 7.0])
        peer.new_state(lambda state: list(state.effort)[:2] == [0.0, 0.0])
        process.wait_for('no command for')
        peer.commands.publish(Float64MultiArray(data=[1.0] * 5))
        peer.new_state(lambda state: list(state.effort) == [1.0] * 5)
        assert peer.set(command_timeout=0.0) == [(True, '')]
        begun = stamp_ns(peer.new_state())
        later = peer.new_state(lambda state: stamp_ns(state) > begun + 2_500_000_000)
        assert list(later.effort) in ([1.0] * 5, [0.0] * 5)
        assert process.stop(signal.SIGTERM) == 0, process.output
    told = events(path)
    first, second, *_ = [event for event in told if event['kind'] == 'command']
    ends = [event for event in told if event['kind'] == 'command_timeout']
    assert [(end['tick'], end['data']['joints']) for end in ends[:2]] == [
        (first['tick'] + 200, JOINTS[:1]), (second['tick'] + 200, JOINTS[1:2])]
    code, output = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, output
