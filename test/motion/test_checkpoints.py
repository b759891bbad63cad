"""Checkpoints and copies: what they hold, where they can be restored, and what is refused."""
import copy
from dataclasses import replace
import pickle

import numpy as np
from oracles.border_fuzz import FRICTION, sum_of_bits
import pytest

import planar_chain_sim as pcs
from planar_chain_sim import _kernel
from planar_chain_sim.chain.quantities import changed_chain
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.motion.integrators import method_data
from planar_chain_sim.recording.events import apply_event

TWO_RODS = pcs.load_chain('double_pendulum.yaml')
ROBOT = pcs.load_chain('four_link_robot.yaml')
ADAPTIVE = [name for name, row in pcs.METHODS.items() if row.adaptive]
COPIES = (copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one)))


def bits(simulation):
    """Return all results of a simulation."""
    return (simulation.tick, simulation.time, *(getattr(simulation, name).tobytes() for name in (
        'position', 'velocity', 'effort', 'acceleration', 'wrench_effort')), simulation.statistics, simulation.plan,
        simulation.payloads)


def state_of(simulation):
    return [part.tobytes() for part in simulation.checkpoint().state]


@pytest.mark.parametrize('into', pcs.METHODS)
@pytest.mark.parametrize('method', pcs.METHODS)
@pytest.mark.parametrize('chain', [TWO_RODS, FRICTION], ids=lambda chain: chain.name)
def test_another_method_starts_anew_at_the_same_time_from_the_same_state(chain, method, into):
    """Twin: the same checkpoint without what the method keeps."""
    going = pcs.Simulation(chain, method)
    going.advance(37)
    saved, other = going.checkpoint(), pcs.Simulation(chain, into)
    other.advance(5)
    other.restore(saved)
    assert (other.tick, other.time) == (37, 0.037)
    assert state_of(other)[:5] == state_of(going)[:5]
    twin = pcs.Simulation(chain, into)
    twin.restore(replace(twin.checkpoint(), tick=37, state=(*saved.state[:5], twin.checkpoint().state[5])))
    for simulation in (twin, other, going):
        simulation.advance(40)
    assert state_of(other) == state_of(going if into == method else twin)
    assert np.abs(other.position - going.position).max() < 1e-2


@pytest.mark.parametrize('into', pcs.METHODS)
@pytest.mark.parametrize('method', pcs.METHODS)
def test_another_step_keeps_the_time_or_is_refused(method, into):
    going = pcs.Simulation(TWO_RODS, method, 1e-3)
    going.advance(40)
    other = pcs.Simulation(TWO_RODS, into, 1e-2)
    other.restore(going.checkpoint())
    assert (other.tick, other.time) == (4, 0.04)
    assert state_of(other)[:5] == state_of(going)[:5]
    going.advance(7)
    if into in ADAPTIVE:
        other.restore(going.checkpoint())
        assert (other.tick, other.time) == (4, 0.047)
        other.advance_to(0.047)
        assert state_of(other)[:4] == state_of(going)[:4]
        other.advance(1)
        going.advance_to(0.05)
        assert other.time == 0.05 and np.abs(other.position - going.position).max() < 1e-3
    else:
        before = state_of(other)
        with pytest.raises(ValueError, match='time of the checkpoint is 0.047 s, must be a whole number >= 0 of steps'):
            other.restore(going.checkpoint())
        assert state_of(other) == before and other.tick == 4


def test_another_tolerance_or_form_starts_anew():
    for settings in ({'tolerance': 1e-6}, {'form': 'recursive'}):
        going, other = pcs.Simulation(TWO_RODS, 'taylor', 0.01), pcs.Simulation(TWO_RODS, 'taylor', 0.01, **settings)
        going.advance(5)
        other.restore(going.checkpoint())
        kept = other.checkpoint().state[5]
        assert other.time == 0.05 and kept.size < going.checkpoint().state[5].size, 'no step is under way'
        other.advance(1)


def test_between_two_ticks_goes_into_an_adaptive_method_only():
    going = pcs.Simulation(TWO_RODS, 'taylor', 0.01)
    going.advance_to(0.0355)
    other = pcs.Simulation(TWO_RODS, 'dop853', 0.01)
    other.restore(going.checkpoint())
    assert (other.tick, other.time) == (3, 0.0355)
    with pytest.raises(ValueError, match='time of the checkpoint is 0.0355 s'):
        pcs.Simulation(TWO_RODS, 'rk4', 0.01).restore(going.checkpoint())


@pytest.mark.parametrize('chain', [TWO_RODS, FRICTION], ids=lambda chain: chain.name)
@pytest.mark.parametrize('method', ADAPTIVE)
def test_between_two_ticks_may_be_at_the_second(method, chain):
    """Then the next tick takes no time, and the method has not yet made any step."""
    other, going = pcs.Simulation(chain, method, 0.01), pcs.Simulation(chain, 'rk4', 0.01)
    going.advance(3)
    other.restore(replace(going.checkpoint(), between=4 * 0.01))
    other.advance(1)
    assert other.tick == 4 and other.position.tobytes() == going.position.tobytes()
    other.advance(1)
    going.advance(1)
    assert other.tick == 5 and np.abs(other.position - going.position).max() < 1e-6


def test_another_chain_is_refused_and_a_changed_one_is_taken():
    heavier = ROBOT.with_parameters({f'{ROBOT.bodies[0].name}.mass': 2.5})
    saved = pcs.Simulation(heavier).checkpoint()
    simulation = pcs.Simulation(ROBOT)
    simulation.advance(3)
    before = bits(simulation)
    with pytest.raises(ValueError, match='checkpoint is of the chain .* they differ in more than payloads, gravity'):
        simulation.restore(saved)
    assert bits(simulation) == before
    changed = pcs.Simulation(changed_chain(ROBOT, 'gravity', [0.0, -1.6]))
    changed.attach(ROBOT.bodies[-1].name, 0.5)
    changed.set_wrench(ROBOT.bodies[-1].name, (1.0, 0.0))
    changed.advance(10)
    simulation.restore(changed.checkpoint())
    assert simulation.payloads == ('payload',) and simulation.wrenches == changed.wrenches
    for each in (simulation, changed):
        each.advance(20)
    assert state_of(simulation) == state_of(changed)
    simulation = pcs.Simulation(ROBOT)
    start = simulation.checkpoint()
    simulation.replace_chain(heavier)
    simulation.restore(start)   # of a chain that it has had
    assert simulation.chain == ROBOT


@pytest.mark.parametrize('damage, message', [
    ({'format': 1}, 'has the format 1, must have 2'), ({'format': None}, 'has the format None'),
    ({'chain': None}, 'it lacks its chain'), ({'wrenches': None}, 'it lacks its chain or its wrenches'),
    ({'tick': -1}, 'its tick is -1'), ({'tick': 2**60}, 'its tick is 1152'), ({'tick': 5.0}, 'its tick is 5.0'),
    ({'tick': 2**52}, 'its steps cannot be'), ({'tick': 0}, 'its steps cannot be'),
    ({'between': 1.0}, 'its time between two ticks is 1.0'), ({'between': np.nan}, 'its time between'),
    ({'step': 0.0}, 'its step is 0.0'), ({'step': 'x'}, "its step is 'x'"), ({'own_bodies': None}, 'bodies that are'),
    ({'state': ()}, 'its state cannot be'), ({'state': None}, 'its state cannot be'),
    ({'wrenches': {'nobody': None}}, 'its wrenches cannot be'),
])
def test_a_damaged_checkpoint_is_one_sentence_and_changes_nothing(damage, message):
    simulation = pcs.Simulation(TWO_RODS, 'taylor')
    simulation.advance(7)
    saved = simulation.checkpoint()
    simulation.advance(30)
    before = bits(simulation)
    with pytest.raises(ValueError, match=message):
        simulation.restore(replace(saved, **damage))
    with pytest.raises(ValueError, match='must be what Simulation.checkpoint returned'):
        simulation.restore(vars(saved))
    assert bits(simulation) == before


@pytest.mark.parametrize('method', pcs.METHODS)
@pytest.mark.parametrize('chain', [TWO_RODS, FRICTION], ids=lambda chain: chain.name)
def test_whatever_number_of_a_state_is_damaged_it_is_refused_or_harmless(chain, method):
    """Also with a sum that is right again: the kernel judges each number, and where the steps lead."""
    simulation = pcs.Simulation(chain, method)
    simulation.advance(8)
    saved, before = simulation.checkpoint(), state_of(simulation)
    parts = saved.state

    def with_part(k, part):
        return replace(saved, state=(*parts[:k], part, *parts[k + 1:]))
    for k, part in enumerate(parts):
        for bad in (part[:-1], np.append(part, 0.0), part.astype(np.float32), part.tolist(), part[:, None],
                    part * np.nan, np.full(part.shape, np.inf)):
            with pytest.raises(ValueError, match='checkpoint is damaged: its '):
                simulation.restore(with_part(k, bad))
    steps, refused = parts[5], 0
    for at in range(len(steps) - 1):
        for value in (0.0, 1.0, 2.0, 4.0, -1.0, 0.5, 1e18, 1e300, np.nan, steps[at] * (1.0 + 1e-9) + 1e-300):
            damaged = steps.copy()
            damaged[at] = value
            if damaged.tobytes() == steps.tobytes():
                continue
            with pytest.raises(ValueError, match='its steps cannot be'):
                simulation.restore(with_part(5, damaged))
            assert state_of(simulation) == before
            damaged[-1] = sum_of_bits(damaged[:-1])
            try:
                simulation.restore(with_part(5, damaged))
                simulation.advance(2)
            except (ValueError, pcs.SimulationError):
                refused += 1
            simulation.restore(saved)
            assert state_of(simulation) == before
    assert refused > 0
    for length in range(len(steps)):
        cut = np.append(steps[:length], sum_of_bits(steps[:length]))
        if cut.tobytes() != steps.tobytes():
            with pytest.raises(ValueError, match='its steps cannot be'):
                simulation.restore(with_part(5, cut))


@pytest.mark.parametrize('method', pcs.METHODS)
def test_positions_of_standing_joints_and_remainders_of_sums_are_checked(method):
    simulation = pcs.Simulation(FRICTION, method)
    for _ in range(3000):
        simulation.advance(1)
        saved = simulation.checkpoint()
        position, velocity, *left, effort, steps = saved.state
        if steps[10] == 1.0:   # after format, kind, whether under way, and efforts: whether each stands, and its sign
            break
    assert velocity[2] == 0.0
    elsewhere, moving, excess = position.copy(), velocity.copy(), steps.copy()
    elsewhere[2] += 1e-13
    moving[2] = 1e-13
    excess[14] = -1.0
    excess[-1] = sum_of_bits(excess[:-1])
    for damaged, word in [((elsewhere, velocity, *left, effort, steps), 'steps'),
                          ((position, moving, *left, effort, steps), 'steps'),
                          ((position, velocity, *left, effort, excess), 'steps'),
                          ((position, velocity, left[0] + 1e-3, left[1], effort, steps), 'position remainder'),
                          ((position, velocity, left[0], left[1] + 1e-3, effort, steps), 'velocity remainder')]:
        with pytest.raises(ValueError, match=f'checkpoint is damaged: its {word} cannot be what was saved'):
            simulation.restore(replace(saved, state=damaged))
        assert state_of(simulation) == [part.tobytes() for part in saved.state]


@pytest.mark.parametrize('copied', COPIES, ids=['copy', 'deepcopy', 'pickle'])
@pytest.mark.parametrize('method', pcs.METHODS)
@pytest.mark.parametrize('chain', [ROBOT, FRICTION], ids=lambda chain: chain.name)
def test_a_copy_is_equal_and_independent(chain, method, copied):
    simulation = pcs.Simulation(chain, method)
    simulation.note = ['mine']
    effort = np.linspace(0.3, -0.2, chain.joint_count)
    simulation.advance(20, effort)
    apply_event(simulation, 'payload', {'name': 'load', 'body': chain.bodies[-1].name, 'mass': 0.25,
                                        'position': [0.1, 0.0], 'inertia_com': 0.0})
    simulation.set_wrench(chain.bodies[-1].name, (2.0, 1.0), 0.5, 'world')
    simulation.advance(20, effort)
    if pcs.METHODS[method].adaptive:
        simulation.advance_to(0.0404, effort)
    twin = copied(simulation)
    assert bits(twin) == bits(simulation) and state_of(twin) == state_of(simulation) and twin.note == ['mine']
    before = bits(simulation)
    twin.advance(30, effort)
    assert bits(simulation) == before, 'independent'
    simulation.advance(30, effort)
    assert bits(twin) == bits(simulation) and state_of(twin) == state_of(simulation)
    assert twin.take_events() == simulation.take_events()
    twin.drop('load')
    twin.clear_wrenches()
    assert simulation.payloads == ('load',) and simulation.wrenches


def test_a_name_that_is_no_family_is_an_error():
    assert {row.family for row in pcs.METHODS.values()} == set(_kernel.FAMILIES)
    with pytest.raises(ValueError, match="family 'nonsense' is none of FAMILIES"):
        _kernel.MethodData('nonsense', 4, False, 0.0)
    with pytest.raises(ValueError, match="family of method 'rk4' is 'nonsense', must be one of 'explicit Runge-Kutta'"):
        replace(pcs.METHODS['rk4'], family='nonsense')


@pytest.mark.parametrize('word, settings', [
    ('order', {'order': 0}), ('order', {'order': 31}), ('order', {'family': 'taylor', 'order': 5}),
    ('fixed', {'fixed': -1.0}), ('fixed', {'fixed': np.nan}), ('tolerance', {'tolerance': 0.0}),
    ('tolerance', {'tolerance': 1.0}), ('tolerance', {'tolerance': np.nan}), ('gamma', {'gamma': 0.0}),
    ('gamma', {'gamma': np.inf}), ('stages', {'stages': 65}), ('tableau', {'stages': -1}), ('tableau', {'stages': 3}),
    ('tableau', {'a': [np.nan] * 4}), ('tableau', {'a': [0.0] * 3}), ('tableau', {'b': [1.0]}),
    ('tableau', {'error': []}), ('tableau', {'c': [0.0]}), ('tableau', {'interpolation': [0.0] * 3}),
    ('tableau', {'interpolation': [0.0] * 2}), ('adaptive', {'adaptive': False}),
    ('adaptive', {'family': 'Gauss'}), ('adaptive', {'family': 'semi-implicit'}),
    ('tableau', {'family': 'Gauss', 'adaptive': False, 'a': []}),
    ('tableau', {'family': 'explicit Runge-Kutta', 'adaptive': False, 'a': [0.0, 1.0, 0.0, 0.0]}),
    ('tableau', {'family': 'explicit Runge-Kutta', 'error': [0.0] * 3, 'interpolation_a': [0.0] * 5}),
    ('tableau', {'family': 'explicit Runge-Kutta', 'error': [0.0] * 2}),
    ('tableau', {'family': 'explicit Runge-Kutta', 'error': [0.0] * 3, 'interpolation': [0.0] * 4}),
])
def test_numbers_of_a_method_that_do_not_fit_each_other_make_no_stepper(word, settings):
    """Each differs a little from an accepted one: the kernel computes from these numbers where it reads rows."""
    good = {'stages': 2, 'a': [0.0, 0.0, 1.0, 0.0], 'b': [0.5, 0.5], 'error': [0.0] * 2, 'interpolation_a': [],
            'interpolation': [0.0] * 4, 'c': [0.0] * 4, 'gamma': 0.3}
    method = {'family': 'Rosenbrock', 'order': 6, 'adaptive': True, 'tolerance': 1e-6, 'fixed': 0.0}

    def make(**changes):
        tableau = _kernel.Tableau(*(changes.get(name, value) for name, value in good.items()))
        data = _kernel.MethodData(*(changes.get(name, value) for name, value in method.items()), tableau)
        return _kernel.Stepper(plan_of(TWO_RODS).model, data, 1e-3, False)
    make()
    with pytest.raises(ValueError, match=f'the kernel got a method with a bad {word}'):
        make(**settings)
    for step in (0.0, -1e-3, np.nan, np.inf):
        with pytest.raises(ValueError, match='the kernel got a bad step'):
            _kernel.Stepper(plan_of(TWO_RODS).model, method_data(pcs.METHODS['rk4'], None), step, False)


@pytest.mark.parametrize('method', pcs.METHODS)
@pytest.mark.parametrize('chain', [TWO_RODS, FRICTION], ids=lambda chain: chain.name)
def test_set_state_restarts_the_method(chain, method):
    """Twin: one that has not moved before."""
    going, twin = pcs.Simulation(chain, method), pcs.Simulation(chain, method)
    going.advance(37)
    for simulation in (going, twin):
        simulation.set_state(np.full(chain.joint_count, 0.3), np.full(chain.joint_count, -0.2))
        simulation.advance(40)
    assert going.tick == twin.tick + 37 and going.position.tobytes() == twin.position.tobytes()
    assert going.velocity.tobytes() == twin.velocity.tobytes()
