"""The Taylor series: two forms agree, also with Runge-Kutta and energy; its order; calls may be cut anywhere."""
from dataclasses import replace

import numpy as np
from oracles.random_trees import random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim import _kernel
from planar_chain_sim.benchmark.problems import uniform_rods
from planar_chain_sim.chain.joint_arrays import initial_state
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.motion.stiffness import damping_rate

TWO_RODS = pcs.load_chain('double_pendulum.yaml')


def stepper(chain, order, tolerance=1e-15, fixed=0.0, dense=True, tick=0.05):
    method = _kernel.MethodData('taylor', order, True, tolerance, fixed)
    made = _kernel.Stepper(plan_of(chain).model, method, tick, dense)
    made.put_state(*initial_state(chain))
    return made


def small_trees(count):
    """Random trees of all body kinds with at most eight joints, as the unrolled series takes them."""
    trees = (random_tree(seed, bodies=2 + seed % 5) for seed in range(1000))
    return [tree for tree, _ in zip((tree for tree in trees if tree.joint_count <= 8), range(count))]


@pytest.mark.parametrize('chain', small_trees(40), ids=lambda chain: chain.name)
def test_unrolled_series_is_the_twin_of_the_recursive_one(chain):
    """Coefficients enter the state after a step; both sum them in another order, so bits differ and nothing more."""
    effort = np.linspace(-1.0, 1.0, chain.joint_count)
    states = []
    for dense in (True, False):
        made = stepper(chain, 16, dense=dense, tick=0.02)
        assert made.advance(10, effort, None) is None
        states.append(np.concatenate([made.position, made.velocity]))
    scale = np.abs(states[1]).max() + 1.0
    # 0.2 s of a motion that is not chaotic in that time: round-off grows by the conditioning of H alone
    condition = np.linalg.cond(pcs.mass_matrix(chain, initial_state(chain)[0]))
    assert np.abs(states[0] - states[1]).max() < 50.0 * condition * np.finfo(float).eps * scale


@pytest.mark.parametrize('order, steps', [(4, 32), (6, 16), (8, 16), (10, 4)])
@pytest.mark.parametrize('dense', [True, False])
def test_measured_order(order, steps, dense):
    """Error after fixed steps, as coarse as round-off asks for, falls with the order of the series; within 0.2."""
    chain = random_tree(3, bodies=4)
    exact = stepper(chain, 24, 1e-17, tick=0.5)
    exact.advance(1, None, None)
    errors = []
    for count in (steps, 2 * steps):
        made = stepper(chain, order, fixed=0.5 / count, dense=dense, tick=0.5)
        made.advance(1, None, None)
        errors.append(np.abs(np.concatenate([made.velocity - exact.velocity, made.position - exact.position])).max())
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.2, errors


def test_closed_form_of_a_free_sliding_mass_and_a_damped_wheel():
    """Oracle: constant force, x = u t^2 / 2 m; damped wheel, w = u / d (1 - exp(-d t / J))."""
    chain = pcs.chain_from_dict({'name': 'two', 'gravity': [0, 0], 'bodies': [
        {'name': 'wheel', 'carrier': 'base', 'mass': 1.0, 'inertia': 0.5, 'rotation': {'joint': 'a', 'damping': 2.0}},
        {'name': 'cart', 'carrier': 'base', 'mass': 2.0, 'inertia': 0.1, 'slide': {'joint': 'x', 'axis': 0.3}}]})
    simulation = pcs.Simulation(chain, 'taylor', tolerance=1e-14)
    simulation.advance_to(1.25, [3.0, 5.0])
    turned = 1.5 * (1.25 - 0.25 * (1.0 - np.exp(-5.0)))
    assert simulation.position == pytest.approx([turned, 5.0 * 1.25**2 / 4.0], rel=1e-13)
    assert simulation.velocity == pytest.approx([1.5 * (1.0 - np.exp(-5.0)), 5.0 * 1.25 / 2.0], rel=1e-13)


def test_energy_of_a_double_pendulum_stays_at_round_off_for_1000_s():
    """Brouwer's law leaves 1e-14 of its range of 29.67 J; a drift in one direction would leave 1e-12."""
    chain = TWO_RODS
    simulation = pcs.Simulation(chain, 'taylor', 1.0, tolerance=1e-17)
    start = sum(pcs.energy(chain, simulation.position, simulation.velocity))
    drift = []
    for _ in range(1000):
        simulation.advance(1)
        drift.append(abs(sum(pcs.energy(chain, simulation.position, simulation.velocity)) - start) / 29.67)
    assert max(drift) < 1e-13
    assert simulation.statistics['steps'] < 100_000


def test_ticks_are_read_off_the_same_steps_however_the_run_is_cut():
    chain = pcs.load_chain('four_link_robot.yaml')
    whole = pcs.rollout(chain, 0.4, method='taylor')
    cut = pcs.Simulation(chain, 'taylor')
    for ticks in (1, 2, 30, 67, 300):
        cut.advance(ticks)
        assert cut.position.tobytes() == whole.position[cut.tick].tobytes()
        assert cut.velocity.tobytes() == whole.velocity[cut.tick].tobytes()
    assert cut.statistics['steps'] < 40, 'steps go across ticks'


def test_a_changed_effort_begins_anew_and_an_equal_one_does_not():
    chain = pcs.load_chain('four_link_robot.yaml')
    held, repeated, changed = (pcs.Simulation(chain, 'taylor') for _ in range(3))
    held.advance(100, np.full(5, 0.5))
    repeated.advance(100, np.full((100, 5), 0.5))
    efforts = np.full((100, 5), 0.5)
    efforts[50:, 0] = 0.75
    changed.advance(100, efforts)
    assert repeated.position.tobytes() == held.position.tobytes()
    assert repeated.statistics == held.statistics
    assert changed.statistics['steps'] > held.statistics['steps']
    by_rk4 = pcs.Simulation(chain, 'rk4')
    by_rk4.advance(100, efforts)
    assert changed.position == pytest.approx(by_rk4.position, abs=1e-9)  # the error of rk4


def test_advance_to_lands_between_ticks_and_rejoins_them():
    chain = pcs.load_chain('four_link_robot.yaml')
    whole, simulation = pcs.Simulation(chain, 'taylor'), pcs.Simulation(chain, 'taylor')
    whole.advance(100)
    simulation.advance_to(0.0305)
    assert (simulation.time, simulation.tick) == (0.0305, 30)
    saved = simulation.checkpoint()
    fine = pcs.Simulation(chain, 'taylor', 0.0005)
    fine.advance(61)
    assert simulation.position == pytest.approx(fine.position, abs=1e-15)
    simulation.advance_to(0.1)
    assert simulation.time == 0.1 and simulation.position.tobytes() == whole.position.tobytes()
    other = pcs.Simulation(chain, 'taylor')
    other.restore(saved)
    assert other.time == 0.0305
    other.advance(70)
    assert other.tick == 100 and other.position.tobytes() == whole.position.tobytes()
    for time, effort in ((0.05, None), (float('nan'), None), (0.2005, np.zeros((100, 5)))):
        with pytest.raises(ValueError):
            simulation.advance_to(time, effort)
    assert simulation.time == 0.1


def test_a_state_that_runs_away_stops_at_the_last_good_tick_however_it_is_cut():
    """A spring that pushes outwards is no chain file; a huge effort on a light link runs away as well."""
    chain = TWO_RODS
    states = []
    for ticks in (1, 1000):
        simulation = pcs.Simulation(chain, 'taylor')
        simulation.set_state([0.0, 0.0], [1e150, 0.0])
        with pytest.raises(pcs.SimulationError):
            for _ in range(1000 // ticks):
                simulation.advance(ticks, [1e300, 0.0])
        assert np.isfinite(simulation.position).all() and np.isfinite(simulation.velocity).all()
        states.append((simulation.tick, simulation.position.tobytes()))
    assert states[0] == states[1]


@pytest.mark.parametrize('tolerance', [0.0, -1.0, 1.0, float('nan'), 'small', True])
def test_tolerances_that_make_no_sense_are_refused(tolerance):
    for method in ('auto', 'taylor'):
        with pytest.raises(ValueError, match='tolerance is'):
            pcs.Simulation(TWO_RODS, method, tolerance=tolerance)


@pytest.mark.parametrize('damping, method', [(0.0, 'taylor'), (100.0, 'taylor'), (1e4, 'rodas5p')])
def test_auto_takes_the_method_for_stiff_joints_where_damping_is_stiff(damping, method):
    chain = replace(TWO_RODS, bodies=tuple(
        replace(body, rotation=replace(body.rotation, damping=damping)) for body in TWO_RODS.bodies))
    simulation = pcs.Simulation(chain)
    assert simulation.method == method and f'method {method} (auto: ' in simulation.plan
    fastest = np.linalg.eigvals(np.linalg.solve(pcs.mass_matrix(chain, simulation.position), damping * np.eye(2))).max()
    assert damping_rate(chain) == pytest.approx(fastest, rel=0.05, abs=1e-12)
    simulation.advance(200)
    assert simulation.statistics['steps'] < 600


@pytest.mark.parametrize('links', [1, 2, 3, 12])
def test_terms_that_vanish_by_symmetry_do_not_lengthen_a_step(links):
    """Straight, across and at rest only every fourth term is there; a little off it, the others are small."""
    for power in range(2, 17):
        for off in (0.0, 1e-6):
            simulation = pcs.Simulation(uniform_rods(links), 'taylor', tolerance=10.0**-power)
            simulation.set_state([off] + [0.0] * (links - 1), np.zeros(links))
            before = sum(pcs.energy(simulation.chain, simulation.position, simulation.velocity))
            simulation.advance(1000)
            after = sum(pcs.energy(simulation.chain, simulation.position, simulation.velocity))
            assert abs(after - before) < 10.0 * 10.0**-power + 1e-13
