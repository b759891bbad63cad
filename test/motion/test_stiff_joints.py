"""The Jacobian of the inverse dynamics, and the L-stable method that uses it."""
from dataclasses import replace
import warnings

import numpy as np
from oracles.differences import differences
from oracles.pinocchio_model import pinocchio_model, spring_and_damper
from oracles.random_trees import one_joint, random_state, random_tree
import pytest
from test_methods import CONFIG, double_pendulum

import planar_chain_sim as pcs
from planar_chain_sim import _kernel
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.motion.integrators import method_data, METHODS
from planar_chain_sim.motion.stiffness import step_limit

SEEDS = range(30)


@pytest.mark.parametrize('seed', SEEDS)
def test_derivatives_of_the_inverse_dynamics_are_those_of_differences(seed):
    """Trees of every kind of joint, with rotors, springs and dampers; 1e-10 is round-off of 1e-13 over h = 1e-3."""
    chain = random_tree(seed, bodies=1 + seed % 12)
    position, velocity, acceleration = random_state(chain, seed)
    mass, by_position, by_velocity = plan_of(chain).model.derivatives(position, velocity, acceleration)
    np.testing.assert_allclose(mass, pcs.mass_matrix(chain, position), rtol=0, atol=1e-14 * mass.max())
    for got, function in (
            (by_position, lambda by: pcs.inverse_dynamics(chain, position + by, velocity, acceleration)),
            (by_velocity, lambda by: pcs.inverse_dynamics(chain, position, velocity + by, acceleration))):
        wanted = differences(function, chain.joint_count)
        np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-10 * max(1.0, np.abs(wanted).max()))


def depth_first(chain):
    """Return the same tree with every branch in one piece, as Pinocchio's derivatives need it."""
    def outboard(i):
        return [i, *(k for child, body in enumerate(chain.bodies) if body.carrier == i for k in outboard(child))]
    order = outboard(-1)[1:]
    return replace(chain, bodies=tuple(
        replace(chain.bodies[i], carrier=order.index(chain.bodies[i].carrier) if chain.bodies[i].carrier >= 0 else -1)
        for i in order))


@pytest.mark.parametrize('seed', SEEDS)
def test_pinocchio_agrees_on_the_derivatives_of_the_accelerations(seed):
    """Oracle: H a_q = -K and H a_v = -C; two stable solutions differ by about cond(H) eps."""
    pin = pytest.importorskip('pinocchio')
    chain = depth_first(random_tree(seed, bodies=2 + seed % 10))
    position, velocity, effort = random_state(chain, seed)
    acceleration = pcs.forward_dynamics(chain, position, velocity, effort)
    mass, by_position, by_velocity = plan_of(chain).model.derivatives(position, velocity, acceleration)
    by_position -= np.diag([joint.stiffness for joint in chain.joints])
    by_velocity -= np.diag([joint.damping for joint in chain.joints])
    model = pinocchio_model(pin, chain)
    data = model.createData()
    peer = pin.computeABADerivatives(model, data, position, velocity,
                                     effort + spring_and_damper(chain, position, velocity))
    for ours, theirs in zip((by_position, by_velocity), peer):
        np.testing.assert_allclose(np.linalg.solve(mass, -ours), theirs, rtol=0,
                                   atol=1e-11 * max(1.0, np.abs(theirs).max()))


@pytest.mark.parametrize('kind, inertia', [('rotation', 0.5), ('slide', 2.0)])
@pytest.mark.parametrize('tolerance', [1e-3, 1e-6, 1e-9])
def test_a_joint_damped_by_1e4_follows_the_closed_form_in_few_steps(kind, inertia, tolerance):
    """A rate of 5e3 to 2e4 per second at 1 ms: an explicit method would need thousands of steps for the second."""
    damping, effort, start = 1e4, 100.0, 1.0
    chain = one_joint(kind, damping=damping, velocity=start)
    simulation = pcs.Simulation(chain, 'rodas5p', tolerance=tolerance)
    position, velocity, acted = np.empty((3, 1000, 1))
    simulation.advance(1000, [effort], (position, velocity, acted))
    rate, final, time = damping / inertia, effort / damping, np.arange(1, 1001) * 1e-3
    decay = (start - final) * np.exp(-rate * time)
    assert np.abs(velocity[:, 0] - final - decay).max() < tolerance
    assert np.abs(position[:, 0] - final * time - (start - final - decay) / rate).max() < tolerance
    statistics = simulation.statistics
    assert statistics['steps'] + statistics['rejected_steps'] < {1e-3: 20, 1e-6: 40, 1e-9: 100}[tolerance]


def stiff_arm(**laws):
    """Return the seven-link arm with these laws on all of its joints."""
    chain = pcs.load_chain(CONFIG / 'seven_link_arm.yaml')
    return replace(chain, bodies=tuple(
        replace(body, rotation=body.rotation and replace(body.rotation, **laws)) for body in chain.bodies))


@pytest.mark.parametrize('laws, steps', [({'damping': 1e4}, 100), ({'damping': 1e3, 'stiffness': 1e6}, 2000)])
def test_a_stiff_arm_takes_few_steps_and_meets_the_tolerance(laws, steps):
    chain, effort = stiff_arm(**laws), np.linspace(-5.0, 5.0, 7)
    runs = []
    for tolerance in (1e-9, 1e-12):
        simulation = pcs.Simulation(chain, 'rodas5p', tolerance=tolerance)
        simulation.advance(100, effort)
        runs.append((simulation.position, simulation.velocity, simulation.statistics))
    (position, velocity, statistics), (exact_position, exact_velocity, _) = runs
    assert np.abs(position - exact_position).max() < 1e-9
    assert np.abs(velocity - exact_velocity).max() < 1e-7
    assert statistics['steps'] + statistics['rejected_steps'] < steps


def test_fast_modes_are_damped_not_kept():
    """L-stability: an undamped ringing at 1e5 rad/s, too small for the tolerance to see, is gone after a few steps."""
    chain = one_joint(stiffness=5e9, rest=0.5, position=0.5 + 2.0**-30)
    simulation = pcs.Simulation(chain, 'rodas5p', 0.1, tolerance=1e-3)
    simulation.advance(100)
    assert simulation.statistics['steps'] < 30
    assert abs(simulation.position[0] - 0.5) < 1e-15 and abs(simulation.velocity[0]) < 1e-12


def test_a_step_whose_first_pivot_vanishes_is_between_its_neighbours():
    """Just off upside down, H_11 + (h gamma)^2 K_11 = 0 at some length h: rows are exchanged, and nothing is lost."""
    chain, row = double_pendulum(), pcs.METHODS['rodas5p']
    model, position, velocity = plan_of(chain).model, np.array([np.pi - 1e-9, 1e-9]), np.zeros(2)
    acceleration = pcs.forward_dynamics(chain, position, velocity, velocity)
    mass, by_position, _ = model.derivatives(position, velocity, acceleration)
    length, ends = np.sqrt(-mass[0, 0] / by_position[0, 0]) / row.gamma, []
    for factor in (1.0 - 1e-9, 1.0, 1.0 + 1e-9):
        stepper = _kernel.Stepper(model, method_data(row, 1e-9, fixed=factor * length), length, True)
        stepper.put_state(position, velocity)
        stepper.advance(1, None, None)
        ends.append(stepper.velocity)
    # the state itself is known to eps pi / 1e-9 = 7e-7 of what is off
    assert np.abs(ends[2] - 2 * ends[1] + ends[0]).max() < 1e-5 * np.abs(ends[1]).max()


@pytest.mark.parametrize('method', ['rk4', 'dop853_fixed', 'semi_implicit_euler'])
@pytest.mark.parametrize('law, rate', [({'damping': 1e4}, 1e4), ({'stiffness': 1e6}, 1e3)])
def test_a_fixed_step_beyond_stability_is_warned_of_with_the_limit(method, law, rate):
    """Oracle: 3 % below the estimated limit the motion dies out or stays bounded, 10 % above it runs away."""
    chain = one_joint(inertia=1.0, position=1e-3, velocity=1e-3, **law)
    limit, joint = step_limit(chain, METHODS[method])
    assert joint == 'joint' and 1.9 < limit * rate < 12.0
    with pytest.warns(RuntimeWarning, match=f"should be below about {limit:.2g} s: method '{method}' is unstable"):
        simulation = pcs.Simulation(chain, method, 1.1 * limit)
    with pytest.raises(pcs.SimulationError, match='two half steps give another result'):
        simulation.advance(100_000)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        simulation = pcs.Simulation(chain, method, 0.97 * limit)
        for other in ('auto', 'gauss6', 'rodas5p'):
            pcs.Simulation(chain, other, 1.1 * limit)
    simulation.advance(2000)
    assert abs(simulation.position[0]) < 10.0
