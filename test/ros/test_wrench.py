"""Wrenches and payloads of the node, from another process: their effect, their end, what is refused, and the log."""
import json

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from live import PATIENCE, Peer, Process, run, simulator, stamp_ns
import numpy as np
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from planar_chain_sim import load_log
from planar_chain_sim.recording.log_reader import read_log

# A balanced rod on a cart, upright and at rest, with nothing to pull at it: both accelerations are quotients.
CART, ROD, INERTIA = 3.0, 1.0, 0.5   # kg, kg, kg m^2
CHAIN = f"""
name: rod_on_a_cart
gravity: [0.0, 0.0]
bodies:
  - {{name: cart, carrier: base, mass: {CART}, inertia_com: 1.0, slide: {{joint: rail, axis: 0.0}}}}
  - name: rod
    carrier: cart
    mass: {ROD}
    inertia_com: {INERTIA}
    rotation: {{joint: hinge, position: {np.pi / 2}}}
"""
WRENCH = '/simulator/wrench'


@pytest.fixture
def chain_file(tmp_path):
    path = tmp_path / 'rod_on_a_cart.yaml'
    path.write_text(CHAIN)
    return path


def events(peer, kind):
    return [event for event in map(json.loads, (message.data for message in peer.events)) if event['kind'] == kind]


def wrench(body, x=0.0, y=0.0, moment=0.0):
    message = WrenchStamped()
    message.header.frame_id = body
    message.wrench.force.x, message.wrench.force.y, message.wrench.torque.z = x, y, moment
    # What the bearings take.
    message.wrench.force.z, message.wrench.torque.x, message.wrench.torque.y = 1e6, -1e6, 1e6
    return message


def pusher(peer):
    """Return a publisher of wrenches that the node knows of."""
    publisher = peer.node.create_publisher(WrenchStamped, WRENCH, 64)
    peer.until(publisher.get_subscription_count, 'a match')
    return publisher


def push(peer, publisher, *arguments, **components):
    """Publish a wrench and wait for its event."""
    told = len(events(peer, 'wrench'))
    publisher.publish(wrench(*arguments, **components))
    return peer.until(lambda: events(peer, 'wrench')[told:], 'the wrench')[0]


def step(peer, ticks):
    """Make ticks of a paused simulation and return the state after the last, not one that was still under way."""
    before = stamp_ns(peer.standing_state())
    for _ in range(ticks):
        assert peer.call('step')[0]
    return peer.new_state(lambda state: stamp_ns(state) == before + ticks * 1_000_000)


def resimulated(path):
    code, output = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, output
    return output


def test_a_wrench_acts_as_newton_says_and_the_log_runs_again(chain_file, tmp_path):
    path, again = tmp_path / 'run.mcap', tmp_path / 'again.mcap'
    with simulator(chain_file=chain_file, start_paused=True, record=path) as process, Peer() as peer:
        peer.meet()
        publisher, h, total = pusher(peer), 1e-3, CART + ROD
        event = push(peer, publisher, 'rod', y=-8.0)   # the rod's y axis points to the left
        assert event == {'tick': 0, 'kind': 'wrench',
                         'data': {'body': 'rod', 'force': [0.0, -8.0], 'moment': 0.0, 'axes': 'body'}}
        state = step(peer, 5)
        np.testing.assert_allclose(state.position, [0.5 * 8.0 / total * (5 * h)**2, np.pi / 2], rtol=1e-12)
        # The newest of a body acts; those of other bodies stay.
        push(peer, publisher, 'rod', moment=3.0)
        push(peer, publisher, 'cart', x=-4.0, moment=9.0)
        state = step(peer, 5)
        speeds = [(8.0 - 4.0) / total * 5 * h, 3.0 / INERTIA * 5 * h]
        np.testing.assert_allclose(state.velocity, speeds, rtol=1e-12, atol=1e-15)
        assert list(state.effort) == [0.0, 0.0], 'a wrench is no effort of an actuator'
        push(peer, publisher, 'rod')
        push(peer, publisher, 'cart')
        np.testing.assert_allclose(step(peer, 3).velocity, speeds, rtol=1e-12, atol=1e-15)
        # The same wrench again changes nothing and has no event.
        publisher.publish(wrench('rod'))
        publisher.publish(wrench('cart', x=1.0))
        assert peer.until(lambda: events(peer, 'wrench')[5:])[0]['data']['force'] == [1.0, 0.0]
        assert peer.call('reset')[0]
        assert list(step(peer, 4).velocity) == [0.0, 0.0], 'a reset takes wrenches away'
        push(peer, publisher, 'cart', x=1.0)
        assert step(peer, 1).velocity[0] == pytest.approx(h / total)
        assert process.stop() == 0, process.output
    assert 'equal: 20 states' in resimulated(path)
    assert len([message for message in read_log(path).messages if message.topic == WRENCH]) == 8
    forces = [event['data']['force'] for event in load_log(path).events if event['kind'] == 'wrench']
    assert forces == [[0.0, -8.0], [0.0, 0.0], [-4.0, 0.0], [0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 0.0]]
    with simulator(chain_file=chain_file, start_paused=True, record=again) as process, Peer() as peer:
        peer.meet()
        code, output = run('planar_chain_sim.ros.replay', path, '--wait', PATIENCE)
        assert code == 0, output
        assert peer.until(lambda: [event['data'] for event in events(peer, 'wrench')
                                   if event['data'] == {'body': 'cart', 'force': [1.0, 0.0], 'moment': 0.0,
                                                        'axes': 'body'}], 'the replayed wrench')


def test_a_wrench_is_held_when_its_publisher_has_gone_and_is_no_command(chain_file):
    with simulator(chain_file=chain_file, command_timeout=0.2, publish_clock=True), Peer() as peer:
        peer.meet()
        publisher = pusher(peer)
        push(peer, publisher, 'cart', x=0.5)
        peer.node.destroy_publisher(publisher)
        first = peer.new_state(lambda state: state.velocity[0] > 0.0)   # one from before may come after the event
        last = peer.new_state(lambda state: stamp_ns(state) > stamp_ns(first) + 400_000_000)
        passed = (stamp_ns(last) - stamp_ns(first)) * 1e-9
        assert last.velocity[0] - first.velocity[0] == pytest.approx(0.5 / (CART + ROD) * passed, rel=1e-6)
        assert not events(peer, 'controller_loss') and not events(peer, 'command_timeout')
        # Nor does one who pushes stand in for a controller.
        pusher(peer)
        peer.joint_commands.publish(JointState(name=['hinge'], effort=[0.25]))
        peer.until(lambda: events(peer, 'command'))
        peer.node.destroy_publisher(peer.commands)
        peer.node.destroy_publisher(peer.joint_commands)
        peer.until(lambda: events(peer, 'controller_loss'), 'the loss of the controller')


def test_what_is_no_wrench_is_rejected_and_counted(chain_file):
    with simulator(chain_file=chain_file, start_paused=True) as process, Peer() as peer:
        peer.meet()
        publisher = pusher(peer)
        diagnostics = peer.listen(DiagnosticArray, '/diagnostics')
        across = wrench('rod')
        across.wrench.torque.x = float('nan')
        bad = {'unknown body': [wrench('hand', x=1.0), wrench('', x=1.0)], 'malformed': [bytes(20)],
               'not finite': [wrench('rod', y=float('inf')), across], 'too long': [wrench('r' * 2 ** 20)]}
        for reason, messages in bad.items():
            for message in messages:
                told = len(events(peer, 'rejected'))
                publisher.publish(message)
                data = peer.until(lambda: events(peer, 'rejected')[told:], reason)[0]['data']
                assert data['topic'] == WRENCH and data['count'] == 1 and '\n' not in data['reason']
        told = [event['data']['reason'] for event in events(peer, 'rejected')]
        assert told[0] == "its frame_id is 'hand', must be the name of a body: cart, rod"

        def counted():
            statuses = {status.name: status for status in diagnostics[-1].status} if diagnostics else {}
            values = {value.key: value.value for value in statuses['simulator: commands'].values} if statuses else {}
            return values if values.get('rejected') == '6' else None
        values = peer.until(counted, 'the count of all')
        assert {reason: values[f'rejected, {reason}'] for reason in bad} == {
            reason: str(len(messages)) for reason, messages in bad.items()}
        assert list(step(peer, 3).velocity) == [0.0, 0.0] and not events(peer, 'wrench')
        process.wait_for(f'wrench on {WRENCH} rejected')


def test_in_lockstep_a_wrench_acts_and_nobody_waits_for_it(chain_file, tmp_path):
    path = tmp_path / 'run.mcap'
    with simulator(chain_file=chain_file, lockstep=True, record=path) as process, Peer() as peer:
        peer.meet()
        publisher = pusher(peer)
        for tick in range(10):
            state = peer.until(lambda: next((s for s in peer.states if stamp_ns(s) == tick * 1_000_000), None))
            if tick == 4:
                assert push(peer, publisher, 'cart', x=2.0)['tick'] == 4
            peer.joint_commands.publish(JointState(header=state.header, name=['rail', 'hinge'], effort=[0.0, 0.0]))
        state = peer.until(lambda: next((s for s in peer.states if stamp_ns(s) == 10_000_000), None))
        assert state.velocity[0] == pytest.approx(2.0 / (CART + ROD) * 6e-3)
        assert process.stop() == 0, process.output
    assert 'equal: 11 states' in resimulated(path)


def test_a_payload_comes_and_goes_and_energy_stays_in_balance(tmp_path):
    path = tmp_path / 'run.mcap'
    with simulator(record=path, payload_body='forearm', payload_position='[0.1,0.05]', payload_mass=0.5) as process, \
            Peer() as peer:
        peer.meet()
        publisher = pusher(peer)
        diagnostics = peer.listen(DiagnosticArray, '/diagnostics')
        assert peer.set(payload_mass=2.5) == [(True, '')]
        (success, sentence), = peer.set(payload_mass=-1.0)
        assert not success and 'payload_mass' in sentence and '\n' not in sentence
        push(peer, publisher, 'forearm', x=12.0, y=-3.0, moment=0.5)
        # Only what the balance of at least a second says, begun when the payload came, is looked at.
        peer.until(lambda: len(diagnostics) > 2)
        seen = len(diagnostics)
        peer.until(lambda: len(diagnostics) > seen + 1)
        values = {value.key: value.value for value in diagnostics[-1].status[0].values}
        assert abs(float(values['energy balance error, relative'])) < 1e-6
        assert peer.set(payload_mass=0.0) == [(True, '')]
        seen = len(diagnostics)
        peer.until(lambda: len(diagnostics) > seen + 1)
        values = {value.key: value.value for value in diagnostics[-1].status[0].values}
        assert abs(float(values['energy balance error, relative'])) < 1e-6
        assert process.stop() == 0, process.output
    resimulated(path)
    payloads = [json.loads(message.data[8:-1])['data'] for message in read_log(path).messages
                if message.topic == '/simulator/events' and b'"payload"' in message.data]
    assert [payload['mass'] for payload in payloads] == [0.5, 2.5, 0.0]
    assert ['welded bodies merged: 1' in payload['plan'] for payload in payloads] == [True, True, False]
    assert {(payload['body'], *payload['position']) for payload in payloads} == {('forearm', 0.1, 0.05)}


def test_a_row_with_a_reader_makes_a_topic_that_changes_the_run(chain_file, tmp_path):
    path, topic = tmp_path / 'run.mcap', '/simulator/payload'
    with Process('payload_topic', '--ros-args', '-p', f'chain_file:={chain_file}', '-p', 'start_paused:=true', '-p',
                 f'record:={path}') as process, Peer() as peer:
        process.wait_for('running')
        peer.meet()
        publisher = peer.node.create_publisher(Float64MultiArray, topic, 64)
        peer.until(publisher.get_subscription_count, 'a match')
        for mass in (6.0, -1.0):
            told = len(events(peer, 'payload')) + len(events(peer, 'rejected'))
            publisher.publish(Float64MultiArray(data=[mass, 0.0, 0.0]))
            peer.until(lambda: len(events(peer, 'payload')) + len(events(peer, 'rejected')) > told)
        payload, = events(peer, 'payload')
        assert payload['data']['mass'] == 6.0 and 'welded bodies merged: 1' in payload['data']['plan']
        rejected, = events(peer, 'rejected')
        assert rejected['data']['topic'] == topic and 'a mass of -1.0 kg' in rejected['data']['reason']
        process.wait_for(f'payload on {topic} rejected')
        peer.joint_commands.publish(JointState(name=['rail'], effort=[5.0]))
        peer.until(lambda: events(peer, 'command'))
        assert step(peer, 10).velocity[0] == pytest.approx(5.0 / (CART + ROD + 6.0) * 0.01)
        assert process.stop() == 0, process.output
    assert 'equal: 11 states' in resimulated(path)
    assert [command['effort'][0] for command in load_log(path).commands if command['topic'] == topic] == [6.0, -1.0]


def test_a_payload_moves_slower(chain_file):
    with simulator(chain_file=chain_file, start_paused=True) as _, Peer() as peer:
        peer.meet()
        assert peer.set(payload_mass=6.0) == [(True, '')]
        peer.joint_commands.publish(JointState(name=['rail'], effort=[5.0]))
        peer.until(lambda: events(peer, 'command'))
        assert step(peer, 10).velocity[0] == pytest.approx(5.0 / (CART + ROD + 6.0) * 0.01)
