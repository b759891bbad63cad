"""Oracle tests: the error of one evaluation, against accelerations to 50 digits."""
import dataclasses

import numpy as np
from oracles import fifty_digits
from oracles.random_trees import random_state, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.benchmark.problems import uniform_rods
from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain.tree import Body, Joint
from planar_chain_sim.mechanics.plan import DENSE_LINKS, plan_of

EPS = np.finfo(float).eps


def rods_with_tip(count, ratio):
    """Return uniform rods whose last is `ratio` times as heavy."""
    rods = uniform_rods(count)
    *light, last = rods.bodies
    heavy = {name: ratio * getattr(last, name) for name in ('mass', 'inertia', 'inertia_com')}
    return dataclasses.replace(rods, bodies=(*light, dataclasses.replace(last, **heavy)))


def serial_chain(seed, links):
    """Return a chain of plain rotations with mass centres and joints off the line, some of them clockwise."""
    chain = random_tree(seed, links, kinds=('turning',), armature=False)
    return dataclasses.replace(chain, bodies=tuple(
        dataclasses.replace(body, carrier=i - 1) for i, body in enumerate(chain.bodies)))


def states(joints):
    """Position and velocity where a long chain is hardest, straight, and where it is anything."""
    random = np.random.default_rng(joints)
    yield np.zeros(joints), np.zeros(joints)
    yield 0.2 * np.sin(np.arange(joints)), 0.3 * np.cos(np.arange(joints))
    yield random.normal(0.0, 1.5, joints), random.normal(0.0, 1.0, joints)


@pytest.mark.parametrize('count, ratio',
                         [(512, 1.0), (512, 1e6), (10, 1e6), (10, 1e-6), (6, 1e6), (10, 1e9), (64, 1e4)])
def test_one_evaluation_keeps_thirteen_digits(count, ratio):
    """The worst of these is 4e-15; with no refinement a ratio of 1e6 leaves 1e-10."""
    chain = rods_with_tip(count, ratio)
    assert plan_of(chain).model.refined == (ratio > 1.0)
    for position, velocity in states(count):
        effort = np.zeros(count)
        exact = fifty_digits.forward_dynamics(chain, position, velocity, effort)
        assert fifty_digits.error(pcs.forward_dynamics(chain, position, velocity, effort), exact) < 1e-13


@pytest.mark.parametrize('tilt', [0.7, -1.5])
def test_a_straight_chain_released_from_rest_is_as_exact_as_its_angles(tilt):
    """
    Straight under its weight, 512 rods are ill-conditioned: the error, 2e-13 and 5e-13, is no defect of the evaluation.

    Each absolute angle moved by half an ulp, less than a joint's reading can say, changes the accelerations by more.
    """
    chain, zero = uniform_rods(512), np.zeros(512)
    position = np.r_[tilt, np.zeros(511)]
    exact = fifty_digits.forward_dynamics(chain, position, zero, zero)
    moved = np.random.default_rng(0).choice([-0.5, 0.5], 512) * np.spacing(abs(tilt))
    other = fifty_digits.forward_dynamics(chain, position + np.r_[0.0, np.diff(moved)], zero, zero)
    sensitivity = fifty_digits.error(np.array([float(a) for a in other]), exact)
    assert fifty_digits.error(pcs.forward_dynamics(chain, position, zero, zero), exact) < sensitivity < 2e-11


@pytest.mark.parametrize('gravity', [-9.81j, 9.81 * np.exp(-0.7j), 0j])
@pytest.mark.parametrize('links', [1, 2, 7, 33])
def test_chains_that_need_no_refinement_are_not_refined(links, gravity):
    """Lying across, hanging or floating: straight, a chain may be in balance, and all of its acceleration rounding."""
    rods = uniform_rods(links, complex(gravity))
    hanging = dataclasses.replace(rods, bodies=(dataclasses.replace(rods.bodies[0], angle=-0.7), *rods.bodies[1:]))
    assert not plan_of(hanging).model.refined


def test_a_heavy_body_on_a_branch_and_on_a_slide_is_refined_too():
    def link(i, carrier, mass, slide=None, rotation=None):
        return Body(f'b{i}', carrier, 0.5 + 0j, 0.3, mass, 0.2 + 0.1j, 0.06 * mass, 0.01 * mass, slide, rotation)
    bodies = [link(i, i - 1, 1.0, rotation=Joint(f'r{i}', 'rotation', 1.0)) for i in range(6)]
    bodies.append(link(6, 3, 0.5, slide=Joint('s6', 'slide', 0.4), rotation=Joint('r6', 'rotation', -1.0)))
    bodies.append(link(7, 5, 1e6, slide=Joint('s7', 'slide', 1.1)))
    bodies.append(link(8, 7, 1e6, rotation=Joint('r8', 'rotation', 1.0)))
    chain = Chain('hoist', -9.81j, tuple(bodies))
    assert plan_of(chain).model.refined and 'iterative refinement' in str(plan_of(chain))
    for seed in range(5):
        state = random_state(chain, seed)
        exact = fifty_digits.forward_dynamics(chain, *state)
        assert fifty_digits.error(pcs.forward_dynamics(chain, *state), exact) < 1e-14


@pytest.mark.parametrize('form, limit', [('recursive', 1e-14), ('dense', 1e-12)])
@pytest.mark.parametrize('links', range(1, 18))
def test_serial_chains_of_every_length_that_is_unrolled_or_padded(links, form, limit):
    """Recursion of serial chains, dense form unrolled to 8 links and not: the worst are 2e-15 and 1e-13."""
    for seed in range(3):
        chain = serial_chain(100 * links + seed, links)
        state = random_state(chain, seed)
        exact = fifty_digits.forward_dynamics(chain, *state)
        assert fifty_digits.error(pcs.forward_dynamics(chain, *state, form), exact) < limit


@pytest.mark.parametrize('form', ['reference', 'dense', 'recursive'])
@pytest.mark.parametrize('links', [1, 2, 5, 11])
@pytest.mark.parametrize('turned', [9.0, 6e6, -1e12])
def test_angles_of_a_million_turns(form, links, turned):
    """Whole turns are left out before angles are summed."""
    chain = serial_chain(links, links)
    position, velocity, effort = random_state(chain, links)
    position[links // 2] += turned
    exact = fifty_digits.forward_dynamics(chain, position, velocity, effort)
    assert fifty_digits.error(pcs.forward_dynamics(chain, position, velocity, effort, form), exact) < 1e-13


@pytest.mark.parametrize('form', ['dense', 'recursive'])
@pytest.mark.parametrize('seed', range(8))
def test_trees_of_every_body_kind(seed, form):
    chain = random_tree(seed, bodies=9)
    state = random_state(chain, seed)
    exact = fifty_digits.forward_dynamics(chain, *state)
    H = pcs.mass_matrix(chain, state[0])
    assert fifty_digits.error(pcs.forward_dynamics(chain, *state, form), exact) < np.linalg.cond(H) * EPS


def test_the_oracle_is_the_inverse_of_the_kernel():
    """What the 50-digit accelerations ask for is the effort they were made from, by the kernel's inverse dynamics."""
    chain = random_tree(11, bodies=12)
    position, velocity, effort = random_state(chain, 11)
    exact = np.array([float(a) for a in fifty_digits.forward_dynamics(chain, position, velocity, effort)])
    np.testing.assert_allclose(pcs.inverse_dynamics(chain, position, velocity, exact), effort, rtol=0, atol=1e-12)


@pytest.mark.parametrize('links', [DENSE_LINKS, DENSE_LINKS + 1])
def test_auto_is_a_rule_on_the_shape_of_the_chain(links):
    chain = uniform_rods(links)
    form = 'dense' if links <= DENSE_LINKS else 'recursive'
    assert plan_of(chain).form == form == pcs.Simulation(chain, 'rk4').form
    other = {'dense': 'recursive', 'recursive': 'dense'}[form]
    position, velocity = 0.2 * np.sin(np.arange(links)), 0.3 * np.cos(np.arange(links))
    auto, named, twin = (pcs.forward_dynamics(chain, position, velocity, velocity, name)
                         for name in ('auto', form, other))
    assert auto.tobytes() == named.tobytes() != twin.tobytes()
    runs = {name: pcs.rollout(chain, 0.05, method='rk4', form=name).position for name in ('auto', form, other)}
    assert runs['auto'].tobytes() == runs[form].tobytes() != runs[other].tobytes()
    np.testing.assert_allclose(runs[form], runs[other], rtol=0, atol=1e-12)


def test_what_auto_takes_for_other_shapes():
    one = uniform_rods(2)
    for change in ({'carrier': -1}, {'rotation': Joint('joint1', 'rotation', 1.0, armature=0.1)},
                   {'slide': Joint('s', 'slide', 0.0)}):
        changed = dataclasses.replace(one, bodies=(one.bodies[0], dataclasses.replace(one.bodies[1], **change)))
        assert plan_of(changed).form == 'recursive' and 'not a serial chain' in pcs.Simulation(changed, 'rk4').plan
    heavy = rods_with_tip(DENSE_LINKS, 1e6)
    assert plan_of(heavy).form == 'recursive' and 'light links carry a heavy one' in pcs.Simulation(heavy, 'rk4').plan
    assert pcs.Simulation(heavy).form == 'recursive'  # the series is made from the same factors
    assert '(auto' not in pcs.Simulation(one, 'rk4', form='dense').plan
