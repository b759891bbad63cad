"""A preload is an effort that always acts: in every form and method, with friction and stops, and in the energy."""
from dataclasses import replace

import numpy as np
from oracles.random_trees import one_joint, random_state, random_tree
import pytest

import planar_chain_sim as pcs


def loaded(chain, preload):
    """Return the chain with these preloads, (joints,)."""
    numbers = iter(preload.tolist())
    return replace(chain, bodies=tuple(replace(body, **{
        kind: joint and replace(joint, preload=next(numbers))
        for kind, joint in (('slide', body.slide), ('rotation', body.rotation))}) for body in chain.bodies))


@pytest.mark.parametrize('bodies', [1, 4, 9])
@pytest.mark.parametrize('seed', range(4))
def test_a_preload_is_an_effort_in_every_form(seed, bodies):
    """Twin: 1e-15: the sum of two efforts is rounded at another place."""
    chain = random_tree(seed, bodies)
    position, velocity, effort = random_state(chain, seed)
    preload = np.random.default_rng(seed).normal(size=chain.joint_count)
    other = loaded(chain, preload)
    for form in ('reference', 'dense', 'recursive', 'auto'):
        got = pcs.forward_dynamics(other, position, velocity, effort, form)
        wanted = pcs.forward_dynamics(chain, position, velocity, effort + preload, form)
        scale = np.linalg.cond(pcs.mass_matrix(chain, position)) * (1.0 + abs(wanted).max())
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-15 * scale)
    np.testing.assert_allclose(pcs.inverse_dynamics(other, position, velocity, got), effort, rtol=0, atol=1e-13 * scale)
    assert sum(pcs.energy(other, position, velocity)) == pytest.approx(
        sum(pcs.energy(chain, position, velocity)) - preload @ position, rel=1e-13)


@pytest.mark.parametrize('method', sorted(pcs.METHODS))
def test_a_preload_is_an_effort_by_every_method(method):
    """Twin: a run with the preload, and one with its effort held."""
    chain = pcs.load_chain('four_link_robot.yaml')
    preload = np.array([3.0, -2.0, 1.0, -0.5, 0.25])
    runs = [pcs.rollout(each, 0.2, method=method, effort=np.tile(effort, (200, 1)))
            for each, effort in ((loaded(chain, preload), 0.0 * preload), (chain, preload))]
    np.testing.assert_allclose(runs[0].position, runs[1].position, rtol=0, atol=1e-9)
    assert abs(runs[0].position - pcs.rollout(chain, 0.2, method=method).position).max() > 1e-3


def test_each_scene_of_a_batch_has_its_own_preload():
    chains = [loaded(pcs.load_chain('double_pendulum.yaml'), np.array([k, -k])) for k in (0.0, 1.0, 2.0, 3.0)]
    batch = pcs.rollout_batch(chains[2], position=8 * [[0.1, 0.2]], duration=0.1, method='rk4')
    alone = pcs.Simulation(chains[2], 'rk4')
    alone.set_state([0.1, 0.2], [0.0, 0.0])
    alone.advance(100)
    np.testing.assert_array_equal(batch.position[3, -1], alone.position)


def test_friction_and_a_stop_carry_a_preload():
    """Closed form: stuck below the friction, beyond it accelerated by the rest, at last on the stop."""
    stuck, slipping = (pcs.Simulation(one_joint('slide', friction=friction, preload=-19.62, lower=-0.1))
                       for friction in (20.0, 9.62))
    stuck.advance(100)
    slipping.advance(100)
    assert stuck.position[0] == 0.0 and slipping.position[0] == pytest.approx(-0.5 * 5.0 * 0.1**2, rel=1e-9)
    slipping.advance(400)
    assert slipping.position[0] == -0.1 and slipping.velocity[0] == 0.0


def test_the_energy_balance_counts_a_preload():
    from planar_chain_sim.motion.energy_balance import EnergyBalance
    chain = loaded(pcs.load_chain('double_pendulum.yaml'), np.array([5.0, -3.0]))
    simulation = pcs.Simulation(chain, tolerance=1e-12)
    balance = EnergyBalance(chain, simulation.step, simulation.position, simulation.velocity)
    for _ in range(500):
        simulation.advance(1)
        balance.add((simulation.position, simulation.velocity, simulation.effort))
    balance.fold()
    assert abs(balance.error) < 1e-10 * balance.size


def test_equations_print_a_preload():
    chain = loaded(pcs.load_chain('four_link_robot.yaml'), np.array([3.0, -2.0, 1.0, -0.5, 0.25]))
    position, velocity, effort = random_state(chain, 1)
    acceleration = pcs.forward_dynamics(chain, position, velocity, effort)
    for coordinates in ('joint', 'absolute'):
        equations = pcs.equations(chain, coordinates)
        state = equations.state(position, velocity, acceleration, effort)
        for equation in equations:
            size = sum(abs(term.evaluate(state)) for term in equation.terms)
            assert abs(equation.residual(state)) < 1e-12 * size
            assert 'preload' in [term.kind for term in equation.terms]
    assert str(pcs.equations(chain)['column_slide']).endswith(' + f_p1 + f1')
