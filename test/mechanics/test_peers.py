"""Oracle tests: the same chains in MuJoCo and Pinocchio, which share no code with this package."""
import numpy as np
from oracles.pinocchio_model import pinocchio_model, spring_and_damper
from oracles.random_trees import random_state, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.benchmark.peers.mujoco_peer import mujoco_model

SEEDS = range(30)
# Two stable solutions differ by about cond(H) eps: the worst of these trees is 3e-14. Entries of H and T are plain
# sums: the worst is 1.4e-15.
SOLVED, SUMMED = 3e-13, 1e-14


@pytest.mark.parametrize('seed', SEEDS)
def test_mujoco_agrees(seed):
    mujoco = pytest.importorskip('mujoco')
    chain = random_tree(seed, bodies=2 + seed % 12)
    position, velocity, effort = random_state(chain, seed)
    model = mujoco_model(chain)
    data = mujoco.MjData(model)
    address = [model.joint(name).dofadr[0] for name in chain.joint_names]   # MuJoCo's order is depth first
    data.qpos[address], data.qvel[address] = position, velocity
    data.qfrc_applied[address] = effort   # damping and springs are the model's own
    mujoco.mj_forward(model, data)
    wanted = pcs.forward_dynamics(chain, position, velocity, effort)
    np.testing.assert_allclose(data.qacc[address], wanted, rtol=0, atol=SOLVED * np.abs(wanted).max())
    H, column = np.zeros((model.nv, model.nv)), np.zeros(model.nv)
    for k, unit in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, column, unit)
        H[:, k] = column
    H = H[np.ix_(address, address)]
    np.testing.assert_allclose(H, pcs.mass_matrix(chain, position), rtol=0, atol=SUMMED * H.max())


@pytest.mark.parametrize('seed', SEEDS)
def test_pinocchio_agrees(seed):
    pin = pytest.importorskip('pinocchio')
    chain = random_tree(seed, bodies=2 + seed % 12)
    position, velocity, effort = random_state(chain, seed)
    model = pinocchio_model(pin, chain)
    data = model.createData()
    # rotations about z only: Pinocchio's configuration vector is ours
    got = pin.aba(model, data, position, velocity, effort + spring_and_damper(chain, position, velocity))
    wanted = pcs.forward_dynamics(chain, position, velocity, effort)
    np.testing.assert_allclose(got, wanted, rtol=0, atol=SOLVED * np.abs(wanted).max())
    back = pcs.inverse_dynamics(chain, position, velocity, wanted) + spring_and_damper(chain, position, velocity)
    peer = pin.rnea(model, data, position, velocity, wanted)
    np.testing.assert_allclose(back, peer, rtol=0, atol=SOLVED * np.abs(peer).max())
    kinetic, _ = pcs.energy(chain, position, velocity)
    kinetic -= 0.5 * model.armature @ velocity**2
    model.armature[:] = 0.0   # the peer's own account of rotor energy is incomplete
    assert kinetic == pytest.approx(pin.computeKineticEnergy(model, data, position, velocity), rel=SUMMED, abs=0)
