"""The benchmark executable with tiny settings, its named problems and its arithmetic; no time is judged."""
import csv
from dataclasses import replace
import os
from pathlib import Path
from random import Random
import re
import shlex

import numpy as np
from oracles.random_trees import random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.benchmark import cpu_time, energy_drift, references, scaling, skipping, stability, work_precision
from planar_chain_sim.benchmark.command_line import main
from planar_chain_sim.benchmark.peers import open_peers
from planar_chain_sim.benchmark.problems import PROBLEMS, uniform_rods
from planar_chain_sim.benchmark.scenes import Check, damaged_files, flood
from planar_chain_sim.benchmark.table import shown, table_lines
from planar_chain_sim.chain.joint_arrays import initial_state
from planar_chain_sim.chain_file import chain_from_text
from planar_chain_sim.mechanics.plan import plan_of

OWN = work_precision.OWN


def table_of(path):
    with open(path, newline='') as file:
        return list(csv.reader(file))


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return a folder that `benchmark all` has made, with no peer."""
    pytest.importorskip('matplotlib')
    made = tmp_path_factory.mktemp('all') / 'new'
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('COMPILER', os.environ.get('CXX', 'c++'))
        patch.setenv('CXX', shlex.join(['sh', str(Path(__file__).with_name('unoptimised.sh'))]))
        assert main(['all', '--quick', '--peers', 'none', '--folder', str(made)]) == 0
    return made


@pytest.mark.slow
@pytest.mark.parametrize('suite', ['work-precision', 'step-time', 'calls', 'scaling', 'skipping', 'energy'])
def test_suite_writes_its_table(suite, folder):
    header, *rows = table_of(folder / f'{suite}.csv')
    assert rows and len(set(header)) == len(header) and all(len(row) == len(header) for row in rows)
    timed = [name for name in header if name.startswith(('CPU', 'evaluation, ns', 'min, ', 'kernel', 'load'))]
    assert timed
    for name in timed:
        values = [row[header.index(name)] for row in rows]   # empty where nothing is timed
        assert any(values) and all(float(value) > 0.0 for value in values if value), name
    if suite == 'work-precision':
        assert {row[0] for row in rows} == set(PROBLEMS) and {row[2] for row in rows} >= set(pcs.METHODS)
        assert (folder / 'work-precision_summary.csv').exists()


@pytest.mark.slow
@pytest.mark.parametrize('suite', ['work-precision', 'step-time', 'scaling', 'batch'])
def test_suite_draws_its_picture(suite, folder):
    assert (folder / f'{suite}.svg').read_bytes().startswith(b'<?xml')


def test_one_suite_prints_its_table_and_draws_by_the_same_command(tmp_path, capsys):
    pytest.importorskip('matplotlib')
    table, picture = tmp_path / 'table.csv', tmp_path / 'picture.png'
    assert main(['step-time', '--quick', '--peers', 'none', '--csv', str(table), '--picture', str(picture)]) == 0
    printed = capsys.readouterr().out
    first, *lines = printed.splitlines()
    rule = next(k for k, line in enumerate(lines) if not line.strip('- '))
    assert first == 'peers: none' and max(map(len, lines)) <= 100
    header, *rows = table_of(table)
    assert len(lines[rule].split()) == len(header) and len(lines) == rule + 1 + len(rows)
    assert [line.split()[:2] for line in lines[rule + 1:]] == [row[:2] for row in rows]
    assert picture.read_bytes().startswith(b'\x89PNG')


@pytest.mark.parametrize('arguments, said', [
    (['all'], '--folder'), (['step-time', '--folder', 'x'], '--folder'), (['step-time', '--peers', 'Moco'], "'Moco'"),
    (['skipping', '--picture', 'a.svg'], 'no picture'), (['step-time', '--picture', 'a.jpeg'], "'.png'"),
    (['step-time', '--csv', '/nowhere/a.csv'], '--csv'), (['node', '--csv', '/nowhere/a.csv'], '--csv'),
    (['speed'], 'speed')])
def test_mistake_is_one_sentence_before_anything_is_measured(arguments, said, capsys):
    assert main([*arguments, '--quick']) == 2
    printed = capsys.readouterr()
    assert printed.err.count('\n') == 1 and said in printed.err and '--' not in printed.out


@pytest.mark.parametrize('name, arguments', [
    ('table.csv', ['--csv', 'table.csv']), ('table_summary.csv', ['--csv', 'table.csv']),
    ('picture.svg', ['--picture', 'picture.svg'])])
def test_no_file_is_overwritten(name, arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path(name).write_text('mine')
    assert main(['work-precision', '--quick', '--peers', 'none', *arguments]) == 2
    assert capsys.readouterr().err == f"benchmark: '{name}': the file exists and is not overwritten, give a new name\n"
    assert Path(name).read_text() == 'mine' and len(list(tmp_path.iterdir())) == 1


def test_tables_are_aligned_and_no_wider_than_100_columns():
    random, broken = Random(6), 0
    words = ['planar_chain_sim', 'a', 'joint', 'stops that open and close', 'evaluation, ns: median', 'x' * 25, '']
    for _ in range(300):
        count = random.randint(1, 11)
        columns = [random.choice(words[:-1]) for _ in range(count)]
        kinds = [random.random() < 0.6 for _ in columns]
        rows = [[random.choice([None, 10**random.uniform(-9, 9), random.randrange(10**6)]) if number
                 else random.choice(words) for number in kinds] for _ in range(random.randrange(6))]
        lines = list(table_lines(columns, rows))
        assert max(map(len, lines)) <= 100
        rule = next(k for k, line in enumerate(lines) if line and not line.strip('- '))
        places = [match.span() for match in re.finditer('-+', lines[rule])]
        assert len(places) == count
        joined = [''.join(line[start:end].strip() for line in lines[:rule]) for start, end in places]
        assert [text.replace(' ', '') for text in joined] == [column.replace(' ', '') for column in columns]
        for line in lines:      # nothing but blanks between the columns
            between = [line[end:start] for (_, end), (start, _) in zip(places, places[1:])]
            assert all(not text.strip() for text in between)
        broken += len(lines) > rule + 1 + len(rows)
        body = ''.join(lines[rule + 1:]).replace(' ', '')
        assert sorted(body) == sorted(''.join(shown(value) for row in rows for value in row).replace(' ', ''))
    assert broken > 30


def test_a_curve_ends_where_it_gets_no_finer_or_too_dear():
    problem = PROBLEMS['double_pendulum']
    rk4 = next(curve for curve in work_precision.own_curves(problem) if curve.method == 'rk4')
    tried = work_precision._tried(problem, replace(rk4, settings=[1e-3, 5e-4, 2.5e-4]), 10.0)
    assert [setting for setting, _, _ in tried] == [1e-3, 5e-4, 2.5e-4]
    coarse, fine = (counted[0] for _, _, counted in tried[1:])
    assert 3.8 < np.log2(coarse / fine) < 4.2            # the order, seen against the stored digits
    assert [counted[1:] for _, _, counted in tried] == [(4 * n, n, 0) for n in (5000, 10000, 20000)]
    tried[0][1].go()                                     # a second run starts again, and counts again
    assert tried[0][1].end()[1:] == (20000, 5000, 0) and problem.error(tried[0][1].end()[0]) == tried[0][2][0]
    assert len(work_precision._tried(problem, replace(rk4, settings=[0.01, 0.005]), 0.0)) == 1
    idle = work_precision._tried(problem, replace(rk4, settings=[0.01] * 9), 10.0)
    assert len(idle) == 1 + work_precision.PATIENCE


def test_summary_takes_the_cheapest_setting_that_reaches_each_target():
    def row(library, method, error, median):
        return ('problem', library, method, 'step', 0.1, error, 1, 1, 0, median, median / 2)
    table = [row(OWN, 'a', 1e-3, 1.0), row(OWN, 'a', 1e-7, 4.0), row(OWN, 'b', 1e-7, 3.0), row('peer', 'c', 1e-9, 30.0),
             row('peer', 'c', 1.1e-3, 0.1)]
    _, result = work_precision.summary(table)
    found = {line[1:3]: line[3:7] for line in result}
    assert found[OWN, 'a'] == (1.0, 4.0, '', '')
    assert found[OWN, 'BEST'] == (1.0, 3.0, '', '')
    assert found['peer', 'BEST'] == (30.0, 30.0, 30.0, '')
    assert found['peer', 'TIMES OURS'] == (30.0, 10.0, '', '')
    assert work_precision._frontier([(1e-3, 1.0), (1e-6, 0.5), (1e-9, 2.0)]) == [(1e-9, 2.0), (1e-6, 0.5)]


def test_readings_are_taken_in_turns(monkeypatch):
    calls, clock = [], [0.0]
    monkeypatch.setattr(cpu_time, 'process_time', lambda: clock[0])

    def run(name, seconds):
        def go(count):
            calls.append((name, count))
            clock[0] += seconds * count
        return go
    times = cpu_time.interleaved([run('short', 1e-4), run('dear', 1.0)], rounds=6, budget=4.0)
    assert [len(readings) for readings in times] == [6, 4]
    np.testing.assert_allclose(times[0], 1e-4, rtol=1e-9)
    np.testing.assert_allclose(times[1], 1.0, rtol=1e-9)
    asked = dict(calls)                                        # the last count of each
    assert asked == {'short': 20, 'dear': 1}
    turns = [name for name, _ in calls[-10:]]
    assert turns.count('short') == 6 and turns.count('dear') == 4 and 'dear dear' not in ' '.join(turns)


def test_a_cold_start_does_not_set_the_count(monkeypatch):
    clock, made = [0.0], []
    monkeypatch.setattr(cpu_time, 'process_time', lambda: clock[0])

    def run(count):
        clock[0] += 1e-6 * count + (1e-3 if len(made) < 2 else 0.0)
        made.append(count)
    times, = cpu_time.interleaved([run], rounds=3)
    assert all(2000 <= count <= 2001 for count in made[-3:])   # LEAST over 1e-6 s, rounded up
    np.testing.assert_allclose(times, 1e-6, rtol=1e-6)


def test_growth_is_the_slope_of_the_root_mean_square():
    time = np.arange(1.0, 1001.0)
    errors = np.array([[1.0], [-1.0], [2.0]]) * time**0.5
    assert energy_drift._growth(errors) == pytest.approx(0.5, abs=1e-12)


def test_energy_is_measured_over_its_range():
    start, range_ = energy_drift._energy_range(energy_drift.configured('double_pendulum'))
    assert range_ == pytest.approx(9.81 * (1.5 * (1 - np.cos(2.0)) + 0.5 * (1 - np.cos(2.5))), rel=1e-14)   # 29.67 J
    assert len({chain.joints[0].position for chain in energy_drift._scenes(3)}) == 3


@pytest.mark.parametrize('name', PROBLEMS)
def test_stored_end_is_where_another_library_ends(name):
    heyoka_peer = pytest.importorskip('planar_chain_sim.benchmark.peers.heyoka_peer')
    pytest.importorskip('heyoka')
    problem = PROBLEMS[name]
    chain, peer = problem.chain(), heyoka_peer.Peer()
    taylor, system = peer.integrator(chain, 'Taylor, articulated bodies', 1e-11)
    taylor.propagate_until(problem.duration)
    position, velocity = system.joints(taylor.state)
    assert problem.error(position) < 1e-9    # tolerance times what these motions amplify, 400 at most
    np.testing.assert_allclose(velocity, problem.end[1], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize('name', PROBLEMS)
def test_two_integrations_in_many_digits_agree(name):
    pytest.importorskip('heyoka')
    chain, duration = PROBLEMS[name].chain(), 0.004
    first, second = (motion(chain, duration, *initial_state(chain))
                     for motion in (references.extrapolated_motion, references.taylor_motion))
    for a, b in zip(first, second):
        assert max(abs(x - y) for x, y in zip(a, b)) < 1e-20
    simulation = pcs.Simulation(chain, 'rk4', duration / 64)
    simulation.advance(64)
    np.testing.assert_allclose(simulation.position, [float(x) for x in first[0]], rtol=0, atol=1e-13)
    np.testing.assert_allclose(simulation.velocity, [float(x) for x in first[1]], rtol=0, atol=1e-11)


@pytest.mark.parametrize('seed', range(5))
def test_virtual_power_in_many_digits_is_our_acceleration(seed):
    from mpmath import mp
    chain = random_tree(seed, 5, kinds=('turning', 'sliding and turning'))
    position, velocity = np.random.default_rng(seed).normal(size=(2, chain.joint_count))
    with mp.workdps(30):
        got = references.VirtualPower(mp, chain).accelerations(*([mp.mpf(float(x)) for x in values]
                                                                 for values in (position, velocity)))
    wanted = pcs.forward_dynamics(chain, position, velocity, np.zeros(chain.joint_count))
    np.testing.assert_allclose(wanted, [float(x) for x in got], rtol=0, atol=3e-13 * np.abs(wanted).max())


@pytest.mark.parametrize('feature', skipping.FEATURES)
def test_feature_is_in_the_plan_of_its_scene_alone(feature):
    add, zero = skipping.FEATURES[feature]
    plain = uniform_rods(skipping.LINKS, gravity=0j, bend=0.2)
    silent = feature.startswith(('joint offset', 'mass centre'))   # data of every scene, no feature of the plan yet
    assert silent or set(plan_of(add(plain)).used) - set(plan_of(plain).used)
    if zero:
        assert plan_of(zero(plain)).used == plan_of(plain).used
    if feature == 'welded halves':
        H, position = pcs.mass_matrix(plain, np.ones(8)), np.ones(8)
        np.testing.assert_allclose(pcs.mass_matrix(add(plain), position), H, rtol=1e-13)


def test_text_of_a_long_chain_loads_as_the_same_chain():
    chain = uniform_rods(7, bend=0.2)
    loaded = chain_from_text(scaling.chain_text(chain))
    arrays = np.random.default_rng(3).normal(size=(3, 7))
    np.testing.assert_array_equal(pcs.forward_dynamics(chain, *arrays), pcs.forward_dynamics(loaded, *arrays))
    assert [joint.position for joint in loaded.joints] == [joint.position for joint in chain.joints]


@pytest.fixture(scope='module')
def stability_table():
    """Return the rows of the scenes at a small part of their length, with MuJoCo; at full length: `make soak`."""
    found, _ = open_peers(['MuJoCo'])
    return list(stability.rows(found, quick=True))


@pytest.mark.slow
def test_every_number_of_the_stability_suite_holds(stability_table):
    assert {row[0] for row in stability_table} == set(stability.SCENES) and len(stability_table) > 80
    assert [row for row in stability_table if row[4] != 'yes' and not row[4].startswith('not run: ROS 2')] == []


@pytest.mark.slow
def test_mujoco_runs_what_it_can(stability_table):
    if 'MuJoCo' in (missing := open_peers(['MuJoCo'])[1]):
        pytest.skip(f'MuJoCo: {missing["MuJoCo"]}')
    compared = {row[0] for row in stability_table if row[5] is not None}
    assert set(stability.SCENES) - compared <= {'chain files', 'messages to the node'}
    assert {row[5] for row in stability_table if row[0] == 'massless'} == {'cannot be built'}
    theirs = {row[:2]: row[5] for row in stability_table}
    assert theirs['stop hit at 100 rad/s', 'under gravity: penetration, rad'] > 0.1
    assert theirs['efforts', next(row[1] for row in stability_table if row[1].startswith('nan'))] > 0


@pytest.mark.slow
def test_the_stability_suite_is_drawn(stability_table, tmp_path):
    pytest.importorskip('matplotlib')
    stability.draw(stability_table, tmp_path / 'a.png')
    assert (tmp_path / 'a.png').read_bytes().startswith(b'\x89PNG')


def test_a_check_holds_only_with_a_number_within_its_limit():
    assert [Check('', 1.0, measured).holds for measured in (1.0, 1.1, float('nan'), float('inf'), -1.0)] == [
        'yes', 'NO', 'NO', 'NO', 'yes']
    assert stability.row_of('scene', Check('what', 0, None, why='no ROS 2')) == (
        'scene', 'what', 0.0, None, 'not run: no ROS 2', None)


def test_without_ros_the_flood_is_left_out_in_one_sentence(monkeypatch):
    def missing(count):
        raise ImportError("No module named 'rclpy'")
    monkeypatch.setattr(flood, '_flooded', missing)
    holds = {check.holds for check in flood.messages({}, 0.001)}
    assert holds == {"not run: ROS 2 cannot be used (No module named 'rclpy')"}


def test_a_reader_that_crashes_or_runs_wild_is_told(monkeypatch):
    monkeypatch.setattr(damaged_files, '__name__', 'planar_chain_sim.no_such_module')
    first, *others = damaged_files.chain_files({}, 0.001)
    assert first.measured == 100 and {check.holds for check in others} == {'not run: the process crashed'}
    monkeypatch.setattr(damaged_files, 'chain_from_text', lambda text, name: 1 / 0)
    assert damaged_files.read_damaged(20)[0] == 20
