"""All that the node offers besides states and commands, from another process: time, parameters, descriptions."""
import json
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from live import CONFIG, Peer, run, simulator, stamp_ns
import numpy as np
import pinocchio
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from visualization_msgs.msg import Marker, MarkerArray

from planar_chain_sim import load_chain
from planar_chain_sim.mechanics.body_lines import body_lines
from planar_chain_sim.recording.cdr import decode_clock, decode_joint_state, decode_string
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.robot_files.urdf_writer import urdf_of
from planar_chain_sim.ros.description import TOPIC
from planar_chain_sim.ros.parameters import PARAMETERS

CHAIN = load_chain(CONFIG / 'four_link_robot.yaml')
MS = 1_000_000
TOPICS = {   # name below the namespace, node 'sim': type, depth, latched
    'joint_states': ('sensor_msgs/msg/JointState', False), 'sim/events': ('std_msgs/msg/String', False),
    '/clock': ('rosgraph_msgs/msg/Clock', False), '/diagnostics': ('diagnostic_msgs/msg/DiagnosticArray', False),
    'robot_description': ('std_msgs/msg/String', True), 'sim/markers': ('visualization_msgs/msg/MarkerArray', False)}
COMMANDS = {'sim/commands': 'std_msgs/msg/Float64MultiArray', 'sim/joint_commands': 'sensor_msgs/msg/JointState',
            'sim/wrench': 'geometry_msgs/msg/WrenchStamped'}


def events(peer, kind):
    return [event for event in map(json.loads, (message.data for message in peer.events)) if event['kind'] == kind]


@pytest.fixture(scope='module')
def everything(tmp_path_factory):
    """Yield a node with all that can be switched on, by another name and namespace, its log, and a peer."""
    path = tmp_path_factory.mktemp('everything') / 'run.mcap'
    with simulator('__ns:=/left', '__node:=sim', publish_clock=True, publish_markers=True, use_sim_time=True,
                   record=path) as process, Peer('sim', '/left') as peer:
        peer.process, peer.log = process, path
        yield peer.meet()


def test_every_topic_has_its_name_type_and_quality(everything):
    for name, (type_name, latched) in TOPICS.items():
        topic = name if name.startswith('/') else f'/left/{name}'
        offered, = everything.until(lambda: everything.node.get_publishers_info_by_topic(topic), topic)
        assert offered.topic_type == type_name
        assert offered.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        assert (offered.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL) == latched
    for name, type_name in COMMANDS.items():
        wanted, = everything.node.get_subscriptions_info_by_topic(f'/left/{name}')
        assert wanted.topic_type == type_name
    assert not everything.node.get_subscriptions_info_by_topic('/clock'), 'the clock does not listen to itself'


def test_every_parameter_can_be_listed_described_and_got(everything):
    everything.until(everything.parameters.services_are_ready)
    names = [row.name for row in PARAMETERS]
    listed = everything.ask(everything.parameters.list_parameters([], 10)).result.names
    assert set(names) <= set(listed)
    described = everything.ask(everything.parameters.describe_parameters(names)).descriptors
    assert all(descriptor.description for descriptor in described)
    assert {descriptor.name for descriptor in described if not descriptor.read_only} == {
        'real_time_factor', 'command_timeout', 'on_controller_loss', 'gravity', 'damping', 'effort_limit',
        'payload_mass'}
    values = dict(zip(names, everything.ask(everything.parameters.get_parameters(names)).values))
    assert values['publish_rate'].double_value == values['rate'].double_value == 1000.0
    assert list(values['gravity'].double_array_value) == [0.0, -9.81]
    assert list(values['lockstep_joints'].string_array_value) == list(CHAIN.joint_names)
    (success, reason), = everything.set(rate=500.0)
    assert not success and 'read-only' in reason


def test_the_clock_goes_before_the_states_that_bear_its_time(everything):
    clock = everything.listen(Clock, '/clock')
    everything.until(lambda: len(clock) > 200 and len(everything.states) > 200)
    times = [message.clock.sec * 10**9 + message.clock.nanosec for message in clock]
    assert (np.diff(times) > 0).all() and times[0] < 3600 * 10**9
    assert all(stamp_ns(state) % MS == 0 for state in everything.states)
    everything.call('pause', True)
    everything.call('reset')
    held = stamp_ns(everything.standing_state())
    everything.until(lambda: clock[-1].clock.sec * 10**9 + clock[-1].clock.nanosec == held)
    everything.call('pause', False)
    everything.new_state(lambda state: stamp_ns(state) > held)
    assert everything.process.output.count('use_sim_time is set and this node is the clock') == 1


def test_a_node_on_simulated_time_follows(everything):
    follower = Node('follower', context=everything.context,
                    parameter_overrides=[Parameter('use_sim_time', value=True)])
    everything.executor.add_node(follower)
    before = stamp_ns(everything.new_state())
    everything.until(lambda: follower.get_clock().now().nanoseconds > before)
    assert follower.get_clock().now().nanoseconds < 3600 * 10**9
    everything.executor.remove_node(follower)
    follower.destroy_node()


def test_use_sim_time_without_a_clock_keeps_wall_time_and_says_so():
    with simulator('__ns:=/wall', use_sim_time=True) as process, Peer(namespace='/wall') as peer:
        peer.meet()
        first = stamp_ns(peer.new_state())
        assert stamp_ns(peer.new_state(lambda state: stamp_ns(state) > first + 100 * MS)) > 10**18
        assert process.stop() == 0, process.output
    assert 'use_sim_time is set, but this node keeps wall time and stamps with it' in process.output


def test_markers_stand_where_the_bodies_are(everything):
    arrays = everything.listen(MarkerArray, '/left/sim/markers')
    everything.call('pause', True)
    state = everything.standing_state()
    arrays.clear()
    everything.until(lambda: len(arrays) > 1)
    *bodies, points = arrays[-1].markers
    assert {marker.header.frame_id for marker in arrays[-1].markers} == {'world'}
    assert {stamp_ns(marker) for marker in arrays[-1].markers} == {stamp_ns(state)}
    assert [marker.ns for marker in bodies] == [body.name for body in CHAIN.bodies]
    for marker, lines in zip(bodies, body_lines(CHAIN, np.array(state.position))):
        assert marker.type == Marker.LINE_LIST
        assert [complex(p.x, p.z) for p in marker.points] == [complex(end) for line in lines for end in line]
    assert len(points.points) == len(CHAIN.bodies)
    everything.call('pause', False)


def test_the_description_waits_for_those_who_come_later(everything):
    texts = everything.listen(String, '/left/robot_description', latched=True)
    everything.until(lambda: texts)
    assert [message.data for message in texts] == [urdf_of(CHAIN, '/left/sim/joint_commands', '/left/joint_states')]
    model = pinocchio.buildModelFromXML(texts[0].data)
    assert set(CHAIN.joint_names) <= set(model.names)


def test_parameters_that_live_act_at_a_tick(everything):
    assert everything.set(gravity=[0, 0], damping=[0.0] * 5, effort_limit=[2.5, float('inf'), 1.0, 1.0, 1.0]) == [
        (True, '')] * 3
    everything.commands.publish(Float64MultiArray(data=[9.0] * 5))
    everything.new_state(lambda state: list(state.effort) == [2.5, 9.0, 1.0, 1.0, 1.0])
    told = {event['data']['name']: event for event in everything.until(
        lambda: events(everything, 'parameter') if len(events(everything, 'parameter')) >= 3 else None)}
    assert told['gravity']['data']['value'] == [0.0, 0.0]
    assert told['effort_limit']['data']['value'] == [2.5, None, 1.0, 1.0, 1.0]
    assert told['gravity']['tick'] <= told['damping']['tick'] <= told['effort_limit']['tick']
    (success, reason), = everything.set(damping=[-1.0] * 5)
    assert not success and 'must be finite numbers >= 0' in reason


def statuses(message, node='left/sim'):
    return {status.name.removeprefix(f'{node}: '): status for status in message.status
            if status.name.startswith(f'{node}: ')}


def values(status):
    return {pair.key: pair.value for pair in status.values}


def test_diagnostics_have_time_commands_energy_and_log(everything):
    messages = everything.listen(DiagnosticArray, '/diagnostics')
    for command in ([1.0], [float('nan')] * 5, [1.0, 2.0]):
        everything.commands.publish(Float64MultiArray(data=command))
    everything.until(lambda: sum(event['data']['count'] for event in events(everything, 'rejected')) >= 3)
    messages.clear()
    everything.until(lambda: len(messages) >= 3)
    parts = statuses(messages[-1])
    assert list(parts) == ['simulation', 'commands', 'log', 'network']
    assert {part.hardware_id for part in parts.values()} == {CHAIN.name}
    simulation = values(parts['simulation'])
    assert float(simulation['real_time_factor']) > 0.0
    assert {'missed ticks', 'dropped ticks', 'lateness mean, s', 'energy balance error, J'} <= set(simulation)
    assert 0.0 < abs(float(simulation['energy balance error, relative'])) < 1e-5   # exactly 0: nobody looks
    assert values(parts['commands']) == {'rejected': '3', 'rejected, wrong length': '2', 'rejected, not finite': '1',
                                         'ignored': '0', 'superseded': '0'}
    assert values(parts['log'])['path'] == str(everything.log) and parts['log'].message == 'writing'
    apart = (stamp_ns(messages[-1]) - stamp_ns(messages[0])) / (len(messages) - 1)
    assert apart > 0.5e9, 'once a second, not more often; one may be late'


def test_diagnostics_of_a_divergence_are_an_error_with_joint_time_and_state(everything):
    messages = everything.listen(DiagnosticArray, '/diagnostics')
    everything.set(effort_limit=[float('inf')] * 5)
    everything.commands.publish(Float64MultiArray(data=[0.0, 1e306, 0.0, 0.0, 0.0]))
    everything.until(lambda: events(everything, 'divergence'))
    event = events(everything, 'divergence')[-1]['data']
    status = everything.until(lambda: next((
        part for message in messages for part in [statuses(message)['simulation']]
        if part.level == DiagnosticStatus.ERROR), None))
    told = values(status)
    assert status.message == event['message'] and told['divergence joint'] == event['joint']
    assert told['divergence body'] == event['body']
    assert float(told['divergence time, s']) == event['time']
    assert json.loads(told['last good position']) == event['position']
    assert everything.call('reset')[0]


def test_all_that_runs_again_from_the_log_alone(everything):
    """The last of this node: it ends, and what was changed above gives the same bits."""
    assert everything.process.stop() == 0, everything.process.output
    code, output = run('planar_chain_sim.resimulation.command_line', everything.log)
    assert code == 0, output
    log = list(read_log(everything.log).messages)
    kinds = {json.loads(decode_string(m.data))['kind'] for m in log if m.topic == '/left/sim/events'}
    assert kinds >= {'parameter', 'command', 'rejected', 'reset', 'pause', 'resume', 'divergence'}
    newest = None
    for message in log:
        if message.topic == '/clock':
            newest = decode_clock(message.data)
        elif message.topic == '/left/joint_states' and newest is not None:
            assert decode_joint_state(message.data).stamp in (newest, newest + MS)
    assert newest > 0


def test_as_fast_as_possible_and_slower_than_time():
    with simulator('__ns:=/fast', real_time_factor=0, publish_clock=True, start_paused=True,
                   publish_rate=100) as process, Peer(namespace='/fast') as peer:
        peer.meet()
        assert stamp_ns(peer.standing_state()) == 0
        peer.call('pause', False)
        peer.new_state(lambda state: stamp_ns(state) > 20 * 10**9)
        wall = time.monotonic()
        assert peer.set(real_time_factor=0.5) == [(True, '')]
        slow = peer.until(lambda: next((event['tick'] for event in events(peer, 'parameter')
                                        if event['data']['name'] == 'real_time_factor'), None))
        ended = stamp_ns(peer.new_state(lambda state: stamp_ns(state) > (slow + 300) * MS))
        assert ended - slow * MS < 0.55 * (time.monotonic() - wall) * 1e9 + 50 * MS, 'at most half of what passed'
        # Another pace is no lost time; what the machine loses later on is.
        assert not [event for event in events(peer, 'dropped_time') if event['tick'] <= slow]
        assert process.stop() == 0, process.output


def test_a_robot_comes_from_the_topic_robot_description(tmp_path):
    """The second node has its chain from the first one's latched text."""
    with simulator('__ns:=/a', chain_file='cart_arm_telescope.yaml') as first:
        with simulator('__ns:=/b', 'robot_description:=/a/robot_description', chain_file='robot_description',
                       effort_limit='[1.0,1.0,1.0,1.0,1.0]', record=tmp_path / 'b.mcap') as second, \
                Peer(namespace='/b') as peer:
            peer.meet()
            state = peer.new_state()
            assert list(state.name) == list(load_chain('cart_arm_telescope.yaml').joint_names)
            peer.joint_commands.publish(JointState(name=['arm_joint'], effort=[5.0]))
            peer.new_state(lambda state: list(state.effort) == [0.0, 1.0, 0.0, 0.0, 0.0])
            assert 'another text' not in second.output
            publisher = peer.node.create_publisher(String, '/a/robot_description', TOPIC.qos)
            publisher.publish(String(data='<robot name="another"/>'))
            second.wait_for('another text has come on /a/robot_description and has no effect')
            assert second.stop() == 0, second.output
        assert first.stop() == 0, first.output
    code, output = run('planar_chain_sim.resimulation.command_line', tmp_path / 'b.mcap')
    assert code == 0, output


def test_waiting_for_a_description_ends_with_a_signal():
    with simulator('__ns:=/none', chain_file='robot_description', ready=False) as process:
        process.wait_for('waiting for the URDF of a planar robot on /none/robot_description')
        assert process.stop() == 0, process.output
