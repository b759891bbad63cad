"""The URDF that is written: every library loads it and computes the same motion; its other contents."""
from dataclasses import replace
import io
from math import inf
from xml.etree import ElementTree

import mujoco
import numpy as np
from oracles.random_trees import random_state, random_tree
import pinocchio
import pytest
from urdf_parser_py.urdf import URDF
import yourdfpy

import planar_chain_sim as pcs
from planar_chain_sim import urdf_file
from planar_chain_sim.chain_file import chain_from_text
from planar_chain_sim.robot_files.urdf_writer import link_names, SHARE, urdf_of

SHIPPED = ('arczewski_example', 'cart_arm_telescope', 'chain_32_links', 'double_pendulum', 'four_link_robot',
           'seven_link_arm')


def without(chain, **laws):
    """Return the chain without what URDF cannot say, and with the laws given in every joint."""
    laws = {'stiffness': 0.0, 'rest': 0.0, 'armature': 0.0, 'friction': 0.0, **laws}
    return replace(chain, bodies=tuple(replace(body, slide=body.slide and replace(body.slide, **laws),
                                               rotation=body.rotation and replace(body.rotation, **laws))
                                       for body in chain.bodies))


def sliding_trees(seeds):
    """Return trees with many bodies that slide and turn, some of them on one carrier, some of little inertia."""
    for seed in seeds:
        chain = without(random_tree(seed, 8, ('turning', 'sliding and turning', 'sliding and turning', 'sliding')))
        light = np.random.default_rng(seed).choice([1.0, 1e-3, 1e-6], len(chain.bodies))
        bodies = tuple(replace(body, inertia_com=body.inertia_com * part,
                               inertia=body.inertia - body.inertia_com * (1.0 - part))
                       for body, part in zip(chain.bodies, light))
        yield replace(chain, bodies=bodies)


def mujoco_accelerations(chain, position, velocity, effort):
    """Return MuJoCo's joint accelerations for the URDF of a chain."""
    model = mujoco.MjModel.from_xml_string(urdf_of(chain))
    model.opt.gravity[:] = chain.gravity.real, 0.0, chain.gravity.imag
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    places = [model.joint(name).dofadr[0] for name in chain.joint_names]
    data.qpos[places], data.qvel[places], data.qfrc_applied[places] = position, velocity, effort
    mujoco.mj_forward(model, data)
    return data.qacc[places]


def pinocchio_accelerations(chain, position, velocity, effort):
    model = pinocchio.buildModelFromXML(urdf_of(chain))
    model.gravity = pinocchio.Motion(np.array([chain.gravity.real, 0.0, chain.gravity.imag, 0.0, 0.0, 0.0]))
    q, v, tau = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    places = []
    for k, joint in enumerate(chain.joints):
        own = model.joints[model.getJointId(joint.name)]
        q[own.idx_q:own.idx_q + own.nq] = [position[k]] if own.nq == 1 else [np.cos(position[k]), np.sin(position[k])]
        v[own.idx_v], tau[own.idx_v] = velocity[k], effort[k] - joint.damping * velocity[k]
        places.append(own.idx_v)
    return pinocchio.aba(model, model.createData(), q, v, tau)[places]


@pytest.mark.parametrize('library', [mujoco_accelerations, pinocchio_accelerations])
@pytest.mark.parametrize('chains', [
    lambda: [without(pcs.load_chain(f'{name}.yaml')) for name in SHIPPED],
    lambda: [without(random_tree(seed, 7)) for seed in range(30)],
    lambda: sliding_trees(range(30))], ids=['shipped', 'random', 'carriages'])
def test_other_libraries_move_it_alike(chains, library):
    """Oracle: accelerations to 1e-12, or what the mass matrix makes of round-off."""
    for chain in chains():
        position, velocity, effort = random_state(chain, 4)
        wanted = pcs.forward_dynamics(chain, position, velocity, effort)
        condition = np.linalg.cond(pcs.mass_matrix(chain, position))
        allowed = max(1e-12, 100 * condition * np.finfo(float).eps) * max(1.0, abs(wanted).max())
        np.testing.assert_allclose(library(chain, position, velocity, effort), wanted, rtol=0, atol=allowed,
                                   err_msg=chain.name)


def test_a_carriage_of_a_point_mass_has_almost_no_mass():
    """A point mass has no inertia to share: its carriage gets so little that no other number changes."""
    chain = pcs.chain_from_dict({'bodies': [
        {'name': 'a', 'carrier': 'base', 'mass': 1e-3, 'center_of_mass': [0.5, 0.0], 'inertia_com': 0.0,
         'slide': {'joint': 's', 'axis': 0.3}, 'rotation': {'joint': 'r'}}]})
    model = pinocchio.buildModelFromXML(urdf_of(chain))
    q = np.array([0.2, np.cos(0.4), np.sin(0.4)])
    matrix = pinocchio.crba(model, model.createData(), q)
    wanted = pcs.mass_matrix(chain, [0.2, 0.4])
    np.testing.assert_allclose(np.triu(matrix), np.triu(wanted), rtol=0, atol=1e-12 * abs(wanted).max())


@pytest.mark.parametrize('name', SHIPPED)
def test_every_parser_takes_every_shipped_chain(name, capfd):
    chain = pcs.load_chain(f'{name}.yaml')
    text = urdf_of(chain)
    names, carriages = link_names(chain)
    links = ['world', *names.values(), *carriages.values()]
    robot = URDF.from_xml_string(text)   # the parser of ROS in Python; Pinocchio's is the one in C++
    assert sorted(link.name for link in robot.links) == sorted(links)
    model = pinocchio.buildModelFromXML(text)
    assert sorted(model.names)[1:] != [] and set(chain.joint_names) < set(model.names)
    assert set(yourdfpy.URDF.load(io.BytesIO(text.encode())).actuated_joint_names) == set(chain.joint_names)
    model = mujoco.MjModel.from_xml_string(text)
    assert [model.joint(i).name for i in range(model.njnt)] == list(chain.joint_names)
    assert all(model.joint(joint.name).limited[0] == (joint.lower > -inf or joint.upper < inf)
               for joint in chain.joints)
    assert 'rror' not in capfd.readouterr().err


def test_an_unlimited_slide_has_no_limits():
    robot = ElementTree.fromstring(urdf_of(pcs.load_chain('cart_arm_telescope.yaml')))
    for joint in robot.findall('joint'):
        limit = joint.find('limit')
        assert limit is None or not {'lower', 'upper'} & set(limit.attrib)
        assert (joint.get('type') == 'prismatic') <= (limit is not None)   # which urdfdom demands
    assert robot.find("joint[@name='arm_joint']/limit").attrib == {'effort': '50.0', 'velocity': '1000000000.0'}
    assert robot.find("joint[@name='gripper_joint']/limit") is None


def test_its_ros2_control_block_is_the_topic_based_hardware_on_our_topics():
    chain = pcs.load_chain('cart_arm_telescope.yaml')
    text = urdf_of(chain, '/arm/sim/joint_commands', '/arm/joint_states')
    control = ElementTree.fromstring(text).find('ros2_control')
    assert control.attrib == {'name': 'planar_chain_sim', 'type': 'system'}
    assert control.find('hardware/plugin').text == 'topic_based_ros2_control/TopicBasedSystem'
    assert {param.get('name'): param.text for param in control.findall('hardware/param')} == {
        'joint_commands_topic': '/arm/sim/joint_commands', 'joint_states_topic': '/arm/joint_states',
        'trigger_joint_command_threshold': '-1'}
    assert [joint.get('name') for joint in control.findall('joint')] == list(chain.joint_names)
    for joint, element in zip(chain.joints, control.findall('joint')):
        assert [command.get('name') for command in element.findall('command_interface')] == ['effort']
        limits = {param.get('name'): float(param.text) for param in element.find('command_interface')}
        assert limits == ({} if joint.effort_limit == inf else {'min': -joint.effort_limit, 'max': joint.effort_limit})
        states = {state.get('name'): float(state.find('param').text) for state in element.findall('state_interface')}
        assert states == {'position': joint.position, 'velocity': joint.velocity, 'effort': 0.0}
        unlimited = joint.kind == 'slide'   # a limit without lower and upper reads 0 to 0 in ros2_control
        assert (element.find('limits') is not None) == unlimited


@pytest.mark.parametrize('seed', range(10))
def test_laws_come_back(seed):
    """Twin: damping, friction, effort limits and stops of a random tree, through the text and back."""
    random = np.random.default_rng(seed)
    chain = random_tree(seed, 6)
    laws = {}
    for joint in chain.joints:
        stops = sorted(random.normal(0.0, 1.0, 2)) if random.random() < 0.5 else (-inf, inf)
        laws[joint.name] = {'lower': float(stops[0]), 'upper': float(stops[1]),
                            'damping': float(random.choice([0.0, random.uniform()])),
                            'friction': float(random.choice([0.0, random.uniform()])),
                            'effort_limit': float(random.choice([inf, random.uniform(1.0, 9.0)])),
                            'position': float(np.clip(0.0, *stops))}
    bodies = tuple(replace(body, slide=body.slide and replace(body.slide, **laws[body.slide.name]),
                           rotation=body.rotation and replace(body.rotation, **laws[body.rotation.name]))
                   for body in chain.bodies)
    chain = without(replace(chain, bodies=bodies, gravity=-9.81j), friction=0.25)
    again = chain_from_text(urdf_of(chain))
    assert again.joint_names == chain.joint_names
    for old, new in zip(chain.joints, again.joints):
        for key in ('damping', 'friction', 'effort_limit', 'lower', 'upper', 'position'):
            assert getattr(new, key) == getattr(old, key), (old.name, key)


def test_a_carriage_has_a_part_that_is_easy_to_see():
    chain = pcs.load_chain('four_link_robot.yaml')
    robot = ElementTree.fromstring(urdf_of(chain))
    parts = [float(robot.find(f"link[@name='{name}']/inertial/mass").get('value'))
             for name in ('column_carriage', 'column')]
    assert sum(parts) == 2.0 and 0.5 * SHARE < parts[0] / 2.0 <= SHARE


def test_a_file_that_exists_is_not_overwritten(tmp_path, capsys):
    path = tmp_path / 'mine.urdf'
    assert urdf_file.main(['double_pendulum.yaml', '--output', str(path)]) == 0
    written = path.read_bytes()
    assert urdf_file.main([str(path), '--output', str(path)]) == 2
    assert 'exists and is not overwritten' in capsys.readouterr().err and path.read_bytes() == written


def test_held_joints_are_welded_in_it(capsys):
    assert urdf_file.main(['double_pendulum.yaml', '--hold', 'lower_joint=90deg']) == 0
    held, text = pcs.load_chain('double_pendulum.yaml', hold={'lower_joint': '90 deg'}), capsys.readouterr().out
    assert held.joint_names == chain_from_text(text).joint_names == ('upper_joint',)
    accelerations = [pcs.forward_dynamics(each, [0.3], [0.2], [0.1]) for each in (held, chain_from_text(text))]
    np.testing.assert_allclose(*accelerations, rtol=1e-14)
