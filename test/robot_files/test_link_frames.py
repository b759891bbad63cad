"""Frames of links: TF and markers agree with the kinematics of the same URDF in other libraries, in every frame."""
import io
import subprocess
import sys

import numpy as np
from oracles.random_trees import random_state, random_tree
import pytest
import yourdfpy

import planar_chain_sim as pcs
from planar_chain_sim.chain_file import chain_from_text
from planar_chain_sim.mechanics.body_lines import body_lines
from planar_chain_sim.robot_files.link_frames import LinkFrames, quaternion
from planar_chain_sim.robot_files.planar_robot import body_names
from planar_chain_sim.robot_files.urdf_writer import link_names, urdf_of

# A plane that stands askew in its root's frame, and a link that is welded.
TILTED = """<robot name="r"><link name="stand"/>
  <link name="a"><inertial><origin xyz="0 0 -.5"/><mass value="2"/>
    <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="b"><inertial><origin xyz="0 0 -.2"/><mass value="1"/>
    <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tip"/>
  <joint name="j" type="continuous"><parent link="stand"/><child link="a"/><origin xyz=".1 .2 .3" rpy=".4 .5 .6"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="k" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0 0 -1" rpy="0 .3 0"/>
    <axis xyz="0 -1 0"/></joint>
  <joint name="w" type="fixed"><parent link="b"/><child link="tip"/><origin xyz="0 .1 -.4" rpy="1 2 3"/></joint>
</robot>"""
# Slides along the normal: 'b' leaves the plane, with what it carries.
OUT_OF_PLANE = """<robot name="r"><link name="stand"/>
  <link name="base"><inertial><origin xyz="0 0 -.5"/><mass value="2"/>
    <inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="b"><inertial><origin xyz="0 0 -.3"/><mass value="1"/>
    <inertia ixx=".02" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="c"><inertial><origin xyz="0 0 -.1"/><mass value="1"/>
    <inertia ixx=".02" iyy=".02" izz=".02" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="s" type="continuous"><parent link="stand"/><child link="base"/><origin xyz=".1 .2 .3" rpy=".4 .5 .6"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="e" type="prismatic"><parent link="base"/><child link="b"/><origin xyz="0 .1 -1" rpy="0 .3 0"/>
    <axis xyz="0 -1 0"/><limit lower="-1" upper="1" effort="10" velocity="1"/></joint>
  <joint name="k" type="continuous"><parent link="b"/><child link="c"/><origin xyz="0 -.2 -.6"/><axis xyz="0 1 0"/>
  </joint>
</robot>"""
TEXTS = {'four_link_robot': lambda: urdf_of(pcs.load_chain('four_link_robot.yaml')),
         'cart_arm_telescope': lambda: urdf_of(pcs.load_chain('cart_arm_telescope.yaml')),
         'tree': lambda: urdf_of(random_tree(3, 8)), 'tilted': lambda: TILTED,
         'out of plane': lambda: OUT_OF_PLANE}


@pytest.fixture(params=TEXTS)
def urdf(request):
    return TEXTS[request.param]()


def at_random(urdf, seed):
    """Return a chain, its joint positions, joint -> position, and the other library's robot there."""
    chain = chain_from_text(urdf)
    position = random_state(chain, seed)[0]
    robot = yourdfpy.URDF.load(io.BytesIO(urdf.encode()), load_meshes=False, build_scene_graph=True)
    by_name = dict(zip(chain.joint_names, position))
    robot.update_cfg(by_name)
    return chain, position, by_name, robot


def test_poses_are_those_of_another_library(urdf):
    frames = LinkFrames(urdf)
    for seed in range(5):
        _, _, by_name, robot = at_random(urdf, seed)
        for link in frames.links:
            turn, shift = frames.pose(link, by_name)
            wanted = robot.get_transform(link, frames.root)
            np.testing.assert_allclose(turn, wanted[:3, :3], atol=1e-12)
            np.testing.assert_allclose(shift, wanted[:3, 3], atol=1e-12)


def matrix_of(quaternion):
    """Return the rotation matrix of a unit quaternion x, y, z, w."""
    x, y, z, w = quaternion
    return np.array([[1 - 2 * (y*y + z*z), 2 * (x*y - w*z), 2 * (x*z + w*y)],
                     [2 * (x*y + w*z), 1 - 2 * (x*x + z*z), 2 * (y*z - w*x)],
                     [2 * (x*z - w*y), 2 * (y*z + w*x), 1 - 2 * (x*x + y*y)]])


def test_frames_make_one_tree_of_all_links(urdf):
    """Every link but the root has one parent: /tf and /tf_static together have each link once."""
    frames = LinkFrames(urdf)
    for seed in range(5):
        chain, position, _, robot = at_random(urdf, seed)
        fixed, moving = frames.fixed(), frames.moving(chain.joint_names)
        assert sorted(child for _, child in fixed.pairs + moving.pairs) == sorted(frames.links[1:])
        for (parent, child), pose in zip(fixed.pairs + moving.pairs,
                                         np.vstack((fixed.poses(position), moving.poses(position)))):
            wanted = robot.get_transform(child, parent)
            np.testing.assert_allclose(matrix_of(pose[3:]), wanted[:3, :3], atol=1e-12)
            np.testing.assert_allclose(pose[:3], wanted[:3, 3], atol=1e-12)


@pytest.mark.ros
def test_markers_lie_on_the_links_in_whatever_frame_is_named(urdf):
    """Oracle: a body's line begins at its link's origin, seen from the frame that is named, by another library."""
    from planar_chain_sim.ros.markers import marker_array
    frames = LinkFrames(urdf)
    for seed, frame in enumerate([*frames.links, '', 'nobody']):
        chain, position, by_name, robot = at_random(urdf, seed)
        array = marker_array(chain, frames, 1_500_000_000, position, frame)
        seen_from = frame if frame in frames.links else frames.root
        links = {body: link for link, body in body_names(frames._robot).items() if link != frames.root}
        drawn = [body.name for body in chain.bodies if body.name in links]
        assert [marker.ns for marker in array.markers] == [*drawn, 'joint points'], 'and no body that is no link'
        for marker in array.markers[:-1]:
            assert marker.header.frame_id == frame
            assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (1, 500_000_000)
            start = np.array([marker.points[0].x, marker.points[0].y, marker.points[0].z])
            wanted = robot.get_transform(links[marker.ns], seen_from)[:3, 3]
            np.testing.assert_allclose(start, wanted, atol=1e-12)


@pytest.mark.ros
def test_markers_in_base_link_are_flat_and_in_world_upright():
    from planar_chain_sim.ros.markers import marker_array
    chain = pcs.load_chain('four_link_robot.yaml')
    frames = LinkFrames(urdf_of(chain))
    position = random_state(chain, 1)[0]
    ends = [end for lines in body_lines(chain, position) for line in lines for end in line]
    for frame, place in (('base_link', lambda end: (end.real, end.imag, 0.0)),
                         ('world', lambda end: (end.real, 0.0, end.imag)), ('', lambda end: (end.real, 0.0, end.imag))):
        points = [point for marker in marker_array(chain, frames, 0, position, frame).markers[:-1]
                  for point in marker.points]
        np.testing.assert_allclose([(p.x, p.y, p.z) for p in points], [place(end) for end in ends], atol=1e-12)


def test_quaternions_of_every_turn():
    random = np.random.default_rng(1)
    turns = [np.eye(3), np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0]), np.diag([-1.0, -1.0, 1.0])]
    for _ in range(200):
        turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
        turns.append(turn * np.linalg.det(turn))
    for turn in turns:
        np.testing.assert_allclose(matrix_of(quaternion(turn)), turn, atol=1e-13)
        assert quaternion(turn)[3] >= 0.0


def test_urdf_reports_what_it_leaves_out(tmp_path):
    command = [sys.executable, '-m', 'planar_chain_sim.urdf_file']
    done = subprocess.run([*command, 'cart_arm_telescope.yaml'], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0 and done.stderr == (
        'urdf: note: not in the URDF: springs of cart_slide, telescope_slide, gripper_slide, gripper_joint\n')
    (tmp_path / 'moon.yaml').write_text('gravity: [0, -1.62]\nbodies: [{name: a, carrier: base, mass: 1, inertia: 1, '
                                        'rotation: {joint: j, armature: 0.1}}]')
    done = subprocess.run([*command, tmp_path / 'moon.yaml'], capture_output=True, text=True, timeout=600)
    assert done.stderr == ('urdf: note: not in the URDF: rotors of j; gravity [0, -1.62] m/s^2, readers take '
                           '[0, -9.81]\n')


def test_urdf_writes_a_chain(tmp_path, capsys):
    from planar_chain_sim import urdf_file
    chain = pcs.load_chain('four_link_robot.yaml')
    assert urdf_file.main(['four_link_robot.yaml']) == 0
    assert capsys.readouterr().out == urdf_of(chain)
    path = tmp_path / 'robot.urdf'
    assert urdf_file.main(['four_link_robot.yaml', '--output', str(path), '--commands', '/c', '--states', '/s']) == 0
    assert path.read_text() == urdf_of(chain, '/c', '/s')
    assert [link_names(pcs.load_chain(path))[0][-1], *pcs.load_chain(path).joint_names] == [
        'base_link', *chain.joint_names]
    capsys.readouterr()
    for wrong in (['four_link_robot.yaml', '--output', str(tmp_path / 'no' / 'x')], ['nobody.yaml'], []):
        assert urdf_file.main(wrong) == 2
        error = capsys.readouterr().err
        assert error.startswith('urdf: ') and error.count('\n') == 1
