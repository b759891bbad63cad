"""Arguments and results of Simulation and rollout, and what they refuse in one sentence."""
import copy

import numpy as np
from oracles.random_trees import random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.benchmark.problems import uniform_rods
from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain.tree import Body, Joint
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.motion.simulation import whole_ticks


def test_time_is_ticks_times_step_and_advance_to_lands_on_it():
    simulation = pcs.Simulation(uniform_rods(1), 'rk4', 1e-3)
    simulation.advance_to(5.0)
    assert (simulation.tick, simulation.time) == (5000, 5.0)
    for bad, message in [(4.0, 'must not lie before'), (5.0005, 'time is 5.0005 s, must be a whole number'),
                         (np.nan, 'time is nan s')]:
        with pytest.raises(ValueError, match=message):
            simulation.advance_to(bad)
    simulation.advance_to(5.0)
    simulation.advance(0)
    assert simulation.statistics == {'evaluations': 20000, 'steps': 5000, 'rejected_steps': 0, 'events': 0}
    simulation.set_state([0.1], [0.2])
    assert simulation.time == 5.0
    simulation.advance_to(5.25)
    assert simulation.tick == 5250


@pytest.mark.parametrize('arguments, message', [
    ({'method': 'rk5'}, "method is 'rk5', must be 'auto' or one of"),
    ({'method': {}}, "method is {}, must be 'auto' or one of"),
    ({'method': np.zeros(2)}, r"method is array\(\[0., 0.\]\), must be 'auto' or one of"),
    ({'step': 0.0}, 'step is 0.0, must be a positive'), ({'step': np.inf}, 'step is inf'),
    ({'step': '1'}, "step is '1'"),
    ({'method': 'rk4', 'tolerance': 1e-9}, "tolerance is 1e-09, must be None: method 'rk4' has a fixed step"),
    ({'form': 'reference'}, "form is 'reference', must be 'auto', 'dense' or 'recursive'"),
])
def test_bad_settings_are_one_sentence(arguments, message):
    with pytest.raises(ValueError, match=message):
        pcs.Simulation(uniform_rods(1), **arguments)


def test_bad_efforts_move_nothing():
    simulation = pcs.Simulation(uniform_rods(3))
    simulation.advance(10)
    before = simulation.position.tobytes()
    rows = np.zeros((5, 3))
    rows[4, 1] = np.nan
    for ticks, effort, message in [
            (5, rows, r'effort\[4, 1\] is nan'), (5, np.zeros(2), r'shape \(2,\), must have \(3,\)'),
            (4, np.zeros((5, 3)), r'shape \(5, 3\), must have \(4, 3\)'), (1, np.inf, 'effort has shape'),
            (-1, None, 'ticks is -1'), (1.5, None, 'ticks is 1.5')]:
        with pytest.raises(ValueError, match=message):
            simulation.advance(ticks, effort)
    assert simulation.position.tobytes() == before and simulation.tick == 10


@pytest.mark.parametrize('duration', [0.00055, -1.0, np.nan, np.inf])
def test_rollout_refuses_a_duration_that_is_no_whole_number_of_steps(duration):
    with pytest.raises(ValueError, match='must be a whole number >= 0 of steps'):
        pcs.rollout(uniform_rods(1), duration)


def test_whole_ticks_forgives_rounding_and_nothing_else():
    assert whole_ticks(0.0, 1e-3) == 0
    assert whole_ticks(10000000.006, 1e-3) == 10000000006       # ticks * step is one ulp beside it
    for duration in (1e-3 * (1 + 1e-6), 1e7 + 2e-8):
        with pytest.raises(ValueError, match='must be a whole number >= 0 of steps of 0.001 s'):
            whole_ticks(duration, 1e-3)
    assert whole_ticks(2.0**53 * 0.25, 0.25) == 2**53
    for duration, step in ((2.0**52, 0.25), (0.1, 1e-308), (np.float32(0.5), 2.0**-60)):
        with pytest.raises(ValueError, match=f'must be at most .* s: no more ticks of {step} s can be counted'):
            whole_ticks(duration, step)


def test_records_and_checkpoints_that_do_not_fit_are_refused():
    simulation = pcs.Simulation(uniform_rods(2))
    good = np.empty((3, 2))
    fixed = np.empty((3, 2))
    fixed.flags.writeable = False
    odd = np.zeros(49, dtype=np.uint8)[1:].view(np.float64).reshape(3, 2)
    for bad in (np.empty((2, 2)), np.empty((3, 2), dtype=np.float32), np.empty((2, 3)).T, fixed, odd):
        with pytest.raises(ValueError, match=r'must be C-ordered writeable float64 of shape \(3, 2\)'):
            simulation.advance(3, record=(good, good, bad))
    with pytest.raises(ValueError, match='checkpoint has 3 joints, must have 2'):
        simulation.restore(pcs.Simulation(uniform_rods(3)).checkpoint())
    assert simulation.tick == 0


def test_a_callable_cannot_reach_the_run_through_its_arguments():
    def spoil(time, position, velocity):
        position[:] = velocity[:] = np.nan
        return np.zeros(2)
    chain = uniform_rods(2)
    spoiled, run = pcs.rollout(chain, 0.01, effort=spoil), pcs.rollout(chain, 0.01)
    assert spoiled.position.tobytes() == run.position.tobytes() and spoiled.velocity.tobytes() == run.velocity.tobytes()


def test_the_plan_says_what_is_used_and_skipped_and_merged():
    rods = pcs.Simulation(uniform_rods(4))
    assert rods.plan == (
        '4 links, 4 joints; uses gravity; skips slides, branches, bent links, armature, damping, spring, preload, '
        'friction, effort limits, stops; method taylor (auto: not stiff), order 17 for tolerance 1e-09, '
        'tick 0.001 s; form dense (auto: the series of at most 8 joints is unrolled)')
    laws = {'damping': 1.0, 'stiffness': 1.0, 'preload': 1.0, 'friction': 1.0, 'armature': 1.0, 'effort_limit': 1.0,
            'lower': 0.0}
    everything = Chain('all', 1 + 0j, (
        Body('b', -1, 0j, 0.0, 1.0, 0j, 1.0, 1.0, Joint('s', 'slide', 0.0, **laws), None),
        Body('c', 0, 0j, 0.0, 1.0, 0j, 1.0, 1.0, None, Joint('r', 'rotation', 1.0)),
        Body('d', 0, 0j, 0.0, 1.0, 0j, 1.0, 1.0, None, Joint('t', 'rotation', 1.0)),
        Body('e', 2, 0j, 0.0, 1.0, 0j, 1.0, 1.0)))
    assert str(plan_of(everything)) == (
        '3 links, 3 joints; uses slides, branches, gravity, armature, damping, spring, preload, friction, '
        'effort limits, stops, welded bodies merged: 1; skips bent links')
    assert 'method rk4, order 4' in pcs.Simulation(uniform_rods(1), 'rk4').plan


def test_rollout_shapes():
    chain = random_tree(2, bodies=4)
    run = pcs.rollout(chain, 0.01)
    joints = chain.joint_count
    assert (run.time.shape, run.position.shape, run.velocity.shape, run.effort.shape) == (
        (11,), (11, joints), (11, joints), (10, joints))
    copied = copy.deepcopy(chain)
    assert pcs.rollout(copied, 0.01).position.tobytes() == run.position.tobytes()


@pytest.mark.parametrize('record', [
    (), (1, 2), 'abc', 5, [np.empty((10, 2))] * 2, [np.empty((10, 2))] * 4, ([0.0], [0.0], [0.0])])
def test_a_record_that_is_no_three_arrays_is_refused_and_nothing_moves(record):
    simulation = pcs.Simulation(uniform_rods(2))
    with pytest.raises(ValueError, match='must be three arrays, for position, velocity and effort'):
        simulation.advance(10, None, record=record)
    assert simulation.tick == 0


def test_accepted_arguments_move_after_conversion():
    simulation, twin = (pcs.Simulation(uniform_rods(2, bend=0.3)) for _ in range(2))
    rows = [np.empty((10, 2)) for _ in range(3)]
    raw = np.frombuffer(b'x' + np.ones(2).tobytes(), dtype=np.uint8)[1:]
    for effort in ([1, 1], np.ones(2, dtype=np.float32), np.ones(4)[::2], raw.view(np.float64)):
        simulation.advance(np.int64(10), effort, rows)
        twin.advance(10, np.ones(2))
        assert simulation.tick == twin.tick and simulation.position.tobytes() == twin.position.tobytes()
        assert rows[0][-1].tobytes() == twin.position.tobytes()


def test_more_ticks_than_can_be_counted_are_refused():
    simulation = pcs.Simulation(uniform_rods(1))
    for ticks in (2**53 + 1, 2**63, 10**30):
        with pytest.raises(ValueError, match='must be at most 9007199254740992: no more can be counted'):
            simulation.advance(ticks)
    for time in (1e300, 1e308, 10**400, 1e15):
        with pytest.raises(ValueError, match='time is '):
            simulation.advance_to(time)
    assert simulation.tick == 0
