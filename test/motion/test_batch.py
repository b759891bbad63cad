"""rollout_batch: every scene has the bits of a single run, whatever runs beside it."""
from dataclasses import replace
from pathlib import Path

import numpy as np
from oracles.random_trees import one_joint, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim import _kernel
from planar_chain_sim.benchmark.problems import uniform_rods
from planar_chain_sim.chain.chain import Chain
from planar_chain_sim.chain.tree import Body, Joint
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.motion.integrators import method_data

CONFIG = Path(__file__).resolve().parents[2] / 'config'
CHAINS = {path.stem: pcs.load_chain(str(path)) for path in sorted(CONFIG.glob('*.yaml'))}
CHAINS |= {f'{links} rods': uniform_rods(links) for links in (1, 2, 4, 6, 7, 9)}
CHAINS |= {f'tree {seed}': random_tree(seed, bodies) for seed, bodies in ((1, 1), (2, 2), (3, 5), (4, 9), (5, 14))}
FIXED = [name for name, method in pcs.METHODS.items() if not method.adaptive]
ADAPTIVE = [name for name, method in pcs.METHODS.items() if method.adaptive]
SCENES, TICKS = 11, 12   # 11: no whole number of any vector


def states(chain, scenes=SCENES, seed=1):
    """Position, velocity, effort, (scenes, joints) each."""
    return np.random.default_rng(seed).normal(0.0, 0.7, (3, scenes, chain.joint_count))


def single(chain, method, position, velocity, effort, ticks=TICKS, step=1e-3):
    """Return position, velocity (ticks+1, joints), effort (ticks, joints), ticks done, the error or None."""
    simulation = pcs.Simulation(chain, method, step)
    simulation.set_state(position, velocity)
    rows = [np.tile(row, (ticks + 1, 1)) for row in (position, velocity)]
    acted, error = np.zeros((ticks, chain.joint_count)), None
    for k in range(ticks):
        try:
            simulation.advance(1, effort if effort.ndim == 1 else effort[k])
        except pcs.SimulationError as stopped:
            error = stopped
            break
        rows[0][k + 1:], rows[1][k + 1:], acted[k] = simulation.position, simulation.velocity, simulation.effort
    return *rows, acted, simulation.tick, error


def assert_equal_to_single_runs(batch, chains, method, position, velocity, effort, ticks=TICKS, step=1e-3):
    for scene, (q, v, u) in enumerate(zip(position, velocity, effort)):
        chain = chains[scene] if isinstance(chains, list) else chains
        *rows, done, error = single(chain, method, q, v, u, ticks, step)
        for name, got, wanted in zip(('position', 'velocity', 'effort'),
                                     (batch.position, batch.velocity, batch.effort), rows):
            assert got[scene].tobytes() == wanted.tobytes(), (scene, name)
        assert batch.ticks[scene] == done
        assert (error is None) == (scene not in batch.failures)
        if error is not None:
            kept = batch.failures[scene]
            assert str(kept) == f'scene {scene}: {error}'
            assert (kept.tick, kept.time, kept.joint) == (error.tick, error.time, error.joint)
            assert kept.position.tobytes() == error.position.tobytes()
            assert kept.velocity.tobytes() == error.velocity.tobytes()


@pytest.mark.parametrize('method', FIXED + ADAPTIVE)
@pytest.mark.parametrize('name', CHAINS)
def test_every_scene_gets_the_bits_of_a_single_run(name, method):
    chain = CHAINS[name]
    position, velocity, effort = states(chain)
    batch = pcs.rollout_batch(chain, position, velocity, effort, duration=TICKS * 1e-3, method=method)
    assert batch.time.tolist() == (np.arange(TICKS + 1) * 1e-3).tolist()
    assert_equal_to_single_runs(batch, chain, method, position, velocity, effort)


@pytest.mark.parametrize('method', FIXED)
@pytest.mark.parametrize('scenes', [1, 2, 7, 8, 17])
@pytest.mark.parametrize('name', ['tree 4', 'seven_link_arm', 'double_pendulum'])
def test_threads_and_vectors_change_no_bit(name, method, scenes):
    chain = CHAINS[name]
    position, velocity, effort = states(chain, scenes)
    data = method_data(pcs.METHODS[method], None)
    runs = {
        (width, threads): b''.join(part.tobytes() for part in _kernel.roll_batch(
            [(plan_of(chain).model, name == 'double_pendulum', data)], 1e-3, TICKS, position, velocity,
            effort[:, None], True, threads, width))
        for width in (1, *_kernel.vector_widths()) for threads in (1, 2, 5)}
    assert len(set(runs.values())) == 1, {key: hash(value) for key, value in runs.items()}


@pytest.mark.parametrize('name', CHAINS)
def test_evaluations_in_lanes_are_forward_dynamics(name):
    chain = CHAINS[name]
    position, velocity, effort = states(chain)
    for form in ('recursive', 'dense'):
        try:
            batch = _kernel.StateBatch(plan_of(chain).model, position, velocity, effort, form == 'dense')
        except ValueError as error:   # only short serial chains have a dense form for lanes
            assert form == 'dense' != plan_of(chain).form and 'not made for lanes' in str(error)
            continue
        batch.evaluate(2)
        got = batch.accelerations()
        wanted = np.array([pcs.forward_dynamics(chain, *state, form) for state in zip(position, velocity, effort)])
        assert got.tobytes() == wanted.tobytes()


@pytest.mark.parametrize('method', FIXED)
def test_a_far_angle_among_near_ones(method):
    """Beyond half a million quarter turns one lane alone uses the slower reduction."""
    chain = CHAINS['double_pendulum']
    position, velocity, effort = states(chain)
    position[3, 0], position[9, 1] = 1e7, -3e6
    batch = pcs.rollout_batch(chain, position, velocity, effort, duration=TICKS * 1e-3, method=method)
    assert_equal_to_single_runs(batch, chain, method, position, velocity, effort)


def test_laws_of_joints_and_clamped_efforts():
    joint = Joint('knee', 'rotation', -1.0, damping=0.3, stiffness=4.0, rest=0.2, armature=0.1, effort_limit=0.5)
    chain = replace(CHAINS['double_pendulum'], bodies=tuple(
        replace(body, rotation=joint) if k else body for k, body in enumerate(CHAINS['double_pendulum'].bodies)))
    position, velocity, effort = states(chain)
    batch = pcs.rollout_batch(chain, position, velocity, effort, duration=TICKS * 1e-3, method='rk4')
    assert np.abs(batch.effort[:, :, 1]).max() == 0.5
    assert_equal_to_single_runs(batch, chain, 'rk4', position, velocity, effort)


def test_efforts_of_every_shape():
    chain = CHAINS['four_link_robot']
    position, velocity, _ = states(chain)
    rows = np.random.default_rng(3).normal(size=(SCENES, TICKS, chain.joint_count))
    for effort in (rows[0, 0], rows[:, 0], rows, rows[:1], None):
        batch = pcs.rollout_batch(chain, position, velocity, effort, duration=TICKS * 1e-3, method='rk4')
        per_tick = np.zeros_like(rows) + (0.0 if effort is None else effort[:, None] if effort.ndim == 2 else effort)
        assert_equal_to_single_runs(batch, chain, 'rk4', position, velocity, per_tick)


def test_one_state_for_all_and_the_chains_own():
    chain = CHAINS['double_pendulum']
    effort = np.random.default_rng(3).normal(size=(SCENES, chain.joint_count))
    own = pcs.rollout_batch(chain, effort=effort, duration=0.01, method='rk4')
    start = np.array([joint.position for joint in chain.joints]), np.array([joint.velocity for joint in chain.joints])
    given = pcs.rollout_batch(chain, *start, effort, duration=0.01, method='rk4')
    assert own.position.shape == (SCENES, 11, 2) and own.position.tobytes() == given.position.tobytes()
    assert own.position[4].tobytes() == pcs.rollout(chain, 0.01, method='rk4', effort=effort[4]).position.tobytes()


@pytest.mark.parametrize('method', ['rk4', 'taylor'])
def test_last_states_alone(method):
    chain = CHAINS['four_link_robot']
    position, velocity, effort = states(chain)
    whole, last = (pcs.rollout_batch(chain, position, velocity, effort, duration=0.02, method=method, every_tick=every)
                   for every in (True, False))
    assert last.time.tolist() == [0.02] and last.effort.shape == (SCENES, 0, chain.joint_count)
    assert last.position.tobytes() == whole.position[:, -1:].tobytes()
    assert last.velocity.tobytes() == whole.velocity[:, -1:].tobytes()


def thin_chain():
    """Return a massless link, singular where the next one is in a row with it, and a link beside them."""
    def body(carrier, name, mass, origin):
        return Body(name, carrier, origin, 0.0, mass, complex(mass), float(mass), 0.0, None,
                    Joint(name, 'rotation', 1.0))
    return Chain('thin', 0j, (body(-1, 'a', 0.0, 0j), body(0, 'b', 1.0, 1.0 + 0j), body(-1, 'c', 1.0, 0j)))


@pytest.mark.parametrize('scenes', [5, 8, 19])
def test_a_scene_that_fails_leaves_the_others_alone(scenes):
    """One starts in a singular configuration, one runs away; the rest go on."""
    chain = thin_chain()
    position, velocity, effort = states(chain, scenes)
    position[:, 1], position[:, 2] = 1.5, 0.0
    velocity *= 0.1
    position[0, 1] = 0.0
    velocity[scenes - 1, 0] = 1e200
    batch = pcs.rollout_batch(chain, position, velocity, effort, duration=TICKS * 1e-3, method='rk4')
    assert sorted(batch.failures) == [0, scenes - 1]
    assert [batch.ticks[k] for k in batch.failures] == [0, 0]
    assert np.isfinite(batch.position).all() and np.isfinite(batch.velocity).all()
    assert_equal_to_single_runs(batch, chain, 'rk4', position, velocity, effort)
    last = pcs.rollout_batch(chain, position, velocity, effort, duration=TICKS * 1e-3, method='rk4', every_tick=False)
    assert last.position.tobytes() == batch.position[:, -1:].tobytes()
    assert {k: str(error) for k, error in last.failures.items()} == {k: str(e) for k, e in batch.failures.items()}


@pytest.mark.parametrize('method', ['rk4', 'taylor'])
def test_a_chain_for_each_scene(method):
    """Domain randomisation: other masses, the same make; then chains of other makes among them."""
    def heavier(chain, factor):
        return replace(chain, gravity=chain.gravity * (2 - factor), bodies=tuple(
            replace(body, mass=body.mass * factor, inertia=body.inertia * factor, inertia_com=body.inertia_com * factor,
                    rotation=replace(body.rotation, damping=0.1 * factor)) for body in chain.bodies))
    chains = [heavier(CHAINS['double_pendulum'], 1.0 + 0.05 * k) for k in range(SCENES)]
    position, velocity, effort = states(chains[0])
    batch = pcs.rollout_batch(chains, position, velocity, effort, duration=TICKS * 1e-3, method=method)
    assert_equal_to_single_runs(batch, chains, method, position, velocity, effort)
    chains[2], chains[10] = random_tree(7, 2, kinds=('turning',)), CHAINS['double_pendulum']
    batch = pcs.rollout_batch(chains, position, velocity, effort, duration=TICKS * 1e-3, method=method)
    assert_equal_to_single_runs(batch, chains, method, position, velocity, effort)


PAIR = CHAINS['double_pendulum']


@pytest.mark.parametrize('changes, sentence', [
    ({'position': np.zeros(3)}, 'position has shape (3,), must have (2,) or (scenes, 2)'),
    ({'position': 0.0}, 'position has shape (), must have (2,) or (scenes, 2)'),
    ({'velocity': np.zeros((4, 2, 2))}, 'velocity has shape (4, 2, 2), must have (2,) or (scenes, 2)'),
    ({'velocity': np.zeros((0, 2))}, 'velocity has shape (0, 2), must have (2,) or (scenes, 2)'),
    ({'velocity': [[0.0, 0.0], [0.0, np.nan]]}, 'velocity[1, 1] is nan, must be finite'),
    ({'effort': np.zeros((4, 5, 2))}, 'effort has shape (4, 5, 2), must have (2,) or (scenes, 2) or (scenes, 10, 2)'),
    ({'effort': [['a', 'b']]}, "effort must be numbers of shape (1, 2), got [['a', 'b']]"),
    ({'effort': np.zeros((5, 2))}, 'effort has 5 scenes, must have 1 or 4 as position'),
    ({'chain': [PAIR] * 3}, 'position has 4 scenes, must have 1 or 3 as chain'),
    ({'chain': [PAIR, one_joint()]}, 'chain[1] (one) has 1 joints, must have 2 as chain[0]'),
    ({'chain': []}, 'chain is [], must be a Chain or a sequence of them'),
    ({'threads': 0}, 'threads is 0, must be a whole number > 0 or None'),
    ({'threads': 2.5}, 'threads is 2.5, must be a whole number > 0 or None'),
    ({'duration': 0.0105}, 'duration is 0.0105 s, must be a whole number >= 0 of steps of 0.001 s'),
    ({'step': -1.0}, 'step is -1.0, must be a positive finite number of seconds'),
])
def test_bad_arguments_of_a_batch_are_one_sentence(changes, sentence):
    arguments = {'chain': PAIR, 'position': np.zeros((4, 2)), 'velocity': np.zeros(2), 'duration': 0.01} | changes
    with pytest.raises(ValueError) as refused:
        pcs.rollout_batch(**arguments)
    assert str(refused.value) == sentence


def test_chains_with_springs_in_different_joints_do_not_share_lanes():
    rods = uniform_rods(2)
    chains = [replace(rods, bodies=tuple(
        replace(body, rotation=replace(body.rotation, stiffness=5.0 * (i == k))) for i, body in enumerate(rods.bodies)))
        for k in (0, 1, 0, 1)]
    batch = pcs.rollout_batch(chains, [0.3, -0.2], duration=0.1, method='rk4')
    for k, chain in enumerate(chains):
        simulation = pcs.Simulation(chain, 'rk4')
        simulation.set_state([0.3, -0.2], [0.0, 0.0])
        simulation.advance(100)
        assert batch.position[k, -1].tobytes() == simulation.position.tobytes()
