"""What calls from Python accept and refuse: one check in the kernel; the same bits from every kind of number."""
from fractions import Fraction

import numpy as np
from oracles.random_trees import one_joint, random_state, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim import _kernel
from planar_chain_sim.benchmark.problems import uniform_rods
from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain.joint_arrays import joint_array
from planar_chain_sim.chain.tree import Body, Joint
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.mechanics.solvable import singular_joint

EPS = np.finfo(float).eps
CALLS = {'forward_dynamics': 3, 'inverse_dynamics': 3, 'mass_matrix': 1, 'energy': 2, 'linearize': 3}
LOOKS = {
    'list': list, 'tuple': tuple, 'floats': lambda row: row.tolist(), 'integers': lambda row: row.astype(int).tolist(),
    'mixed': lambda row: [int(row[0]), *row[1:].tolist()], 'int32': lambda row: row.astype(np.int32),
    'float32': lambda row: row.astype(np.float32), 'swapped': lambda row: row.astype('>f8'),
    'strided': lambda row: np.repeat(row, 2)[::2], 'backwards': lambda row: row[::-1].copy()[::-1],
    'matrix row': lambda row: np.vstack([row, row])[1], 'column': lambda row: np.column_stack([row, row])[:, 1],
    'read-only': lambda row: np.frombuffer(row.tobytes()),
    'unaligned': lambda row: np.frombuffer(b'x' + row.tobytes(), dtype=np.float64, offset=1),
    'objects': lambda row: row.astype(object), 'fractions': lambda row: [Fraction(number) for number in row]}
NO_NUMBERS = {
    'strings': ['1', '2'], 'bytes': [b'1', b'2'], 'a string': '12', 'bytes alone': b'12', 'bytearray': bytearray(b'12'),
    'strings as objects': np.array(['1', 2.0], dtype=object), 'one string': [0.0, 'x'], 'none': [None, 1.0],
    'dates': np.zeros(2, 'datetime64[s]'), 'spans': np.zeros(2, 'timedelta64[s]'),
    'structured': np.zeros(2, [('a', float)]), 'masked': np.ma.array([1.0, 2.0]),
    'half masked': np.ma.array([1.0, 2.0], mask=[0, 1]), 'complex': [0.0, 1j], 'complex array': np.ones(2) * 1j,
    'complex objects': np.array([0.0, np.complex128(1.0)], dtype=object), 'too large': [10**400, 0],
    'too large, negative': (0, -10**400), 'ragged': [0.0, [1.0, 2.0]], 'a set': {0.0, 1.0},
    'a mapping': {0: 0.0, 1: 1.0}, 'functions': [len, len], 'iterator': iter([0.0, 1.0])}


def bits(answer):
    return [np.asarray(part).tobytes() for part in (answer if isinstance(answer, tuple) else (answer,))]


@pytest.mark.parametrize('call', CALLS)
@pytest.mark.parametrize('look', LOOKS)
def test_the_same_numbers_give_the_same_bits_however_they_come(call, look):
    chain, function = uniform_rods(3, bend=0.2), getattr(pcs, call)
    rows = [np.array([2.0, -1.0, 3.0]), np.array([1.0, 4.0, -2.0]), np.array([5.0, 0.0, -7.0])][:CALLS[call]]
    wanted = bits(function(chain, *rows))
    assert bits(function(chain, *map(LOOKS[look], rows))) == wanted
    simulations = [pcs.Simulation(chain, 'rk4') for _ in range(2)]
    simulations[0].set_state(rows[0], rows[0])
    simulations[1].set_state(LOOKS[look](rows[0]), LOOKS[look](rows[0]))
    for simulation, effort in zip(simulations, (rows[0], LOOKS[look](rows[0]))):
        simulation.advance(3, effort)
    assert bits(simulations[0].position) == bits(simulations[1].position)


def test_a_single_joint_takes_a_bare_number():
    chain = uniform_rods(1)
    assert bits(pcs.forward_dynamics(chain, 0.5, np.float32(2.0), 3)) == bits(
        pcs.forward_dynamics(chain, [0.5], [2.0], [3.0]))


@pytest.mark.parametrize('values, sentence', [
    ([1.0], 'NAME has shape (1,), must have (2,)'), ([], 'NAME has shape (0,), must have (2,)'),
    ([[1.0, 2.0, 3.0]], 'NAME has shape (1, 3), must have (2,)'), (1.0, 'NAME has shape (1,), must have (2,)'),
    (np.zeros((2, 3)), 'NAME has shape (2, 3), must have (2,)'),
    ([0.0, np.nan], 'NAME[1] is nan, must be finite'), ((np.inf, 0.0), 'NAME[0] is inf, must be finite'),
    (np.array([0.0, -np.inf]), 'NAME[1] is -inf, must be finite'),
    ('no', "NAME must be numbers of shape (2,), got 'no'"), (None, 'NAME must be numbers of shape (2,), got None'),
    ([0.0, 'x'], "NAME must be numbers of shape (2,), got [0.0, 'x']"),
    ([0.0, 1j], 'NAME must be numbers of shape (2,), got [0.0, 1j]'),
    ([0.0, [1.0, 2.0]], 'NAME must be numbers of shape (2,), got [0.0, [1.0, 2.0]]'),
    (list(range(100)) + ['x'], 'NAME must be numbers of shape (2,), got ' + repr(list(range(100)))[:80])])
def test_every_call_refuses_each_of_its_arguments_in_one_sentence(values, sentence):
    chain = uniform_rods(2)
    for call, count in CALLS.items():
        third = 'acceleration' if call == 'inverse_dynamics' else 'effort'
        for place, name in enumerate(('position', 'velocity', third)[:count]):
            arguments = [[0.1, 0.2]] * count
            arguments[place] = values
            with pytest.raises(ValueError) as caught:
                getattr(pcs, call)(chain, *arguments)
            wanted = sentence if call == 'linearize' else sentence.replace('(2,)', '(..., 2)')
            assert str(caught.value) == wanted.replace('NAME', name)
    simulation = pcs.Simulation(chain, 'rk4')
    before = bits(simulation.position)
    for name, arguments in (('position', (values, [0.0, 0.0])), ('velocity', ([1.0, 1.0], values))):
        with pytest.raises(ValueError) as caught:
            simulation.set_state(*arguments)
        assert str(caught.value) == sentence.replace('NAME', name) and bits(simulation.position) == before


def doors():
    """Return by name every place at which the Python interface takes two numbers, as a function of these."""
    chain, row = uniform_rods(2), [0.1, 0.2]
    body = chain.bodies[0].name
    counts = {**CALLS, 'body_poses': 1, 'body_velocities': 2, 'center_of_mass': 1, 'momentum': 2, 'reaction_forces': 3}
    found = {f'{name}, argument {place + 1}': lambda values, name=name, place=place, count=count: getattr(pcs, name)(
        chain, *(values if k == place else row for k in range(count)))
        for name, count in counts.items() for place in range(count)}
    return found | {
        'forward_dynamics by matrices': lambda values: pcs.forward_dynamics(chain, row, row, values, form='reference'),
        'jacobian of positions': lambda values: pcs.jacobian(chain, values, body),
        'jacobian of a point': lambda values: pcs.jacobian(chain, row, body, values),
        'set_state, position': lambda values: pcs.Simulation(chain).set_state(values, row),
        'set_state, velocity': lambda values: pcs.Simulation(chain).set_state(row, values),
        'advance': lambda values: pcs.Simulation(chain).advance(2, values),
        'advance_to': lambda values: pcs.Simulation(chain).advance_to(0.0005, values),
        'set_wrench': lambda values: pcs.Simulation(chain).set_wrench(body, values),
        'attach': lambda values: pcs.Simulation(chain).attach(body, 0.1, values),
        'rollout under a function': lambda values: pcs.rollout(chain, 0.001, effort=lambda *_: values),
        **{f'{run.__name__}, {name}': lambda values, run=run, name=name: run(chain, duration=0.002, **{name: values})
           for run in (pcs.rollout, pcs.rollout_batch) for name in ('position', 'velocity', 'effort')}}


@pytest.mark.parametrize('door', doors())
@pytest.mark.parametrize('what', NO_NUMBERS)
def test_what_is_no_number_is_refused_at_every_door(door, what):
    with pytest.raises(ValueError) as caught:
        doors()[door](NO_NUMBERS[what])
    assert 'must' in str(caught.value) and '\n' not in str(caught.value)


@pytest.mark.parametrize('seed', range(40))
def test_a_random_misfit_at_a_random_door_is_one_sentence(seed):
    """Valid rows of which a part is replaced by something that is no number, in any container."""
    draw = np.random.default_rng(seed)
    wrong = ['1', b'1', 'x', None, 1j, 10**400, -10**400, np.nan, np.inf, np.datetime64('2020-01-01'), object(), [0.1]]
    for name, door in doors().items():
        row = [0.1, 0.2]
        row[draw.integers(2)] = wrong[draw.integers(len(wrong))]
        if draw.random() < 0.3:
            boxed = np.empty(2, dtype=object)
            boxed[:] = row
            row = boxed
        elif draw.random() < 0.3:
            row = tuple(row)
        with pytest.raises(ValueError) as caught:
            door(row)
        assert 'must' in str(caught.value) and '\n' not in str(caught.value), (name, row)


@pytest.mark.parametrize('wrong', ['1', b'1', 10**400, -10**400, 1j, [1.0], np.nan, np.inf, None, {}, np.str_('1'),
                                   np.datetime64('2020-01-01'), np.timedelta64(1, 's'), np.array([1.0, 2.0])], ids=repr)
def test_what_is_no_number_is_refused_where_one_is_wanted(wrong):
    chain = uniform_rods(2)
    body = chain.bodies[0].name
    for call in (lambda: pcs.Simulation(chain, step=wrong),
                 lambda: pcs.Simulation(chain, tolerance='none' if wrong is None else wrong),
                 lambda: pcs.Simulation(chain).advance(wrong), lambda: pcs.Simulation(chain).advance_to(wrong),
                 lambda: pcs.Simulation(chain, 'rk4').advance_to(wrong), lambda: pcs.rollout(chain, wrong),
                 lambda: pcs.rollout_batch(chain, duration=wrong),
                 lambda: pcs.rollout_batch(chain, duration=0.002, threads='none' if wrong is None else wrong),
                 lambda: pcs.Simulation(chain).set_wrench(body, moment=wrong),
                 lambda: pcs.Simulation(chain).attach(body, wrong),
                 lambda: pcs.Simulation(chain).attach(body, 0.1, inertia_com=wrong)):
        with pytest.raises(ValueError, match='must'):
            call()


def test_places_in_tables_are_named_by_row_and_column():
    rows = np.zeros((3, 2))
    rows[2, 1] = np.inf
    with pytest.raises(ValueError, match=r'^rows\[2, 1\] is inf, must be finite$'):
        joint_array('rows', rows, (3, 2))
    own = np.zeros(2)
    assert joint_array('own', own, (2,)) is own and joint_array('own', [1, 2], (2,)).tolist() == [1.0, 2.0]


def test_an_error_of_another_kind_is_not_taken_for_a_misfit():
    class Broken:
        def __array__(self, *arguments, **options):
            raise KeyError('broken')
    with pytest.raises(KeyError, match='broken'):
        pcs.mass_matrix(uniform_rods(2), Broken())


def test_what_the_kernel_refuses_counts_no_tick():
    simulation = pcs.Simulation(uniform_rods(2), 'rk4')
    good = np.empty((10, 2))
    for record in ((good, good), [good], (good, good, good.tolist()), good, ()):
        with pytest.raises(ValueError, match='^record '):
            simulation.advance(10, None, record=record)
        assert simulation.tick == 0 and simulation.time == 0.0
    for effort in ([0.0, [1.0, 2.0]], [[0.0, 1.0], [2.0]], {}, 'no'):
        with pytest.raises(ValueError, match='^effort'):
            simulation.advance(2, effort)
    assert simulation.tick == 0 and simulation.statistics['steps'] == 0


@pytest.mark.parametrize('seed', range(60))
def test_linearize_is_the_solution_by_a_general_solver(seed):
    """Twin: H^-1 (-K, -C, 1) by LAPACK; two stable solutions differ by cond(H) eps of the largest number in them."""
    chain = random_tree(seed, bodies=1 + seed % 30)
    position, velocity, effort = random_state(chain, seed)
    n = chain.joint_count
    H, K, C = plan_of(chain).model.derivatives(position, velocity,
                                               pcs.forward_dynamics(chain, position, velocity, effort))
    wanted = np.linalg.solve(H, np.hstack([-K, -C, np.eye(n)]))
    A, B = pcs.linearize(chain, position, velocity, effort)
    got = np.hstack([A[n:], B[n:]])
    limit = 4.0 * np.linalg.cond(H) * EPS * np.abs(wanted).max(axis=0)   # column by column
    assert (np.abs(got - wanted) <= limit).all()


@pytest.mark.parametrize('turns', [1e3, 1e6, 2.0**40])
def test_linearize_leaves_out_whole_turns(turns):
    """A position of whole turns more, in exact multiples of what 2 pi is in doubles, and the same angle near zero."""
    chain, rate = uniform_rods(3, bend=0.2), [0.3, -0.2, 0.1]
    far = np.array([0.5, -1.0, 2.0]) + turns * 2.0 * np.pi
    exact = pytest.importorskip('mpmath')
    with exact.workdps(60):
        near = [float(exact.mpf(q) - 2 * exact.pi * exact.nint(exact.mpf(q) / (2 * exact.pi))) for q in far]
    for got, wanted in zip(pcs.linearize(chain, far, rate, rate), pcs.linearize(chain, near, rate, rate)):
        assert np.abs(got - wanted).max() <= 100.0 * EPS * np.abs(wanted).max()


def collinear():
    return Chain('collinear', -9.81j, (
        Body('link', -1, 0j, 0.0, 0.0, 0j, 0.0, 0.0, None, Joint('shoulder', 'rotation', 1.0)),
        Body('bob', 0, 1 + 0j, 0.0, 1.0, 1 + 0j, 1.0, 0.0, None, Joint('elbow', 'rotation', 1.0))))


@pytest.mark.parametrize('call', [pcs.forward_dynamics, pcs.linearize])
def test_what_has_no_answer_names_its_joint(call):
    with pytest.raises(pcs.SimulationError) as caught:
        call(collinear(), [0.3, 0.0], [0, 0], (0.0, 0.0))
    assert str(caught.value) == "joint 'shoulder' of body 'link' of collinear: the configuration is singular"
    assert caught.value.position.tolist() == [0.3, 0.0] and caught.value.velocity.dtype == np.float64
    with pytest.raises(pcs.SimulationError) as caught:
        call(uniform_rods(2), [0.0, 1.0], [1e200, 1e200], [0.0, 0.0])
    assert str(caught.value).endswith('the acceleration is not finite') and caught.value.joint == 'joint0'
    assert np.isfinite(pcs.linearize(collinear(), [0.3, 1.0], [0.0, 0.0], [0.0, 0.0]).A).all()
    assert singular_joint(collinear()) is None


def test_a_derivative_that_is_not_finite_is_refused():
    """Two rods in line turn against each other so fast that the squares of their rates fit, and twice those do not."""
    chain = Chain('fast', 0j, tuple(
        Body(f'b{k}', k - 1, complex(k), 0.0, 1.0, 0.5 + 0j, 1.0, 0.75, None, Joint(f'j{k}', 'rotation', 1.0))
        for k in range(2)))
    state = [0.0, 0.0], [1.2e154, -1.2e154], [0.0, 0.0]
    assert np.isfinite(pcs.forward_dynamics(chain, *state)).all()
    with pytest.raises(pcs.SimulationError, match='the derivatives of the acceleration are not finite$'):
        pcs.linearize(chain, *state)


def test_friction_that_stands_still_is_refused_before_anything_is_computed():
    with pytest.raises(ValueError, match="^velocity of joint 'joint' is 0.0, must not be: its friction has no "
                                         'derivative where it stands still$'):
        pcs.linearize(one_joint(friction=0.5), [0.0], [0], [0.0])


def test_what_a_method_knows_is_made_once():
    row = pcs.METHODS['rk4']
    pcs.Simulation(uniform_rods(2), 'rk4')
    known = row.stability_limits, row.tableau
    pcs.Simulation(uniform_rods(3), 'rk4')
    assert row.stability_limits is known[0] and row.tableau is known[1]
    # where x^4 / 24 - ... = 1 on the real axis, and 2 sqrt 2 on the imaginary one; both to steps of 0.01
    assert known[0] == (pytest.approx(2.785, abs=0.01), pytest.approx(2.828, abs=0.01))
    assert _kernel.MethodData(row.family, 4, False, 0.0, tableau=row.tableau)
