"""What a viewer receives from the node: markers in the frame that they name, the URDF, and TF or the reason why not."""
from importlib.util import find_spec

from live import CONFIG, Peer, run, simulator
import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from planar_chain_sim import load_chain
from planar_chain_sim.mechanics.body_lines import body_lines
from planar_chain_sim.ros import node

CHAIN = load_chain(CONFIG / 'four_link_robot.yaml')


def test_markers_of_base_link_are_flat_and_no_description_is_published():
    with simulator(frame_id='base_link', publish_markers=True, publish_robot_description=False,
                   start_paused=True) as process, Peer() as peer:
        peer.meet()
        arrays = peer.listen(MarkerArray, '/simulator/markers')
        texts = peer.listen(String, '/robot_description', latched=True)
        peer.until(lambda: len(arrays) > 1)
        position = np.array(peer.new_state().position)
        ends = [complex(end) for lines in body_lines(CHAIN, position) for line in lines for end in line]
        points = [point for marker in arrays[-1].markers[:-1] for point in marker.points]
        assert {marker.header.frame_id for marker in arrays[-1].markers} == {'base_link'}
        np.testing.assert_allclose([(p.x, p.y, p.z) for p in points], [(end.real, end.imag, 0.0) for end in ends],
                                   atol=1e-12)
        assert peer.node.count_publishers('/robot_description') == 0 and not texts
        assert process.stop() == 0, process.output


def test_a_frame_that_is_no_link_is_told():
    with simulator(frame_id='map', publish_markers=True) as process:
        line = process.wait_for("parameter 'frame_id' is 'map', not a link of the robot")
        assert "markers are drawn as in 'world'" in line
        assert process.stop() == 0, process.output


@pytest.mark.skipif(find_spec('tf2_msgs') is not None, reason='tf2_msgs is installed')
def test_tf_without_its_messages_is_one_sentence():
    code, output = run('planar_chain_sim.ros.node', '--ros-args', '-p', 'publish_tf:=true')
    assert code == 2
    assert output.splitlines()[-1] == (
        "simulator: parameter 'publish_tf' is true, which needs tf2_msgs (apt install ros-jazzy-tf2-msgs), must be "
        'false where that is not installed')


@pytest.mark.skipif(find_spec('tf2_msgs') is None, reason='tf2_msgs is not installed')
def test_tf_has_every_link():
    from tf2_msgs.msg import TFMessage
    with simulator(publish_tf=True) as process, Peer() as peer:
        fixed, moving = peer.listen(TFMessage, '/tf_static', latched=True), peer.listen(TFMessage, '/tf')
        peer.until(lambda: fixed and moving)
        told = {transform.child_frame_id for message in (fixed[0], moving[-1]) for transform in message.transforms}
        assert told == {*node.frames_of(CHAIN, None, {'hold': []}).links} - {'world'}
        assert process.stop() == 0, process.output


def test_a_mechanism_that_comes_as_mjcf_on_the_topic_is_drawn_upright():
    mjcf = '<mujoco><worldbody><body name="rod" pos="0 0 2"><joint axis="0 1 0"/>' \
           '<geom type="capsule" fromto="0 0 0 0 0 -1" size="0.02"/></body></worldbody></mujoco>'
    with simulator(ready=False, chain_file='robot_description', publish_markers=True, start_paused=True) as process, \
            Peer() as peer:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        peer.node.create_publisher(String, '/robot_description', latched).publish(String(data=mjcf))
        arrays = peer.listen(MarkerArray, '/simulator/markers')
        peer.until(lambda: arrays)
        points = [(p.x, p.y, p.z) for p in arrays[-1].markers[0].points]
        assert arrays[-1].markers[0].header.frame_id == 'world'
        np.testing.assert_allclose(points, [(0.0, 0.0, 2.0), (0.0, 0.0, 1.0)], atol=1e-12)
        assert process.stop() == 0, process.output


def test_a_urdf_that_is_read_is_drawn_in_its_own_root(tmp_path):
    """The plane of a robot whose axes are about y stands upright in base_link."""
    text = """<robot name="r"><link name="base_link"/><link name="a"><inertial><origin xyz="0 0 -.5"/><mass value="2"/>
      <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="j" type="continuous"><parent link="base_link"/><child link="a"/><origin xyz=".1 0 .3"/>
      <axis xyz="0 1 0"/></joint></robot>"""
    (tmp_path / 'robot.urdf').write_text(text)
    with simulator(chain_file=tmp_path / 'robot.urdf', publish_markers=True, start_paused=True) as process, \
            Peer() as peer:
        arrays = peer.listen(MarkerArray, '/simulator/markers')
        peer.until(lambda: arrays)
        points = [(p.x, p.y, p.z) for p in arrays[-1].markers[0].points]
        assert arrays[-1].markers[0].header.frame_id == 'base_link'
        np.testing.assert_allclose(points, [(.1, 0.0, .3), (.1, 0.0, -.7)], atol=1e-12)
        assert process.stop() == 0, process.output
