"""The linearisation: compared with differences, with eigenfrequencies in closed form, and with the motion."""
from dataclasses import replace

import numpy as np
from oracles.differences import differences
from oracles.random_trees import one_joint, random_state, random_tree
import pytest

import planar_chain_sim as pcs


def at_rest(chain, position, effort=None):
    zero = np.zeros(chain.joint_count)
    return pcs.linearize(chain, position, zero, zero if effort is None else effort)


@pytest.mark.parametrize('seed', range(30))
def test_a_and_b_are_those_of_differences(seed):
    """Oracle: six-point differences of forward_dynamics, all kinds of joint; round-off of cond(H) eps over h = 1e-3."""
    chain = random_tree(seed, bodies=1 + seed % 12)
    position, velocity, effort = random_state(chain, seed)
    joints = chain.joint_count
    A, B = pcs.linearize(chain, position, velocity, effort)
    assert A.shape == (2 * joints, 2 * joints) and B.shape == (2 * joints, joints)
    assert np.array_equal(A[:joints], np.eye(2 * joints)[joints:]) and not B[:joints].any()
    for got, function in (
            (A[joints:, :joints], lambda by: pcs.forward_dynamics(chain, position + by, velocity, effort)),
            (A[joints:, joints:], lambda by: pcs.forward_dynamics(chain, position, velocity + by, effort)),
            (B[joints:], lambda by: pcs.forward_dynamics(chain, position, velocity, effort + by))):
        wanted = differences(function, joints)
        scale = max(1.0, np.abs(wanted).max(), np.abs(A).max())
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-8 * scale)


def test_eigenfrequencies_of_the_hanging_double_pendulum():
    """Oracle: two uniform rods, M = [[4/3, 1/2], [1/2, 1/3]], K = g diag(3/2, 1/2) in absolute angles."""
    chain = pcs.load_chain('double_pendulum.yaml')
    A, _ = at_rest(chain, [0.0, 0.0])
    M, K = np.array([[4 / 3, 0.5], [0.5, 1 / 3]]), 9.81 * np.diag([1.5, 0.5])
    wanted = np.sqrt(np.linalg.eigvals(np.linalg.solve(M, K)).real)
    eigenvalues = np.linalg.eigvals(A)
    assert np.abs(eigenvalues.real).max() < 1e-12
    np.testing.assert_allclose(np.sort(eigenvalues.imag)[2:], np.sort(wanted), rtol=1e-13)
    turned_up = np.linalg.eigvals(at_rest(chain, [np.pi, 0.0])[0])
    assert np.sort(turned_up.real)[-1] > 1.0    # upside down it falls


@pytest.mark.parametrize('kind, inertia', [('rotation', 0.5), ('slide', 2.0)])
def test_a_damped_spring_has_the_roots_of_its_quadratic(kind, inertia):
    """Oracle: (J + Ia) s^2 + d s + k = 0."""
    chain = one_joint(kind, damping=0.3, stiffness=7.0, rest=0.2, armature=0.25)
    A, B = at_rest(chain, [0.2])
    roots = np.roots([inertia + 0.25, 0.3, 7.0])
    np.testing.assert_allclose(np.sort_complex(np.linalg.eigvals(A)), np.sort_complex(roots), rtol=1e-14)
    assert B.tolist() == [[0.0], [1.0 / (inertia + 0.25)]]


def test_small_oscillations_swing_in_the_time_that_a_gives():
    """Oracle: released at rest in an eigenmode, the robot is back after a period, up to the square of the amplitude."""
    chain = pcs.load_chain('four_link_robot.yaml')
    chain = replace(chain, bodies=tuple(replace(
        body, slide=body.slide and replace(body.slide, damping=0.0),
        rotation=replace(body.rotation, damping=0.0)) for body in chain.bodies))
    hanging = np.array([0.25, -np.pi / 2, 0.0, 0.0, 0.0])
    hanging[0] = 0.353986 - 5.3 * 9.81 / 500.0
    A, _ = at_rest(chain, hanging)
    values, vectors = np.linalg.eig(A[5:, :5])
    amplitude = 1e-4
    for value, mode in zip(values.real, vectors.real.T):
        assert value < 0.0
        period = 2 * np.pi / np.sqrt(-value)
        simulation = pcs.Simulation(chain, tolerance=1e-13)
        simulation.set_state(hanging + amplitude * mode, np.zeros(5))
        simulation.advance_to(period)
        # a mode's energy is of the fourth order in the others and the frequency is off by the square
        assert np.abs(simulation.position - hanging - amplitude * mode).max() < 20 * amplitude**2
        assert np.abs(simulation.velocity).max() < 20 * amplitude**2 * np.sqrt(-value)


def test_a_controller_designed_with_a_and_b_holds_the_arm_upside_down():
    """Poles placed by hand on B^-1 A: the closed loop has them, and the simulation stays where it is put."""
    chain = pcs.load_chain('double_pendulum.yaml')
    up = np.array([np.pi, 0.0])
    A, B = at_rest(chain, up)
    gain = np.linalg.solve(B[2:], np.hstack([A[2:, :2] + 25.0 * np.eye(2), A[2:, 2:] + 10.0 * np.eye(2)]))
    np.testing.assert_allclose(np.linalg.eigvals(A - B @ gain).real, -5.0, atol=1e-5)    # a double root: sqrt(eps)
    run = pcs.rollout(chain_at(chain, up + 0.1), 4.0, effort=lambda time, position, velocity: -gain @ np.concatenate(
        [position - up, velocity]))
    assert np.abs(run.position[-1] - up).max() < 1e-6


def chain_at(chain, position):
    return replace(chain, bodies=tuple(replace(body, rotation=replace(body.rotation, position=float(q)))
                                       for body, q in zip(chain.bodies, position)))


def test_refusals_are_one_sentence():
    chain = one_joint(friction=0.5)
    with pytest.raises(ValueError, match="joint 'joint' is 0.0, must not be: its friction has no derivative"):
        pcs.linearize(chain, [0.0], [0.0], [0.0])
    assert pcs.linearize(chain, [0.0], [1.0], [0.0]).A.tolist() == [[0.0, 1.0], [0.0, 0.0]]
    with pytest.raises(ValueError, match='effort has shape'):
        pcs.linearize(chain, [0.0], [1.0], [0.0, 1.0])
    with pytest.raises(ValueError, match='must be finite'):
        pcs.linearize(chain, [np.nan], [1.0], [0.0])
