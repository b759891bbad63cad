"""The benchmark's peers compute the same motions as this package. A peer that is not installed is skipped."""
from importlib import import_module

import numpy as np
from oracles.random_trees import random_state, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.benchmark.peers import compiled, PEERS
from planar_chain_sim.benchmark.problems import Problem, PROBLEMS, uniform_rods
from planar_chain_sim.chain.joint_arrays import initial_state
from planar_chain_sim.mechanics.joint_forces import passive_effort

SAME = 1e-10    # relative; the worst of these is below 1e-12


@pytest.fixture(scope='module')
def peers():
    """Return what makes a peer by its name, once; skips where it is not there."""
    made = {}

    def peer(name):
        if name not in made:
            try:
                made[name] = import_module(f'planar_chain_sim.benchmark.peers.{PEERS[name]}').Peer()
            except (compiled.Missing, ImportError) as error:
                pytest.skip(f'{name}: {error}')
        return made[name]
    return peer


def scenes(armature):
    trees = [random_tree(seed, 2 + seed, armature=armature) for seed in range(8)]
    return [problem.chain() for problem in PROBLEMS.values()] + [uniform_rods(5, bend=0.2)] + trees


@pytest.mark.parametrize('name, armature, passive', [('Pinocchio', True, False), ('MuJoCo', True, True),
                                                     ('Drake', False, True)])
def test_forward_dynamics_agrees(peers, name, armature, passive):
    for chain in scenes(armature):
        position, velocity, effort = random_state(chain, 1)
        wanted = pcs.forward_dynamics(chain, position, velocity, effort)
        applied = effort if passive else effort + passive_effort(chain, position, velocity)
        got = peers(name).forward_dynamics(chain, position, velocity, applied)
        np.testing.assert_allclose(got, wanted, rtol=0, atol=SAME * np.abs(wanted).max())


@pytest.mark.parametrize('seed', range(6))
def test_heyoka_is_given_our_equations(peers, seed):
    chain = random_tree(seed, 3 + seed % 3, kinds=('turning', 'sliding and turning'), armature=False)
    if seed == 0:
        chain = uniform_rods(2)
    random = np.random.default_rng(seed)
    arrays = random.normal(size=(3, 12, chain.joint_count))
    for formulation in peers('heyoka').formulations(chain):
        evaluate, result = peers('heyoka').batch_evaluation(chain, formulation, *arrays)
        evaluate(1)
        for k, got in enumerate(result()):
            wanted = pcs.forward_dynamics(chain, *arrays[:, k])
            np.testing.assert_allclose(got, wanted, rtol=0, atol=SAME * np.abs(wanted).max())
    assert len(peers('heyoka').formulations(chain)) == (2 if seed == 0 else 1)


@pytest.mark.parametrize('name, method, setting, error', [
    ('Pinocchio', 0, 2.5e-3, 1e-4), ('Pinocchio', 1, 1e-9, 1e-6), ('Pinocchio', 2, 1e-9, 1e-6),
    ('Pinocchio', 3, 1e-9, 1e-6), ('MuJoCo', 'RK4', 2.5e-3, 1e-4), ('MuJoCo', 'implicitfast', 2.5e-3, 0.1),
    ('MuJoCo', 'Euler', 2.5e-3, 0.1), ('heyoka', 'Taylor, articulated bodies', 1e-9, 1e-7),
    ('SciPy', 'DOP853', 1e-9, 1e-6), ('SciPy', 'LSODA', 1e-9, 1e-5), ('Drake', 'runge_kutta3', 1e-4, 1e-3),
    ('Drake', 'runge_kutta5', 1e-6, 1e-3)])
def test_integration_ends_where_the_problem_does(peers, name, method, setting, error):
    problem = PROBLEMS['four_link_robot']
    run = peers(name).integration(problem.chain(), method, setting, problem.duration)
    run.go()
    first = run.end()[0].copy()
    assert problem.error(first) < error
    run.go()
    np.testing.assert_array_equal(run.end()[0], first)   # each run starts at the start


@pytest.mark.parametrize('name', ['Pinocchio', 'MuJoCo', 'heyoka', 'SciPy', 'Drake'])
def test_every_curve_can_be_started(peers, name):
    chain = PROBLEMS['four_link_robot'].chain()
    problem = Problem('', lambda: chain, 0.01, (initial_state(chain)[0], ()))
    curves = peers(name).curves(problem)
    for curve in curves:
        run = curve.start(curve.settings[len(curve.settings) // 2])
        run.go()
        position, *counts = run.end()
        assert problem.error(position) < 1e-2 and len(counts) == 3
    assert curves and all(curve.library == name for curve in curves)


def test_loops_evaluate_the_state_that_they_are_given(peers):
    chain = uniform_rods(3, bend=0.2)
    arrays = (*initial_state(chain), np.zeros(3))
    for name in ('Pinocchio', 'MuJoCo'):
        peers(name).evaluation(chain, *arrays)(3)
    np.testing.assert_array_equal(arrays[0], initial_state(chain)[0])


def test_mujoco_rollout_makes_the_steps_of_its_integrator(peers):
    chain = uniform_rods(2)
    position, velocity = np.random.default_rng(0).normal(size=(2, 3, 2))
    roll, states = peers('MuJoCo').rollout(chain, 'RK4', position, velocity, 1e-3, 5, 0)
    roll(1)
    for k, last in enumerate(states[:, -1]):
        simulation = pcs.Simulation(chain, 'rk4', 1e-3)
        simulation.set_state(position[k], velocity[k])
        simulation.advance(5)
        np.testing.assert_allclose(last[1:3], simulation.position, rtol=0, atol=1e-12)


def test_what_does_not_compile_is_said_in_one_clause(tmp_path, monkeypatch):
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    source = tmp_path / 'broken.cpp'
    source.write_text('int main() { return nothing; }\n')
    with pytest.raises(compiled.Missing, match='does not compile broken.cpp: .*nothing'):
        compiled.compile_shared(source, [])
    monkeypatch.setenv('CXX', 'no-such-compiler')
    with pytest.raises(compiled.Missing, match='no C.. compiler no-such-compiler'):
        compiled.compile_shared(source, [])


def test_compiled_code_is_kept_until_its_source_changes(tmp_path, monkeypatch):
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    source = tmp_path / 'number.cpp'
    for number in (1, 2, 2):
        source.write_text(f'extern "C" __attribute__((visibility("default"))) int number() {{ return {number}; }}\n')
        assert compiled.compile_shared(source, []).number() == number
    assert len(list(tmp_path.glob('planar_chain_sim/number-*.so'))) == 2
