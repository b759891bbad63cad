"""Dry friction and stops where rounding decides: named scenes, families of scenes, and the search for events."""
from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from test_events import EXACT, pendulum, with_laws

import planar_chain_sim as pcs
from planar_chain_sim import _kernel
from planar_chain_sim.benchmark.problems import uniform_rods
from planar_chain_sim.benchmark.scenes.friction import break_away, held_rods
from planar_chain_sim.benchmark.scenes.joint_family import METHODS, random_scene, run_scene
from planar_chain_sim.motion.simulation import _WHY

STIFF_TOO = sorted(pcs.METHODS)


def three_links():
    """Return a falling arm whose last joint alone has friction, weak beside what the others carry."""
    rows = (('a', 'base', [0, 0], 1.0, 0.25, 0.021, {'position': -0.5}), ('b', 'a', [0.5, 0], 0.8, 0.2, 0.011, {}),
            ('c', 'b', [0.4, 0], 1.9, 0.1, 0.002, {'friction': 0.05}))
    return pcs.chain_from_dict({'name': 't', 'bodies': [
        {'name': name, 'carrier': carrier, 'origin': origin, 'mass': mass, 'center_of_mass': [center, 0],
         'inertia_com': inertia, 'rotation': {'joint': f'j_{name}', **joint}}
        for name, carrier, origin, mass, center, inertia, joint in rows]})


def coasting_wheel():
    """Return a rod that hangs, and a wheel at its end; the same friction in both joints."""
    return pcs.chain_from_dict({'name': 'pendulum_with_a_wheel', 'bodies': [
        {'name': 'rod', 'carrier': 'base', 'mass': 1.0, 'center_of_mass': [0.0, -0.4], 'inertia_com': 0.1,
         'rotation': {'joint': 'pivot', 'friction': 0.01}},
        {'name': 'wheel', 'carrier': 'rod', 'origin': [0.0, -0.7], 'mass': 1.0, 'inertia_com': 0.1,
         'rotation': {'joint': 'spin', 'friction': 0.01, 'velocity': 20.0}}]})


@pytest.mark.parametrize('method', STIFF_TOO)
@pytest.mark.parametrize('step', [1e-3, 1e-2])
def test_coaxial_joints_of_equal_friction_stand_and_turn_as_they_should(method, step):
    """Oracle: the wheel's friction needs all that the pivot's can give: the rod hangs, the wheel loses 0.1 rad/s^2."""
    simulation = pcs.Simulation(coasting_wheel(), method, step)
    simulation.advance(round(5.0 / step))
    coarse = 0.5 * 0.1 * step * 5.0 + 1e-12 if method == 'semi_implicit_euler' else 1e-12
    np.testing.assert_allclose(simulation.position, [0.0, 98.75], atol=max(coarse, 1e-9))
    np.testing.assert_allclose(simulation.velocity, [0.0, 19.5], atol=1e-9)
    assert simulation.take_events() == [] and simulation.acceleration[0] == 0.0


@pytest.mark.parametrize('method', STIFF_TOO)
@pytest.mark.parametrize('chain', [
    three_links(), *(held_rods(friction) for friction in (10.118077087523773, 9.77, 10.148, 9.18))])
def test_a_break_away_does_not_cause_another_one(method, chain):
    """Runs that once ended or stalled because rounding put lambda beyond its bound in one computation of two."""
    simulation = pcs.Simulation(chain, method)
    most = 0
    for _ in range(3000):
        before = simulation.statistics['steps']
        simulation.advance(1)
        most = max(most, simulation.statistics['steps'] - before)
    assert simulation.tick == 3000 and most <= 10 and 3 < simulation.statistics['events'] < 60


@pytest.mark.parametrize('excess', [1e-2, 1e-4])
def test_a_short_break_away_is_seen_whatever_the_tick(excess):
    """With adaptive methods the slip of the first joint is the same for all ticks, even of 3 s."""
    for method in ('taylor', 'dop853', 'rodas5p'):
        slips = [break_away(excess, method, step) for step in (1e-3, 1e-2, 0.1, 3.0)]
        for slip, events in slips:
            assert slip == slips[0][0] and len(events) == 12
    exact, _ = break_away(excess, 'taylor', 1e-3, 1e-14)
    for method in ('taylor', 'rk4', 'gauss6', 'dop853_fixed'):
        slip, events = break_away(excess, method, 1e-3)
        assert abs(slip - exact) < 1e-11 and len(events) == 12


@pytest.mark.parametrize('method', EXACT)
def test_a_limit_cycle_of_stick_and_slip_closes(method):
    """Oracle: 3 N on 1 kg against 1 N for 1 s, then nothing: 3 m within 3 s, 1 s at rest, and back the same way."""
    chain = pcs.chain_from_dict({'name': 'block', 'gravity': [0.0, 0.0], 'bodies': [
        {'name': 'block', 'carrier': 'base', 'mass': 1.0, 'inertia_com': 0.1,
         'slide': {'joint': 'way', 'axis': 0.0, 'friction': 1.0}}]})
    simulation = pcs.Simulation(chain, method, 0.01)
    for cycle in range(20):
        for way, effort in ((3.0, 3.0), (0.0, -3.0)):
            simulation.advance(100, [effort])
            simulation.advance(300)
            assert simulation.position[0] == pytest.approx(way, abs=1e-11) and simulation.velocity.tolist() == [0.0]
    events = simulation.take_events()
    times = [4.0 * k + offset for k in range(40) for offset in (0.0, 3.0)]
    assert [event.kind for event in events] == ['slipped', 'stuck'][1:] + 39 * ['slipped', 'stuck']
    np.testing.assert_allclose([event.time for event in events], times[1:], atol=1e-10)


@pytest.mark.parametrize('method', ['taylor', 'dop853', 'rk4', 'gauss6', 'dop853_fixed'])
def test_an_oscillator_comes_to_rest_in_the_dead_zone(method):
    """Oracle: the amplitude falls by 2 tau_c / k each half swing, 0.105 to 0.005 m; there the spring is too weak."""
    chain = pcs.chain_from_dict({'name': 'block', 'gravity': [0.0, 0.0], 'bodies': [
        {'name': 'block', 'carrier': 'base', 'mass': 1.0, 'inertia_com': 0.1,
         'slide': {'joint': 'way', 'axis': 0.0, 'friction': 1.0, 'stiffness': 100.0, 'position': 0.105}}]})
    simulation = pcs.Simulation(chain, method, tolerance=1e-13 if pcs.METHODS[method].adaptive else None)
    simulation.advance(2000)
    event, = simulation.take_events()
    assert event.kind == 'stuck' and event.time == pytest.approx(0.5 * np.pi, abs=1e-8)
    assert simulation.position[0] == pytest.approx(-0.005, abs=1e-8) and simulation.velocity.tolist() == [0.0]


@pytest.mark.parametrize('method', METHODS)
def test_a_break_away_within_an_ulp_of_a_tick(method):
    """The friction is what the first joint needs at a tick, and the numbers next to that: no run ends or stalls."""
    chain = held_rods(1e3)
    simulation = pcs.Simulation(chain, method)
    simulation.advance(200)
    need = abs(pcs.inverse_dynamics(held_rods(0.0), simulation.position, simulation.velocity,
                                    simulation.acceleration)[0])
    firsts = []
    for friction in (need, np.nextafter(need, 0.0), np.nextafter(need, 100.0), need * (1 + 1e-13), need * (1 - 1e-13)):
        run = pcs.Simulation(held_rods(float(friction)), method)
        run.advance(1000)
        events = run.take_events()
        assert events[0].kind == 'slipped' and len(events) < 60 and run.statistics['steps'] < 1300
        firsts.append(events[0].time)
    np.testing.assert_allclose(firsts, 0.2, atol=1e-9)


def test_efforts_alone_are_compared_to_the_last_bit_and_rounding_is_allowed_for_elsewhere():
    """Without gravity nothing is rounded: friction of 0.7 N holds at 0.7, not at the next number, for any inertia."""
    for mass in (1.0, 3.0, 7.3):
        chain = pcs.chain_from_dict({'name': 'block', 'bodies': [
            {'name': 'block', 'carrier': 'base', 'mass': mass, 'inertia_com': 0.1,
             'slide': {'joint': 'way', 'axis': 0.0, 'friction': 0.7}}]})
        for effort, moves in ((0.7, False), (-0.7, False), (np.nextafter(0.7, 1.0), True),
                              (-np.nextafter(0.7, 1.0), True)):
            simulation = pcs.Simulation(chain)
            simulation.advance(1000, [effort])
            assert bool(simulation.position[0]) is moves


@pytest.mark.parametrize('method', STIFF_TOO)
def test_many_turns_do_not_make_the_acceleration_of_a_scene_with_friction_less_exact(method):
    """Twin: the same state a million turns on, in a scene with friction and a stop, moving and standing."""
    far = [0.3 + 6588397.0, -0.4 - 3 * 6588397.0, 0.7 + 6588397.0]
    with mpmath.workdps(50):
        exact = [float(mpmath.mpf(x) - 2 * mpmath.pi * mpmath.nint(x / (2 * mpmath.pi))) for x in far]
    chain = with_laws(uniform_rods(3), friction=[0.5, 0.0, 40.0], upper=[np.inf, 1e9, np.inf])
    for velocity in ([1.0, 0.5, 0.0], [0.0, 0.5, 0.0]):
        accelerations = []
        for position in (exact, far):
            simulation = pcs.Simulation(chain, method, 1e-9)
            simulation.set_state(position, velocity)
            accelerations.append(simulation.acceleration)
            simulation.advance(1)
            accelerations.append(simulation.acceleration)
        scale = np.abs(accelerations[0]).max()
        assert np.abs(accelerations[2] - accelerations[0]).max() < 1e-14 * scale
        assert np.abs(accelerations[3] - accelerations[1]).max() < 1e-13 * scale


@pytest.mark.parametrize('seed', range(40))
def test_a_random_scene_with_stops_and_friction_moves_a_million_turns_on_as_it_did(seed):
    """Twins that differ by whole turns of one joint, to twice double precision: the same events, the same motion."""
    draw, pi = np.random.default_rng(seed), Fraction('3.14159265358979323846264338327950288419716939937510582097494459')
    links = int(draw.integers(2, 6))
    turned, turns = int(draw.integers(links)), int(draw.choice([-1, 1])) * 10**6
    bounds = np.where(np.arange(links) == turned, np.inf, draw.uniform(0.3, 2.0, links))
    friction = draw.uniform(0.0, 3.0, links) * (draw.random(links) < 0.7)
    chain = with_laws(uniform_rods(links, bend=0.1), friction=friction,
                      upper=bounds, lower=-bounds, restitution=draw.choice([0.0, 0.5], links))
    start, rate = draw.uniform(-0.3, 0.3, links), draw.normal(size=links)
    method = STIFF_TOO[seed % len(STIFF_TOO)]
    ends = []
    for whole in (0, turns):
        simulation = pcs.Simulation(chain, method, 1e-3, 1e-14 if pcs.METHODS[method].adaptive else None)
        simulation.set_state(start, rate)
        saved = simulation.checkpoint()
        position, remainder = saved.state[0].copy(), np.zeros(links)
        angle = Fraction(start[turned]) + 2 * whole * pi
        position[turned] = float(angle)
        remainder[turned] = float(angle - Fraction(position[turned]))
        simulation.restore(replace(saved, state=(position, saved.state[1], remainder, *saved.state[3:])))
        simulation.advance(300)
        position, velocity, remainder, *_ = simulation.checkpoint().state
        reached = [Fraction(high) + Fraction(low) for high, low in zip(position, remainder)]
        reached[turned] -= 2 * whole * pi
        events = simulation.take_events()
        ends.append(([*map(float, reached), *velocity, *simulation.acceleration, *(event.time for event in events)],
                     [(event.kind, event.joint) for event in events]))
    assert ends[1][1] == ends[0][1]
    np.testing.assert_allclose(ends[1][0], ends[0][0], rtol=1e-10, atol=1e-10)


def test_events_without_end_are_named():
    """Each outcome of the kernel that ends a run has its own sentence: no tolerance is blamed where there is none."""
    assert set(_WHY) == set(_kernel.OUTCOMES) - {'good', 'interrupted'}
    assert 'events' in _WHY['endless_events']
    assert [outcome for outcome, why in _WHY.items() if 'tolerance' in why] == ['stalled']


@pytest.mark.parametrize('seed', range(0, 108))
def test_a_family_of_scenes_runs_to_its_end(seed):
    """Each method, tick and drive of the family: none stops, and few steps are taken for what happens in a tick."""
    report = run_scene(random_scene(7000 + seed), 0.5)
    assert report.failed is None and report.most_steps <= 200


def sequence(scene, method, step, tolerance, duration=1.0, nudge=0.0):
    simulation = pcs.Simulation(scene.chain, method, step, tolerance)
    if nudge:
        position, velocity = simulation.position, simulation.velocity
        simulation.set_state(position, velocity + nudge * (velocity != 0.0))
    states = []
    for k in range(round(duration / 0.01)):
        simulation.advance(round(0.01 / step), scene.efforts(1))
        states.append(simulation.position)
    return np.array(states), simulation.take_events()


@pytest.mark.parametrize('seed', [seed for seed in range(24) if seed // 18 % 2 == 0])
def test_two_methods_and_two_ticks_see_the_same_events(seed):
    """Twin, until a nudge of 1e-12 has grown to 1e-10: from there on the motion itself decides otherwise."""
    scene = random_scene(seed)
    reference, events = sequence(scene, 'taylor', 1e-3, 1e-12)
    nudged, _ = sequence(scene, 'taylor', 1e-3, 1e-12, nudge=1e-12)
    grown = np.nonzero(np.abs(nudged - reference).max(axis=1) > 1e-10)[0]
    ticks = int(grown[0]) if grown.size else len(reference)
    for method, step in (('dop853', 1e-3), ('taylor', 1e-2), ('taylor', 1e-4)):
        states, others = sequence(scene, method, step, 1e-12)
        assert np.abs(states[:ticks] - reference[:ticks]).max(initial=0.0) < 1e-8
        until = ticks * 0.01 - 1e-6
        assert (sorted((event.kind, event.joint) for event in events if event.time < until)
                == sorted((event.kind, event.joint) for event in others if event.time < until))


def test_an_impact_of_joints_that_rest_on_their_stops_is_solved_despite_rounding():
    """Four joints on stops, one of them moving: pivoting went back and forth between two zeros (scene 4838)."""
    assert run_scene(random_scene(4838), 1.5).rise == 0.0


def test_weak_impacts_of_joints_on_their_stops_come_to_an_end():
    """Two joints throw each other at their stops infinitely often within one moment (scene 165 of the family)."""
    for seed in (165, 3, 1262, 1460):
        report = run_scene(random_scene(seed), 5.0)
        assert report.failed is None and report.most_steps <= 60


def test_a_pendulum_held_across_by_just_enough_friction_stands_for_an_hour():
    simulation = pcs.Simulation(pendulum(friction=10.0), step=0.01)
    simulation.advance(360_000)
    assert simulation.position.tolist() == [0.0] and simulation.take_events() == []


@pytest.mark.parametrize('method', STIFF_TOO)
def test_a_wrench_acts_at_once_on_what_slides_sticks_and_rests(method):
    """Oracle: a moment on a rod is an effort of its joint."""
    chain = pcs.chain_from_dict({'name': 'rubbing_rod', 'bodies': [
        {'name': 'rod', 'carrier': 'base', 'mass': 1.0, 'center_of_mass': [0.5, 0.0], 'inertia_com': 0.1,
         'rotation': {'joint': 'hinge', 'friction': 0.5, 'lower': -2.0, 'upper': 0.5, 'velocity': 1.0}}]})
    pushed, driven = pcs.Simulation(chain, method), pcs.Simulation(chain, method)
    for moment in (0.0, 9.0, 20.0, -20.0, 0.0, 3.0):
        pushed.set_wrench('rod', moment=moment)
        for _ in range(2):
            pushed.advance(70)
            driven.advance(70, [moment])
            np.testing.assert_allclose(pushed.position, driven.position, rtol=0.0, atol=1e-9)
            np.testing.assert_allclose(pushed.velocity, driven.velocity, rtol=0.0, atol=1e-8)
            np.testing.assert_allclose(pushed.acceleration, driven.acceleration, rtol=0.0, atol=1e-7)
    assert [event.kind for event in pushed.take_events()] == [event.kind for event in driven.take_events()] != []
    pushed.set_wrench('rod', moment=-5.0)   # also after a state that was put
    for simulation in (pushed, driven):
        simulation.set_state([0.1], [0.0])
    pushed.clear_wrenches()
    pushed.advance(50)
    driven.advance(50)
    np.testing.assert_allclose(pushed.position, driven.position, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize('seed', range(60))
def test_no_impact_gives_energy(seed):
    """Invariant: arms on their stops with any rates and restitutions, also where one is thrown back as it leaves."""
    random = np.random.default_rng(seed)
    bodies = []
    for k in range(int(random.integers(2, 5))):
        joint = {'joint': f'j{k}', 'velocity': random.normal(), random.choice(['lower', 'upper']): 0.0,
                 'restitution': float(random.choice([0.0, 0.5, 0.9, 1.0]))}
        bodies.append({'name': f'b{k}', 'carrier': f'b{k - 1}' if k else 'base', 'origin': [1.0 if k else 0.0, 0.0],
                       'mass': 1.0, 'inertia_com': 0.1, 'center_of_mass': [0.5, 0.0],
                       **({'slide': {'axis': random.normal(), **joint}} if random.random() < 0.3
                          else {'rotation': joint})})
    chain = pcs.chain_from_dict({'name': 'arm', 'gravity': [0.0, 0.0], 'bodies': bodies})
    for method, tolerance in (('taylor', 1e-12), ('rk4', None)):
        simulation = pcs.Simulation(chain, method, tolerance=tolerance)
        energy = sum(pcs.energy(chain, simulation.position, simulation.velocity))
        for _ in range(50):
            simulation.advance(1)
            now = sum(pcs.energy(chain, simulation.position, simulation.velocity))
            assert now <= energy * (1.0 + 1e-9) + 1e-12
            energy = now


@pytest.mark.parametrize('method', STIFF_TOO)
def test_a_joint_held_by_symmetry_alone_has_no_event(method):
    """A body that falls onto a stop and turns there, and an arm that turns as one: lambda is zero but for rounding."""
    fallen = pcs.chain_from_dict({'name': 'fallen', 'gravity': [0.0, 0.0], 'bodies': [
        {'name': 'b', 'carrier': 'base', 'mass': 1.0, 'inertia_com': 0.1, 'center_of_mass': [0.5, 0.0],
         'slide': {'joint': 'j1', 'axis': np.pi / 2, 'velocity': -1.0, 'lower': -1e-6}, 'rotation': {'joint': 'j2'}}]})
    turning = pcs.chain_from_dict({'name': 'turning', 'gravity': [0.0, 0.0], 'bodies': [
        {'name': f'b{k}', 'carrier': f'b{k - 1}' if k else 'base', 'origin': [1.0 if k else 0.0, 0.0], 'mass': 1.0,
         'inertia_com': 0.1, 'center_of_mass': [0.5 if k < 2 else 0.0, 0.0],
         'rotation': {'joint': f'j{k}', **({} if k else {'velocity': -0.7}), **({'lower': 0.0} if k == 2 else {})}}
        for k in range(3)]})
    for chain in (fallen, turning):
        simulation = pcs.Simulation(chain, method)
        simulation.advance(300)
        assert simulation.tick == 300 and simulation.statistics['events'] < 5


@pytest.mark.parametrize('method', STIFF_TOO)
def test_friction_that_stops_a_joint_within_a_tiny_part_of_a_step_ends_no_run(method):
    """Oracle: the slide has what is left of the momentum, m c omega sin(axis) / m."""
    chain = pcs.chain_from_dict({'name': 'strong', 'gravity': [0.0, 0.0], 'bodies': [
        {'name': 'b', 'carrier': 'base', 'mass': 1.0, 'inertia_com': 0.1, 'center_of_mass': [0.5, 0.0],
         'slide': {'joint': 's', 'axis': 0.5}, 'rotation': {'joint': 'r', 'velocity': 0.6, 'friction': 1e6}}]})
    simulation = pcs.Simulation(chain, method)
    simulation.advance(50)
    assert [event.kind for event in simulation.take_events()] == ['stuck']
    assert simulation.velocity[0] == pytest.approx(0.3 * np.sin(0.5), abs=1e-6) and simulation.velocity[1] == 0.0
