"""Poses, momentum and reaction forces of bodies, compared with MuJoCo, which computes them in space."""
import numpy as np
from oracles.random_trees import random_state, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.benchmark.peers.mujoco_peer import mujoco_model

SEEDS = range(60)


def near(found, wanted, error=1e-12):
    np.testing.assert_allclose(found, wanted, rtol=0, atol=error * (1.0 + np.abs(wanted).max()))


@pytest.fixture(params=SEEDS)
def scene(request):
    """Return chain, state and effort, and what MuJoCo makes of them."""
    mujoco = pytest.importorskip('mujoco')
    chain = random_tree(request.param, bodies=1 + request.param % 12)
    position, velocity, effort = random_state(chain, request.param)
    model = mujoco_model(chain)
    data = mujoco.MjData(model)
    address = [model.joint(name).dofadr[0] for name in chain.joint_names]
    data.qpos[address], data.qvel[address], data.qfrc_applied[address] = position, velocity, effort
    mujoco.mj_forward(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    mujoco.mj_subtreeVel(model, data)
    numbers = [model.body(body.name).id for body in chain.bodies]
    return chain, position, velocity, effort, mujoco, model, data, numbers, address


def test_poses_and_velocities_agree(scene):
    chain, position, velocity, _, mujoco, model, data, numbers, _ = scene
    poses, rates = pcs.body_poses(chain, position), pcs.body_velocities(chain, position, velocity)
    near(poses.point, data.xpos[numbers, :2])
    near(poses.center_of_mass, data.xipos[numbers, :2])
    turned = data.xmat[numbers]   # its first and fourth entry are cosine and sine
    near(np.exp(1j * poses.angle), turned[:, 0] + 1j * turned[:, 3])
    for k, number in enumerate(numbers):
        rate = np.zeros(6)   # of the body's frame, in the world's axes: angular, then linear
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, number, rate, 0)
        near([*rates.point[k], rates.angle[k]], [rate[3], rate[4], rate[2]])
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, number, rate, 0)
        near(rates.center_of_mass[k], rate[3:5])


def test_jacobian_agrees(scene):
    chain, position, velocity, _, mujoco, model, data, numbers, address = scene
    for body, number in zip(chain.bodies, numbers):
        point = np.array([0.3, -0.2])
        x, y = data.xmat[number].reshape(3, 3)[:2, :2] @ point + data.xpos[number, :2]
        linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, linear, angular, [x, y, 0.0], number)
        found = pcs.jacobian(chain, position, body.name, point)
        near(found, np.vstack([linear[:2], angular[2:]])[:, address])
        assert found.shape == (3, chain.joint_count)
    rates = pcs.body_velocities(chain, position, velocity)
    near(pcs.jacobian(chain, position, chain.bodies[-1].name) @ velocity, [*rates.point[-1], rates.angle[-1]])


def test_mass_centre_and_momentum_agree(scene):
    chain, position, velocity, _, mujoco, model, data, _, _ = scene
    center = pcs.center_of_mass(chain, position)
    near(center, data.subtree_com[0, :2])
    linear, angular = pcs.momentum(chain, position, velocity)
    near(linear, data.subtree_linvel[0, :2] * model.body_mass.sum())
    about_center = angular - (center[0] * linear[1] - center[1] * linear[0])
    near(about_center, data.subtree_angmom[0, 2])


def test_reaction_forces_agree(scene):
    chain, position, velocity, effort, mujoco, model, data, numbers, _ = scene
    found = pcs.reaction_forces(chain, position, velocity, effort)
    for k, number in enumerate(numbers):
        torque, force = data.cfrc_int[number, :3], data.cfrc_int[number, 3:]
        arm = data.subtree_com[model.body_rootid[number]] - data.xpos[number]   # its torques are about that centre
        wanted = [force[0], force[1], torque[2] + np.cross(arm, force)[2]]
        near(found[k], wanted, 1e-10)   # accelerations are solved for: cond(H) eps


def test_the_joint_carries_its_own_effort(scene):
    """The load along a joint follows from actuator, laws and rotor by virtual work, without Newton's laws."""
    chain, position, velocity, effort, *_ = scene
    acceleration = pcs.forward_dynamics(chain, position, velocity, effort)
    forces, poses = pcs.reaction_forces(chain, position, velocity, effort), pcs.body_poses(chain, position)
    column = 0
    for k, body in enumerate(chain.bodies):
        carrier = poses.angle[body.carrier] if body.carrier >= 0 else 0.0
        for joint in (body.slide, body.rotation):
            if joint is None:
                continue
            along = (forces[k, 0] * np.cos(carrier + joint.axis) + forces[k, 1] * np.sin(carrier + joint.axis)
                     if joint.kind == 'slide' else joint.axis * forces[k, 2])
            wanted = (effort[column] - joint.armature * acceleration[column] - joint.damping * velocity[column]
                      - joint.stiffness * (position[column] - joint.rest))
            near(along, wanted, 1e-10 * np.abs(forces).max())
            column += 1


def test_leading_axes_are_kept():
    chain = random_tree(3, bodies=7)
    rows = np.random.default_rng(0).normal(size=(3, 5, 4, chain.joint_count))
    position, velocity, effort = rows
    whole = {'poses': pcs.body_poses(chain, position).point, 'rates': pcs.body_velocities(chain, *rows[:2]).angle,
             'centre': pcs.center_of_mass(chain, position), 'turning': pcs.momentum(chain, *rows[:2])[1],
             'jacobian': pcs.jacobian(chain, position, chain.bodies[-1].name, (0.1, 0.2)),
             'forces': pcs.reaction_forces(chain, *rows), 'forward': pcs.forward_dynamics(chain, *rows),
             'inverse': pcs.inverse_dynamics(chain, *rows), 'mass': pcs.mass_matrix(chain, position),
             'kinetic': pcs.energy(chain, *rows[:2])[0], 'potential': pcs.energy(chain, *rows[:2])[1]}
    for index in np.ndindex(5, 4):
        q, v, u = rows[(slice(None), *index)]
        one = {'poses': pcs.body_poses(chain, q).point, 'rates': pcs.body_velocities(chain, q, v).angle,
               'centre': pcs.center_of_mass(chain, q), 'turning': pcs.momentum(chain, q, v)[1],
               'jacobian': pcs.jacobian(chain, q, chain.bodies[-1].name, (0.1, 0.2)),
               'forces': pcs.reaction_forces(chain, q, v, u), 'forward': pcs.forward_dynamics(chain, q, v, u),
               'inverse': pcs.inverse_dynamics(chain, q, v, u), 'mass': pcs.mass_matrix(chain, q),
               'kinetic': pcs.energy(chain, q, v)[0], 'potential': pcs.energy(chain, q, v)[1]}
        for name, found in one.items():
            np.testing.assert_allclose(whole[name][index], found, rtol=1e-12, atol=1e-12, err_msg=name)
    held = pcs.body_velocities(chain, position[0, 0], velocity).point   # one position, many rates
    assert held.shape == (5, 4, 7, 2)
    np.testing.assert_array_equal(pcs.forward_dynamics(chain, position, velocity, effort, form='reference').shape,
                                  position.shape)


@pytest.mark.parametrize('call, sentence', [
    (lambda chain, q: pcs.body_poses(chain, q[:-1]), 'position has shape'),
    (lambda chain, q: pcs.body_poses(chain, 1.0), 'position has shape'),
    (lambda chain, q: pcs.body_poses(chain, q * np.nan), 'position[0] is nan, must be finite'),
    (lambda chain, q: pcs.body_poses(chain, ['a'] * len(q)), 'position must be numbers of shape'),
    (lambda chain, q: pcs.body_velocities(chain, [q] * 2, [q] * 3), 'the leading axes do not fit'),
    (lambda chain, q: pcs.jacobian(chain, q, 'bodi1'), "body is 'bodi1', must be one of"),
    (lambda chain, q: pcs.jacobian(chain, q, 'body1', (0.0,)), 'point has shape (1,), must have (2,)'),
    (lambda chain, q: pcs.jacobian(chain, q, 'body1', 'xy'), "point must be numbers of shape (2,), got 'xy'"),
    (lambda chain, q: pcs.forward_dynamics(chain, [q] * 2, [q] * 3, q), 'the leading axes do not fit'),
    (lambda chain, q: pcs.energy(chain, [[]], [[]]), 'position has shape'),
])
def test_bad_arguments_are_refused(call, sentence):
    chain = random_tree(3, bodies=5)
    with pytest.raises(ValueError) as caught:
        call(chain, np.ones(chain.joint_count))
    assert sentence in str(caught.value)
