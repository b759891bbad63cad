"""Chains that change while they move: only the change has an effect, a log repeats it, and energy is balanced."""
from dataclasses import replace
from math import inf

import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain.quantities import changed_chain, QUANTITIES, to_json
from planar_chain_sim.motion.energy_balance import EnergyBalance, ROWS
from planar_chain_sim.recording.events import apply_event
from planar_chain_sim.resimulation import command_line as resimulation

ROBOT = pcs.load_chain('four_link_robot.yaml')
EFFORT = np.array([10.0, -1.0, 0.5, 0.2, -0.2])
SOFT = [1.0, 0.5, 0.25, 0.125, 0.0625]


def test_quantities_replace_what_they_name_alone():
    for name, quantity in QUANTITIES.items():
        values = [float(k + 1) for k in range(len(quantity.get(ROBOT)))]
        changed = changed_chain(ROBOT, name, values)
        assert quantity.get(changed) == values
        assert changed_chain(changed, name, quantity.get(ROBOT)) == ROBOT
    assert changed_chain(ROBOT, 'damping', SOFT).joints[3] == replace(ROBOT.joints[3], damping=0.125)
    assert to_json([inf, 1]) == [None, 1.0]


@pytest.mark.parametrize('method', pcs.METHODS)
def test_a_changed_chain_goes_on_from_the_same_state(method):
    """Twin: a simulation of the other chain, given the state with its hidden terms by a checkpoint."""
    other = changed_chain(ROBOT, 'gravity', [1.0, -3.0])
    simulation, twin = pcs.Simulation(ROBOT, method), pcs.Simulation(other, method)
    simulation.advance(50, EFFORT)
    *state, _ = simulation.checkpoint().state
    before = simulation.statistics
    simulation.replace_chain(other)
    assert simulation.tick == 50 and simulation.chain is other and simulation.statistics == before
    assert simulation.effort.tolist() == EFFORT.tolist()
    twin.restore(replace(twin.checkpoint(), tick=50, state=(*state, twin.checkpoint().state[-1])))
    for run in (simulation, twin):
        run.advance(100, EFFORT)
    assert simulation.position.tobytes() == twin.position.tobytes()
    assert simulation.velocity.tobytes() == twin.velocity.tobytes()
    unchanged = pcs.Simulation(ROBOT, method)
    unchanged.advance(150, EFFORT)
    assert abs(unchanged.position - simulation.position).max() > 1e-3
    assert simulation.statistics['evaluations'] > before['evaluations']


@pytest.mark.parametrize('method', [name for name, method in pcs.METHODS.items() if not method.adaptive])
def test_the_same_chain_again_changes_no_bit(method):
    simulation, twin = pcs.Simulation(ROBOT, method), pcs.Simulation(ROBOT, method)
    simulation.advance(50, EFFORT)
    simulation.replace_chain(changed_chain(ROBOT, 'damping', QUANTITIES['damping'].get(ROBOT)))
    simulation.advance(50, EFFORT)
    twin.advance(100, EFFORT)
    assert simulation.position.tobytes() == twin.position.tobytes()


def test_what_cannot_be_changed_is_refused_and_nothing_moves():
    simulation = pcs.Simulation(ROBOT)
    simulation.advance(10)
    position = simulation.position
    with pytest.raises(ValueError, match="chain 'double_pendulum' has other joints than 'four_link_robot'"):
        simulation.replace_chain(pcs.load_chain('double_pendulum.yaml'))
    with pytest.raises(ValueError, match='has 1 values, must have 2'):
        apply_event(simulation, 'parameter', {'name': 'gravity', 'value': [0.0]})
    assert simulation.chain is ROBOT and simulation.position.tobytes() == position.tobytes()


def test_effort_limits_act_from_their_tick_on():
    simulation = pcs.Simulation(ROBOT)
    simulation.advance(1, EFFORT)
    apply_event(simulation, 'parameter', {'name': 'effort_limit', 'value': [4.0, None, None, None, None]})
    assert simulation.effort[0] == 10.0
    simulation.advance(1, EFFORT)
    assert simulation.effort.tolist() == [4.0, *EFFORT[1:]]


@pytest.mark.parametrize('method', ['auto', 'rk4'])
def test_a_log_with_changes_runs_again(tmp_path, capsys, method):
    simulation, path = pcs.Simulation(ROBOT, method), tmp_path / 'run.mcap'
    changes = {40: ('gravity', [0.0, -1.62]), 90: ('damping', SOFT), 160: ('effort_limit', [0.5, inf, 0.5, 0.5, 0.5])}
    with pcs.OfflineLog(path, simulation) as log:
        for tick in range(300):
            if tick in changes:
                name, value = changes[tick]
                log.change('parameter', name=name, value=value)
            if tick == 200:   # a parameter of the node, which changes no motion
                log._write_event(tick, 'parameter', {'name': 'command_timeout', 'value': 0.5})
            log.advance(1, EFFORT)
    assert resimulation.main([str(path)]) == 0, capsys.readouterr()
    assert 'equal: 301 states' in capsys.readouterr().out


def balance_of(chain, method, step, ticks, effort=None):
    simulation = pcs.Simulation(chain, method, step)
    balance = EnergyBalance(chain, step, simulation.position, simulation.velocity)
    for _ in range(ticks):
        simulation.advance(1, effort)
        balance.add([simulation.position, simulation.velocity, simulation.effort])
    balance.fold()
    return balance


def test_energy_is_balanced_under_efforts_damping_and_springs():
    """Order: the damping's integral is the only thing not exact, its error falls with step^4 (slope within 0.3)."""
    effort = 3.0 * EFFORT
    errors = [abs(balance_of(ROBOT, 'auto', 1.0 / rate, rate, effort).error) for rate in (100, 200)]
    assert abs(np.log2(errors[0] / errors[1]) - 4.0) < 0.3, errors
    balance = balance_of(ROBOT, 'auto', 1e-3, 2 * ROWS + 7, effort)
    assert abs(balance.error) < 1e-7 * balance.size and balance.size > 1.0


def test_the_work_of_a_wrench_is_balanced():
    """Order 4 as above; the wrench on a body that slides and turns changes now and then, another stays."""
    def error(rate):
        simulation = pcs.Simulation(ROBOT, step=1.0 / rate)
        balance = EnergyBalance(ROBOT, simulation.step, simulation.position, simulation.velocity)

        def push(body, force, moment):
            simulation.set_wrench(body, force, moment)
            balance.push(body, force, moment)
        push(ROBOT.bodies[-1].name, [0.0, 9.0], -1.0)
        for tick in range(rate):
            if tick % (rate // 25) == 0:   # the same jumps at every rate
                push('column', [30.0 * np.cos(tick // (rate // 25)), 5.0], 2.0)
            simulation.advance(1)
            balance.add([simulation.position, simulation.velocity, simulation.effort])
        balance.fold()
        assert balance.size > 1.0
        return abs(balance.error) / balance.size
    errors = [error(rate) for rate in (200, 400)]
    assert abs(np.log2(errors[0] / errors[1]) - 4.0) < 0.3, errors
    assert error(2000) < 1e-9   # sums of more than one block


def test_a_new_balance_goes_on_with_the_wrenches_that_act():
    simulation = pcs.Simulation(ROBOT)
    balance = EnergyBalance(ROBOT, simulation.step, simulation.position, simulation.velocity)
    for tick in range(30):
        if tick == 10:   # not long before the chain is changed from outside
            simulation.set_wrench('column', [300.0, 5.0], 2.0)
            balance.push('column', [300.0, 5.0], 2.0)
        if tick == 15:
            simulation.replace_chain(changed_chain(ROBOT, 'gravity', [0.0, -3.0]))
            balance.restart(simulation.chain, simulation.position, simulation.velocity)
        simulation.advance(1)
        balance.add([simulation.position, simulation.velocity, simulation.effort])
    balance.fold()
    assert abs(balance.error) < 1e-9 * balance.size


def test_energy_without_a_source_is_detected():
    free = changed_chain(pcs.load_chain('double_pendulum.yaml'), 'damping', [0.0, 0.0])
    assert abs(balance_of(free, 'auto', 1e-3, 2000).error) < 1e-7 * balance_of(free, 'auto', 1e-3, 1).size
    crude = balance_of(free, 'semi_implicit_euler', 1e-2, 500)
    assert abs(crude.error) > 1e-4 * crude.size
