"""The guard of equations.md 7: a pivot at or below 100 eps of its scale is singular, at every kind of joint."""
import numpy as np
from oracles.random_trees import random_state, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain.tree import Body, Joint

EPS = np.finfo(float).eps


def turning(carrier, mass, center, inertia, origin=0j, armature=0.0):
    return carrier, mass, center, inertia, origin, ('rotation', 1.0, armature)


def sliding(carrier, mass, center, inertia, armature=0.0):
    return carrier, mass, center, inertia, 0j, ('slide', 0.0, armature)


def chain_of(*rows):
    """Return a chain without gravity; joint i is called j<i>."""
    bodies = []
    for i, (carrier, mass, center, inertia, origin, (kind, axis, armature)) in enumerate(rows):
        joint = Joint(f'j{i}', kind, axis, armature=armature)
        bodies.append(Body(f'b{i}', carrier, origin, 0.0, mass, center, inertia, inertia - mass * abs(center)**2,
                           joint if kind == 'slide' else None, None if kind == 'slide' else joint))
    return Chain('thin', 0j, tuple(bodies))


# At zero angles every number below is a power of two or a sum of few, so that joint 0 is left with exactly the pivot
# `t`; before it the scale: what the carried masses and inertias would give if nothing cancelled.
BOB = turning(0, 1.0, 1.0, 1.0, origin=1.0)
CASES = {
    'collinear bob': (1.0, lambda t: (turning(-1, 0.0, 0j, t), BOB)),
    'two bobs, a branch': (2.0, lambda t: (turning(-1, 0.0, 0j, t), BOB, BOB)),
    'mass two links out': (1.0, lambda t: (turning(-1, 0.0, 0j, t), turning(0, 0.25, 1.0, 0.25, origin=1.0),
                                           turning(1, 0.75, 1.0, 0.75, origin=1.0))),
    'branches two links out': (1.0, lambda t: (
        turning(-1, 0.0, 0j, t), turning(0, 0.5, 1.0, 0.5, origin=1.0),
        turning(1, 0.25, 1.0, 0.25, origin=1.0), turning(1, 0.25, 1.0, 0.25, origin=1.0))),
    'slide across the lever': (1.0, lambda t: (turning(-1, 0.0, 0j, t), sliding(0, 1.0, 1j, 1.0))),
    'rotor on a bob folded back': (1.5, lambda t: (turning(-1, 0.0, 0j, t),
                                                   turning(0, 1.0, -1.0, 1.0, origin=1.0, armature=1.0))),
    'cart under a pendulum': (1.0, lambda t: (sliding(-1, t, 0j, 0.0), turning(0, 1.0, 1j, 1.0))),
    'massless cart with a motor': (1.0, lambda t: (sliding(-1, 0.0, 0j, 0.0, armature=t), turning(0, 1.0, 1j, 1.0))),
}


@pytest.mark.parametrize('form', ['reference', 'dense', 'recursive'])
@pytest.mark.parametrize('name', CASES)
def test_threshold_of_the_guard(name, form):
    scale, bodies = CASES[name]
    none, below, above = (chain_of(*bodies(factor * EPS * scale)) for factor in (0.0, 99.0, 101.0))
    zero = np.zeros(below.joint_count)
    for chain in (none, below):
        with pytest.raises(pcs.SimulationError, match="joint 'j0' of body '.*' of thin: the configuration is singular"):
            pcs.forward_dynamics(chain, zero, zero, zero, form)
    assert pcs.forward_dynamics(above, zero, zero, zero, form).tolist() == zero.tolist()


def test_a_massless_slide_between_is_refused_as_a_chain():
    """Its turning link has no inertia of its own in any configuration."""
    chain = chain_of(turning(-1, 0.0, 0j, 0.0), sliding(0, 0.0, 0j, 101.0 * EPS), turning(1, 1.0, 1.0, 1.0, origin=1.0))
    with pytest.raises(pcs.ChainError, match="joint 'j0', which makes the mass matrix singular in every configuration"):
        pcs.forward_dynamics(chain, np.zeros(3), np.zeros(3), np.zeros(3))


@pytest.mark.parametrize('name', CASES)
def test_the_series_have_the_guard_too(name):
    """The unrolled series eliminate slides first: another joint may be named, the threshold is the same within 2."""
    scale, bodies = CASES[name]
    for factor in (0.0, 50.0):
        simulation = pcs.Simulation(chain_of(*bodies(factor * EPS * scale)), 'taylor')
        assert simulation.form == 'dense'
        with pytest.raises(pcs.SimulationError,
                           match='the configuration is singular; the last good state is kept') as stopped:
            simulation.advance(1)
        assert stopped.value.reason == 'singular' and not stopped.value.ran_away   # no divergence
    simulation = pcs.Simulation(chain_of(*bodies(200.0 * EPS * scale)), 'taylor')
    simulation.advance(1)
    assert not simulation.position.any()


def test_an_acceleration_that_overflows_is_named():
    chain = chain_of(turning(-1, 1.0, 0j, 1.0), turning(-1, 1.0, 0j, 1e-3))
    with pytest.raises(pcs.SimulationError, match="joint 'j1' of body 'b1' of thin: the acceleration is not finite"):
        pcs.forward_dynamics(chain, [0.0, 0.0], [0.0, 0.0], [1.0, 1e308])


def test_a_failed_evaluation_does_not_affect_the_next():
    """The limb on the trunk is eliminated before the thin link fails; its share must not remain for the next call."""
    def chain():
        return chain_of(turning(-1, 1.0, 0.5, 1.0), turning(0, 0.0, 0j, 0.0, origin=1.0),
                        turning(1, 1.0, 1.0, 1.0, origin=1.0), turning(0, 1.0, 0.5j, 1.0, origin=0.5))
    state = np.array([0.1, 0.2, 0.9, -0.4]), np.ones(4), np.zeros(4)
    used = chain()
    with pytest.raises(pcs.SimulationError, match="joint 'j1'"):
        pcs.forward_dynamics(used, np.zeros(4), np.zeros(4), np.zeros(4))
    assert pcs.forward_dynamics(used, *state).tobytes() == pcs.forward_dynamics(chain(), *state).tobytes()


def test_every_evaluation_starts_afresh():
    chain, other = random_tree(4, bodies=20), random_tree(4, bodies=20)
    pcs.forward_dynamics(chain, *random_state(chain, 1))
    pcs.inverse_dynamics(chain, *random_state(chain, 2))
    state = random_state(chain, 3)
    assert pcs.forward_dynamics(chain, *state).tobytes() == pcs.forward_dynamics(other, *state).tobytes()
    assert pcs.inverse_dynamics(chain, *state).tobytes() == pcs.inverse_dynamics(
        random_tree(4, bodies=20), *state).tobytes()
