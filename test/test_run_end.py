"""What ends a run early: a state that runs away, a singular configuration."""
import numpy as np
import pytest
from random_trees import one_joint

import planar_chain_sim as pcs
from planar_chain_sim.chain import Body, Chain, Joint


def test_a_run_away_state_stops_at_the_last_good_one():
    """A step far beyond what RK4 can hold: the energy explodes, and the state kept is the one before infinity."""
    chain = one_joint(inertia=1.0, stiffness=1e4, position=1.0)
    simulation, same = pcs.Simulation(chain, 'rk4', 0.1), pcs.Simulation(chain, 'rk4', 0.1)
    with pytest.raises(pcs.SimulationError, match="joint 'joint' of body 'body' of one at tick .*ran away") as caught:
        simulation.advance(100_000)
    error = caught.value
    assert error.tick == simulation.tick > 0 and error.time == simulation.time and error.joint == 'joint'
    assert simulation.statistics['evaluations'] == 4 * (error.tick + 1)     # those of the step that failed are told too
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
    laws = {'turn': {}, 'slide': {}, first: {'stiffness': 1e7, 'position': 1.0}}
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
