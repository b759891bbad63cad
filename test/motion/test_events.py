"""Stops and dry friction: oracle, invariant, order and equality tests of the events between smooth stretches."""
import dataclasses
import subprocess
import sys

import numpy as np
from oracles.random_trees import random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.benchmark.problems import configured, uniform_rods

EVERY_METHOD = sorted(pcs.METHODS)
EXACT = [name for name in EVERY_METHOD if name not in ('semi_implicit_euler', 'rodas5p')]   # on a parabola


def block(axis=0.0, **joint):
    """Return a body of 2 kg that slides on the base under 10 m/s^2, along `axis` (rad), pi/2 being up."""
    return pcs.chain_from_dict({'name': 'block', 'gravity': [0.0, -10.0], 'bodies': [
        {'name': 'block', 'carrier': 'base', 'mass': 2.0, 'inertia_com': 0.1,
         'slide': {'joint': 'way', 'axis': axis, **joint}}]})


def pendulum(**joint):
    """Return a point mass of 1 kg at 1 m, lying across at zero, under 10 m/s^2."""
    return pcs.chain_from_dict({'name': 'pendulum', 'gravity': [0.0, -10.0], 'bodies': [
        {'name': 'rod', 'carrier': 'base', 'mass': 1.0, 'center_of_mass': [1.0, 0.0], 'inertia': 1.0,
         'rotation': {'joint': 'hinge', **joint}}]})


def with_laws(chain, **laws):
    """Return the chain with these laws, (joints,) each, in its joints."""
    rows = iter(range(chain.joint_count))

    def changed(joint):
        if joint is None:
            return None
        k = next(rows)
        return dataclasses.replace(joint, **{name: float(values[k]) for name, values in laws.items()})
    return dataclasses.replace(chain, source='', bodies=tuple(
        dataclasses.replace(body, slide=changed(body.slide), rotation=changed(body.rotation))
        for body in chain.bodies))


@pytest.mark.parametrize('joint, has', [({}, False), ({'damping': 1.0, 'stiffness': 2.0, 'effort_limit': 3.0}, False),
                                        ({'lower': -1.0}, True), ({'upper': 1.0}, True), ({'friction': 0.1}, True)])
def test_only_scenes_with_stops_or_friction_have_events(joint, has):
    assert pcs.Simulation(block(**joint)).has_events is has


@pytest.mark.parametrize('method', EXACT)
def test_a_bouncing_block_meets_the_ground_when_the_closed_form_says(method):
    """Oracle: impact k at t_1 (1 + 2 (e + ... + e^k)), speed e^k v_1; every method is exact on a parabola."""
    simulation = pcs.Simulation(block(np.pi / 2, lower=0.0, position=1.0, restitution=0.5), method)
    simulation.advance(1300)
    events = simulation.take_events()
    first, speed = np.sqrt(0.2), np.sqrt(20.0)
    for k, event in enumerate(events):
        assert event.kind == 'stop_touched' and event.joint == 'way' and event.tick == int(event.time / 1e-3)
        assert event.time == pytest.approx(first * (1.0 + 2.0 * sum(0.5**i for i in range(1, k + 1))), abs=1e-12)
        assert event.speed == pytest.approx(0.5**k * speed, abs=1e-11)
    assert len(events) == 5 == simulation.statistics['events']
    assert simulation.take_events() == []


@pytest.mark.parametrize('method', EVERY_METHOD)
@pytest.mark.parametrize('restitution', [0.0, 0.3, 0.9])
def test_infinitely_many_bounces_end_in_rest(method, restitution):
    """Oracle: they end at t_1 (1 + e) / (1 - e); from then on the block stands to the bit, and nothing happens."""
    simulation = pcs.Simulation(block(np.pi / 2, lower=0.0, position=0.01, restitution=restitution), method)
    end = np.sqrt(0.002) * (1.0 + restitution) / (1.0 - restitution)
    simulation.advance(int(end / 1e-3) + (200 if method == 'semi_implicit_euler' else 2))
    assert simulation.position.tolist() == simulation.velocity.tolist() == simulation.acceleration.tolist() == [0.0]
    bounces = simulation.take_events()
    if method in EXACT:
        assert bounces[-1].time == pytest.approx(end, abs=3e-5)   # what rebounds below 1e-5 m/s would take
    simulation.advance(3_600_000 if method == 'taylor' else 1000)   # an hour
    assert simulation.position.tolist() == [0.0] and simulation.take_events() == []


@pytest.mark.parametrize('method', EVERY_METHOD)
def test_a_sliding_block_stops_and_stands_until_the_break_away_effort(method):
    """Oracle: 4 N on 2 kg stop 1 m/s within 0.5 s and 0.25 m; it stands at 4 N and goes at the next double above."""
    simulation = pcs.Simulation(block(friction=4.0, velocity=1.0), method)
    simulation.advance(600)
    event, = simulation.take_events()
    assert (event.kind, event.joint) == ('stuck', 'way')
    assert event.time == pytest.approx(0.5, abs=1e-12)
    coarse = method == 'semi_implicit_euler'
    assert simulation.position[0] == pytest.approx(0.25, abs=1e-3 if coarse else 1e-10)
    stood = simulation.position.tobytes()
    for effort in (4.0, -4.0, 3.0):
        simulation.advance(100, [effort])
        assert simulation.position.tobytes() == stood and simulation.velocity.tolist() == [0.0]
        assert simulation.acceleration.tolist() == [0.0] and simulation.take_events() == []
    simulation.advance(100, [np.nextafter(4.0, 5.0)])
    assert [event.kind for event in simulation.take_events()] == ['slipped'] and simulation.velocity[0] > 0.0
    simulation.set_state([0.0], [0.0])
    simulation.advance(100, [-6.0])
    assert simulation.velocity[0] == pytest.approx(-0.1, abs=1e-12)


def test_a_slow_ramp_slips_at_the_right_effort_and_friction_holds_an_arm_for_an_hour():
    """The horizontal pendulum needs 10 N m; friction of 12 holds it, and it slips when the ramp has removed 2 N m."""
    simulation = pcs.Simulation(pendulum(friction=12.0, position=0.0), step=0.01)
    simulation.advance(360_000)
    assert simulation.position.tolist() == simulation.velocity.tolist() == [0.0] and simulation.take_events() == []
    ramp = -1e-3 * np.arange(4000)[:, None]
    simulation.advance(4000, ramp)
    event = simulation.take_events()[0]
    assert event.kind == 'slipped' and event.tick == 360_000 + 2001


@pytest.mark.parametrize('method', EVERY_METHOD)
def test_a_stop_hit_at_100_rad_per_s_is_not_passed_and_gives_no_energy(method):
    chain = pendulum(upper=0.5, lower=-2.0, restitution=0.8, velocity=100.0)
    simulation = pcs.Simulation(chain, method)
    energy = sum(pcs.energy(chain, simulation.position, simulation.velocity))
    least = -1.0
    for _ in range(600):
        simulation.advance(1)
        assert -2.0 <= simulation.position[0] <= 0.5
        now = sum(pcs.energy(chain, simulation.position, simulation.velocity))
        # what the methods do to the energy of the smooth stretch, 5000 J at first: h w g, and the tolerance of 1e-9
        assert now <= energy + (1.1 if method == 'semi_implicit_euler' else 1e-5)
        energy, least = now, max(least, simulation.position[0])
    touched = simulation.take_events()
    assert len(touched) > 5 and {event.kind for event in touched} == {'stop_touched'} and least > 0.4


def test_a_grazing_stop_is_seen_between_two_ticks():
    """Thrown up to 1 mm below, to, and 1 um above a stop with ticks of 0.1 s: the peak lies between two of them."""
    for beyond, touches in ((-1e-3, 0), (1e-6, 1), (1e-12, 1)):
        top = 0.5**2 / (2.0 * 10.0)   # the speed's square over twice the gravity
        chain = block(np.pi / 2, upper=top - beyond, velocity=0.5, restitution=0.5)
        for method in ('taylor', 'rk4', 'dop853'):
            simulation = pcs.Simulation(chain, method, step=0.1)
            simulation.advance(2)
            assert len(simulation.take_events()) == touches


@pytest.mark.parametrize('seed', range(12))
def test_standing_and_sliding_joints_are_the_unique_solution(seed):
    """
    Invariant: trees at rest, some joints on stops and some with friction.

    With lambda = inverse dynamics less the efforts, every joint stands with lambda inside its bounds, or accelerates
    with lambda at the bound that opposes it.
    """
    random = np.random.default_rng(seed)
    chain = random_tree(seed, bodies=7)
    joints = chain.joint_count
    position = np.array([joint.position for joint in chain.joints])
    friction = random.choice([0.0, 0.5, 5.0, 50.0], joints)
    side = random.choice([-1, 0, 1], joints)
    lower = np.where(side < 0, position, -np.inf)
    upper = np.where(side > 0, position, np.inf)
    chain = with_laws(chain, position=position, velocity=np.zeros(joints), friction=friction, lower=lower, upper=upper)
    simulation = pcs.Simulation(chain, step=1e-9)
    effort = random.normal(0.0, 5.0, joints)
    simulation.advance(1, effort)
    acceleration = simulation.acceleration
    held = pcs.inverse_dynamics(chain, position, np.zeros(joints), acceleration) - effort
    scale = 1e-6 * (1.0 + np.abs(held).max() + np.abs(acceleration).max())   # the tick of 1e-9 s moves it a little
    for a, force, most, where in zip(acceleration, held, friction, side):
        least, greatest = (-np.inf if where > 0 else -most), (np.inf if where < 0 else most)
        assert least - scale <= force <= greatest + scale
        if a > scale:
            assert force == pytest.approx(least, abs=scale)
        elif a < -scale:
            assert force == pytest.approx(greatest, abs=scale)
        elif most > 0.0 or where:
            assert a == 0.0 or abs(abs(force) - most) < scale


def test_acceleration_after_set_state_respects_standing_joints():
    chain = with_laws(uniform_rods(2), friction=[10.0, 0.0], upper=[np.inf, 0.5], position=[0.1, 0.2])
    simulation = pcs.Simulation(chain)
    held = simulation.acceleration
    assert held[0] == 0.0 and held[1] != 0.0 and simulation.statistics['events'] == 0
    simulation.advance(1)
    np.testing.assert_allclose(simulation.acceleration, held, rtol=0.05)
    simulation.set_state([0.1, 0.5], [0.0, 0.0])
    up = pcs.inverse_dynamics(chain, [0.1, 0.5], [0.0, 0.0], [0.0, 3.0])
    assert simulation.acceleration[1] < 0.0                       # the weight takes it off the stop
    simulation.advance(1, up)
    assert simulation.acceleration.tolist() == [0.0, 0.0]         # and this effort holds it there


def robot():
    """Return the four-link robot with friction in two joints and stops in three."""
    return with_laws(configured('four_link_robot'), friction=[0.0, 1.5, 0.0, 0.6, 0.0],
                     lower=[0.2, -np.inf, -1.0, 1.1, -np.inf], upper=[np.inf, np.inf, np.inf, np.inf, 0.9],
                     restitution=[0.5, 0.0, 0.3, 0.0, 1.0])


@pytest.mark.parametrize('method', EVERY_METHOD)
def test_calls_may_be_cut_anywhere_and_a_checkpoint_goes_on_with_the_same_bits(method):
    chain = robot()
    whole, cut = pcs.Simulation(chain, method), pcs.Simulation(chain, method)
    whole.advance(1500)
    for ticks in (1, 1, 398, 7, 593):
        cut.advance(ticks)
    saved = cut.checkpoint()
    cut.advance(500)
    other = pcs.Simulation(chain, method)
    other.restore(saved)
    other.advance(500)
    for simulation in (cut, other):
        assert simulation.position.tobytes() == whole.position.tobytes()
        assert simulation.velocity.tobytes() == whole.velocity.tobytes()
    kinds = {event.kind for event in whole.take_events()}
    assert kinds == {'stop_touched', 'stop_left', 'stuck', 'slipped'}


def test_energy_never_rises_by_itself():
    """Friction, stops and dampers only take energy, within the tolerance of the method."""
    chain = robot()
    simulation = pcs.Simulation(chain, tolerance=1e-12)
    energy = sum(pcs.energy(chain, simulation.position, simulation.velocity))
    for _ in range(3000):
        simulation.advance(1)
        now = sum(pcs.energy(chain, simulation.position, simulation.velocity))
        assert now <= energy + 1e-10
        energy = now
    assert simulation.statistics['events'] > 10


@pytest.mark.parametrize('method, order, rates', [('semi_implicit_euler', 1, (2048, 4096, 8192, 16384)),
                                                  ('rk4', 4, (256, 512, 1024)), ('gauss6', 6, (128, 256, 512))])
def test_order_of_convergence_survives_events(method, order, rates):
    """Order: two rods that stick, slip, hit a stop, bounce to rest on it and leave it; two methods agree on the end."""
    chain = with_laws(uniform_rods(2), position=[0.4, 0.3], velocity=[-2.0, 1.0], friction=[0.6, 0.15],
                      upper=[np.inf, 0.9], lower=[-0.9, -np.inf], restitution=[0.7, 0.4])
    reference, twin = (pcs.Simulation(chain, name, 0.25, 1e-14) for name in ('taylor', 'dop853'))
    for simulation in (reference, twin):
        simulation.advance(6)
    assert np.abs(twin.position - reference.position).max() < 1e-12
    events, others = ([(event.kind, event.joint) for event in run.take_events()] for run in (reference, twin))
    assert events == others and {kind for kind, _ in events} == {'stop_touched', 'stop_left', 'stuck', 'slipped'}
    errors = []
    for rate in rates:
        simulation = pcs.Simulation(chain, method, 1.0 / rate)
        simulation.advance(rate * 3 // 2)
        errors.append(np.abs(simulation.position - reference.position).max())
    slope = -np.polyfit(np.log(rates), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.4 if order == 1 else 0.2)


def test_a_batch_gives_the_bits_of_single_runs():
    chain = robot()
    position = np.array([joint.position for joint in chain.joints]) + 0.01 * np.arange(5)[:, None]
    batch = pcs.rollout_batch(chain, position, duration=1.0, method='rk4')
    for scene in range(5):
        simulation = pcs.Simulation(chain, 'rk4')
        simulation.set_state(position[scene], np.zeros(5))
        simulation.advance(1000)
        assert batch.position[scene, -1].tobytes() == simulation.position.tobytes()


def test_two_stops_at_once():
    """Oracle: rods of a straight chain reach their stops together; each rebounds with its own share, e v."""
    chain = with_laws(uniform_rods(2, gravity=0j), velocity=[-1.0, -2.0], lower=[-0.5, -1.0], position=[0.0, 0.0],
                      restitution=[0.5, 0.25])
    velocity = np.array([-1.0, -2.0])
    simulation = pcs.Simulation(chain)
    simulation.set_state([-0.5, -1.0], velocity)
    simulation.advance(0)
    simulation.advance_to(1e-9)
    first = simulation.take_events()
    assert [event.joint for event in first] == ['joint0', 'joint1']
    np.testing.assert_allclose(simulation.velocity, [0.5, 0.5], atol=1e-6)


def test_a_state_beyond_a_stop_is_refused():
    simulation = pcs.Simulation(pendulum(lower=-0.5, upper=0.5))
    wanted = "position of joint 'hinge' of pendulum is 0.75, must lie between its stops, -0.5 and 0.5"
    for position in ([0.75], np.array([0.75])):   # the kernel looks at an array by itself
        with pytest.raises(ValueError, match=wanted):
            simulation.set_state(position, np.zeros(1))
    with pytest.raises(ValueError, match=wanted):
        pcs.rollout_batch(simulation.chain, [[0.0], [0.75]], duration=0.1)
    assert simulation.position.tolist() == [0.0]


def random_scene(seed):
    """Return a tree with friction, stops and restitution of a few hard values, and efforts for three stretches."""
    random = np.random.default_rng(seed)
    chain = random_tree(seed, bodies=int(random.integers(1, 9)))
    joints = chain.joint_count
    position = np.array([joint.position for joint in chain.joints])
    stops = random.choice([0, 1, 2, 3], joints)
    on_it = random.choice([0.0, 1.0], joints)
    lower = np.where(stops & 1, position - random.uniform(0.0, 1.0, joints) * on_it, -np.inf)
    upper = np.where(stops & 2, position + random.uniform(0.01, 1.0, joints), np.inf)
    chain = with_laws(chain, friction=random.choice([0.0, 0.1, 2.0, 30.0], joints), lower=lower, upper=upper,
                      restitution=np.full(joints, random.choice([0.0, 0.5, 1.0])), effort_limit=np.full(joints, np.inf),
                      velocity=random.choice([0.0, 2.0], joints) * random.normal(size=joints))
    return chain, [random.normal(0.0, 20.0, joints) * (random.random() < 0.5) for _ in range(3)]


@pytest.mark.parametrize('method', ['taylor', 'dop853', 'rk4'])
@pytest.mark.parametrize('seed', range(24))
def test_random_scenes_keep_to_their_stops_and_only_lose_energy(seed, method):
    """Invariant. Two joints on stops that push each other off (seeds 0, 3) must not do it for ever."""
    chain, efforts = random_scene(seed)
    lower, upper = (np.array([getattr(joint, side) for joint in chain.joints]) for side in ('lower', 'upper'))
    simulation = pcs.Simulation(chain, method, 2e-3)
    for effort in efforts:
        energy = np.inf
        for _ in range(50):
            simulation.advance(2, effort)
            assert (simulation.position >= lower).all() and (simulation.position <= upper).all()
            now = sum(pcs.energy(chain, simulation.position, simulation.velocity))
            if not effort.any() and method != 'rk4':   # RK4's own error in the energy is larger
                assert now <= energy + 1e-6 * (1.0 + abs(energy if np.isfinite(energy) else 0.0))
            energy = now
    assert simulation.statistics['events'] < 2000


@pytest.mark.parametrize('method', [name for name, row in pcs.METHODS.items() if row.adaptive])
@pytest.mark.parametrize('step', [5e-324, 1e-320, 1e-300])
def test_ticks_shorter_than_any_motion_end(method, step):
    """A part of so short a step may underflow to zero: the search for events must still end."""
    program = (f'import planar_chain_sim as pcs; s = pcs.Simulation(pcs.chain_from_dict({{"bodies": [{{"name": "a", '
               f'"carrier": "base", "mass": 1.0, "inertia_com": 0.1, "rotation": {{"joint": "j", "friction": 0.1, '
               f'"velocity": 1.0}}}}]}}), {method!r}, step={step!r}); s.advance(3); print(s.tick)')
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True, timeout=600)
    assert done.stdout == '3\n', done.stderr
