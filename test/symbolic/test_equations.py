"""The equations as they are printed, against Lagrange's by SymPy, the book, the reference form and the kernel."""
from dataclasses import replace
import json
import math
import re

import numpy as np
from oracles.lagrange import Lagrange
from oracles.lagrange_numbers import LagrangeNumbers
from oracles.random_trees import random_state, random_tree
from printed import expression_of_latex, from_text, PlaneVector, READERS, vectors_of
import pytest
import sympy

import planar_chain_sim as pcs
from planar_chain_sim.mechanics import equations_of_motion
from planar_chain_sim.mechanics.path_matrix import motion_of_joints
from planar_chain_sim.symbolic.factors import Coordinate, Motion, Symbol
from planar_chain_sim.symbolic.json_document import json_document
from planar_chain_sim.symbolic.latex_document import latex_document
from planar_chain_sim.symbolic.notation import display_width, LATEX, SOFT_BREAK
from planar_chain_sim.symbolic.terms import Coefficient, Equation, Term
from planar_chain_sim.symbolic.text_document import text_document
from planar_chain_sim.symbolic.writing import Writer

EPS = np.finfo(float).eps
WRITERS = {'text': text_document, 'latex': latex_document, 'json': json_document}
FORMS = [(coordinates, trigonometric, numeric) for coordinates in ('absolute', 'joint')
         for trigonometric in (False, True) for numeric in (False, True)]
EXAMPLES = [(coordinates, trigonometric) for coordinates in ('absolute', 'joint') for trigonometric in (False, True)]
CONFIG = ('arczewski_example', 'cart_arm_telescope', 'double_pendulum', 'four_link_robot', 'seven_link_arm')

# (5.90) to (5.94) as corrected in equations.md 8
BOOK = {
    'phi1': ('(J1 + M2*r2**2)*phi1_dd + r2*r2_hat @ (M3*r3*r3_hat + M4*r4*r4_hat + m2*c2*c2_hat)*phi2_dd'
             ' + m3*r2*c3*r2_hat @ c3_hat*phi3_dd + m4*r2*c4*r2_hat @ c4_hat*phi4_dd'
             ' + (M2*r2*a2_hat + m1*c1*u1_hat) @ chi1_hat*x1_dd'
             ' - r2*a2_hat @ (M3*r3*r3_hat + M4*r4*r4_hat + m2*c2*c2_hat)*phi2_d**2'
             ' - m3*r2*c3*a2_hat @ c3_hat*phi3_d**2 - m4*r2*c4*a2_hat @ c4_hat*phi4_d**2',
             'g_vec @ (M2*r2*a2_hat + m1*c1*u1_hat) + tau1 - tau2'),
    'phi2': ('r2*r2_hat @ (M3*r3*r3_hat + M4*r4*r4_hat + m2*c2*c2_hat)*phi1_dd + (J2 + M3*r3**2 + M4*r4**2)*phi2_dd'
             ' + m3*r3*c3*r3_hat @ c3_hat*phi3_dd + m4*r4*c4*r4_hat @ c4_hat*phi4_dd'
             ' + (M3*r3*a3_hat + M4*r4*a4_hat + m2*c2*u2_hat) @ chi1_hat*x1_dd'
             ' - r2*(M3*r3*a3_hat + M4*r4*a4_hat + m2*c2*u2_hat) @ r2_hat*phi1_d**2'
             ' - m3*r3*c3*a3_hat @ c3_hat*phi3_d**2 - m4*r4*c4*a4_hat @ c4_hat*phi4_d**2',
             'g_vec @ (M3*r3*a3_hat + M4*r4*a4_hat + m2*c2*u2_hat) + tau2 - tau3 - tau4'),
    'phi3': ('m3*r2*c3*r2_hat @ c3_hat*phi1_dd + m3*r3*c3*c3_hat @ r3_hat*phi2_dd + J3*phi3_dd'
             ' + m3*c3*u3_hat @ chi1_hat*x1_dd - m3*r2*c3*u3_hat @ r2_hat*phi1_d**2'
             ' - m3*r3*c3*u3_hat @ r3_hat*phi2_d**2', 'm3*c3*g_vec @ u3_hat + tau3'),
    'phi4': ('m4*r2*c4*r2_hat @ c4_hat*phi1_dd + m4*r4*c4*c4_hat @ r4_hat*phi2_dd + J4*phi4_dd'
             ' + m4*c4*u4_hat @ chi1_hat*x1_dd - m4*r2*c4*u4_hat @ r2_hat*phi1_d**2'
             ' - m4*r4*c4*u4_hat @ r4_hat*phi2_d**2', 'm4*c4*g_vec @ u4_hat + tau4'),
    'x1': ('(M2*r2*a2_hat + m1*c1*u1_hat) @ chi1_hat*phi1_dd'
           ' + (M3*r3*a3_hat + M4*r4*a4_hat + m2*c2*u2_hat) @ chi1_hat*phi2_dd'
           ' + m3*c3*u3_hat @ chi1_hat*phi3_dd + m4*c4*u4_hat @ chi1_hat*phi4_dd + M1*x1_dd'
           ' - chi1_hat @ (M2*r2*r2_hat + m1*c1*c1_hat)*phi1_d**2'
           ' - chi1_hat @ (M3*r3*r3_hat + M4*r4*r4_hat + m2*c2*c2_hat)*phi2_d**2'
           ' - m3*c3*chi1_hat @ c3_hat*phi3_d**2 - m4*c4*chi1_hat @ c4_hat*phi4_d**2', 'M1*g_vec @ chi1_hat + f1')}


def test_printed_equations_of_the_example_are_those_of_the_book():
    assert from_text(text_document(pcs.equations(pcs.load_chain('arczewski_example.yaml')))) == BOOK


# --- SymPy


def symbolic_constant(kind, body, number):
    """Return a datum of the example by its name; its slide goes straight up and gravity straight down."""
    if number == 0.0:
        return sympy.Integer(0)
    if kind in ('g', 'epsilon'):
        return {'g': -sympy.Symbol('g'), 'epsilon': sympy.pi / 2}[kind]
    return sympy.Symbol(f'{kind}{body + 1}')


def vanishes(expression, angles):
    """Whether an expression is zero by the addition theorems and sin^2 = 1 - cos^2 alone, which is a decision."""
    expression = sympy.expand(expression.subs(sympy.Symbol('delta_g'), -sympy.pi / 2), trig=True)
    names = {f(angle): sympy.Symbol(f'{f.__name__}_{angle}') for angle in angles for f in (sympy.sin, sympy.cos)}
    polynomial = sympy.expand(expression.xreplace(names))
    for angle in angles:
        sine, cosine = names[sympy.sin(angle)], names[sympy.cos(angle)]
        polynomial = sympy.rem(polynomial, sine**2 + cosine**2 - 1, sine)
    return sympy.expand(polynomial) == 0


@pytest.fixture(scope='module')
def example():
    """Return the equations of the example by (coordinates, trigonometric), and what is read back of each document."""
    made = {}
    for coordinates, trigonometric in EXAMPLES:
        equations = pcs.equations(pcs.load_chain('arczewski_example.yaml'), coordinates, trigonometric)
        documents = {written: write(equations) for written, write in WRITERS.items()}
        read = {written: READERS[written](text) for written, text in documents.items()}
        made[coordinates, trigonometric] = equations, json.loads(documents['json']), read
    return made


@pytest.mark.slow
@pytest.mark.parametrize('coordinates, trigonometric', EXAMPLES)
def test_example_is_lagrange_symbol_for_symbol(coordinates, trigonometric, example):
    """Oracle: the terms of the JSON document, less Lagrange's equations from positions alone, are zero identically."""
    equations, document, read = example[coordinates, trigonometric]
    oracle = Lagrange(equations.chain, coordinates == 'absolute', symbolic_constant)
    names = {str(symbol): symbol for symbols in (oracle.coordinates, oracle.rates, oracle.accelerations)
             for symbol in symbols}
    names.update({f'{letter}{i}': sympy.Symbol(f'{letter}{i}') for letter in 'mcrJ' for i in (1, 2, 3, 4)})
    m1, m2, m3, m4 = (names[f'm{i}'] for i in (1, 2, 3, 4))
    names.update(M1=m1 + m2 + m3 + m4, M2=m2 + m3 + m4, M3=m3, M4=m4, g=sympy.Symbol('g'), delta_g=-sympy.pi / 2,
                 epsilon1=sympy.pi / 2, cos=sympy.cos, sin=sympy.sin)
    names.update({name: sympy.Symbol(name, real=True) for name in ('tau1', 'tau2', 'tau3', 'tau4', 'f1')})
    names.update(vectors_of(document, sympy, names), dot=lambda u, v: u @ v)
    assert list(read['json']) == [equation.coordinate.name for equation in equations]
    angles = [c for c in oracle.coordinates if not str(c).startswith('x')]
    for coordinate, wanted in zip(oracle.coordinates, oracle.residuals()):
        left, right = read['json'][str(coordinate)]
        printed = eval(left, {}, names) - eval(right, {}, names)
        assert vanishes(printed - wanted, angles), coordinate


class AnyName(dict):
    """Names of an expression: a symbol for each, for a vector two, and functions of which nothing is known."""

    def __missing__(self, name):
        self[name] = (PlaneVector(*sympy.symbols(f'{name}_x {name}_y')) if name.endswith(('_hat', '_vec'))
                      else sympy.Symbol(name))
        return self[name]


@pytest.mark.parametrize('coordinates, trigonometric', EXAMPLES)
def test_the_documents_of_the_example_say_the_same(coordinates, trigonometric, example):
    """Text and LaTeX letter for letter; both and JSON, whose terms are not gathered, by multiplying out alone."""
    *_, read = example[coordinates, trigonometric]
    assert list(read['text'].items()) == list(read['latex'].items())
    assert list(read['text']) == list(read['json'])
    names = AnyName(dot=lambda u, v: u @ v, cos=sympy.Function('cosine'), sin=sympy.Function('sine'))
    for coordinate, sides in read['json'].items():
        for terms, gathered in zip(sides, read['text'][coordinate]):
            assert sympy.expand(eval(terms, {}, names) - eval(gathered, {}, names)) == 0, coordinate


def with_friction(chain, seed):
    """Return the chain with friction on some of its joints."""
    random = np.random.default_rng(seed)
    joint = {body.name: random.choice([0.0, 0.3], 2) for body in chain.bodies}
    return replace(chain, bodies=tuple(
        replace(body, slide=body.slide and replace(body.slide, friction=float(joint[body.name][0])),
                rotation=body.rotation and replace(body.rotation, friction=float(joint[body.name][1])))
        for body in chain.bodies))


def with_quarter_turns(chain, seed):
    """Return the chain with all its angles and offsets along the axes of the frames, as most chain files have them."""
    random = np.random.default_rng(seed)

    def quarter():
        return float(random.integers(-1, 3)) * np.pi / 2

    def along(value):
        return abs(value) * (1.0, 1j, -1.0, -1j)[random.integers(4)]

    return replace(chain, gravity=along(chain.gravity), bodies=tuple(
        replace(body, angle=quarter(), origin=along(body.origin), center_of_mass=along(body.center_of_mass),
                slide=body.slide and replace(body.slide, axis=quarter())) for body in chain.bodies))


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(20))
def test_random_trees_are_lagrange_number_for_number(seed):
    """Oracle: every notation and form, read back and evaluated; numbers have 6 digits, in JSON all of them."""
    chain = with_friction(random_tree(seed, bodies=2 + seed % 4), seed)
    if seed % 4 == 3:
        chain = with_quarter_turns(chain, seed)
    position, velocity, acceleration = random_state(chain, seed)
    effort = np.random.default_rng(seed + 100).normal(size=chain.joint_count)
    wanted = {}
    for coordinates, trigonometric, numeric in FORMS:
        equations = pcs.equations(chain, coordinates, trigonometric, numeric)
        state = equations.state(position, velocity, acceleration, effort)
        names = values_of(equations, state)
        if coordinates not in wanted:
            wanted[coordinates] = LagrangeNumbers(chain, coordinates == 'absolute').values(names)
        names.update(vectors_of(json.loads(json_document(equations)), math, names), dot=lambda u, v: u @ v,
                     cos=math.cos, sin=math.sin, sign=np.sign)
        for written, write in WRITERS.items():
            read = READERS[written](write(equations))
            assert set(read) == set(wanted[coordinates])
            for equation in equations:
                left, right = (eval(side, {}, names) for side in read[equation.coordinate.name])
                size = sum(abs(term.evaluate(state)) for term in equation.terms)
                # rounding of some hundred operations; half a unit of the sixth digit of every number
                tolerance = (5e-6 if numeric and written != 'json' else 100 * EPS) * size
                assert abs(left - right - wanted[coordinates][equation.coordinate.name]) <= tolerance


def values_of(equations, state):
    """Return the value of every name that expressions use, vectors left out."""
    names = {name: symbol.value for name, symbol in equations.symbols().items()}
    for k, equation in enumerate(equations):
        for order, mark in enumerate(('', '_d', '_dd')):
            names[equation.coordinate.name + mark] = float(state.motion[order, k])
        for term in equation.terms:
            names.update((str(factor), factor.evaluate(state)) for factor in term.factors if term.kind == 'effort')
    return names


# --- the reference form and the kernel


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(200))
def test_terms_evaluated_alone_add_up_to_the_reference_form_and_the_kernel(seed):
    """Twin: residuals of both, within rounding of the terms; the worst of these 200 trees is 5.7 eps."""
    chain = with_friction(random_tree(seed, bodies=1 + seed % (7 if seed < 176 else 12)), seed)
    position, velocity, acceleration = random_state(chain, seed)
    effort = np.random.default_rng(seed + 300).normal(size=chain.joint_count)
    forms = (equations_of_motion.inverse_dynamics, pcs.inverse_dynamics)
    wanted = [form(chain, position, velocity, acceleration) - effort for form in forms]
    for coordinates, trigonometric, numeric in FORMS[seed % 2::2]:     # symbols in every other tree, then numbers
        equations = pcs.equations(chain, coordinates, trigonometric, numeric)
        state = equations.state(position, velocity, acceleration, effort)
        values = [[term.evaluate(state) for term in equation.terms] for equation in equations]
        size = max(sum(map(abs, row)) for row in values)
        worth = np.abs(map_of(equations)).sum(0).max()
        got = np.array([sum(row) for row in values])
        assert got.tolist() == [equation.residual(state) for equation in equations]
        if coordinates == 'absolute':       # virtual work: the residual of q is G^T of those of the angles and slides
            got = map_of(equations).T @ got
        for residual in wanted:
            assert np.abs(got - residual).max() <= 10 * EPS * size * worth


def map_of(equations):
    """Return G of the equations' own coordinates: absolute ones from joint ones, or the identity."""
    if equations.coordinates == 'joint':
        return np.eye(len(equations))
    bodies = len(equations.chain.bodies)
    rows = [equation.coordinate.index - 1 + bodies * (equation.coordinate.letter == 'x') for equation in equations]
    return motion_of_joints(equations.chain)[0][rows]


@pytest.mark.parametrize('seed', range(0, 200, 10))
def test_each_kind_of_term_is_its_part_of_the_reference_form(seed):
    """Twin: coefficients of accelerations are H, terms of rates the bias, the others gravity and passive efforts."""
    chain = random_tree(seed, bodies=1 + seed % 12)
    position, velocity, acceleration = random_state(chain, seed)
    H, h = equations_of_motion.joint_equations(chain, position, velocity)
    still = replace(chain, bodies=tuple(replace(
        body, slide=body.slide and replace(body.slide, damping=0.0, stiffness=0.0),
        rotation=body.rotation and replace(body.rotation, damping=0.0, stiffness=0.0)) for body in chain.bodies))
    zero = np.zeros(chain.joint_count)
    gravity = -equations_of_motion.joint_equations(still, position, zero)[1]
    bias = equations_of_motion.joint_equations(still, position, velocity)[1] + gravity
    passive = -(h - bias + gravity)
    for trigonometric in (False, True):
        equations = pcs.equations(chain, 'joint', trigonometric)
        state = equations.state(position, velocity, acceleration)
        matrix, sums = np.zeros_like(H), {kind: np.zeros(chain.joint_count) for kind in ('bias', 'gravity', 'passive')}
        for i, equation in enumerate(equations):
            for term in equation.terms:
                value = term.contribution(state)
                if term.kind == 'acceleration':
                    (_, place), = term.factors[-1].parts
                    matrix[i, place.place] += value / acceleration[place.place]
                elif term.kind != 'effort':
                    kind = {'squared rate': 'bias', 'Coriolis': 'bias', 'gravity': 'gravity'}.get(term.kind, 'passive')
                    sums[kind][i] += value
        for got, expected in ((matrix, H), (sums['bias'], bias), (sums['gravity'], gravity),
                              (sums['passive'], passive)):
            scale = max(np.abs(h).max(), np.abs(H).max(), np.abs(gravity).max(), 1.0)
            np.testing.assert_allclose(got, expected, rtol=0, atol=200 * EPS * scale)


def test_acceleration_is_what_forward_dynamics_gives_where_none_is_named():
    equations = pcs.equations(pcs.load_chain('cart_arm_telescope.yaml'))
    random = np.random.default_rng(1)
    position, velocity, effort = random.normal(size=(3, 5))
    state = equations.state(position, velocity, effort=effort)
    for equation in equations:
        size = sum(abs(term.evaluate(state)) for term in equation.terms)
        assert abs(equation.residual(state)) < 1e-13 * size    # cond(H) is 1e3


# --- reduction


@pytest.mark.parametrize('seed', range(30))
def test_nothing_printed_is_zero_or_said_twice(seed):
    """Invariant: no term vanishes at every state, and no two have the same factors at every state."""
    chain = with_friction(random_tree(seed, bodies=1 + seed % 8), seed)
    for coordinates, trigonometric, numeric in FORMS:
        equations = pcs.equations(chain, coordinates, trigonometric, numeric)
        states = [equations.state(*random_state(chain, k), random_state(chain, k + 10)[0]) for k in range(3)]
        for equation in equations:
            seen = set()
            for term in equation.terms:
                assert any(term.evaluate(state) != 0.0 for state in states)
                moving = tuple(round(math.prod(factor.evaluate(state) for factor in term.factors), 9)
                               for state in states)
                moving = max(moving, tuple(-value for value in moving))
                if term.kind == 'friction':     # signs may well be equal at three states
                    moving = term.factors
                key = (term.kind, term.coefficient.symbols, moving)
                assert key not in seen, str(term)
                seen.add(key)


def test_zero_data_leave_no_trace():
    """No gravity, offset, damping, spring: a body on its joint point has J phi'' = tau and nothing else."""
    chain = pcs.chain_from_dict({'gravity': [0.0, 0.0], 'bodies': [
        {'name': 'wheel', 'carrier': 'base', 'mass': 2.0, 'inertia': 0.5, 'rotation': {'joint': 'spin', 'axis': -1}}]})
    assert str(pcs.equations(chain)[0]) == 'J1*phi1_dd = -tau1'
    assert str(pcs.equations(chain, 'joint')['spin']) == 'J1*q1_dd = tau1'
    assert str(pcs.equations(chain, numeric=True)['phi1']) == '0.5*phi1_dd = -tau1'


def test_quarter_turns_are_worked_out_and_like_numbers_added():
    chain = pcs.load_chain('arczewski_example.yaml')
    slide = pcs.equations(chain, trigonometric=True, numeric=True)['column_slide']
    assert {term.kind: term.coefficient.number for term in slide.terms}['gravity'] == pytest.approx(-5.3 * 9.81)
    upper = from_text(text_document(pcs.equations(chain, trigonometric=True, numeric=True)))['phi2']
    assert upper == ('1.4625*cos(phi1 - phi2)*phi1_dd + 0.97*phi2_dd + 0.21*cos(phi2 - phi3)*phi3_dd'
                     ' + 0.1*cos(phi2 - phi4)*phi4_dd + 1.625*cos(phi2)*x1_dd - 1.4625*sin(phi1 - phi2)*phi1_d**2'
                     ' + 0.21*sin(phi2 - phi3)*phi3_d**2 + 0.1*sin(phi2 - phi4)*phi4_d**2',
                     '-15.9413*cos(phi2) + tau2 - tau3 - tau4')


def test_what_terms_share_is_taken_out_once():
    """M r^2 + m r c = r (M r + m c), in signs and numbers too."""
    coordinate = Coordinate('q', 1, 'turn', 0)
    M, m, r, c = (Symbol(letter, 1, 2.0) for letter in 'Mmrc')
    acceleration = Motion(2, ((1, coordinate),))
    terms = [Term(coordinate, 'acceleration', Coefficient(-2, symbols), (acceleration,))
             for symbols in ((M, r, r), (m, r, c))]
    (sign, piece), = Writer(LATEX).left(Equation(coordinate, tuple(terms)))
    assert sign == -1 and expression_of_latex(piece.replace(SOFT_BREAK, ' ')) == '2*r1*(M1*r1 + m1*c1)*q1_dd'


def test_double_pendulum_in_joint_coordinates_is_the_textbook():
    """The classic: the square of the first rate drops out of the first equation, 2 q1' q2' + q2'^2 stays."""
    first, second = pcs.equations(pcs.load_chain('double_pendulum.yaml'), 'joint', trigonometric=True)
    assert [str(term) for term in first.left] == [
        'J1*q1_dd', 'J2*q1_dd', 'M2*r2*r2*q1_dd', '2*m2*r2*c2*cos(q2)*q1_dd', 'J2*q2_dd', 'm2*r2*c2*cos(q2)*q2_dd',
        '-m2*r2*c2*sin(q2)*q2_d*q2_d', '-2*m2*r2*c2*sin(q2)*q1_d*q2_d']
    assert [str(term) for term in second.left] == [
        'J2*q1_dd', 'm2*r2*c2*cos(q2)*q1_dd', 'J2*q2_dd', 'm2*r2*c2*sin(q2)*q1_d*q1_d']


# --- documents


@pytest.mark.parametrize('name', [*CONFIG, 'chain_32_links'])
def test_text_is_comfortable_in_80_columns(name):
    chain = pcs.load_chain(f'{name}.yaml')
    for coordinates, trigonometric, numeric in FORMS if name != 'chain_32_links' else FORMS[:4]:
        text = text_document(pcs.equations(chain, coordinates, trigonometric, numeric))
        assert max(map(display_width, text.splitlines())) <= 80
        assert not re.search(r'[ \x1f\xa0]$', text, re.MULTILINE) and '\x1f' not in text and '\xa0' not in text


def test_topology_of_the_example_is_the_book_s():
    topology = json.loads(json_document(pcs.equations(pcs.load_chain('arczewski_example.yaml'))))['topology']
    assert topology['S'] == [[1, -1, 0, 0], [0, 1, -1, -1], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert topology['S_'] == [[0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 0], [0, 0, 0, 0]]
    assert topology['P'] == [[1, 1, 1, 1], [0, 1, 1, 1], [0, 0, 1, 0], [0, 0, 0, 1]]
    P, m = np.array(topology['P']), np.diag([2.0, 1.5, 1.0, 0.8])
    assert topology['M'] == (P @ m @ P.T).tolist()
    text = text_document(pcs.equations(pcs.load_chain('arczewski_example.yaml')))
    assert '\n   .  1 -1 -1    . . 1 1    . 1 1 1    M2 M2 M3 M4\n' in text.translate(
        {0xb7: '.', 0x2212: '-', **{0x2080 + digit: str(digit) for digit in range(10)}})


def test_names_of_a_chain_file_are_escaped_in_latex():
    chain = pcs.chain_from_dict({'name': 'a_b', 'bodies': [
        {'name': 'x_y & 100 % {$^~\\#}', 'carrier': 'base', 'mass': 1.0, 'inertia': 1.0, 'rotation': {'joint': 'j'}}]})
    latex = latex_document(pcs.equations(chain))
    assert r'x\_y \& 100 \% \{\$\textasciicircum{}\textasciitilde{}\textbackslash{}\#\}' in latex


def test_coordinates_are_found_by_joint_and_by_symbol():
    chain = pcs.load_chain('four_link_robot.yaml')
    equations = pcs.equations(chain)
    assert equations['forearm_joint'] is equations['phi3'] is equations[2]
    assert [equation.coordinate.joint for equation in pcs.equations(chain, 'joint')] == list(chain.joint_names)
    with pytest.raises(KeyError, match='did you mean'):
        equations['forearm_jiont']
    with pytest.raises(ValueError, match="must be one of 'absolute', 'joint'"):
        pcs.equations(chain, 'relative')
    with pytest.raises(ValueError, match='position has shape'):
        equations.state([0.0], [0.0])


def test_terms_name_their_symbols_and_factors():
    term = pcs.equations(pcs.load_chain('arczewski_example.yaml'))['phi1'].terms[5]
    assert (term.kind, str(term.coefficient), [str(factor) for factor in term.factors]) == (
        'acceleration', 'm3*r2*c3', ['dot(r2_hat, c3_hat)', 'phi3_dd'])
    assert term.coefficient.value == 1.0 * 0.9 * 0.3 and isinstance(term.factors[-1], Motion)
