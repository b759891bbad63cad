"""A bag of a running node, recorded over real DDS, is computed again by resimulate."""
from bag_recorder import BagRecorder
from geometry_msgs.msg import WrenchStamped
from live import Peer, simulator
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

from planar_chain_sim.resimulation import command_line as resimulation

TOPICS = {'/joint_states': JointState, '/simulator/events': String, '/simulator/commands': Float64MultiArray,
          '/simulator/wrench': WrenchStamped, '/robot_description': String}
EFFORTS = [[4.0, 0.0], [-3.0, 1.0], [2.0, -2.0], [0.0, 1.5]]


def test_a_bag_of_the_node_is_repeated(tmp_path, capsys):
    """Commands, a wrench, a pause with one step, a reset; the recorder joins late; the chain is that of the bag."""
    with simulator(chain_file='double_pendulum.yaml', rate=100.0) as process, BagRecorder(TOPICS) as recorder:
        with Peer() as peer:
            pushes = peer.node.create_publisher(WrenchStamped, '/simulator/wrench', 10)
            peer.meet().until(lambda: pushes.get_subscription_count() and recorder.heard(pushes, peer.commands),
                              'a match')
            push = WrenchStamped()
            push.header.frame_id, push.wrench.force.x = 'lower_rod', 2.0
            for k, effort in enumerate(EFFORTS):
                peer.commands.publish(Float64MultiArray(data=effort))
                peer.new_state(lambda state: list(state.effort) == effort)
                if k == 0:
                    pushes.publish(push)
                    peer.until(lambda: any('"wrench"' in event.data for event in peer.events), 'the wrench')
                if k == 1:
                    assert peer.call('pause', True)[0] and peer.call('step')[0] and peer.call('pause', False)[0]
                if k == 2:
                    assert peer.call('reset')[0]
                for _ in range(6):
                    peer.new_state()
        recorder.wait_for('controller_loss')
        assert process.stop() == 0, process.output
    recorder.write(tmp_path / 'bag')
    for arguments in ([], ['--chain', 'double_pendulum.yaml']):
        assert resimulation.main([str(tmp_path / 'bag'), '--threshold', '1e-6', *arguments]) == 0, (
            capsys.readouterr().out)
        assert 'Commands and other changes act at the ticks that the events of the node name' in capsys.readouterr().out
