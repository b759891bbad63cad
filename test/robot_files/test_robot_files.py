"""People's URDF files: mountings, dialects, limits, loops, macros; compared with two oracles."""
from math import cos, pi, sin
import re
import warnings

import numpy as np
from oracles.random_robots import by_mujoco, by_pinocchio, inertial, random_robot, row
from oracles.robot_arm import arm, load, POINT, refusal, YAWING
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain_file import chain_from_text

STATE = [0.3, -0.4], [0.5, 0.2], [0.0, 0.0]
ACCELERATION = [-7.35932895481, 28.7823596235]   # of ARM as it is, by Pinocchio and MuJoCo


def agrees(text: str, chain, seed: int, tolerance: float = 1e-11, held: str = '') -> None:
    """Compare accelerations at a random state with those of both oracles; `held`: the text that they get instead."""
    position, velocity, effort = np.random.default_rng(seed).normal(size=(3, chain.joint_count))
    got = pcs.forward_dynamics(chain, position, velocity, effort)
    for oracle in (by_pinocchio, by_mujoco):
        wanted = oracle(held or text, chain.joint_names, position, velocity, effort)
        np.testing.assert_allclose(got, wanted, rtol=0, atol=tolerance * (1.0 + abs(wanted).max()))


NORMALS = {'anyhow': lambda seed: None, 'yawed': lambda seed: (cos(seed), sin(seed), 0.0),
           'flat': lambda seed: (0, 0, 1), 'tilted': lambda seed: (0.0, cos(seed), sin(seed)),
           'axis 1 1 0': lambda seed: (1, 1, 0)}


@pytest.mark.parametrize('mounting', NORMALS)
def test_mountings(mounting):
    """100 robots of each kind: trees, products of inertia, mass off the plane; 1e-11: 200 times what was seen."""
    for seed in range(100):
        text = random_robot(seed, NORMALS[mounting](seed))
        agrees(text, chain_from_text(text), seed)


def test_slides_along_the_normal_have_no_part_in_the_plane():
    """Upright nothing pulls them, flat all of gravity; on one another they couple by what they carry in common."""
    alone = stacked = 0
    for seed in range(200):
        text = random_robot(seed, NORMALS[list(NORMALS)[seed % 5]](seed), lengthwise=0.7)
        chain = chain_from_text(text)
        agrees(text, chain, seed)
        loads = [body for body in chain.bodies if body.name.endswith('_load')]
        alone, stacked = alone + any(not body.mass for body in loads), stacked + any(body.mass for body in loads)
    assert alone > 40 and stacked > 5


def test_a_scara_is_reported_and_recorded():
    limit = '<limit lower="-1" upper="1" effort="50" velocity="1"/>'
    text = arm(kind='prismatic', in_e=limit, axis='0 0 1', second='0 0 1')
    chain, note, _ = load(text)
    assert "gravity [0, 0] m/s^2; along its normal, on their own, slide 'e'" in note
    assert chain.joint_names == ('s', 'e') and pcs.forward_dynamics(chain, *STATE)[1] == pytest.approx(-9.81, rel=1e-15)
    assert (chain.joints[1].lower, chain.joints[1].effort_limit) == (-1.0, 50.0)
    simulation = pcs.Simulation(chain_from_text(chain.source))
    simulation.advance(400, effort=[0.0, 9.81])     # its mass is 1 kg
    assert abs(simulation.position[1]) < 1e-14
    simulation.advance(1000)
    assert simulation.position[1] == -1.0


@pytest.mark.parametrize('angle', ['1.5708', '1.57', '1.567'])
def test_angles_of_few_digits_are_corrected_and_reported(angle):
    """The motion is off by no more than the angle to the plane, here by its square: what moves is level."""
    text, off = arm(rpy=f'{angle} 0 0', second='0 0 -1'), pi / 2 - float(angle)
    chain, note, _ = load(text)
    assert f'axes projected on the plane, from which they differ by up to {abs(off):.2g} rad' in note
    agrees(text, chain, 3, 30.0 * off**2)


def test_the_error_of_a_projection_is_of_the_order_of_the_angle():
    for askew in (1e-5, 1e-3):
        for seed in range(40):
            text = random_robot(seed, askew=askew / 2)
            agrees(text, chain_from_text(text), seed, 10.0 * askew)
    assert 'the robot is not planar' in refusal(arm(second='0 1 0.0051')) and load(arm(second='0 1 0.0049'))


DIALECTS = {
    'default namespace': lambda: arm().replace('<robot', '<robot xmlns="http://example.org/robot"', 1),
    'material without a name': lambda: arm(in_a='<visual><geometry><box size="1 1 1"/></geometry><material><color '
                                                'rgba="1 0 0 1"/></material></visual>'),
    'capsule': lambda: arm(in_a='<collision><geometry><capsule radius="0.1" length="1"/></geometry></collision>'),
    'partial transmission': lambda: arm(more='<transmission name="t"><joint name="s"/><actuator name="m">'
                                             '<hardwareInterface>E</hardwareInterface></actuator></transmission>'),
    'version 0.0': lambda: '<?xml version="0.0" ?>\n' + arm(),
    'another encoding': lambda: '<?xml version="1.0" encoding="latin-1"?>' + arm(),
    'blank line first': lambda: '\n\n  <?xml version="1.0"?>\n' + arm(),
    'prefix that nobody declared': lambda: arm(in_a='<drake:acceleration/>', more='<foo:bar baz:x="1"/>'),
    'CDATA': lambda: arm(more='<gazebo><![CDATA[ <joint> -- & ${x} <!-- ]]></gazebo>'.replace('${x}', '')),
    '-- in a comment': lambda: arm(more='<!-- ---- <joint/> -- ${x} -->'),
    'processing instruction': lambda: arm(more='<?foo bar?>'),
    'world that is no link': lambda: arm(more='<joint name="w" type="fixed"><parent link="world"/><child link="stand"/>'
                                              '</joint>'),
    'links named by text': lambda: arm().replace('<parent link="a"/>', '<parent>a</parent>'),
    'a stray link': lambda: arm(more='<link name="lost"/>'),
    'numbers with blanks': lambda: arm(axis=' 0  1.\t+.0e0 '),
    'numbers with commas': lambda: arm(axis='0,1, 0'),
    'no gravity axis': lambda: arm(axis='0 3 0', second='0 1e-3 0'),
    'welded to the world in gazebo': lambda: arm(more='<gazebo><joint name="w" type="fixed"><parent>world</parent>'
                                                      '<child>stand</child></joint></gazebo>'),
    'a joint named in a plugin': lambda: arm(more='<gazebo><plugin name="p"><joint>s</joint></plugin></gazebo>'),
    'xacro declared': lambda: arm().replace('<robot', '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"'),
}


@pytest.mark.parametrize('dialect', DIALECTS)
def test_dialects_make_no_difference(dialect):
    chain, _, told = load(DIALECTS[dialect]())
    assert chain.joint_names == ('s', 'e') and not told
    np.testing.assert_allclose(pcs.forward_dynamics(chain, *STATE), ACCELERATION, rtol=0, atol=1e-9)


@pytest.mark.parametrize('limit, stops, effort, said, warned', [
    ('lower="0" upper="0" effort="0" velocity="0"', (-np.inf, np.inf), np.inf, "no stops at 'e' (0 to 0)", True),
    ('lower="1" upper="-1" effort="10"', (-np.inf, np.inf), 10.0, "no stops at 'e' (1 to -1)", False),
    ('effort="10"', (-np.inf, np.inf), 10.0, "no stops at 'e' (0 to 0)", False),
    ('lower="-1" upper="1" effort="0" velocity="2"', (-1.0, 1.0), np.inf, 'not used: velocity limits', True),
    ('lower="-1" upper="1e9" effort="1e9" velocity="1e9"', (-1.0, np.inf), np.inf, '', False),
    ('upper="1" acceleration="3"', (0.0, 1.0), np.inf, 'not used: acceleration of limit', False),
])
def test_limits(limit, stops, effort, said, warned):
    chain, note, told = load(arm(kind='revolute', in_e=f'<limit {limit}/>'))
    joint = chain.joints[1]
    assert (joint.lower, joint.upper, joint.effort_limit) == (*stops, effort)
    assert said in note and told == warned * ["r.urdf: effort limit 0 at 'e', taken as no limit"]
    assert ('no stops' in note) == ('no stops' in said) and ('not used' in note) == ('not used' in said)


def test_a_joint_that_has_no_limits_and_one_that_starts_at_its_stop():
    assert "no stops at 'e' (no limits)" in load(arm(kind='revolute'))[1]
    chain, note, _ = load(arm(kind='revolute', in_e='<limit lower="0.2" upper="1"/>'))
    assert chain.joints[1].position == 0.2 and "initial position moved to the stop at 'e' (0.2)" in note


@pytest.mark.parametrize('told, position, velocity', [
    ('<state_interface name="position"><param name="initial_value">0.7</param></state_interface>', 0.7, 0.0),
    ('<command_interface name="position"><param name="initial_value">-0.7</param></command_interface>', -0.7, 0.0),
    ('<param name="initial_position"> 0.7 </param><state_interface name="effort"/>', 0.7, 0.0),
    ('<state_interface name="velocity"><param name="initial_value">2e0</param></state_interface>', 0.0, 2.0),
    ('<state_interface name="effort"><param name="initial_value">5</param></state_interface>', 0.0, 0.0),
])
def test_ros2_control_says_where_a_joint_starts(told, position, velocity):
    chain = load(arm(more=f'<ros2_control name="c" type="system"><joint name="s">{told}</joint></ros2_control>'))[0]
    assert (chain.joints[0].position, chain.joints[0].velocity) == (position, velocity)
    assert (chain.joints[1].position, chain.joints[1].velocity) == (0.0, 0.0)


@pytest.mark.parametrize('changes, said', [
    ({'more': '<gazebo reference="s"><springStiffness>3</springStiffness></gazebo>'}, 'springs'),
    ({'more': '<gazebo reference="a"><turnGravityOff>true</turnGravityOff></gazebo>'}, 'turnGravityOff of gazebo'),
    ({'more': '<gazebo reference="a"><gravity>0</gravity></gazebo>'}, 'gravity of gazebo'),
    ({'more': '<gazebo reference="a"><gravity>False</gravity></gazebo>'}, 'gravity of gazebo'),
    ({'more': '<ros2_control><joint name="s"><command_interface name="position"><param name="initial_value">0.1'
              '</param></command_interface><state_interface name="position"><param name="initial_value">0.2</param>'
              '</state_interface></joint></ros2_control>'},
     "initial position 0.1 of 's', which a later one, 0.2, replaces"),
    ({'more': '<ros2_control><joint name="S"><param name="initial_position">1</param></joint></ros2_control>'},
     "initial position of 'S', which the robot does not have"),
    ({'more': '<gazebo><plugin><joint>s</joint><mimicJoint>E</mimicJoint></plugin></gazebo>'},
     "mimic at 'E', which the robot does not have"),
    ({'more': '<force_element name="f"/>'}, 'element force_element'),
    ({'in_s': '<safety_controller k_velocity="1"/>'}, 'safety_controller'),
    ({'in_s': '<dynamics damping="1" spring_stiffness="2"/>'}, 'spring_stiffness of dynamics'),
    ({'more': '<link name="lost"/>'}, "link 'lost', which no joint joins to the others"),
    ({'in_s': '<limit velocity="1"/>', 'in_e': '<limit velocity="1"/>'}, 'velocity limits (2)'),
])
def test_what_is_dropped_is_listed(changes, said):
    assert load(arm(**changes))[1].endswith(f'; not used: {said}')
    assert 'not used' not in load(arm())[1]
    for usual in ('1', 'true'):
        assert 'not used' not in load(arm(more=f'<gazebo reference="a"><gravity>{usual}</gravity></gazebo>'))[1]


def test_the_mass_of_the_root_and_a_missing_inertia_are_reported():
    heavy = arm().replace('<link name="stand"/>',
                          '<link name="stand"><inertial><mass value="9"/><inertia/></inertial></link>')
    assert "not used: the mass of the root link 'stand', which is the base" in load(heavy)[1]
    point = arm().replace(POINT.format(0.02), '</inertial>')
    chain, note, _ = load(point)
    assert "not used: inertia, none is given, of link 'b'" in note and chain.bodies[1].inertia_com == 0.0


@pytest.mark.parametrize('changes, said', [
    ({'more': '<gazebo><joint name="d" type="revolute"><parent>b</parent><child>stand</child></joint></gazebo>'},
     "joint 'd' between 'b' and 'stand' (in <gazebo>, line 7) closes a loop"),
    ({'more': '<gazebo reference="b"><x><joint name="d" type="fixed"><parent>b</parent><child>stand</child></joint></x>'
              '</gazebo>'}, "joint 'd' between 'b' and 'stand'"),
    ({'more': '<gazebo><plugin filename="gz-sim-detachable-joint-system" name="gz::sim::systems::DetachableJoint">'
              '<parent_link>b</parent_link><child_link>stand</child_link></plugin></gazebo>'},
     "DetachableJoint 'gz::sim::systems::DetachableJoint' between 'b' and 'stand'"),
    ({'more': '<gazebo><plugin name="gz::sim::systems::DetachableJoint"><parent_link>b</parent_link><child_model>box'
              '</child_model><child_link>lid</child_link></plugin></gazebo>'},
     "(in <gazebo>, line 7) ties link 'b' to another model"),
    ({'more': '<mujoco><equality><connect name="d" body1="b" body2="a"/></equality></mujoco>'},
     "connect 'd' between 'b' and 'a' (in <mujoco>, line 7) closes a loop"),
    ({'more': '<loop_joint name="d" type="revolute"/>'}, "joint 'd' (on line 7) closes a loop"),
    ({'more': '<joint name="d" type="continuous"><parent link="stand"/><child link="b"/></joint>'},
     "joint 'd' closes a loop at link 'b', which 'e' carries"),
    ({'more': '<gazebo><joint name="d" type="fixed"><parent>world</parent><child>b</child></joint></gazebo>'},
     "joint 'd' between 'world' and 'b' (in <gazebo>, line 7) closes a loop"),
    ({'more': '<gazebo><plugin filename="libignition-gazebo-detachable-joint-system.so"><parent_link>b</parent_link>'
              '<child_link>stand</child_link></plugin></gazebo>'}, "DetachableJoint 'libignition-gazebo-det"),
    ({'more': '<gazebo><plugin name="p"><joint>s</joint><mimicJoint>e</mimicJoint></plugin></gazebo>'},
     "joint 'e' mimics 's', must move on its own or be welded"),
    ({'more': '<ros2_control><joint name="e"><param name="mimic">s</param><param name="multiplier">1</param></joint>'
              '</ros2_control>'}, "joint 'e' mimics 's', must move on its own or be welded"),
    ({'more': '<ros2_control><joint name="e" mimic="true"/></ros2_control>'},
     "joint 'e' mimics a joint that it does not name, must move on its own or be welded (hold 'e')"),
    ({'in_e': '<mimic joint="S"/>'}, "joint 'e' mimics 'S', which the robot does not have (did you mean 's'?), must "
                                     "move on its own or be welded (hold 'e')"),
    ({'in_e': '<axis/></joint><joint name="e&#10;f" type="fixed">'}, "line 7 has the name 'e\\nf', must"),
    ({'in_a': '<inertial><origin xyz="1e300 0 0"/><mass value="1"/></inertial>'}, "link 'a': center_of_mass is too"),
    ({'in_e': '<mimic joint="s" multiplier="-0.5"/>'}, "joint 'e' mimics 's', must move on its own or be welded"),
    ({'kind': 'floating'}, "joint 'e' is of type 'floating', must be one of fixed, continuous, revolute, prismatic, "
                           "or be welded where it is (hold 'e')"),
    ({'more': '<link name="c"/><joint name="f" type="fixed"><parent link="c"/><child link="lost"/></joint>'
              '<link name="lost"/>'}, "has 2 links that no joint carries, 'stand', 'c', must be one tree"),
    ({'more': '<link name="c"/><joint name="f" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/>'
              '</joint>'}, "joint 'f' moves no mass, as link 'c' and what they carry have none, must move some"),
    ({'in_a': '<inertial><mass value="-1"/></inertial>'}, "link 'a' has value '-1', must be a finite number >= 0"),
    ({'in_e': '<dynamics damping="-1"/>'}, "joint 'e' has damping '-1', must be a finite number >= 0"),
    ({'in_a': '<inertial><inertia iyy="-1"/></inertial>'}, "link 'a' has the moment of inertia -1 kg m^2"),
])
def test_what_is_no_tree_of_free_joints_is_refused(changes, said):
    assert said in refusal(arm(**changes))


@pytest.mark.parametrize('changes, said', [
    ({'more': '<xacro:arm side="left"/>'}, 'the element xacro:arm of xacro on line 7'),
    ({'mount': 'xyz="0 0 ${height}"'}, '0 0 ${height} of xacro on line 4'),
    ({'more': '<gazebo><plugin><parameters>$(find x)/y.yaml</parameters></plugin></gazebo>'}, '$(find x)/y.yaml'),
    ({'more': '<include filename="x.urdf"/>'}, 'the element include of xacro'),
])
def test_macros_that_were_not_expanded(changes, said):
    sentence = refusal(arm(**changes))
    assert said in sentence and 'must be expanded first: xacro FILE > robot.urdf' in sentence
    prefixed = arm(more='<x:arm/>').replace('<robot', '<robot xmlns:x="http://www.ros.org/wiki/xacro"')
    assert 'the element x:arm of xacro' in refusal(prefixed)


def welded(text: str, joint: str) -> str:
    """Return the URDF with a joint fixed where it reads 0."""
    head, tail = text.split(f'<joint name="{joint}"')
    return head + f'<joint name="{joint}" type="fixed"' + tail.split('"', 2)[2]


def test_a_joint_that_leaves_the_plane_of_the_others_is_named_and_can_be_welded():
    assert ("joint 's' turns about another direction than 'e', 'w': the robot is not planar, must be welded there to "
            "make it so (hold 's')") in refusal(YAWING)
    chain, note, _ = load(YAWING, ['s'])
    assert chain.joint_names == ('e', 'w') and "welded: 's' at 0" in note
    agrees(YAWING, chain, 0, held=welded(YAWING, 's'))
    turned, note, _ = load(YAWING, {'s': 0.7})   # turns the plane about gravity
    assert "welded: 's' at 0.7" in note and 'x along (0.765, 0.644, 0)' in note
    np.testing.assert_allclose(pcs.forward_dynamics(turned, *STATE), pcs.forward_dynamics(chain, *STATE), rtol=1e-12)
    assert chain_from_text(chain.source) == chain and load(YAWING, 's=0.7')[0] == turned


def test_welded_joints_of_random_robots():
    """Oracle: any joint fixed in the text where it reads 0, and Pinocchio's reduced model at any other value."""
    for seed in range(60):
        text = random_robot(seed, lengthwise=0.3 if seed % 2 else 0.0)
        names = [f'j{k}' for k in range(1, 8) if f'name="j{k}"' in text and f'name="j{k}" type="fixed"' not in text]
        if len(names) > 1:
            name = names[seed % len(names)]
            agrees(text, chain_from_text(text, 'r.urdf', {name: 0.0}), seed, held=welded(text, name))
            value = float(np.random.default_rng(seed).normal())
            chain = chain_from_text(text, 'r.urdf', {name: value})
            state = np.random.default_rng(seed).normal(size=(3, chain.joint_count))
            wanted = by_pinocchio(text, chain.joint_names, *state, hold={name: value})
            np.testing.assert_allclose(pcs.forward_dynamics(chain, *state), wanted, rtol=0,
                                       atol=1e-11 * (1.0 + abs(wanted).max()))


@pytest.mark.parametrize('in_e, plugin', [
    ('<mimic joint="s" multiplier="-0.5" offset="0.1"/>', ''),
    ('', '<gazebo><plugin name="p"><joint>s</joint><mimicJoint>e</mimicJoint><multiplier> -0.5</multiplier>'
         '<offset>0.1</offset></plugin></gazebo>'),
    ('', '<ros2_control><joint name="e"><param name="mimic">s</param><param name="multiplier">-0.5</param>'
         '<param name="offset">0.1</param></joint></ros2_control>'),
    ('<mimic joint="s" multiplier="-0.5" offset="0.1"/>',
     '<ros2_control><joint name="e" mimic="true"/></ros2_control>'),
])
def test_joints_that_mimic_a_welded_joint_are_welded_too(in_e, plugin):
    third = ('<link name="c"><inertial><mass value="1"/>' + POINT.format(0.1) + '</link><joint name="w" '
             'type="continuous"><parent link="b"/><child link="c"/><axis xyz="0 1 0"/></joint>')
    mimicking = arm(in_e=in_e, more=plugin + third)
    assert "joint 'e' mimics 's'" in refusal(mimicking)
    chain, note, _ = load(mimicking, {'s': 0.4})
    assert "welded: 's' at 0.4, 'e' at -0.1" in note and chain.joint_names == ('w',)
    assert load(mimicking, {'e': None})[0].joint_names == ('s', 'w')


@pytest.mark.parametrize('hold, said', [
    (['S_'], "hold names 'S_', which the robot does not have (did you mean 's'?), must name its joints"),
    (['e=3'], "hold gives 3.0 to joint 'e', must lie between its limits, -2.0 and 2.0"),
    (['e=-3'], "hold gives -3.0 to joint 'e', must lie between its limits, -2.0 and 2.0"),
    (['e=x'], "hold 'e=x' has no number after '=', must be JOINT=VALUE (rad or m)"),
    ({'e': float('nan')}, "hold has nan for 'e', must be a finite number"),
    ({'e': True}, "hold has true for 'e', must be a finite number"),
    (['s=1', 's=2'], "hold names 's' twice, with 1.0 and 2.0, must name it once"),
    (['s', 's=2'], "hold names 's' twice, with no value and 2.0, must name it once"),
    ({'e': '30 gon'}, "hold has '30 gon' for 'e', must be a finite number (rad or m), or a string such as '90 deg'"),
    (3, 'hold is 3, must be a joint, a list of joints or a mapping'),
    (['s', 'e', 'w'], 'has no joint that moves'),
])
def test_joints_that_cannot_be_welded(hold, said):
    assert said in refusal(YAWING, hold)


def test_a_joint_with_one_stop_is_welded_within_it():
    text = arm(kind='revolute', in_e='<limit lower="-1" upper="1e9" effort="1" velocity="1"/>')
    assert load(text, {'e': 50.0})[0].joint_names == ('s',)
    assert "hold gives -2.0 to joint 'e', must lie between its limits, -1.0 and inf" in refusal(text, {'e': -2.0})


def test_joints_that_move_no_mass_are_named_together():
    tips = ''.join(f'<link name="c{k}"/><joint name="f{k}" type="prismatic"><parent link="b"/><child link="c{k}"/>'
                   '<axis xyz="0 0 1"/></joint>' for k in (1, 2))
    assert ("joints 'f1', 'f2' move no mass, as links 'c1', 'c2' and what they carry have none, must move some or be "
            "welded (hold 'f1', 'f2')") in refusal(arm(more=tips))
    assert load(arm(more=tips), ['f1', 'f2'])[0].joint_names == ('s', 'e')
    bare = re.sub('<inertial>.*?</inertial>', '', arm())
    assert refusal(bare) == 'r.urdf: has no link with a mass (element inertial), must have one to move'


def test_an_inertia_below_zero_by_rounding_is_none():
    texts = [arm().replace(POINT.format(0.02), POINT.format(value)) for value in ('-5.4e-20', '0')]
    assert chain_from_text(texts[0]) == chain_from_text(texts[1])
    below = arm().replace(POINT.format(0.02), POINT.format('-1e-9'))
    assert "link 'b' has the moment of inertia -1e-09 kg m^2" in refusal(below)


def test_a_file_in_another_encoding_loads(tmp_path):
    path = tmp_path / 'robot.urdf'
    path.write_bytes(arm(more='<!-- fl\xe8che, pivot noktas\xfd -->').encode('latin-1'))
    assert pcs.load_chain(path).joint_names == ('s', 'e')


def test_gantries():
    """Slides alone, one of them along the normal of the plane of the others."""
    for axes in (((1, 0, 0), (0, 1, 0), (0, 0, 1)), ((0, 0, 1), (1, 0, 0), (0, 1, 0)), ((1, 1, 0),), ((0, 0, 1),),
                 ((0, 1, 0), (1, 0, 0), (0, 0, 1), (0, 0, -1), (0, 1, 0))):
        random = np.random.default_rng(0)
        text = '<robot name="g"><link name="l0"/>' + ''.join(
            f'<link name="l{k}">{inertial(random)}</link><joint name="j{k}" type="prismatic"><parent link="l{k - 1}"/>'
            f'<child link="l{k}"/><axis xyz="{row(axis)}"/><limit lower="-9" upper="9" effort="9" velocity="1"/>'
            '</joint>' for k, axis in enumerate(axes, start=1)) + '</robot>'
        agrees(text, chain_from_text(text), 1)


@pytest.mark.parametrize('hold', ['s=90deg', ['s=pi/2', 's=90 deg'][:1], {'s': '90 deg'}, ['s=0.5*pi', 's=0.5*pi']])
def test_joints_are_welded_at_angles_as_text(hold):
    """As for --position: at a joint that turns, in every way to say what is welded."""
    assert load(YAWING, hold) == load(YAWING, {'s': pi / 2})
    chain = pcs.load_chain('four_link_robot.yaml', hold={'forearm_joint': '-30 deg'})
    assert chain == pcs.load_chain('four_link_robot.yaml', hold={'forearm_joint': -pi / 6})
    assert chain_from_text(chain.source) == chain
    text = pcs.load_chain('four_link_robot.yaml').source
    assert chain_from_text(f'{text}\nhold: {{forearm_joint: -30 deg}}') == chain
    with pytest.raises(pcs.ChainError, match="'90deg' to joint 'column_slide', must be a number .m., as it slides"):
        pcs.load_chain('four_link_robot.yaml', hold=['column_slide=90deg'])
    slide = arm(kind='prismatic', second='0 0 1')
    assert "hold gives '90deg' to joint 'e', must be a number (m), as it slides" in refusal(slide, ['e=90deg'])


def test_an_axis_of_any_length_is_a_direction():
    with warnings.catch_warnings():
        warnings.simplefilter('error', RuntimeWarning)
        assert load(arm(second='0 1e300 0'))[0].joints == load(arm())[0].joints


@pytest.mark.parametrize('effort', ['-10', 'nan'])
def test_an_effort_limit_that_means_none_is_reported_as_written(effort):
    told = load(arm(in_e=f'<limit effort="{effort}"/>'))[2]
    assert told == [f"r.urdf: effort limit {effort} at 'e', taken as no limit"]


def test_a_singular_joint_is_reported_in_terms_of_the_robot():
    """Two joints about one axis, with nothing between."""
    text = arm(more='<link name="c"><inertial><mass value="1"/>' + POINT.format(0.1) + '</link><link name="m"/>'
                    '<joint name="f" type="continuous"><parent link="b"/><child link="m"/><axis xyz="0 1 0"/></joint>'
                    '<joint name="g" type="continuous"><parent link="m"/><child link="c"/><axis xyz="0 1 0"/></joint>')
    sentence = refusal(text)
    assert re.match("r.urdf: joint '[fg]' makes the mass matrix singular", sentence)
    assert 'bodies[' not in sentence and 'armature' not in sentence and 'body' not in sentence


def test_floating_bases_are_welded_where_they_are():
    text = arm(more='<link name="w"/><joint name="root" type="floating"><parent link="w"/><child link="stand"/>'
                    '</joint>')
    assert "joint 'root' is of type 'floating'" in refusal(text)
    np.testing.assert_allclose(pcs.forward_dynamics(load(text, 'root')[0], *STATE), ACCELERATION, rtol=0, atol=1e-9)
    assert "of type 'floating', must be welded without a value" in refusal(text, {'root': 1.0})


def test_joints_of_a_yaml_chain_are_welded():
    """A slide and a rotation, in a file, by a call and by a key; twin: the joint led there and stopped dead."""
    chain = pcs.load_chain('four_link_robot.yaml')
    held = pcs.load_chain('four_link_robot.yaml', hold={'column_slide': 0.3, 'forearm_joint': -0.4})
    kept = [k for k, name in enumerate(chain.joint_names) if name in held.joint_names]
    assert len(kept) == chain.joint_count - 2 and chain_from_text(held.source) == held
    position = np.zeros(chain.joint_count)
    position[kept] = 0.2, -0.3, 0.4
    for name, value in (('column_slide', 0.3), ('forearm_joint', -0.4)):
        position[chain.joint_names.index(name)] = value
    np.testing.assert_allclose(pcs.mass_matrix(held, position[kept]),
                               pcs.mass_matrix(chain, position)[np.ix_(kept, kept)], rtol=0, atol=1e-13)
    still = np.zeros(chain.joint_count)
    np.testing.assert_allclose(pcs.inverse_dynamics(held, position[kept], still[kept], still[kept]),
                               pcs.inverse_dynamics(chain, position, still, still)[kept], rtol=0, atol=1e-12)
    again = pcs.load_chain('four_link_robot.yaml', hold=['column_slide'])
    assert again.bodies[0].origin == chain.bodies[0].origin + chain.joints[0].position * np.exp(1j * pi / 2)
    for hold, said in ((['colum_slide'], "hold names 'colum_slide', which is not a joint of this chain (did you m"),
                       (chain.joint_names, 'hold names all joints of the chain, must leave one that moves')):
        with pytest.raises(pcs.ChainError, match=r'four_link_robot.yaml: .*must') as caught:
            pcs.load_chain('four_link_robot.yaml', hold=hold)
        assert said in str(caught.value)


@pytest.mark.filterwarnings('always')
def test_executables_report_the_file_and_weld_joints(tmp_path, capsys):
    from planar_chain_sim.recording import rollout
    from planar_chain_sim.resimulation import command_line as resimulation
    from planar_chain_sim.symbolic import command_line as equations
    robot, log = tmp_path / 'robot.urdf', tmp_path / 'run.mcap'
    robot.write_text(YAWING)
    assert rollout.main([str(robot), '--duration', '0.1', '--output', str(log)]) == 2
    assert capsys.readouterr().err.count('\n') == 1 and not log.exists()
    assert rollout.main([str(robot), '--hold', 's=0.7', '--duration', '0.1', '--output', str(log)]) == 0
    told = capsys.readouterr().err
    assert f"rollout: note: {robot}: joints 'e', 'w'; plane with x along" in told and "welded: 's' at 0.7" in told
    assert resimulation.main([str(log)]) == 0
    assert equations.main([str(robot), '--hold', 's', '--joint']) == 0
    assert equations.main([str(log), '--hold', 's']) == 2 and '--hold is for chain files' in capsys.readouterr().err
