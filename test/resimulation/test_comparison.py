"""resimulate on another chain, by another method or step: differences are those of simulations moved by hand."""
from functools import partial
from math import ceil
from random import Random

import numpy as np
from oracles.random_runs import NOTHING, random_plan, write_plan
from oracles.random_trees import random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.recording.following import Following
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.rollout import main as rollout
from planar_chain_sim.resimulation import command_line as resimulation
from planar_chain_sim.resimulation.changed_run import changed_simulation
from planar_chain_sim.resimulation.comparison import compare, report
from planar_chain_sim.resimulation.deviation import CURVE, Deviation

ROBOT = 'four_link_robot.yaml'


def by_hand(simulation, plan, ratio=1):
    """Move a simulation along a plan, with ticks `ratio` times as long: positions and velocities of each tick."""
    rows, effort, joints = [(simulation.position, simulation.velocity)], None, simulation.chain.joint_count
    for tick, kind, data in plan:
        while simulation.tick < ceil(tick / ratio):
            simulation.advance(1, effort)
            rows.append((simulation.position, simulation.velocity))
        if kind == 'effort':
            effort = data
        elif kind == 'reset':
            simulation.set_state(*(np.array([getattr(joint, name) for joint in simulation.chain.joints])
                                   for name in ('position', 'velocity')))
            simulation.clear_wrenches()
            effort = None
        elif kind == 'state':
            simulation.set_state(**data)
        elif kind == 'wrench':
            simulation.set_wrench(**data)
        elif kind == 'payload':
            if simulation.payloads:
                simulation.drop('load')
            if data['mass']:
                simulation.attach(data['body'], data['mass'], data['position'], name='load')
        elif kind == 'parameter':
            names = ('gravity.x', 'gravity.y') if data['name'] == 'gravity' else [
                f'{joint}.damping' for joint in simulation.chain.joint_names]
            simulation.replace_chain(simulation.chain.with_parameters(dict(zip(names, data['value']))))
        rows[-1] = simulation.position, simulation.velocity   # after what happened at this tick
    assert all(row[0].shape == (joints,) for row in rows)
    return np.array(rows)   # (ticks + 1, 2, joints)


def changed(path, threshold=1e-3, **changes):
    log = read_log(path)
    return compare(log, partial(Following, log), lambda own: changed_simulation(own, **changes), threshold)


@pytest.mark.parametrize('seed', range(4))
def test_a_run_in_which_nothing_is_changed_is_equal_in_every_bit(tmp_path, seed):
    for k in range(25 * seed, 25 * seed + 25):
        random, rng, chain = Random(k), np.random.default_rng(k), random_tree(k, 1 + k % 5)
        method = random.choice(['auto', 'rk4', 'dop853', 'gauss6'])
        tolerance = random.choice([None, 1e-5]) if method in ('auto', 'dop853') else None
        simulation = pcs.Simulation(chain, method, random.choice([1e-3, 0.005, 1 / 3000]), tolerance)
        simulation.advance(random.choice([0, 0, 3]))
        path = write_plan(tmp_path / f'{k}.mcap', simulation, random_plan(random, rng, chain))
        same = {'method': simulation.method, 'step': simulation.step, 'tolerance': simulation.tolerance,
                'parameters': dict(list(chain.parameters.items())[:3]), 'chain': chain}
        given = {name: same[name] for name in random.sample(sorted(same), random.randrange(1, 6))}
        if 'tolerance' in given and simulation.tolerance is None:
            del given['tolerance']
        comparison = changed(path, **given)
        assert comparison.deviation.equal and comparison.deviation.states >= 121, (k, given)
        assert not comparison.deviation.largest.any() and np.isnan(comparison.deviation.apart).all()
        assert report(comparison).splitlines()[-1] == (
            f'It is repeated: {comparison.deviation.states} states equal, bit for bit.')


@pytest.mark.parametrize('seed', range(6))
def test_differences_are_those_of_two_simulations_moved_by_hand(tmp_path, seed):
    """Another method, in most cases another step; what a log says twice of one tick, as at a reset, is left out."""
    ratio = [1, 1, 2, 0.5, 3, 1.5][seed]
    random, rng, chain = Random(seed), np.random.default_rng(seed), random_tree(seed, 2 + seed % 3)
    plan = [each for each in random_plan(random, rng, chain) if each[1] not in ('reset', 'state')]
    path = write_plan(tmp_path / 'run.mcap', pcs.Simulation(chain), plan)
    theirs = by_hand(pcs.Simulation(chain), plan)
    mine = by_hand(pcs.Simulation(chain, 'rk4', 1e-3 * ratio), plan, ratio)
    common = [tick for tick in range(121) if tick % ratio == 0 or tick / ratio == tick // ratio]
    differences = np.abs(mine[[round(tick / ratio) for tick in common]] - theirs[common])
    comparison = changed(path, method='rk4', step=1e-3 * ratio, threshold=(limit := differences[:, 0].max() / 2))
    deviation = comparison.deviation
    assert deviation.states == len(common) and not deviation.equal
    assert deviation.largest.tolist() == differences.max(axis=0).tolist()
    np.testing.assert_allclose(deviation.rms, np.sqrt((differences**2).mean(axis=0)), rtol=1e-12)
    beyond = differences[:, 0] > limit
    first = [1e-3 * common[column.argmax()] if column.any() else np.nan for column in beyond.T]
    np.testing.assert_array_equal(deviation.apart, first)
    assert deviation.largest_at[0].tolist() == [1e-3 * common[k] for k in differences[:, 0].argmax(axis=0)]
    assert comparison.run.late == sum(tick % ratio > 0 for tick, kind, _ in plan if kind != NOTHING)


def test_differences_of_many_states_are_those_of_numpy():
    """Several blocks, of which the last are equal; a largest difference that comes twice is told of the first time."""
    rng, deviation, states = np.random.default_rng(1), Deviation(3, 0.7), 2 * CURVE + 5
    rows = rng.uniform(0.0, 0.5, (states, 4, 3))
    rows[3000:, 2:] = rows[3000:, :2]
    rows[[10, 2000], :, 1] = [1.0, 2.0, 3.0, 5.0]
    for k, row in enumerate(rows):
        deviation.add(0.5 * k, *row)
    deviation.close()
    differences = np.abs(rows[:, 2:] - rows[:, :2])
    assert not deviation.equal and deviation.states == states
    assert deviation.largest.tolist() == differences.max(axis=0).tolist()
    assert deviation.largest_at.tolist() == (0.5 * differences.argmax(axis=0)).tolist()
    np.testing.assert_allclose(deviation.rms, np.sqrt((differences**2).mean(axis=0)), rtol=1e-12)
    np.testing.assert_array_equal(deviation.apart, [np.nan, 5.0, np.nan])
    assert deviation.apart_from == 5.0 and deviation.grown.tolist()[:4] == 4 * [0.0] and deviation.grown[4] == 5.0
    time, curve = deviation.curve
    assert len(time) == len(curve) <= CURVE and (np.diff(time) > 0).all() and time[0] == 0.0
    assert curve.max(axis=0).tolist() == differences.max(axis=0).tolist()
    assert not curve[time > 1500.0].any() and curve[time < 1490.0].all()


def test_another_chain_takes_what_it_has_by_name(tmp_path):
    """Joints in another order, one more and one less; a wrench on a body that is not there is said."""
    chain = pcs.chain_from_dict({'name': 'two', 'bodies': [
        {'name': 'a', 'carrier': 'base', 'mass': 1.0, 'center_of_mass': [0.5, 0.0], 'inertia_com': 0.1,
         'rotation': {'joint': 'a_joint', 'position': 0.3}},
        {'name': 'b', 'carrier': 'a', 'origin': [1.0, 0.0], 'mass': 1.0, 'center_of_mass': [0.5, 0.0],
         'inertia_com': 0.1, 'rotation': {'joint': 'b_joint', 'damping': 0.1}}]})
    other = pcs.chain_from_dict({'name': 'other', 'bodies': [
        {'name': 'c', 'carrier': 'base', 'mass': 1.0, 'inertia_com': 0.2, 'rotation': {'joint': 'c_joint'}},
        {'name': 'b', 'carrier': 'c', 'origin': [0.5, 0.0], 'mass': 2.0, 'center_of_mass': [0.5, 0.0],
         'inertia_com': 0.1, 'rotation': {'joint': 'b_joint', 'damping': 0.2, 'velocity': 0.7}},
        {'name': 'd', 'carrier': 'b', 'origin': [1.0, 0.0], 'mass': 0.1, 'inertia_com': 0.1,
         'rotation': {'joint': 'a_joint', 'position': 0.3}}]})
    simulation = pcs.Simulation(chain)
    simulation.set_state([0.4, -0.2], [0.0, 0.1])      # which the log begins with
    path = tmp_path / 'run.mcap'
    with pcs.OfflineLog(path, simulation) as log:
        log.advance(30, [1.0, -2.0])
        log.change('wrench', body='a', force=[1.0, 0.0])
        log.change('wrench', body='b', force=[1.0, 0.0])
        log.change('parameter', name='damping', value=[0.5, 0.1])
        log.change('state', position=[0.1, 0.2], velocity=[0.3, 0.4])
        log.advance(30, [1.0, -2.0])
    mine = pcs.Simulation(other)
    mine.set_state([0.0, -0.2, 0.4], [0.0, 0.7, 0.0])  # what the other chain starts with differs from the first in b
    mine.advance(30, [0.0, -2.0, 1.0])
    mine.set_wrench('b', [1.0, 0.0])
    mine.replace_chain(mine.chain.with_parameters({'a_joint.damping': 0.5}))   # that of b was not changed
    mine.set_state([mine.position[0], 0.2, 0.1], [mine.velocity[0], 0.4, 0.3])
    mine.advance(30, [0.0, -2.0, 1.0])
    comparison = changed(path, chain=other)
    assert comparison.run.simulation.position.tobytes() == mine.position.tobytes()
    assert comparison.run.simulation.velocity.tobytes() == mine.velocity.tobytes()
    assert comparison.joints == ('b_joint', 'a_joint')
    parted = abs(mine.position[[1, 2]] - pcs.load_log(path).position[-1, [1, 0]])
    assert (comparison.deviation.largest[0] >= parted).all() and parted.max() > 0.005
    said = report(comparison)
    assert 'Joints of the changed run alone, which are not compared: c_joint' in said
    assert "Left out 1 time: wrench on the body 'a', which the other chain does not have." in said
    assert 'chain two -> other; ' in said and 'b.mass 1 -> 2; ' in said


@pytest.fixture(scope='module')
def swing(tmp_path_factory):
    path = tmp_path_factory.mktemp('log') / 'swing.mcap'
    assert rollout([ROBOT, '--duration', '0.5', '--effort', '1,2,0,0,0', '--output', str(path)]) == 0
    return path


@pytest.mark.parametrize('arguments, first, last', [
    (['--method', 'rk4'], 'method taylor -> rk4; tolerance 1e-09 -> none',
     'No, it does not matter: no position differs by more than 0.001 rad or m; the largest difference of a position'),
    (['--method', 'rk4', '--threshold', '1e-11'], 'method taylor', 'Yes, it matters: from t = 0.'),
    (['--set', 'gravity.y=-1.62', '--set', 'forearm_joint.damping=0.5'],
     'gravity.y -9.81 -> -1.62; forearm_joint.damping 0.3 -> 0.5', 'Yes, it matters: from t = 0.'),
    (['--tolerance', '1e-6', '--step', '0.01'], 'tolerance 1e-09 -> 1e-06; step 0.001 -> 0.01 s', 'No, it does'),
    (['--chain', ROBOT], 'nothing', 'It is repeated: 501 states equal, bit for bit.'),
    (['--step', '0.0005'], 'step 0.001 -> 0.0005 s', 'No, it does not matter: 501 states equal, bit for bit.'),
])
def test_the_report_says_what_was_changed_and_whether_it_matters(swing, capsys, arguments, first, last):
    assert resimulation.main([str(swing), *arguments]) == 0
    said = capsys.readouterr()
    lines = said.out.splitlines()
    states = 51 if '0.01' in arguments else 501
    assert lines[0].startswith(f'{swing}: {states} states of four_link_robot, t = 0 to 0.5 s, compared with a run by '
                               'method ')
    assert lines[1].startswith(f'Changed: {first}')
    assert [line.split(',')[0] for line in lines[4:9]] == list(pcs.load_chain(ROBOT).joint_names)
    assert lines[-1].startswith(last) and said.err == ''


def test_what_chaos_makes_of_a_rounding_error_is_not_taken_for_an_effect(tmp_path, capsys):
    path = tmp_path / 'run.mcap'
    assert rollout(['double_pendulum.yaml', '--duration', '12', '--step', '0.01', '--output', str(path)]) == 0
    capsys.readouterr()
    assert resimulation.main([str(path), '--method', 'dop853']) == 0
    *_, grown, amplified, answer = capsys.readouterr().out.splitlines()
    assert grown.startswith('The largest difference of a position, rad or m, is above 1e-12 from t = 0.0')
    assert amplified.startswith('From t = 7.69 s on this motion amplifies: there, 1e-09 rad/s or m/s more at the start')
    assert answer.startswith('No, it matters no more than a rounding error would: positions differ by more than 0.001')
    assert resimulation.main([str(path), '--set', 'gravity.y=-9.80']) == 0    # shows before
    assert capsys.readouterr().out.splitlines()[-1].startswith('Yes, it matters: from t = 0.')


def test_changes_between_two_ticks_of_a_longer_step_are_said(tmp_path, capsys):
    path = tmp_path / 'run.mcap'
    with pcs.OfflineLog(path, pcs.Simulation(pcs.load_chain(ROBOT))) as log:
        log.advance(21, [1.0, 0.0, 0.0, 0.0, 0.0])   # at tick 0
        log.advance(3, [2.0, 0.0, 0.0, 0.0, 0.0])    # at 21, in the other run at 22
        log.advance(76, [3.0, 0.0, 0.0, 0.0, 0.0])   # at 24
    assert resimulation.main([str(path), '--step', '0.002']) == 0
    assert ('1 change at times that are no tick of 0.002 s acted at the next tick, at most 0.001 s later.'
            in capsys.readouterr().out)


def test_a_changed_run_that_stops_is_an_answer(tmp_path, capsys):
    chain, path = tmp_path / 'spring.yaml', tmp_path / 'run.mcap'
    chain.write_text('name: spring\nbodies:\n- {name: b, carrier: base, mass: 1, inertia_com: 1,\n'
                     '   rotation: {joint: j, stiffness: 1e8, position: 1}}\n')
    assert rollout([str(chain), '--duration', '0.05', '--output', str(path)]) == 0
    capsys.readouterr()
    assert resimulation.main([str(path), '--method', 'rk4']) == 0
    said = capsys.readouterr()
    answer, states = said.out.splitlines()[-1], int(said.out.partition(': ')[2].split()[0])
    assert 1 <= states == int(answer.partition('at tick ')[2].partition(',')[0]) + 1 < 51
    assert answer.startswith("Yes, it matters: the computed run stops (joint 'j' of body 'b' of spring")
    assert said.err.startswith('resimulate: warning: step is 0.001 s, should be below about ')


def test_a_picture_of_no_difference_has_the_threshold_alone(swing, tmp_path, capsys):
    assert resimulation.main([str(swing), '--set', 'gravity.y=-9.81', '--picture', str(tmp_path / 'a.png')]) == 0
    said = capsys.readouterr()
    assert 'equal, bit for bit' in said.out and not said.err


@pytest.mark.parametrize('ending', ['.png', '.svg', '.pdf'])
def test_a_picture_of_how_they_part(swing, tmp_path, capsys, ending):
    picture = tmp_path / f'deviation{ending}'
    assert resimulation.main([str(swing), '--set', 'gravity.y=-9.8', '--picture', str(picture)]) == 0
    start = picture.read_bytes()[:600]
    assert start.startswith({'.png': b'\x89PNG', '.svg': b'<?xml', '.pdf': b'%PDF'}[ending])
    assert resimulation.main([str(swing), '--set', 'gravity.y=-9.8', '--picture', str(picture)]) == 2
    assert 'the file exists and is not overwritten' in capsys.readouterr().err


@pytest.mark.parametrize('arguments, sentence', [
    (['--set', 'forearm.mas=2'],
     "parameter 'forearm.mas' is not one of four_link_robot (did you mean 'forearm.mass'?)"),
    (['--set', 'forearm.mass=heavy'], "--set 'forearm.mass=heavy' must be a name and a number, as forearm.mass=2"),
    (['--set', 'forearm.mass'], "--set 'forearm.mass' must be a name and a number"),
    (['--set', 'forearm.mass=-1'], "body 'forearm' key 'mass' is -1.0, must be"),
    (['--set', 'column_joint.effort_limit=nan'], "body 'column' key 'rotation.effort_limit' is nan, must be a finite "),
    (['--method', 'euler'], "argument --method: invalid choice: 'euler' (choose from 'auto', "),
    (['--method', 'rk4', '--tolerance', '1e-5'],
     "--tolerance is for adaptive methods, but method 'rk4' has a fixed step"),
    (['--tolerance', '2'], '--tolerance is 2.0, must be a number between'),
    (['--step', '0'], '--step is 0.0, must be a positive finite number of seconds'),
    (['--step', 'nan'], '--step is nan, must be a positive finite number of seconds'),
    (['--step', '-1e-3'], '--step is -0.001, must be a positive finite number of seconds'),
    (['--step', '0.00031234567'], '--step is 0.000312346 s, must be one whose ticks meet those of the recorded step of '
     '0.001 s, for example 0.0005 or 0.002'),
    (['--step', '1e300'], '--step is 1e+300 s, must be '),
    (['--step', '1e-300'], '--step is 1e-300 s, must be '),
    (['--step', '1'], '--step is 1 s, must be shorter than what the log holds'),
    (['--chain', 'double_pendulum.yaml'], "chain 'double_pendulum' has the joints upper_joint, lower_joint, must share "
     "one with 'four_link_robot', which has column_slide, "),
    (['--chain', 'four_link_robt.yaml'], "did you mean 'four_link_robot.yaml'?"),
    (['--threshold', 'nan', '--method', 'rk4'], '--threshold is nan, must be a finite number >= 0'),
    (['--picture', 'a.png'], '--picture is for a run that is changed: give --method, '),
    (['--method', 'rk4', '--picture', 'a.gif'], "--picture is 'a.gif', must end in .png, .svg, .pdf"),
    (['--method', 'rk4', '--picture', 'no/such/a.png'], "'no/such/a.png': No such file or directory"),
    (['--set', 'forearm_joint.lower=-1', '--set', 'forearm_joint.upper=-0.9'],
     "body 'forearm' key 'rotation.position' is 1.4, must lie between the stops, -1.0 and -0.9"),
])
def test_a_mistake_is_one_sentence(swing, tmp_path, monkeypatch, capsys, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    assert resimulation.main([str(swing), *arguments]) == 2
    said = capsys.readouterr()
    assert said.out == '' and said.err.count('\n') == 1 and said.err.startswith('resimulate: ')
    assert sentence in said.err
    assert list(tmp_path.iterdir()) == []
