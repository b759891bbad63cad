"""A log with record_tf: what Foxglove draws the arm from, as readers by other authors decode it."""
import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from oracles.log_frames import check_frames
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
import yourdfpy

import planar_chain_sim as pcs
from planar_chain_sim.recording.cdr import TransformsLayout
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.recorded_frames import RATE
from planar_chain_sim.resimulation import command_line as resimulation

TOPICS = '/robot_description', '/tf_static', '/tf'
TICKS = 200
LAYOUTS = Path(__file__).resolve().parents[2] / 'launch'


def logged(path, name, **options):
    """Log 0.2 s of a moving chain."""
    sim = pcs.Simulation(pcs.load_chain(name))
    with pcs.OfflineLog(path, sim, **options) as log:
        log.advance(TICKS, effort=np.linspace(-20.0, 20.0, sim.chain.joint_count))
    return path


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


def test_the_layouts_show_what_such_a_log_has(tmp_path):
    chain = pcs.load_chain('four_link_robot.yaml')
    with AnyReader([logged(tmp_path / 'run.mcap', 'four_link_robot.yaml', record_tf=True)]) as reader:
        topics = set(reader.topics)
    layout = json.loads((LAYOUTS / 'view.foxglove.json').read_text())
    panels = layout['configById']

    def leaves(tree):
        return [tree] if isinstance(tree, str) else leaves(tree['first']) + leaves(tree['second'])
    assert sorted(leaves(layout['layout'])) == sorted(panels)
    arm = panels['3D!arm']
    assert set(arm['topics']) < topics and arm['topics']['/robot_description']['visible'], 'Foxglove hides it else'
    assert arm['followTf'] == 'world'
    for name in ('position', 'velocity', 'effort'):
        assert [path['value'] for path in panels[f'Plot!{name}']['paths']] == [
            f'/joint_states.{name}[{k}]' for k in range(7)]
    curves = [curve.get('name') for curve in ElementTree.parse(LAYOUTS / 'view.plotjuggler.xml').iter('curve')]
    assert curves == [f'/joint_states/{joint}/{name}' for name in ('position', 'velocity', 'effort')
                      for joint in chain.joint_names]
