"""Every event of a live node, on its topic and in its log, has the data of its row in EVENTS."""
from itertools import cycle
import json
import os
import signal
import time

from geometry_msgs.msg import WrenchStamped
from live import Peer, run, simulator
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from planar_chain_sim.recording.events import EVENTS
from planar_chain_sim.recording.log import load_log

CHAIN = """
name: hammer
bodies:
- {name: boom, carrier: base, mass: 1.0, center_of_mass: [0.5, 0.0], inertia_com: 0.1,
   rotation: {joint: luff, lower: -0.5, upper: 0.5}}
- {name: wheel, carrier: base, mass: 1.0, inertia_com: 1.0, rotation: {joint: spin, friction: 1.0}}
"""
# Of OfflineLog alone; of a middleware that blocks; ends of the motion, which test_event_kinds.py has.
NOT_HERE = {'state', 'held_up', 'stopped', 'divergence'}


def check(events):
    """Return the kinds of events after a look at their data."""
    for event in events:
        assert list(event) == ['tick', 'kind', 'data'] and tuple(event['data']) == EVENTS[event['kind']].keys, event
    return {event['kind'] for event in events}


def test_every_kind_that_can_be_provoked_has_the_keys_of_its_row(tmp_path):
    (tmp_path / 'hammer.yaml').write_text(CHAIN)
    path = tmp_path / 'run.mcap'
    with simulator(chain_file=tmp_path / 'hammer.yaml', method='rk4', record=path, gravity='[0.0, -9.0]',
                   command_timeout=0.5, payload_body='boom') as process, Peer() as peer:
        peer.meet()
        wrenches = peer.node.create_publisher(WrenchStamped, '/simulator/wrench', 10)

        def until(kind, again=None):
            peer.until(lambda: any(f'"kind": "{kind}"' in event.data for event in peer.events), kind, again)

        until('parameter', lambda: peer.set(damping=[0.1, 0.0]))
        until('payload', lambda: peer.set(payload_mass=0.5))
        until('wrench', lambda: wrenches.publish(_wrench('wheel')))
        until('ignored', lambda: wrenches.publish(_wrench('boom', out_of_plane=1.0)))
        until('rejected', lambda: wrenches.publish(_wrench('elbow')))
        until('command', lambda: peer.joint_commands.publish(JointState(name=['luff'], effort=[4.5])))
        until('command_timeout')
        peer.until(lambda: peer.call('reset')[0])
        until('stop_touched', lambda: peer.commands.publish(Float64MultiArray(data=[-20.0, 0.0])))
        pushes = cycle([40.0, -40.0])   # from whichever stop it lies on
        until('stop_left', lambda: peer.commands.publish(Float64MultiArray(data=[next(pushes), 0.0])))
        until('pause', lambda: peer.call('pause', True))
        until('step', lambda: peer.call('step'))
        until('reset', lambda: peer.call('reset'))
        peer.set(gravity=[0.0, 0.0])
        until('resume', lambda: peer.call('pause', False))
        for _ in range(10):   # a joint that starts at once has not been held
            peer.new_state()
        until('slipped', lambda: peer.commands.publish(Float64MultiArray(data=[0.0, 3.0])))
        until('stuck')   # after the time-out

        def halt():   # again where it stops in a publication, which explains the time
            process.send(signal.SIGSTOP)
            time.sleep(1.0)
            process.send(signal.SIGCONT)
        until('dropped_time', halt)
        peer.node.destroy_publisher(peer.joint_commands)
        assert peer.set(command_timeout=0.0) == [(True, '')]   # the last command holds until its publisher goes
        peer.commands.publish(Float64MultiArray(data=[1.0, 0.0]))
        peer.new_state(lambda state: state.effort[0] == 1.0)
        peer.node.destroy_publisher(peer.commands)
        until('controller_loss')
        os.rename(path, tmp_path / 'moved.mcap')
        until('log_failure')
        published = check([json.loads(each.data) for each in peer.events])
        assert process.stop() == 0, process.output
    assert published - {'held_up'} == EVENTS.keys() - NOT_HERE   # the middleware may block
    log = load_log(tmp_path / 'moved.mcap')
    assert check(log.events) >= published and {command['topic'] for command in log.commands} == {
        '/simulator/commands', '/simulator/joint_commands', '/simulator/wrench'}
    code, words = run('planar_chain_sim.resimulation.command_line', tmp_path / 'moved.mcap')
    assert code == 0, words


def _wrench(body, out_of_plane=0.0):
    message = WrenchStamped()
    message.header.frame_id, message.wrench.force.x, message.wrench.force.z = body, 1.0, out_of_plane
    return message
