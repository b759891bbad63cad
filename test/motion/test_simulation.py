"""Order, invariants and bit equality of Simulation and rollout."""
from fractions import Fraction
import pickle

import numpy as np
from oracles.random_trees import one_joint, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain.tree import Body, Joint
from planar_chain_sim.mechanics import invariants


def total_energy(chain, run):
    return np.array([sum(pcs.energy(chain, q, v)) for q, v in zip(run.position, run.velocity)])


def test_rows_are_explicit_and_consistent():
    for method in (row for row in pcs.METHODS.values() if row.family == 'explicit Runge-Kutta'):
        assert not np.triu(method.a).any()
        assert sum(method.b) == pytest.approx(1.0, rel=1e-15, abs=0)


def test_ticks_are_the_tableau_in_plain_arithmetic_bit_for_bit():
    """Stages as the method's row says, sums in twice the digits: what rounding loses is kept exactly, and used."""
    def two_sum(value, term):
        total = value + term
        return total, np.array([float(Fraction(a) + Fraction(b) - Fraction(c)) for a, b, c in zip(value, term, total)])

    def weighed(weights, rows):
        return sum((weight * row for weight, row in zip(weights, rows) if weight), zero)
    chain, step, method = random_tree(7, bodies=5), 0.01, pcs.METHODS['rk4']
    zero, effort = np.zeros(chain.joint_count), np.linspace(-1.0, 1.0, chain.joint_count)
    simulation = pcs.Simulation(chain, 'rk4', step)
    q, v, q_rest, v_rest = zero, zero, zero, zero
    simulation.set_state(q, v)
    for _ in range(100):
        rates, accelerations = [], []
        for row in method.a:
            stage = q + (step * weighed(row, rates) + q_rest)
            rates.append(v + (step * weighed(row, accelerations) + v_rest))
            accelerations.append(pcs.forward_dynamics(chain, stage, rates[-1], effort))
        q, q_rest = two_sum(q, step * weighed(method.b, rates) + q_rest)
        v, v_rest = two_sum(v, step * weighed(method.b, accelerations) + v_rest)
        simulation.advance(1, effort)
        kept = simulation.checkpoint().state[:4]
        assert [array.tobytes() for array in kept] == [array.tobytes() for array in (q, v, q_rest, v_rest)]


@pytest.mark.parametrize('kind', ['rotation', 'slide'])
def test_damped_spring_follows_the_closed_form(kind):
    inertia = {'rotation': 0.5, 'slide': 2.0}[kind] + 0.25
    d, k, rest, position, velocity, effort = 0.3, 8.0, 0.4, 1.1, -0.7, 0.9
    chain = one_joint(kind, armature=0.25, damping=d, stiffness=k, rest=rest, position=position, velocity=velocity)
    run = pcs.rollout(chain, 3.0, 1e-3, 'rk4', effort=[effort])
    decay, middle = d / (2 * inertia), rest + effort / k
    omega = np.sqrt(k / inertia - decay**2)
    start = position - middle
    exact = middle + np.exp(-decay * run.time) * (
        start * np.cos(omega * run.time) + (velocity + decay * start) / omega * np.sin(omega * run.time))
    # RK4's local error (omega h)^5 / 120 a step, over 3000 steps of an amplitude of 0.6, is 6e-12 where omega is 3.3
    np.testing.assert_allclose(run.position[:, 0], exact, rtol=0, atol=6e-12)


def test_energy_of_a_free_arm_is_conserved_to_the_order_of_the_method():
    chain = Chain('free', -9.81j, tuple(
        Body(f'b{i}', carrier, origin, 0.0, 1.0, 0.3 + 0.1j, 0.2, 0.1, slide,
             Joint(f'r{i}', 'rotation', 1.0, position=1.0))
        for i, (carrier, origin, slide) in enumerate([
            (-1, 0j, None), (0, 0.6 + 0j, Joint('s', 'slide', 0.3, velocity=0.5)), (1, 0.5 + 0j, None),
            (1, 0.2j, None)])))
    drifts = []
    for step in (2e-3, 1e-3):
        energy = total_energy(chain, pcs.rollout(chain, 2.0, step, 'rk4'))
        drifts.append(np.abs(energy - energy[0]).max() / np.ptp([invariants.energy(chain, q, v)[1] for q, v in [
            (np.zeros(5), np.zeros(5)), (np.ones(5), np.zeros(5))]]))
    assert drifts[1] < 2e-10                  # round-off alone would be 1e-14: this is 130 h^4 and says so below
    assert abs(np.log2(drifts[0] / drifts[1]) - 4.0) < 0.05


def test_power_balance():
    """DE/dt = effort . velocity - dissipation, at random states of random trees, along the kernel's accelerations."""
    for seed in range(20):
        chain = random_tree(seed, bodies=8)
        position, velocity, effort = np.random.default_rng(seed).normal(size=(3, chain.joint_count))
        acceleration = pcs.forward_dynamics(chain, position, velocity, effort)
        wanted = effort @ velocity - invariants.dissipated_power(chain, position, velocity)
        h = 3e-4   # five points along the motion: truncation 1e3 h^4, round-off eps / h, both below 1e-11 of the terms

        def energy_at(t):
            return sum(pcs.energy(chain, position + t * velocity + 0.5 * t * t * acceleration,
                                  velocity + t * acceleration))
        rate = (8 * (energy_at(h) - energy_at(-h)) - (energy_at(2 * h) - energy_at(-2 * h))) / (12 * h)
        size = np.abs(effort * velocity).sum() + abs(rate) + sum(map(abs, pcs.energy(chain, position, velocity)))
        assert abs(rate - wanted) < 2e-11 * size


def test_energy_over_a_driven_damped_run_is_the_work_done():
    """E(t) - E(0) = integral of effort . velocity - dissipation, by Simpson's rule on the ticks."""
    chain = random_tree(11, bodies=4)
    effort = np.linspace(-1.0, 1.0, chain.joint_count)
    run = pcs.rollout(chain, 1.0, 1e-3, 'rk4', effort=effort)
    power = np.array([effort @ v - invariants.dissipated_power(chain, q, v)
                      for q, v in zip(run.position, run.velocity)])
    work = (power[0] + power[-1] + 4 * power[1:-1:2].sum() + 2 * power[2:-1:2].sum()) * 1e-3 / 3
    energy = total_energy(chain, run)
    # Simpson's rule and the method are both off by about h^4
    assert abs(energy[-1] - energy[0] - work) < 1e-11 * np.ptp(energy)


def test_how_calls_are_cut_changes_no_bit():
    chain = random_tree(5, bodies=9)
    efforts = np.random.default_rng(5).normal(size=(300, chain.joint_count))
    whole, ones, pieces = (pcs.Simulation(chain) for _ in range(3))
    whole.advance(300, efforts)
    for row in efforts:
        ones.advance(1, row)
    for start in range(0, 300, 7):
        pieces.advance(len(efforts[start:start + 7]), efforts[start:start + 7])
    run = pcs.rollout(chain, 0.3, effort=efforts)
    for other in (ones, pieces):
        assert whole.position.tobytes() == other.position.tobytes()
        assert whole.velocity.tobytes() == other.velocity.tobytes()
    assert run.position[-1].tobytes() == whole.position.tobytes()
    by_call = pcs.rollout(chain, 0.3, effort=lambda time, position, velocity: efforts[round(time * 1000)])
    assert by_call.position.tobytes() == run.position.tobytes() and by_call.effort.tobytes() == run.effort.tobytes()


def test_checkpoint_goes_on_with_the_same_bits_and_set_state_clears_hidden_terms():
    chain = random_tree(6, bodies=6)
    simulation, other = pcs.Simulation(chain), pcs.Simulation(chain)
    simulation.advance(499)
    simulation.advance(1, np.full(chain.joint_count, 0.1))
    saved = pickle.loads(pickle.dumps(simulation.checkpoint()))
    simulation.advance(500)
    other.restore(saved)
    assert (other.tick, other.time) == (500, 0.5)
    again = other.checkpoint()
    assert [array.tobytes() for array in again.state] == [array.tobytes() for array in saved.state]
    other.advance(500)
    assert other.position.tobytes() == simulation.position.tobytes()
    other.set_state(simulation.position, simulation.velocity)
    assert [array.any() for array in saved.state[2:4]] == [True, True]
    assert [array.any() for array in other.checkpoint().state[2:4]] == [False, False]


def test_compensation_keeps_round_off_from_growing_with_the_steps():
    """1e6 small steps of free flight: x = v t to the last bit, where a plain sum would be off by hundreds of ulps."""
    chain = one_joint('slide', velocity=1 / 3)
    simulation = pcs.Simulation(chain, step=1e-5)
    simulation.advance(1_000_000)
    assert abs(simulation.position[0] - 10 / 3) <= 2 * np.spacing(10 / 3)


def test_effort_is_clamped_and_reported_as_it_acted():
    chain = one_joint(inertia=1.0, effort_limit=2.0)
    simulation = pcs.Simulation(chain)
    simulation.advance(100, [5.0])
    assert simulation.effort.tolist() == [2.0]
    assert simulation.velocity[0] == pytest.approx(0.2, rel=1e-15, abs=0)     # the sum of 100 ticks is compensated
    simulation.advance(1, [-7.0])
    assert simulation.effort.tolist() == [-2.0]
    assert simulation.acceleration.tolist() == [-2.0]
