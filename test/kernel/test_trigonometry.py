"""The kernel's sine and cosine against 50 digits."""
import hashlib
import math

from mpmath import mp, mpf
import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim._kernel import unit_vector
from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain.tree import Body, Joint

EDGES = [0.0, -0.0, 5e-324, -2.2e-308, 1e-9, math.pi / 4, math.pi / 2, math.pi, 2 * math.pi, 1e5 * math.pi, 355.0,
         710.0]
# doubles next to multiples of pi/2, where the reduced angle is smallest (the last one: 524287 quarter turns)
NEAR = [float(k) * math.pi / 2 for k in (1, 2, 3, 4, 7, 11, 22, 33, 355, 103993, 104348, 208341, 312689, 524287)]


def ulps(got, exact):
    """Error of a double in units of its last place, taken where the exact value lies."""
    return float(abs(mpf(got) - exact) / mpf(float(np.spacing(max(abs(float(exact)), 2.3e-308)))))


@pytest.mark.parametrize('scale', [1e-3, 1.0, 4.0, 100.0, 1e4, 8e5, 1e9, 1e300])
def test_below_one_ulp_of_fifty_digits(scale):
    random = np.random.default_rng(int(math.log10(scale)) % 99)
    angles = random.uniform(-scale, scale, 1000)
    with mp.workdps(50 + max(0, int(math.log10(scale)))):
        worst = max(max(ulps(z.imag, mp.sin(mpf(a))), ulps(z.real, mp.cos(mpf(a))))
                    for a, z in ((a, unit_vector(a)) for a in map(float, angles)))
    assert worst < 1.0


def test_bits_are_the_same_on_every_machine():
    """The sum of the bits of 8000 numbers: they come from no math library and no fused operation."""
    for scale, bits in ((411.7, 'ad0d3ecf096dbd60227103855345de73941e91d26eb4fbe90d7856fa58ec7e1b'),
                        (1.23456789e120, 'a4c503f3662efeb1c0bb92333d3fb370a7bb07ef2f7d99e04d0221a6c6b75a12')):
        numbers = [unit_vector(k * scale) for k in range(-2000, 2000)]
        assert hashlib.sha256(np.array(numbers).astype('<c16').tobytes()).hexdigest() == bits


def test_far_angles_next_to_quarter_turns():
    """Where the angle is reduced most: doubles next to k pi/2, and the double nearest of all to one (Muller, 2006)."""
    random = np.random.default_rng(1)
    with mp.workdps(400):
        nearest = [float(int(k) * mp.pi / 2) for k in random.integers(10**6, 10**18, 300)]
        for angle in [*nearest, 6381956970095103 * 2.0**797, -1.7976931348623157e308]:
            z = unit_vector(angle)
            assert ulps(z.imag, mp.sin(mpf(angle))) < 1.0 and ulps(z.real, mp.cos(mpf(angle))) < 1.0, angle


def test_edges_and_angles_next_to_quarter_turns():
    with mp.workdps(80):
        for angle in EDGES + [v for a in NEAR for v in (a, math.nextafter(a, 0), math.nextafter(a, 1e9), -a)]:
            z = unit_vector(angle)
            assert ulps(z.imag, mp.sin(mpf(angle))) < 1.0 and ulps(z.real, mp.cos(mpf(angle))) < 1.0, angle


@pytest.mark.parametrize('angle', [math.nan, math.inf, -math.inf])
def test_what_is_no_angle_gives_no_number(angle):
    assert math.isnan(unit_vector(angle).real) and math.isnan(unit_vector(angle).imag)


@pytest.mark.parametrize('count', [2, 3, 4, 7, 8, 9, 20])
@pytest.mark.parametrize('far', [0.0, 1e7])
def test_angles_turned_in_blocks_give_the_bits_of_each_alone(count, far):
    """Pendulums that are evaluated together do not affect each other, whether or not a far angle is among them."""
    def pendulum(k):
        return Body(f'b{k}', -1, 0j, 0.0, 1.0, 0.5 + 0.1j, 0.36 + 0.1 * k, 0.1 + 0.1 * k, None,
                    Joint(f'j{k}', 'rotation', 1.0))
    angles = np.random.default_rng(count).normal(0.0, 3.0, count)
    angles[-1] += far
    zero = np.zeros(count)
    together = pcs.forward_dynamics(Chain('wood', -9.81j, tuple(map(pendulum, range(count)))), angles, zero, zero)
    alone = [pcs.forward_dynamics(Chain('tree', -9.81j, (pendulum(k),)), [angle], [0.0], [0.0])[0]
             for k, angle in enumerate(angles)]
    assert together.tolist() == alone
