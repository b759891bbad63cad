"""Order, error control, dense output and repeatability of every row of METHODS."""
from pathlib import Path

import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim import _kernel
from planar_chain_sim.integrators import method_data
from planar_chain_sim.plan import plan_of
from planar_chain_sim.simulation import initial_state

ROOT = Path(__file__).resolve().parent.parent
CHAIN = pcs.load_chain(str(ROOT / 'config' / 'four_link_robot.yaml'))    # branched, sliding, damped
TIME = 1.0
ADAPTIVE = [name for name, row in pcs.METHODS.items() if row.adaptive]
OF_ONE_ORDER = [name for name, row in pcs.METHODS.items() if row.order]
STEPS = {1: 1024, 4: 128, 5: 256, 6: 32, 8: 32}   # coarsest for the order: errors from 1e-3 down to 1e-12


def exact_state(chain, time, effort=None):
    """Position and velocity by series of order 20, whose error is round-off."""
    simulation = pcs.Simulation(chain, 'taylor', time, tolerance=1e-16)
    simulation.advance(1, effort)
    return np.array([simulation.position, simulation.velocity])


def state_by_given_steps(name, steps, at=TIME):
    """State at `at` s by steps of TIME / steps; between their ends by dense output."""
    length = TIME / steps
    row = pcs.METHODS[name]
    if not row.adaptive:
        simulation = pcs.Simulation(CHAIN, name, length)
        simulation.advance(round(at / length))
        return np.array([simulation.position, simulation.velocity])
    stepper = _kernel.Stepper(plan_of(CHAIN).model, method_data(row, 1e-9, fixed=length), TIME)
    stepper.set_state(*initial_state(CHAIN))
    stepper.reach(0.0, at, np.zeros(CHAIN.joint_count))
    assert abs(stepper.counts[1] - at / length) < 1.0 + 1e-9
    return np.array([stepper.position, stepper.velocity])


@pytest.mark.parametrize('name', OF_ONE_ORDER)
def test_measured_order(name):
    """Positions and velocities at the end of ever smaller steps converge with the declared order."""
    order = pcs.METHODS[name].order
    counts = STEPS[order] * np.array([2, 3, 4]) // 2
    exact = exact_state(CHAIN, TIME)
    errors = np.array([np.abs(state_by_given_steps(name, count) - exact).max() for count in counts])
    slopes = -np.diff(np.log2(errors)) / np.diff(np.log2(counts))
    assert np.abs(slopes - order).max() < 0.2, (errors, slopes)


def test_dop853_is_the_published_tableau():
    """The same numbers as in another code that was written from Hairer's."""
    published = pytest.importorskip('scipy.integrate._ivp.dop853_coefficients')
    row = pcs.METHODS['dop853']
    assert np.array_equal(row.a, published.A[:12, :12]) and np.array_equal(row.b, published.B)
    assert np.array_equal(row.error, [published.E5, published.E3])
    assert np.array_equal(row.dense_a, published.A[13:]) and np.array_equal(row.dense, published.D)
    assert pcs.METHODS['dop853_fixed'].a == row.a and pcs.METHODS['dop853_fixed'].b == row.b
