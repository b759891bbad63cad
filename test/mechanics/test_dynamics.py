"""Twin, oracle and invariant tests of forward and inverse dynamics, mass matrix and energy."""

import numpy as np
from oracles.random_trees import random_state, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.benchmark.problems import uniform_rods
from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain.tree import Body, Joint
from planar_chain_sim.mechanics import equations_of_motion, invariants

EPS = np.finfo(float).eps
# two backward stable solutions differ by a small multiple of cond(H) eps: the worst of these 200 trees is 0.6; the way
# back adds a few roundings of every term: the worst is 1.2
TWIN = 2.0
TWIN_H = 15.0   # an entry of H is a sum over up to 30 bodies, each rounded a few times; the worst is 8

# Derived symbolically from the positions of the mass centres alone, at 50 digits: absolute accelerations, T, V, det H.
PHI, RATE, TAU = (0.3, -0.5, 1.1, 2.0), (0.7, -1.2, 0.4, 1.5), (1.0, -0.5, 0.3, 0.2)
CARRIER = (-1, 0, 1, 1)
CASES = {
    'A': {
        'c': (0.45, 0.35, 0.30, 0.25), 'J': (0.6, 0.28, 0.13, 0.08), 'rho': (0.0, 0.9, 0.7, 0.5),
        'slides': {0: (np.pi / 2, 0.25, -0.6, 2.5, -7.7386320113188676997)},    # axis, x, x', f, x''
        'phi2': (-1.6885418081546309732, -1.5673906215470620974, -0.54634404870092430565, 0.42528308014579388658),
        'T': 1.3904645658410369045, 'V': 20.981808434654299181, 'det': 0.016766360087837080534},
    'B': {
        'c': (0.45 + 0.1j, 0.35 - 0.05j, 0.3, 0.25 + 0.15j), 'J': (0.6, 0.28, 0.13, 0.12),
        'rho': (0.1 + 0.2j, 0.8 + 0.3j, 0.6 - 0.25j, 0.4 + 0.35j),
        'slides': {0: (np.pi / 2, 0.25, -0.6, 2.5, -7.9936912683089892237),
                   1: (0.4, -0.15, 0.8, -1.0, 0.52173968008791709562),
                   3: (-0.9, 0.35, -0.45, 0.7, 0.19421957639785696466)},
        'phi2': (-2.3722762815943053815, -3.3881575049142709804, -2.4383165880428522573, 1.2898525829955420015),
        'T': 0.46055770763036092208, 'V': 35.710374051496288995, 'det': 0.0054396939395748990956},
}


def book_case(case):
    """Return chain, joint position, velocity and effort, and the joint accelerations that the 50-digit values give."""
    data, bodies, rows = CASES[case], [], []
    for i, mass in enumerate((2.0, 1.5, 1.0, 0.8)):
        c, J, slide = complex(data['c'][i]), data['J'][i], None
        if i in data['slides']:
            axis, *row = data['slides'][i]
            slide = Joint(f'slide{i}', 'slide', axis)
            rows.append(row)
        bodies.append(Body(f'body{i}', CARRIER[i], complex(data['rho'][i]), 0.0, mass, c, J, J - mass * abs(c)**2,
                           slide, Joint(f'turn{i}', 'rotation', 1.0)))
        p = CARRIER[i]
        rows.append([values[i] - (values[p] if p >= 0 else 0.0) for values in (PHI, RATE)] + [TAU[i]]
                    + [data['phi2'][i] - (data['phi2'][p] if p >= 0 else 0.0)])
    return Chain(case, -9.81j, tuple(bodies)), *np.array(rows).T


@pytest.mark.parametrize('form', ['reference', 'dense', 'recursive'])
@pytest.mark.parametrize('case', 'AB')
def test_fifty_digit_accelerations(case, form):
    chain, position, velocity, effort, wanted = book_case(case)
    got = pcs.forward_dynamics(chain, position, velocity, effort, form)
    # the worst of the others is 4.3; the dense solve owes cond(H) eps, 158 and 310 here, and takes 10 and 17
    limit = 0.1 * np.linalg.cond(pcs.mass_matrix(chain, position)) if form == 'dense' else 10.0
    assert np.abs(got - wanted).max() <= limit * EPS * np.abs(wanted).max()


@pytest.mark.parametrize('energy', [pcs.energy, invariants.energy], ids=['kernel', 'reference'])
@pytest.mark.parametrize('case', 'AB')
def test_fifty_digit_energy(case, energy):
    chain, position, velocity, *_ = book_case(case)
    assert energy(chain, position, velocity) == pytest.approx((CASES[case]['T'], CASES[case]['V']), rel=4 * EPS, abs=0)


@pytest.mark.parametrize('mass_matrix', [pcs.mass_matrix, equations_of_motion.mass_matrix], ids=['kernel', 'reference'])
@pytest.mark.parametrize('case', 'AB')
def test_fifty_digit_determinant(case, mass_matrix):
    # det is the product of eigenvalues: its error may be cond(H) eps; the maps to joint coordinates have determinant 1
    chain, position, *_ = book_case(case)
    H = mass_matrix(chain, position)
    assert np.linalg.det(H) == pytest.approx(CASES[case]['det'], rel=np.linalg.cond(H) * EPS, abs=0)


def test_written_out_equations_of_the_book():
    """The robot's own equations (5.90)-(5.94) as corrected in equations.md 8, term by term, at 20 random states."""
    chain = book_case('A')[0]
    m, c, J, r = (2.0, 1.5, 1.0, 0.8), CASES['A']['c'], CASES['A']['J'], CASES['A']['rho']
    m1, m2, m3, m4 = m
    M1, M2, M3, M4 = sum(m), m2 + m3 + m4, m3, m4

    def dot(u, v):
        return (np.conj(u) * v).real

    for seed in range(20):
        random = np.random.default_rng(seed)
        position, velocity, effort = random.normal(size=(3, 5))
        a = pcs.forward_dynamics(chain, position, velocity, effort)
        carrier_sums = np.array([[1, 0, 0, 0], [1, 1, 0, 0], [1, 1, 1, 0], [1, 1, 0, 1]])     # P^T
        phi, w, alpha = (carrier_sums @ values[1:] for values in (position, velocity, a))
        (w1, w2, w3, w4), (a1, a2, a3, a4), ddx = w**2, alpha, a[0]
        f1, (t1, t2, t3, t4) = effort[0], effort[1:]
        chi, g = 1j, -9.81j
        r2, r3, r4 = np.exp(1j * phi[0]), np.exp(1j * phi[1]), np.exp(1j * phi[1])
        c1, c2, c3, c4 = np.exp(1j * phi)
        Br = M3 * r[2] * r3 + M4 * r[3] * r4 + m2 * c[1] * c2
        Ba, l1 = 1j * Br, M2 * r[1] * 1j * r2 + m1 * c[0] * 1j * c1
        equations = {
            '5.90': ((J[0] + M2 * r[1]**2) * a1 + r[1] * dot(Br, r2) * a2 + m3 * r[1] * c[2] * dot(r2, c3) * a3
                     + m4 * r[1] * c[3] * dot(r2, c4) * a4 + dot(l1, chi) * ddx - r[1] * dot(Br, 1j * r2) * w2
                     - m3 * r[1] * c[2] * dot(1j * r2, c3) * w3 - m4 * r[1] * c[3] * dot(1j * r2, c4) * w4,
                     dot(g, l1) + t1 - t2),
            '5.91': (r[1] * dot(Br, r2) * a1 + (J[1] + M3 * r[2]**2 + M4 * r[3]**2) * a2
                     + m3 * r[2] * c[2] * dot(r3, c3) * a3 + m4 * r[3] * c[3] * dot(r4, c4) * a4
                     + dot(Ba, chi) * ddx - r[1] * dot(Ba, r2) * w1
                     - m3 * r[2] * c[2] * dot(1j * r3, c3) * w3 - m4 * r[3] * c[3] * dot(1j * r4, c4) * w4,
                     dot(g, Ba) + t2 - t3 - t4),
            '5.92': (J[2] * a3 + m3 * c[2] * dot(1j * c3, r[1] * 1j * r2 * a1 + r[2] * 1j * r3 * a2 + chi * ddx
                                                 - r[1] * r2 * w1 - r[2] * r3 * w2), m3 * c[2] * dot(g, 1j * c3) + t3),
            '5.93': (J[3] * a4 + m4 * c[3] * dot(1j * c4, r[1] * 1j * r2 * a1 + r[3] * 1j * r4 * a2 + chi * ddx
                                                 - r[1] * r2 * w1 - r[3] * r4 * w2), m4 * c[3] * dot(g, 1j * c4) + t4),
            '5.94': (M1 * ddx + dot(l1, chi) * a1 + dot(Ba, chi) * a2 + m3 * c[2] * dot(1j * c3, chi) * a3
                     + m4 * c[3] * dot(1j * c4, chi) * a4 - dot(M2 * r[1] * r2 + m1 * c[0] * c1, chi) * w1
                     - dot(Br, chi) * w2 - m3 * c[2] * dot(c3, chi) * w3 - m4 * c[3] * dot(c4, chi) * w4,
                     M1 * dot(g, chi) + f1)}
        scale = 100.0 * EPS * (1.0 + np.abs(a).max()) * M1 * 10.0   # a few dozen terms, each at most M1 a few m/s^2
        for number, (left, right) in equations.items():
            assert left == pytest.approx(right, abs=scale), number


@pytest.mark.parametrize('seed', range(200))
def test_reference_against_kernel_on_random_trees(seed):
    """All body kinds, up to 30 bodies, armature, dampers, springs: every form within TWIN cond(H) eps of the others."""
    chain = random_tree(seed, bodies=1 + seed % 30)
    position, velocity, effort = random_state(chain, seed)
    H, h = equations_of_motion.joint_equations(chain, position, velocity)
    wanted = equations_of_motion.forward_dynamics(chain, position, velocity, effort)
    assert pcs.forward_dynamics(chain, position, velocity, effort, 'reference').tobytes() == wanted.tobytes()
    # the right side effort - h is itself a difference of terms of the size of |effort| + |h|
    size = np.abs(wanted).max() + (np.abs(effort) + np.abs(h)).max() / np.linalg.norm(H, 2)
    for form in ('dense', 'recursive'):
        got = pcs.forward_dynamics(chain, position, velocity, effort, form)
        assert np.abs(got - wanted).max() <= TWIN * np.linalg.cond(H) * EPS * size, form
    np.testing.assert_allclose(pcs.mass_matrix(chain, position), H, rtol=0, atol=TWIN_H * EPS * np.abs(H).max())
    back = pcs.inverse_dynamics(chain, position, velocity, got)
    terms = np.abs(H) @ np.abs(got) + np.abs(h) + np.abs(effort)
    assert np.abs(back - effort).max() <= TWIN * EPS * terms.max()
    T, V = pcs.energy(chain, position, velocity)
    kinetic, potential = invariants.energy(chain, position, velocity)
    weight = abs(chain.gravity) * sum(body.mass for body in chain.bodies)    # V is a difference: about this, over 1 m
    assert abs(T - kinetic) <= TWIN_H * EPS * kinetic and abs(V - potential) <= TWIN_H * EPS * weight


def test_unit_determinant_of_the_joint_map_and_symmetry():
    chain = random_tree(3, bodies=12)
    H = pcs.mass_matrix(chain, random_state(chain, 3)[0])
    assert np.array_equal(H, H.T) and np.linalg.eigvalsh(H).min() > 0.0


def test_welded_bodies_are_merged_exactly_like_bodies_that_stay():
    """The same robot with a welded payload, and with the payload's mass in its carrier."""
    arm = Body('arm', -1, 0j, 0.3, 2.0, 0.4 + 0.1j, 0.9, 0.9 - 2.0 * 0.17, None, Joint('turn', 'rotation', -1.0))
    payload = Body('payload', 0, 0.8 - 0.2j, 1.1, 1.5, 0.1 + 0.05j, 0.2, 0.2 - 1.5 * 0.0125)
    at = payload.origin + np.exp(1j * payload.angle) * payload.center_of_mass
    mass, center = 3.5, (2.0 * arm.center_of_mass + 1.5 * at) / 3.5
    inertia = arm.inertia + payload.inertia_com + 1.5 * abs(at)**2
    whole = Body('whole', -1, 0j, 0.3, mass, center, inertia, inertia - mass * abs(center)**2, None, arm.rotation)
    state = [0.7], [2.0], [0.5]
    welded, solid = (pcs.forward_dynamics(Chain('c', -9.81j, bodies), *state) for bodies in ((arm, payload), (whole,)))
    assert welded == pytest.approx(solid, rel=4 * EPS, abs=0)


@pytest.mark.parametrize('form', ['reference', 'dense', 'recursive'])
@pytest.mark.parametrize('velocity, wanted', [(2.0, -0.25), (-1e-300, 0.25), (0.0, 0.0)])
def test_friction_opposes_motion_whatever_its_speed(form, velocity, wanted):
    joint = Joint('turn', 'rotation', -1.0, friction=0.5)
    chain = Chain('c', 0j, (Body('b', -1, 0j, 0.0, 1.0, 0j, 2.0, 2.0, None, joint),))
    assert pcs.forward_dynamics(chain, [0.3], [velocity], [0.0], form).tolist() == [wanted]
    assert pcs.inverse_dynamics(chain, [0.3], [velocity], [wanted]).tolist() == [0.0]
    assert invariants.dissipated_power(chain, np.array([0.3]), np.array([velocity])) == 0.5 * abs(velocity)


def test_singular_configuration_is_named():
    """A massless link with a point mass outboard has no inertia left when the two are collinear (equations.md 7)."""
    chain = Chain('collinear', -9.81j, (
        Body('link', -1, 0j, 0.0, 0.0, 0j, 0.0, 0.0, None, Joint('shoulder', 'rotation', 1.0)),
        Body('bob', 0, 1 + 0j, 0.0, 1.0, 1 + 0j, 1.0, 0.0, None, Joint('elbow', 'rotation', 1.0))))
    assert np.isfinite(pcs.forward_dynamics(chain, [0.3, 1.0], [0.0, 0.0], [0.0, 0.0])).all()
    wanted = "joint 'shoulder' of body 'link' of collinear: the configuration is singular"
    with pytest.raises(pcs.SimulationError, match=wanted) as caught:
        pcs.forward_dynamics(chain, [0.3, 0.0], [0.0, 0.0], [0.0, 0.0])
    assert caught.value.joint == 'shoulder' and caught.value.body == 'link'


@pytest.mark.parametrize('arguments, message', [
    (([0.0], [0.0, 0.0], [0.0, 0.0]), r'position has shape \(1,\), must have \(..., 2\)'),
    (([0.0, 0.0], [0.0, np.nan], [0.0, 0.0]), r'velocity\[1\] is nan, must be finite'),
    (([0.0, 0.0], [0.0, 0.0], ['x', 0.0]), 'effort must be numbers'),
])
def test_bad_arguments_are_one_sentence(arguments, message):
    with pytest.raises(ValueError, match=message):
        pcs.forward_dynamics(uniform_rods(2), *arguments)
    with pytest.raises(ValueError, match="form is 'fast', must be one of"):
        pcs.forward_dynamics(uniform_rods(1), [0.0], [0.0], [0.0], form='fast')
