"""A log with record_tf: what Foxglove draws the arm from, as readers by other authors decode it."""
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
import yourdfpy

import planar_chain_sim as pcs
from planar_chain_sim.recording import resimulation
from planar_chain_sim.recording.cdr import TransformsLayout
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.recorded_frames import RATE

TOPICS = '/robot_description', '/tf_static', '/tf'
TICKS = 200


def logged(path, name, **options):
    """Log 0.2 s of a moving chain."""
    sim = pcs.Simulation(pcs.load_chain(name))
    with pcs.OfflineLog(path, sim, **options) as log:
        log.advance(TICKS, effort=np.linspace(-20.0, 20.0, sim.chain.joint_count))
    return path


def in_world(transforms):
    """Return child -> (rotation, position) in the frame `world`; transforms: those of a state, by child."""
    places = {'world': (np.eye(3), np.zeros(3))}

    def place(child):
        if child not in places:
            transform = transforms[child]
            turn, shift = place(transform.header.frame_id)
            v, q = transform.transform.translation, transform.transform.rotation
            x, y, z, w = q.x, q.y, q.z, q.w
            assert x*x + y*y + z*z + w*w == pytest.approx(1.0, abs=1e-12)
            own = np.array([[1 - 2 * (y*y + z*z), 2 * (x*y - w*z), 2 * (x*z + w*y)],
                            [2 * (x*y + w*z), 1 - 2 * (x*x + z*z), 2 * (y*z - w*x)],
                            [2 * (x*z - w*y), 2 * (y*z + w*x), 1 - 2 * (x*x + y*y)]])
            places[child] = turn @ own, shift + turn @ np.array([v.x, v.y, v.z])
        return places[child]
    return {child: place(child) for child in transforms}


def check_frames(path, chain):
    """Compare the frames on /tf and /tf_static, chained up to `world`, with body_poses; return the stamps of /tf, ns."""
    positions, stamps, fixed = {}, [], {}
    with AnyReader([Path(path)]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.msgtype == 'sensor_msgs/msg/JointState':
                positions[message.header.stamp.sec * 10**9 + message.header.stamp.nanosec] = message.position
            elif connection.topic == '/tf_static':
                fixed = {transform.child_frame_id: transform for transform in message.transforms}
            elif connection.topic == '/tf':
                stamp, = {t.header.stamp.sec * 10**9 + t.header.stamp.nanosec for t in message.transforms}
                places = in_world({**fixed, **{t.child_frame_id: t for t in message.transforms}})
                poses = pcs.body_poses(chain, positions[stamp])   # of the state before it in the file
                for body, point, angle in zip(chain.bodies, poses.point, poses.angle):
                    turn, shift = places[body.name]
                    np.testing.assert_allclose(shift, [point[0], 0.0, point[1]], atol=1e-12)
                    np.testing.assert_allclose(turn[:, 0], [np.cos(angle), 0.0, np.sin(angle)], atol=1e-12)
                    np.testing.assert_allclose(turn[:, 2], [0.0, -1.0, 0.0], atol=1e-12)
                stamps.append(stamp)
    return stamps


@pytest.mark.parametrize('name', ['four_link_robot.yaml', 'cart_arm_telescope.yaml', 'arczewski_example.yaml'])
def test_frames_are_where_the_bodies_are(tmp_path, name):
    chain = pcs.load_chain(name)
    path = logged(tmp_path / 'run.mcap', name, record_tf=True)
    stamps = check_frames(path, chain)
    assert stamps[0] == 0 and (np.diff(stamps) == 17_000_000).all(), 'as often as whole ticks allow'
    assert 1e9 / 18_000_000 < RATE < 1e9 / 16_000_000
    with AnyReader([path]) as reader:
        first = [(connection.topic, data) for connection, _, data in reader.messages()][:2]
        assert [topic for topic, _ in first] == ['/robot_description', '/tf_static'], 'before the first state'
        text = reader.deserialize(first[0][1], 'std_msgs/msg/String').data
        latched = {connection.topic: connection.ext.offered_qos_profiles[0].durability.name
                   for connection in reader.connections if connection.topic in TOPICS}
    assert latched == {'/robot_description': 'TRANSIENT_LOCAL', '/tf_static': 'TRANSIENT_LOCAL', '/tf': 'VOLATILE'}
    (tmp_path / 'robot.urdf').write_text(text)
    assert text == pcs.urdf_of(chain)
    robot = yourdfpy.URDF.load(str(tmp_path / 'robot.urdf'), load_meshes=False, build_scene_graph=False)
    assert {body.name for body in chain.bodies} <= set(robot.link_map)


def test_frames_change_nothing_else_in_a_log(tmp_path):
    with_tf, without = (logged(tmp_path / f'{tf}.mcap', 'four_link_robot.yaml', record_tf=tf) for tf in (True, False))
    messages = list(read_log(with_tf).messages)
    assert [message for message in messages if message.topic not in TOPICS] == list(read_log(without).messages)
    assert len(messages) == len(list(read_log(without).messages)) + 2 + 1 + TICKS // 17
    assert resimulation.main([str(with_tf)]) == 0
    log, other = pcs.load_log(with_tf), pcs.load_log(without)
    assert log.position.tobytes() == other.position.tobytes() and log.events == other.events and not log.commands


def test_rollout_records_frames(tmp_path, monkeypatch):
    from planar_chain_sim.recording import rollout
    monkeypatch.chdir(tmp_path)
    assert rollout.main(['double_pendulum.yaml', '--duration', '0.1', '--step', '0.02', '--record-tf']) == 0
    stamps = check_frames('double_pendulum.mcap', pcs.load_chain('double_pendulum.yaml'))
    assert stamps == [0, 20_000_000, 40_000_000, 60_000_000, 80_000_000, 100_000_000], 'slow ticks: at every one'


def test_the_layout_is_that_of_another_encoder():
    types = get_typestore(Stores.ROS2_JAZZY)
    names = {name.split('/')[-1]: types.types[name] for name in (
        'tf2_msgs/msg/TFMessage', 'geometry_msgs/msg/TransformStamped', 'geometry_msgs/msg/Transform',
        'geometry_msgs/msg/Vector3', 'geometry_msgs/msg/Quaternion', 'std_msgs/msg/Header',
        'builtin_interfaces/msg/Time')}
    pairs = [('world', 'base_link'), ('base_link', 'a'), ('a', 'é'), ('', '12345678')]
    poses = np.arange(28.0).reshape(4, 7)
    for count in (0, 1, 4):
        transforms = [names['TransformStamped'](
            names['Header'](names['Time'](-2, 999_999_999), parent), child,
            names['Transform'](names['Vector3'](*pose[:3]), names['Quaternion'](*pose[3:])))
            for (parent, child), pose in zip(pairs[:count], poses)]
        wanted = types.serialize_cdr(names['TFMessage'](transforms), 'tf2_msgs/msg/TFMessage')
        assert TransformsLayout(pairs[:count]).stamped(-1_000_000_001, poses[:count]) == bytes(wanted)
