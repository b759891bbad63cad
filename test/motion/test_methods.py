"""Order, error control, interpolation and repeatability of every row of METHODS."""
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
import pickle

import numpy as np
from oracles.random_trees import one_joint, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim import _kernel, SimulationError
from planar_chain_sim.benchmark.problems import uniform_rods
from planar_chain_sim.chain.joint_arrays import initial_state
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.motion.integrators import Method, method_data

CONFIG = Path(__file__).resolve().parents[2] / 'config'
CHAIN = pcs.load_chain(str(CONFIG / 'four_link_robot.yaml'))    # branched, sliding, damped
TIME = 1.0
OF_ONE_ORDER = [name for name, row in pcs.METHODS.items() if row.order]
ADAPTIVE = [name for name, row in pcs.METHODS.items() if row.adaptive]
STEPS = {1: 1024, 4: 128, 5: 256, 6: 32, 8: 32}   # coarsest for the order: errors from 1e-3 down to 1e-12
INTERPOLATION_ORDER = {'dop853': 7, 'rodas5p': 4, 'dopri5': 4, 'bare dopri5': 3}
# Dormand and Prince (1980), with its derivative at the end in the error estimate, as a user would add it: one row.
DOPRI5 = Method('dopri5', 'explicit Runge-Kutta', 5, True, '', '', a=(
    (0, 0, 0, 0, 0, 0), (1 / 5, 0, 0, 0, 0, 0), (3 / 40, 9 / 40, 0, 0, 0, 0), (44 / 45, -56 / 15, 32 / 9, 0, 0, 0),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0)),
    b=(35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    error=((71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),),
    interpolation=((-12715105075 / 11282082432, 0, 87487479700 / 32700410799, -10690763975 / 1880347072,
                    701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423),))
BARE_DOPRI5 = replace(DOPRI5, name='bare dopri5', interpolation=())


def exact_state(time, chain=CHAIN, effort=None):
    """Position and velocity (2, joints) by series of order 20, whose error is round-off."""
    simulation = pcs.Simulation(chain, 'taylor', time, tolerance=1e-16)
    simulation.advance(1, effort)
    return np.array([simulation.position, simulation.velocity])


def stepper_of(row, tick, tolerance=1e-9, fixed=0.0):
    stepper = _kernel.Stepper(plan_of(CHAIN).model, method_data(row, tolerance, fixed), tick, True)
    stepper.put_state(*initial_state(CHAIN))
    return stepper


def state_by_given_steps(row, steps, at=TIME):
    """State (2, joints) at `at` s by steps of TIME / steps; between their ends by interpolation."""
    length = TIME / steps
    stepper = stepper_of(row, TIME if row.adaptive else length, fixed=length)
    if row.adaptive:
        stepper.advance_to(0, float(at), np.zeros(CHAIN.joint_count))
    else:
        stepper.advance(round(at / length), None, None)
    assert abs(stepper.counts[1] - at / length) < 1.0 + 1e-9
    return np.array([stepper.position, stepper.velocity])


@pytest.mark.parametrize('row', [*(pcs.METHODS[name] for name in OF_ONE_ORDER), DOPRI5], ids=lambda row: row.name)
def test_measured_order(row):
    """Positions and velocities at the end of ever smaller steps converge with the declared order."""
    counts = STEPS[row.order] * np.array([2, 3, 4]) // 2
    exact = exact_state(TIME)
    errors = np.array([np.abs(state_by_given_steps(row, count) - exact).max() for count in counts])
    slopes = -np.diff(np.log2(errors)) / np.diff(np.log2(counts))
    assert np.abs(slopes - row.order).max() < 0.2, (errors, slopes)


@pytest.mark.parametrize('row', [pcs.METHODS['dop853'], pcs.METHODS['rodas5p'], DOPRI5, BARE_DOPRI5],
                         ids=lambda row: row.name)
def test_measured_order_of_interpolation(row):
    """Inside one step the error falls with one power more than the order of its interpolation."""
    order, errors = INTERPOLATION_ORDER[row.name], []
    lengths = np.array([1 / 16, 1 / 32, 1 / 64]) / (4 if order < 7 else 1)
    for length in lengths:
        places = length * np.linspace(0.1, 0.9, 9)
        errors.append(max(np.abs(state_by_given_steps(row, TIME / length, at) - exact_state(at)).max()
                          for at in places))
    slopes = -np.diff(np.log2(errors))
    assert np.abs(slopes - order - 1).max() < 0.4, (errors, slopes)


@pytest.mark.parametrize('row', [*(pcs.METHODS[name] for name in ADAPTIVE), DOPRI5], ids=lambda row: row.name)
def test_ticks_are_as_good_as_the_tolerance_asks(row):
    """Ticks read off few steps: all are within a small multiple of the tolerance, and it is not wasted."""
    ticks, errors, counts = 200, [], []
    exact = pcs.rollout(CHAIN, TIME, TIME / ticks, 'dop853_fixed')
    for tolerance in (1e-4, 1e-7, 1e-10):
        stepper = stepper_of(row, TIME / ticks, tolerance)
        position, velocity, effort = np.empty((3, ticks, CHAIN.joint_count))
        stepper.advance(ticks, None, (position, velocity, effort))
        errors.append(max(np.abs(position - exact.position[1:]).max(), np.abs(velocity - exact.velocity[1:]).max()))
        counts.append(stepper.counts[1])
        assert errors[-1] < 100 * tolerance, (tolerance, errors)   # a local error, times steps and what the arm adds
    assert errors[0] > 1e3 * errors[2]
    if row.order:
        assert 1 / 3 < counts[2] / counts[0] / 10 ** (6 / row.order) < 3
        assert counts[2] < {5: 1000, 8: 60}[row.order]


@pytest.mark.parametrize('row', [pcs.METHODS['dop853'], DOPRI5], ids=lambda row: row.name)
def test_no_evaluation_is_thrown_away(row):
    """
    An explicit step costs its stages, the first being the last of the step before, and a rejected one those it had.

    Besides: the very first, one to find a first length, and the stages of interpolation where ticks are read.
    """
    for tick, reads_ticks in ((1e-4, True), (TIME, False)):
        stepper = stepper_of(row, tick)
        stepper.advance(round(TIME / tick), None, None)
        evaluations, steps, rejected, _ = stepper.counts
        extra = len(row.interpolation_a) * (steps if reads_ticks else 1)
        in_rejected = len(row.b) - 1 + (row is DOPRI5)
        assert evaluations == 2 + len(row.b) * steps + in_rejected * rejected + extra
        assert rejected > 0 or row is DOPRI5


def test_dop853_is_the_published_tableau():
    """The same numbers as in another code that was written from Hairer's."""
    published = pytest.importorskip('scipy.integrate._ivp.dop853_coefficients')
    row, fixed = pcs.METHODS['dop853'], pcs.METHODS['dop853_fixed']
    assert np.array_equal(row.a, published.A[:12, :12]) and np.array_equal(row.b, published.B)
    assert np.array_equal(row.error, [published.E5, published.E3])
    assert np.array_equal(row.interpolation_a, published.A[13:]) and np.array_equal(row.interpolation, published.D)
    assert (fixed.a, fixed.b) == (row.a, row.b)


def schedule(chain):
    """Efforts that are held for a while, change, and come back: (ticks, joints)."""
    low, high = np.full(chain.joint_count, -0.2), np.linspace(0.1, 0.5, chain.joint_count)
    return np.array([low] * 7 + [high] * 20 + [low] + [high] * 12)


@pytest.mark.parametrize('name', pcs.METHODS)
def test_how_calls_are_cut_changes_no_bit(name):
    efforts = schedule(CHAIN)
    whole, ones = (pcs.Simulation(CHAIN, name, 5e-3) for _ in range(2))
    whole.advance(len(efforts), efforts)
    for row in efforts:
        ones.advance(1, row)
    assert whole.position.tobytes() == ones.position.tobytes()
    assert whole.velocity.tobytes() == ones.velocity.tobytes()
    held = [pcs.Simulation(CHAIN, name, 5e-3) for _ in range(2)]
    held[0].advance(40, efforts[-1])
    for ticks in (1, 11, 28):
        held[1].advance(ticks, efforts[-1])
    assert held[0].position.tobytes() == held[1].position.tobytes()


@pytest.mark.parametrize('name', pcs.METHODS)
def test_checkpoint_goes_on_with_the_same_bits(name):
    """After every tick, so within steps and at their ends, into a simulation that has been elsewhere."""
    efforts = schedule(CHAIN)
    simulation, other = (pcs.Simulation(CHAIN, name, 5e-3) for _ in range(2))
    other.advance(3, efforts[9])
    for row in efforts:
        simulation.advance(1, row)
        other.restore(pickle.loads(pickle.dumps(simulation.checkpoint())))
        for going in (simulation, other):
            going.advance(1, row)
        assert other.position.tobytes() == simulation.position.tobytes()
        assert other.velocity.tobytes() == simulation.velocity.tobytes()
        assert [part.tobytes() for part in other.checkpoint().state] == [
            part.tobytes() for part in simulation.checkpoint().state]


@pytest.mark.parametrize('name', ADAPTIVE)
def test_steps_start_anew_where_the_effort_changes(name):
    """The same as setting the state at that tick: nothing of the old step is used."""
    efforts = schedule(CHAIN)
    going = pcs.Simulation(CHAIN, name, 5e-3)
    going.advance(7, efforts[0])
    saved = going.checkpoint()
    going.advance(5, efforts[7])
    anew = pcs.Simulation(CHAIN, name, 5e-3)
    anew.restore(replace(saved, state=(*saved.state[:5], anew.checkpoint().state[5])))
    anew.advance(5, efforts[7])
    assert going.position.tobytes() == anew.position.tobytes()
    exact = exact_state(7 * 5e-3, effort=efforts[0])
    assert np.abs(saved.state[0] - exact[0]).max() < 1e-8


@pytest.mark.parametrize('name', pcs.METHODS)
@pytest.mark.parametrize('stem', sorted(path.stem for path in CONFIG.iterdir()))
def test_every_method_moves_every_shipped_chain(name, stem):
    """Ten ticks of 1 ms end where the others end, as near as the order allows."""
    chain = pcs.load_chain(CONFIG / f'{stem}.yaml')
    run = pcs.rollout(chain, 0.01, 1e-3, name)
    exact = exact_state(0.01, chain)
    tolerance = 1e-2 if pcs.METHODS[name].order == 1 else 1e-6
    assert np.abs(run.position[-1] - exact[0]).max() < tolerance * max(1.0, np.abs(exact[0]).max())
    assert np.abs(run.position[-1] - run.position[0]).max() > 1e-6


def double_pendulum():
    """Return the config's chain, high up and with no damping."""
    chain = pcs.load_chain(CONFIG / 'double_pendulum.yaml')
    return replace(chain, bodies=tuple(
        replace(body, rotation=replace(body.rotation, damping=0.0, position=position, velocity=0.0))
        for body, position in zip(chain.bodies, (2.0, 0.5))))


def energy_errors(name, step, ticks):
    """|E - E_0| over the range of V, at 40 places of a run of the free double pendulum."""
    chain = double_pendulum()
    simulation = pcs.Simulation(chain, name, step)
    start = sum(pcs.energy(chain, simulation.position, simulation.velocity))
    potential = [pcs.energy(chain, [angle, 0.0], [0.0, 0.0])[1] for angle in np.linspace(0.0, 2 * np.pi, 100)]
    errors = []
    for _ in range(40):
        simulation.advance(ticks // 40)
        errors.append(sum(pcs.energy(chain, simulation.position, simulation.velocity)) - start)
    return np.abs(errors) / np.ptp(potential)


def test_gauss6_keeps_the_energy_of_a_free_arm():
    """
    At 10 ms for 1000 s its error shows no trend, where rk4's goes on growing.

    At 1 ms for 100 s it is round-off, but for places where the arm whips: an error that comes back is no drift.
    """
    free = energy_errors('gauss6', 0.01, 100_000)
    assert free[20:].max() < 3 * free[:20].max() < 1e-4
    growing = energy_errors('rk4', 0.005, 100_000)
    assert growing[20:].max() > 1.5 * growing[:20].max()
    assert np.median(energy_errors('gauss6', 0.001, 100_000)) < 5e-15    # 20 eps: a random walk of 1e5 steps, no sum


def test_semi_implicit_euler_moves_with_the_new_velocity():
    """On a spring, in exact binary fractions: v_1 = v_0 - h k q_0 / m, q_1 = q_0 + h v_1."""
    chain = one_joint('slide', stiffness=8.0, position=1.0, velocity=0.5)
    simulation = pcs.Simulation(chain, 'semi_implicit_euler', 0.25)
    simulation.advance(2)
    assert simulation.velocity.tolist() == [-0.5 - 0.875]
    assert simulation.position.tolist() == [0.875 - 0.25 * 1.375]
    assert simulation.statistics['evaluations'] == 2


@pytest.mark.parametrize('name', ['semi_implicit_euler', 'gauss6'])
def test_hidden_terms_of_velocities_enter_the_positions(name):
    """Constant acceleration in steps of 2^-10 s: position with its hidden term is right far below double precision."""
    start, step, ticks = 1000 / 3, Fraction(1, 1024), 100
    simulation = pcs.Simulation(one_joint('slide', mass=3.0, velocity=start), name, float(step))
    simulation.advance(ticks, [1.0])
    time, rate = ticks * step, Fraction(simulation.acceleration[0])
    exact = Fraction(start) * time + rate * time * (time + (step if name == 'semi_implicit_euler' else 0)) / 2
    position, _, hidden, _ = (Fraction(array[0]) for array in simulation.checkpoint().state[:4])
    assert abs(position + hidden - exact) < 1e-18


def test_gauss6_says_when_its_iteration_does_not_converge():
    stiff = one_joint(damping=1e4, velocity=1.0)
    simulation = pcs.Simulation(stiff, 'gauss6', 1e-3)
    with pytest.raises(SimulationError, match='tick 0.*the step is too long, its iteration does not converge'):
        simulation.advance(1)
    assert simulation.velocity.tolist() == [1.0]


def test_gauss6_iterates_from_the_last_stages():
    """Where the same effort goes on, the stages of the last two steps are a far better start than the state alone."""
    evaluations = []
    for change in (0.0, 1e-300):
        simulation = pcs.Simulation(double_pendulum(), 'gauss6', 1e-3)
        simulation.advance(1000, np.outer(np.arange(1000) % 2, [change, 0.0]))
        evaluations.append(simulation.statistics['evaluations'])
    assert evaluations[0] < 0.7 * evaluations[1]


def test_a_free_slide_is_a_straight_line_for_every_method():
    """With an error estimate of zero steps may grow without bound, and ticks stay exact to a few roundings."""
    for name in pcs.METHODS:
        simulation = pcs.Simulation(one_joint('slide', velocity=1 / 3), name, 0.1)
        simulation.advance(10_000)
        roundings = 200 if name == 'rodas5p' else 8   # whose stages are weighed with numbers as large as 150
        assert abs(simulation.position[0] - 1000 / 3) <= roundings * np.spacing(1000 / 3), name
        assert simulation.velocity[0] == 1 / 3


def test_an_adaptive_step_that_cannot_be_evaluated_fails_and_keeps_the_state():
    tree = random_tree(3, bodies=4)
    simulation = pcs.Simulation(tree, 'dop853', 0.01)
    simulation.set_state(np.full(tree.joint_count, 1e160), np.zeros(tree.joint_count))
    with pytest.raises(SimulationError, match='tick 0'):
        simulation.advance(10)
    assert simulation.position.tolist() == [1e160] * tree.joint_count


@pytest.mark.parametrize('turns', [2, -1_000_000, 10**10])
@pytest.mark.parametrize('method', pcs.METHODS)
def test_a_million_turns_behind_it_an_arm_moves_as_it_did(method, turns):
    """Twins that differ by whole turns, to twice double precision, at the same tolerance."""
    pi = Fraction('3.14159265358979323846264338327950288419716939937510582097494459')
    start, rate = [0.5, 0.3, -0.2], [1.0, 0.5, 0.2]
    ends = []
    for whole in (0, turns):
        simulation = pcs.Simulation(uniform_rods(3), method, 1e-3, 1e-15 if pcs.METHODS[method].adaptive else None)
        simulation.set_state(start, rate)
        saved = simulation.checkpoint()
        angle = Fraction(start[0]) + 2 * whole * pi
        position, remainder = saved.state[0].copy(), np.zeros(3)
        position[0] = float(angle)
        remainder[0] = float(angle - Fraction(position[0]))
        simulation.restore(replace(saved, state=(position, saved.state[1], remainder, *saved.state[3:])))
        simulation.advance(200)
        position, velocity, remainder, *_ = simulation.checkpoint().state
        reached = [Fraction(high) + Fraction(low) for high, low in zip(position, remainder)]
        reached[0] -= 2 * whole * pi
        ends.append([*map(float, reached), *velocity])
    np.testing.assert_allclose(ends[1], ends[0], rtol=0, atol=1e-13)
