"""Runs that end early: a state that diverges, a singular configuration."""
from dataclasses import replace
import warnings

import numpy as np
from oracles.random_trees import one_joint
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.benchmark.scenes import coarse_steps
from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain.tree import Body, Joint


@pytest.mark.filterwarnings('ignore:step is')
def test_a_run_away_state_stops_at_the_last_good_one():
    """A step far beyond what RK4 can hold: the energy explodes, and the state kept is the one before a wild step."""
    chain = one_joint(inertia=1.0, stiffness=1e4, position=1e-6)
    simulation, same = pcs.Simulation(chain, 'rk4', 0.1), pcs.Simulation(chain, 'rk4', 0.1)
    with pytest.raises(pcs.SimulationError, match="joint 'joint' of body 'body' of one at tick .*half steps") as caught:
        simulation.advance(100_000)
    error = caught.value
    assert error.tick == simulation.tick > 0 and error.time == simulation.time and error.joint == 'joint'
    assert simulation.statistics['evaluations'] == 4 * (error.tick + 1)     # those of the failed step are counted, too
    assert abs(simulation.position[0]) < 10.0
    assert np.isfinite(simulation.position).all() and error.position.tobytes() == simulation.position.tobytes()
    same.advance(error.tick)
    assert same.position.tobytes() == simulation.position.tobytes()
    simulation.set_state([0.0], [0.0])
    simulation.advance(1)                       # it still answers


@pytest.mark.parametrize('laws, step, position, velocity', [
    ({'damping': 4.0}, 1.0, -1.79e308, 1e306),            # the sum of stages overflows: the position alone
    ({'stiffness': 1e4}, 1e-3, 1.7e304, 1.2e306),         # the spring does, in the last stage: the velocity alone
])
def test_either_half_of_the_state_can_run_away(laws, step, position, velocity):
    simulation = pcs.Simulation(one_joint(inertia=1.0, **laws), 'rk4', step)
    simulation.set_state([position], [velocity])
    with pytest.raises(pcs.SimulationError, match="joint 'joint' of body 'body' of one at tick 0, .*ran away"):
        simulation.advance(1)
    assert (simulation.position.tolist(), simulation.velocity.tolist()) == ([position], [velocity])


@pytest.mark.parametrize('first', ['turn', 'slide'])
def test_a_run_away_is_not_taken_for_a_singular_configuration(first):
    """Its squares overflow in the pivot of the arm, or its angle is infinite, before the state itself is."""
    laws = {'turn': {}, 'slide': {}, first: {'stiffness': 1e7, 'position': 1e160 if first == 'slide' else 1e308}}
    simulation = pcs.Simulation(Chain('arm', 0j, (
        Body('arm', -1, 0j, 0.0, 1.0, 0.5 + 0j, 1.0, 0.75, None, Joint('turn', 'rotation', 1.0, **laws['turn'])),
        Body('hand', 0, 1 + 0j, 0.0, 1.0, 0.5 + 0j, 1.0, 0.75, Joint('slide', 'slide', 0.0, **laws['slide']),
             Joint('wrist', 'rotation', 1.0)))), 'rk4', 0.1)
    with pytest.raises(pcs.SimulationError, match='of arm at tick .*ran away'):
        simulation.advance(100_000)


def test_a_singular_configuration_on_the_way_stops_the_run():
    chain = Chain('collinear', 0j, (
        Body('link', -1, 0j, 0.0, 0.0, 0j, 0.0, 0.0, None, Joint('shoulder', 'rotation', 1.0)),
        Body('bob', 0, 1 + 0j, 0.0, 1.0, 1 + 0j, 1.0, 0.0, None, Joint('elbow', 'rotation', 1.0))))
    simulation = pcs.Simulation(chain)
    with pytest.raises(pcs.SimulationError, match="joint 'shoulder' of body 'link' of collinear at tick 0, .*singular"):
        simulation.advance(1)
    assert simulation.tick == 0 and simulation.position.tolist() == [0.0, 0.0]


@pytest.mark.parametrize('method, step, chain', [
    ('rk4', 0.1, 'double_pendulum'), ('semi_implicit_euler', 0.01, 'double_pendulum'), ('rk4', 0.01, 'seven_link_arm'),
    ('dop853_fixed', 0.1, 'double_pendulum'), ('rk4', 0.01, 'seven_link_arm with stops')])
def test_a_fixed_step_that_is_far_from_right_is_warned_of_once(method, step, chain):
    """All of these end off by 0.1 rad or more after two seconds, and none is unstable."""
    made = pcs.load_chain(f"{chain.removesuffix(' with stops')}.yaml")
    if 'stops' in chain:
        made = replace(made, bodies=tuple(replace(body, rotation=replace(body.rotation, upper=50.0))
                                          for body in made.bodies))
    simulation = pcs.Simulation(made, method, step)
    told = f"^step is {step} s, too long for method '{method}': at tick .* is off by about .* at joint '"
    with pytest.warns(RuntimeWarning, match=told):
        simulation.advance(round(2.0 / step))
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        simulation.advance(1)   # once


@pytest.mark.parametrize('method, step', [('rk4', 1e-3), ('dop853_fixed', 1e-2), ('semi_implicit_euler', 1e-3)])
def test_an_exact_step_has_no_warning_and_checks_change_no_bit(method, step):
    """Where the check falls, the bits are those of calls that begin there."""
    chain = pcs.load_chain('four_link_robot.yaml')
    simulation, again = pcs.Simulation(chain, method, step), pcs.Simulation(chain, method, step)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        simulation.advance(600)
    for _ in range(600):
        again.advance(1)
    assert simulation.position.tobytes() == again.position.tobytes()
    assert simulation.statistics['steps'] == 600


@pytest.mark.parametrize('method, step', [('rk4', 0.01), ('gauss6', 10.0 / 178), ('dop853_fixed', 0.05)])
def test_small_errors_that_chaos_makes_large_are_warned_of_however_calls_are_cut(method, step):
    """All of these end off by 0.1 rad or more after ten seconds, and no step alone is far off."""
    texts = []
    for cut in (round(10.0 / step), 1):
        simulation = pcs.Simulation(pcs.load_chain('double_pendulum.yaml'), method, step)
        with pytest.warns(RuntimeWarning, match='at tick .* the errors of all steps have added up') as told:
            for _ in range(round(10.0 / step) // cut):
                simulation.advance(cut)
        texts += [str(warning.message) for warning in told]
    assert len(texts) == 2 and texts[0] == texts[1]


def test_steps_on_random_arms_are_right_or_warned_of():
    """Some of each chain, among them joints so stiff that longer steps would run away; all in the benchmark."""
    counts = {'double_pendulum': 3, 'four_link_robot': 2, 'seven_link_arm': 1, 'cart_arm_telescope': 3}
    runs = [run for chain, *start in coarse_steps.arms(counts) for step in (0.002, 0.01, 0.05)
            for run in coarse_steps.found(chain, start, step)]
    assert [run.what for run in runs if not (run.told or run.end <= 0.1)] == []
    assert [run.what for run in runs if run.largest <= 1e-3 and run.told] == []
    assert sum(run.told for run in runs) > 40 and sum(run.largest <= 1e-3 for run in runs) > 40


def test_the_error_estimate_changes_no_bit():
    """A batch has no warnings and no error estimate: the same bits, the starting values of gauss6 included."""
    chain, (position, velocity) = pcs.load_chain('four_link_robot.yaml'), np.zeros((2, 5))
    position = np.array([0.0, 0.3, -0.2, 0.1, 0.4])
    for method, step in (('gauss6', 0.01), ('rk4', 0.004)):
        simulation = pcs.Simulation(chain, method, step)
        simulation.set_state(position, velocity)
        simulation.advance(500)
        batch = pcs.rollout_batch(chain, position[None], duration=500 * step, step=step, method=method)
        assert batch.position[0, -1].tobytes() == simulation.position.tobytes()


def test_a_violent_step_ends_a_scene_of_a_batch_as_it_ends_a_run():
    chain = pcs.load_chain('seven_link_arm.yaml')
    position = np.random.default_rng(5).normal(0.0, 1.0, (9, 7))
    batch = pcs.rollout_batch(chain, position, duration=3.0, step=0.05, method='rk4')
    ends = []
    for start in position:
        simulation = pcs.Simulation(chain, 'rk4', 0.05)
        simulation.set_state(start, np.zeros(7))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')
                simulation.advance(60)
            ends.append(None)
        except pcs.SimulationError as error:
            ends.append(error.tick)
    assert any(ends)
    assert [batch.failures[k].tick if k in batch.failures else None for k in range(9)] == ends
