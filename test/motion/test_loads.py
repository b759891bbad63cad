"""Wrenches and payloads on a moving chain: the joint efforts that do the same work, in every method."""
from dataclasses import replace

import numpy as np
from oracles.random_trees import random_state, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim import _kernel
from planar_chain_sim.chain.tree import BASE, Body
from planar_chain_sim.mechanics.loads import Wrench
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.motion.integrators import method_data
from planar_chain_sim.recording.events import apply_event
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.resimulation.bits import resimulate
from planar_chain_sim.symbolic.logged_state import state_at

ROBOT = pcs.load_chain('four_link_robot.yaml')
ARM = pcs.load_chain('seven_link_arm.yaml')
FAMILIES = ['semi_implicit_euler', 'rk4', 'dop853', 'gauss6', 'rodas5p', 'taylor']


def frames(chain, q):
    """Return x, y, angle of every body's frame, straight from the chain file's numbers; q may be complex."""
    placed, k = [], 0
    for body in chain.bodies:
        x, y, angle = placed[body.carrier] if body.carrier != BASE else (0.0, 0.0, 0.0)
        ox, oy = body.origin.real, body.origin.imag
        if body.slide is not None:
            ox, oy, k = ox + q[k] * np.cos(body.slide.axis), oy + q[k] * np.sin(body.slide.axis), k + 1
        x, y = x + np.cos(angle) * ox - np.sin(angle) * oy, y + np.sin(angle) * ox + np.cos(angle) * oy
        angle = angle + body.angle
        if body.rotation is not None:
            angle, k = angle + body.rotation.axis * q[k], k + 1
        placed.append((x, y, angle))
    return placed


def equivalent_efforts(chain, q, wrenches):
    """Virtual work: tau_k = F . dr/dq_k + N dphi/dq_k, with derivatives by a complex step."""
    efforts = np.zeros(chain.joint_count)
    for name, (force, moment, axes) in wrenches.items():
        body = [each.name for each in chain.bodies].index(name)
        if axes == 'body':
            force *= np.exp(1j * frames(chain, q)[body][2])
        for k in range(chain.joint_count):
            step = q.astype(complex)
            step[k] += 1e-30j
            x, y, angle = (1e30 * np.imag(value) for value in frames(chain, step)[body])
            efforts[k] += force.real * x + force.imag * y + moment * angle
    return efforts


def random_wrenches(chain, seed):
    """Return a wrench on each body, in its own axes or in the plane's."""
    random = np.random.default_rng(seed)
    return {body.name: Wrench(complex(*random.normal(0.0, 3.0, 2)), float(random.normal()),
                              ('body', 'world')[random.integers(2)]) for body in chain.bodies}


def put(simulation, wrenches):
    for body, (force, moment, axes) in wrenches.items():
        simulation.set_wrench(body, (force.real, force.imag), moment, axes)


@pytest.mark.parametrize('seed', range(40))
def test_accelerations_are_those_of_the_efforts_that_do_the_same_work(seed):
    chain = random_tree(seed, 2 + seed % 7)
    position, velocity, _ = random_state(chain, seed)
    wrenches = random_wrenches(chain, seed)
    simulation = pcs.Simulation(chain)
    simulation.set_state(position, velocity)
    put(simulation, wrenches)
    expected = pcs.forward_dynamics(chain, position, velocity, equivalent_efforts(chain, position, wrenches))
    np.testing.assert_allclose(simulation.acceleration, expected, rtol=0, atol=1e-12 * max(1.0, abs(expected).max()))


@pytest.mark.parametrize('form', ['dense', 'recursive'])
@pytest.mark.parametrize('seed', range(30))
def test_the_series_are_those_of_a_pushed_chain(seed, form):
    """Against a method that only ever evaluates accelerations, which the test above has checked."""
    chain = random_tree(100 + seed, 2 + seed % 6)
    position, velocity, effort = 0.3 * random_state(chain, seed)
    wrenches = random_wrenches(chain, seed)
    ends = []
    for method, step, tolerance in (('taylor', 0.1, 1e-15), ('dop853_fixed', 1e-3, None)):
        simulation = pcs.Simulation(chain, method, step, tolerance, form)
        simulation.set_state(position, velocity)
        put(simulation, wrenches)
        simulation.advance(round(0.3 / step), effort)
        ends.append(np.concatenate([simulation.position, simulation.velocity]))
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-11 * max(1.0, abs(ends[1]).max()))


@pytest.mark.parametrize('seed', range(8))
def test_the_stiff_method_keeps_its_order_by_the_derivative_of_the_wrench(seed):
    chain = random_tree(200 + seed, 4, kinds=('turning', 'sliding and turning', 'sliding'))
    position, velocity, _ = 0.3 * random_state(chain, seed)
    wrenches = {name: wrench._replace(force=10.0 * wrench.force)
                for name, wrench in random_wrenches(chain, seed).items()}
    ends = []
    for length in (4e-3, 2e-3, None):
        if length is None:
            stepper = pcs.Simulation(chain, 'taylor', 0.16, 1e-15)._stepper
        else:
            row = method_data(pcs.METHODS['rodas5p'], 1e-9, length)
            stepper = _kernel.Stepper(plan_of(chain).model, row, 0.16, False)
        stepper.put_state(position, velocity)
        put(stepper, wrenches)
        stepper.advance(1, None, None)
        ends.append(np.concatenate([stepper.position, stepper.velocity]))
    errors = [abs(end - ends[2]).max() for end in ends[:2]]
    assert errors[1] < 3e-11 or np.log2(errors[0] / errors[1]) > 4.3


@pytest.mark.parametrize('method', FAMILIES[1:])
def test_a_constant_force_is_a_potential(method):
    """T + V - F . r stays, r being the joint point on which a force of constant direction acts."""
    simulation = pcs.Simulation(ARM, method, 1e-3)
    simulation.set_wrench('link_7', (3.0, 8.0), axes='world')

    def total():
        x, y, _ = frames(ARM, simulation.position)[-1]
        return sum(pcs.energy(ARM, simulation.position, simulation.velocity)) - 3.0 * x - 8.0 * y
    before = total()
    simulation.advance(300)
    assert abs(total() - before) < 1e-7


@pytest.mark.parametrize('method', FAMILIES)
def test_weights_put_on_by_hand_are_gravity(method):
    centred = replace(ARM, bodies=tuple(replace(body, center_of_mass=0j, inertia_com=body.inertia)
                                        for body in ARM.bodies))
    falls, pushed = pcs.Simulation(centred, method), pcs.Simulation(replace(centred, gravity=0j), method)
    for body in centred.bodies:
        weight = body.mass * centred.gravity
        pushed.set_wrench(body.name, (weight.real, weight.imag), axes='world')
    for simulation in (falls, pushed):
        simulation.advance(200)
    assert abs(falls.position).max() > 0.1
    np.testing.assert_allclose(pushed.position, falls.position, rtol=0, atol=1e-8)


class Odd(str):
    """A text that must not be compared by its own code."""

    __hash__ = str.__hash__

    def __eq__(self, other):
        raise AssertionError('compared')


def test_a_body_is_found_by_any_kind_of_text():
    simulation = pcs.Simulation(ROBOT)
    for name in ('forearm', np.str_('forearm'), Odd('forearm')):
        simulation.clear_wrenches()
        simulation.set_wrench(name, moment=1.0, axes=np.str_('world'))
        assert simulation.wrenches == {'forearm': Wrench(0j, 1.0, 'world')}


def test_a_wrench_is_held_replaced_and_taken_away():
    free = replace(ROBOT, gravity=0j)
    simulation = pcs.Simulation(free)
    simulation.set_state(np.zeros(5), np.zeros(5))
    rest = simulation.acceleration
    simulation.set_wrench('forearm', (0.0, 2.0), 0.5)
    simulation.set_wrench('column', (1.0, 0.0))
    assert simulation.wrenches == {'forearm': Wrench(2j, 0.5, 'body'), 'column': Wrench(1 + 0j, 0.0, 'body')}
    simulation.set_wrench('forearm', moment=0.25)
    assert list(simulation.wrenches.items())[-1] == ('forearm', Wrench(0j, 0.25, 'body')), 'the newest is the last'
    assert abs(simulation.acceleration - rest).max() > 0.1
    simulation.set_wrench('forearm')
    simulation.set_wrench('column')
    assert not simulation.wrenches and simulation.acceleration.tobytes() == rest.tobytes()
    simulation.set_wrench('forearm', (1.0, 1.0))
    apply_event(simulation, 'reset', {})
    assert not simulation.wrenches


@pytest.mark.parametrize('arguments, sentence', [
    (('elbow', (1.0, 0.0)), "body is 'elbow', must be one of column, upper_arm, forearm, side_arm, payload"),
    (('forearm', (1.0, np.nan)), 'force[1] is nan, must be finite'),
    (('forearm', (1.0,)), 'force has shape (1,), must have (2,)'),
    (('forearm', (1.0, 0.0), np.inf), 'moment[0] is inf, must be finite'),
    (('payload', (0.0, 1.7e308), 1.7e308), 'force is (0.0, 1.7e+308), moment 1.7e+308, must be smaller: about the '
     "link's joint point they are not finite"),
    (('forearm', (1.0, 0.0), 0.0, 'link'), "axes is 'link', must be 'body' or 'world'"),
    ((Odd('elbow'),), "body is 'elbow', must be one of column, upper_arm, forearm, side_arm, payload")])
def test_a_wrench_that_cannot_be_is_refused_and_changes_nothing(arguments, sentence):
    simulation = pcs.Simulation(ROBOT)
    simulation.attach('forearm', 0.5, (0.3, 0.4))
    simulation.set_wrench('column', moment=1.0)
    with pytest.raises(ValueError) as error:
        simulation.set_wrench(*arguments)
    assert str(error.value) == sentence and list(simulation.wrenches) == ['column']


@pytest.mark.parametrize('method', FAMILIES)
def test_calls_may_be_cut_and_a_checkpoint_knows_wrenches_and_payloads(method):
    def loaded():
        simulation = pcs.Simulation(ROBOT, method)
        simulation.set_wrench('forearm', (3.0, -2.0), 0.7)
        simulation.set_wrench('column', (1.0, 5.0), 0.2, 'world')
        simulation.advance(7)
        return simulation
    whole, cut = loaded(), loaded()
    whole.advance(40)
    for _ in range(40):
        cut.set_wrench('forearm', (3.0, -2.0), 0.7)   # the same again is no change
        cut.advance(1)
    assert whole.position.tobytes() == cut.position.tobytes()
    whole.attach('side_arm', 1.5, (0.1, 0.0))
    saved = whole.checkpoint()
    whole.advance(20)
    end = whole.position
    whole.clear_wrenches()
    whole.drop()
    whole.advance(5)
    assert whole.position.tobytes() != end.tobytes()
    for simulation in (whole, cut):
        simulation.restore(saved)
        assert simulation.payloads == ('payload',) and len(simulation.wrenches) == 2
        simulation.advance(20)
        assert simulation.position.tobytes() == end.tobytes() and simulation.tick == 67


def rods_with(**laws):
    """Return the seven-link arm whose second joint has these laws."""
    first, second, *others = ARM.bodies
    return replace(ARM, bodies=(first, replace(second, rotation=replace(second.rotation, **laws)), *others))


@pytest.mark.parametrize('method', FAMILIES)
def test_a_joint_that_stands_carries_wrenches_as_a_weld_does(method):
    position = np.linspace(0.2, -0.4, 7)
    stuck = pcs.Simulation(rods_with(friction=1e6), method, 2e-3)
    stuck.set_state(position, np.zeros(7))
    chain = rods_with()
    second = chain.bodies[1]
    weld = replace(second, rotation=None, angle=second.angle + second.rotation.axis * position[1])
    welded = pcs.Simulation(replace(chain, bodies=(chain.bodies[0], weld, *chain.bodies[2:])), method, 2e-3)
    others = [0, 2, 3, 4, 5, 6]
    welded.set_state(position[others], np.zeros(6))
    for simulation in (stuck, welded):
        simulation.attach('link_4', 0.05, (0.05, 0.02), name='tray')
        for body, axes in (('link_2', 'world'), ('link_3', 'body'), ('tray', 'world'), ('link_7', 'body')):
            simulation.set_wrench(body, (4.0, -3.0), 0.3, axes)
        simulation.advance(100)
    assert stuck.position[1] == position[1]
    np.testing.assert_allclose(stuck.position[others], welded.position, rtol=0, atol=1e-10)


def test_a_wrench_breaks_friction_at_the_right_moment_with_an_event():
    for moment, kinds in ((2.999999, []), (3.000001, ['slipped'])):
        chain = replace(ARM, gravity=0j, bodies=(replace(ARM.bodies[0], rotation=replace(
            ARM.bodies[0].rotation, friction=3.0)), *ARM.bodies[1:]))
        simulation = pcs.Simulation(chain)
        simulation.set_state(np.zeros(7), np.zeros(7))
        simulation.advance(5)
        simulation.take_events()
        # A couple on the first link alone: the others stay where they are until it moves.
        simulation.set_wrench(chain.bodies[0].name, moment=moment)
        simulation.advance(5)
        assert [(event.kind, event.tick) for event in simulation.take_events()] == [(kind, 5) for kind in kinds]
        assert (simulation.position[0] == 0.0) == (not kinds)


def test_a_held_joint_carries_the_wrenches_outboard():
    """A force that turns with a moving link moves the standing link when its moment exceeds the friction there."""
    first, second = ARM.bodies[:2]
    held = replace(first, rotation=replace(first.rotation, friction=1.0))
    chain = replace(ARM, gravity=0j, bodies=(held, second))
    simulation = pcs.Simulation(chain, 'taylor', 1e-3, 1e-12)
    simulation.set_state(np.zeros(2), [0.0, 1.0])
    simulation.set_wrench(chain.bodies[1].name, (10.0, 0.0))
    simulation.advance(2000)
    slip = next(event for event in simulation.take_events() if event.kind == 'slipped')
    # Until then the second link turns as if its joint point stood: the first one feels force and centrifugal force.
    angle = slip.time * 1.0   # no moment acts on the second link about its joint
    pull = 10.0 * np.exp(1j * angle) + second.mass * second.center_of_mass * np.exp(1j * angle) * 1.0**2
    moment = (np.conj(second.origin) * pull).imag
    assert abs(moment) == pytest.approx(1.0, abs=1e-9)


def payload_chain(chain, body, mass, position, inertia_com):
    """Return the chain as if it had been loaded with the payload."""
    carrier = [each.name for each in chain.bodies].index(body)
    payload = Body('payload', carrier, complex(*position), 0.0, mass, 0j, inertia_com, inertia_com)
    return replace(chain, bodies=(*chain.bodies, payload))


@pytest.mark.parametrize('method', FAMILIES)
def test_a_payload_is_a_body_from_its_tick_on_and_none_after(method):
    simulation = pcs.Simulation(ROBOT, method)
    simulation.advance(50)
    start = simulation.checkpoint()
    simulation.attach('forearm', 2.0, (0.4, 0.1), 0.05)
    assert simulation.payloads == ('payload',) and 'welded bodies merged: 1' in simulation.plan
    assert simulation.tick == 50 and simulation.position.tobytes() == start.state[0].tobytes()
    twin = pcs.Simulation(payload_chain(ROBOT, 'forearm', 2.0, (0.4, 0.1), 0.05), method)
    twin.set_state(start.state[0], start.state[1])
    np.testing.assert_allclose(simulation.acceleration, twin.acceleration, rtol=1e-13)
    for each in (simulation, twin):
        each.advance(50)
    np.testing.assert_allclose(simulation.position, twin.position, rtol=0, atol=1e-12)
    simulation.drop()
    assert not simulation.payloads and simulation.chain == ROBOT
    plain = pcs.Simulation(ROBOT, method)
    plain.set_state(simulation.position, simulation.velocity)
    np.testing.assert_allclose(simulation.acceleration, plain.acceleration, rtol=1e-12)


def test_a_heavy_payload_changes_the_form_and_keeps_the_digits():
    light = pcs.Simulation(replace(ARM, bodies=ARM.bodies[:4]), 'rk4')
    assert light.form == 'dense'
    light.attach(light.chain.bodies[-1].name, 1e6, (0.3, 0.0))
    assert light.form == 'recursive' and 'light links carry a heavy one' in light.plan
    light.drop()
    assert light.form == 'dense' and light.form_asked == 'auto'


@pytest.mark.parametrize('arguments, sentence', [
    (('elbow', 1.0), "body is 'elbow', must be one of column, upper_arm, forearm, side_arm"),
    (('forearm', -1.0), "payload 'payload' has a mass of -1.0 kg and an inertia of 0.0 kg m^2, must be > 0 and >= 0"),
    (('forearm', np.nan), 'mass[0] is nan, must be finite'),
    (('forearm', 1.0, (0.0, np.inf)), 'position[1] is inf, must be finite'),
    (('forearm', 1.0, (0.0, 0.0), 0.0, 'column'),
     "name is 'column', must be a string and not the name of a body of four_link_robot"),
    *((('forearm', mass, (place, 0.0)), "body 'payload' of four_link_robot is welded on too far from a joint: "
       'its moment of inertia about that is not finite') for mass, place in [(1.0, 1e300), (1e300, 1e100)])])
def test_a_payload_that_cannot_be_is_refused_and_changes_nothing(arguments, sentence):
    simulation = pcs.Simulation(ROBOT)
    with pytest.raises(ValueError) as error:
        simulation.attach(*arguments)
    assert str(error.value) == sentence and simulation.chain is ROBOT
    with pytest.raises(ValueError, match="payload is 'payload', must be one that is attached: there is none"):
        simulation.drop()


def test_payloads_carry_payloads_and_wrenches():
    simulation = pcs.Simulation(ROBOT)
    simulation.attach('forearm', 1.0, (0.1, 0.0), name='tray')
    simulation.attach('tray', 0.5, (0.0, 0.1), name='cup')
    simulation.set_wrench('cup', (0.0, -1.0), axes='world')
    simulation.set_wrench('column', moment=1.0)
    with pytest.raises(ValueError, match="payload 'tray' carries another one"):
        simulation.drop('tray')
    with pytest.raises(ValueError, match='must be one that is attached: tray, cup'):
        simulation.drop('forearm')
    simulation.drop('cup')
    assert list(simulation.wrenches) == ['column'] and simulation.payloads == ('tray',)
    simulation.drop('tray')
    assert simulation.chain == ROBOT


def test_an_arm_that_friction_held_slips_under_its_payload():
    chain = pcs.chain_from_dict({'name': 'crane', 'bodies': [
        {'name': 'boom', 'carrier': 'base', 'mass': 1.0, 'inertia': 1.0,
         'rotation': {'joint': 'luff', 'friction': 3.0}}]})
    simulation = pcs.Simulation(chain)
    simulation.advance(10)
    simulation.attach('boom', 0.25, (1.0, 0.0))   # 2.45 N m
    simulation.advance(10)
    assert simulation.position[0] == 0.0 and not simulation.take_events()[1:]
    simulation.drop()
    simulation.attach('boom', 0.5, (1.0, 0.0))    # 4.9 N m
    simulation.advance(10)
    assert simulation.position[0] < 0.0
    assert [(event.kind, event.tick) for event in simulation.take_events()] == [('slipped', 20)]


def test_changes_of_a_log_do_the_same():
    direct, changed = pcs.Simulation(ROBOT), pcs.Simulation(ROBOT)
    direct.set_wrench('forearm', (1.0, 2.0), 0.5)
    apply_event(changed, 'wrench', {'body': 'forearm', 'force': [1.0, 2.0], 'moment': 0.5, 'axes': 'body'})
    direct.attach('forearm', 0.5, (0.1, 0.0), 0.01)
    data = {'name': 'payload', 'body': 'forearm', 'mass': 0.5, 'position': [0.1, 0.0], 'inertia_com': 0.01}
    apply_event(changed, 'payload', data)
    for simulation in (direct, changed):
        simulation.advance(30)
    assert direct.position.tobytes() == changed.position.tobytes()
    with pytest.raises(ValueError):
        apply_event(changed, 'payload', {**data, 'mass': -1.0})
    assert changed.payloads == ('payload',) and changed.chain == direct.chain
    direct.drop()
    direct.attach('forearm', 0.75, (0.1, 0.0), 0.01)
    apply_event(changed, 'payload', {**data, 'mass': 0.75})
    assert changed.chain == direct.chain
    for _ in range(2):   # the second time there is none to drop
        apply_event(changed, 'payload', {**data, 'mass': 0.0})
        assert changed.chain == ROBOT


@pytest.mark.parametrize('method', ['auto', 'rk4'])
def test_a_log_with_loads_runs_again_and_knows_the_chain_of_each_tick(tmp_path, method):
    simulation, path = pcs.Simulation(ROBOT, method), tmp_path / 'run.mcap'
    payload = {'name': 'payload', 'body': 'forearm', 'mass': 0.5, 'position': [0.1, 0.0], 'inertia_com': 0.01}
    changes = {40: ('wrench', {'body': 'column', 'force': [1.0, -2.0], 'moment': 0.3, 'axes': 'body'}),
               90: ('payload', payload), 120: ('wrench', {'body': 'forearm', 'force': [0.0, 4.0], 'axes': 'world'}),
               160: ('payload', {**payload, 'mass': 0.0}), 200: ('reset', {})}
    accelerations = {}
    with pcs.OfflineLog(path, simulation) as log:
        for tick in range(240):
            if tick in changes:
                kind, data = changes[tick]
                log.change(kind, **data)
            log.advance(1)
            accelerations[tick + 1] = simulation.acceleration
    read = read_log(path)
    assert resimulate(read).difference is None
    for tick in (20, 41, 91, 130, 170, 230):
        chain, _, position, velocity, effort = state_at(read, tick * 1e-3)
        assert len(chain.bodies) == (5 if tick in (91, 130) else 4)
        acceleration = pcs.forward_dynamics(chain, position, velocity, effort)
        np.testing.assert_allclose(acceleration, accelerations[tick], rtol=1e-9, atol=1e-9)


def test_a_wrench_that_has_not_acted_yet_is_in_the_acceleration_and_in_a_checkpoint():
    """A joint that friction holds: whether it slips is decided with the wrench, also after a restore."""
    first, *others = ARM.bodies
    held = replace(first, rotation=replace(first.rotation, friction=3.0))
    chain = replace(ARM, gravity=0j, bodies=(held, *others))
    simulation = pcs.Simulation(chain)
    simulation.set_state(np.zeros(7), np.zeros(7))
    simulation.advance(5)
    assert simulation.acceleration[0] == 0.0
    simulation.set_wrench('link_1', moment=4.0)
    saved = simulation.checkpoint()
    assert simulation.acceleration[0] > 0.0
    ends = []
    for again in range(2):
        if again:
            simulation.restore(saved)
        simulation.advance(5)
        ends.append(simulation.position.tobytes())
        assert [event.kind for event in simulation.take_events()] == ['slipped']
    assert ends[0] == ends[1] and simulation.position[0] > 0.0
