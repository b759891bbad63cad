"""The executable rollout: what it prints, and the effort files that it reads."""
from pathlib import Path
from random import Random
import re
import signal
import subprocess
import sys
from time import monotonic, sleep

import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.recording import effort_table, rollout
from planar_chain_sim.recording.cdr import decode_joint_state
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.resimulation import command_line as resimulation

ROBOT = 'four_link_robot.yaml'


def test_ten_seconds_into_a_log_of_the_chain_files_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert rollout.main([ROBOT]) == 0
    chain = pcs.load_chain(ROBOT)
    first, last = capsys.readouterr().out.splitlines()
    assert first == f'{chain.name}: {pcs.Simulation(chain).plan}'
    assert re.fullmatch(r'four_link_robot\.mcap: 10 s simulated in \d+\.\d\d s, 10001 states', last)
    assert sum(1 for _ in read_log(tmp_path / 'four_link_robot.mcap').messages) == 10001


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_run_and_closes_the_log(tmp_path, number):
    path = tmp_path / 'run.mcap'
    process = subprocess.Popen([sys.executable, '-m', 'planar_chain_sim.recording.rollout', ROBOT, '--duration', '1e5',
                                '--output', str(path)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        started = monotonic()
        while not (path.exists() and path.stat().st_size > 1_000_000) and monotonic() - started < 300.0:
            sleep(0.01)
        process.send_signal(number)
        assert process.communicate(timeout=600)[1] == 'rollout: interrupted\n'
    finally:
        process.kill()
    assert process.returncode == 128 + number and read_log(path).complete


def test_lines_without_a_value_are_skipped(tmp_path):
    """As a spreadsheet writes its empty rows."""
    chain = pcs.load_chain('double_pendulum.yaml')
    (tmp_path / 'efforts.csv').write_text('upper_joint,lower_joint\n,\n1,2\n"",""\n;\n\t\n3,4\n,\n')
    assert effort_table.read_efforts(str(tmp_path / 'efforts.csv'), chain).rows.tolist() == [[1.0, 2.0], [3.0, 4.0]]


def test_one_is_one(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('one.yaml').write_text('name: one\nbodies:\n- {name: b, carrier: base, mass: 1, inertia_com: 1, rotation: '
                                '{joint: j}}\n')
    Path('efforts.csv').write_text('time,j\n0,1\n1\n')
    assert rollout.main(['one.yaml', '--effort', 'efforts.csv']) == 2
    assert 'line 3 has 1 column, must have 2 as the lines before it' in capsys.readouterr().err
    assert rollout.main(['one.yaml', '--duration', '0.001', '--output', 'run.mcap']) == 0
    assert 'one: 1 link, 1 joint; ' in capsys.readouterr().out
    assert resimulation.main(['run.mcap']) == 0
    assert capsys.readouterr().out == 'equal: 2 states over 1 tick, bit for bit\n'
    assert repr(pcs.load_log('run.mcap')).startswith('Log of one: 2 states of 1 joint, ')


def test_progress_is_shown_tick_by_tick_in_the_end(tmp_path):
    simulation, shown = pcs.Simulation(pcs.load_chain(ROBOT)), []
    with pcs.OfflineLog(tmp_path / 'run.mcap', simulation) as log:
        log.advance(2500, progress=shown.append)
    assert sum(shown) == 2500 and max(shown) <= 1000 and len(shown) > 3


def test_efforts_are_the_same_from_a_table_and_an_array_file(tmp_path):
    chain, rows = pcs.load_chain(ROBOT), np.random.default_rng(0).normal(size=(7, 5))
    np.save(tmp_path / 'efforts.npy', rows)
    np.savetxt(tmp_path / 'efforts.csv', rows, delimiter=',')
    for name in ('efforts.npy', 'efforts.csv'):
        assert effort_table.read_efforts(str(tmp_path / name), chain).rows.tobytes() == rows.tobytes()
    assert effort_table.read_efforts('1,0,-2,3e1,0.5', chain).tolist() == [1.0, 0.0, -2.0, 30.0, 0.5]


@pytest.mark.parametrize('name, content, message', [
    ('missing.npy', None, 'cannot be read (No such file or directory), must be an array of numbers with 5 columns'),
    ('missing.csv', None, 'No such file or directory, must be 5 numbers joined by commas, joint=number, or a .csv'),
    ('words.csv', lambda path: path.write_text('1,2,3,4,five\n'), "line 1 column 5 (side_arm_joint) is 'five'"),
    ('pickled.npy', lambda path: np.save(path, np.array([{}] * 5)), 'Object arrays cannot be loaded'),
    ('rows.npy', lambda path: np.save(path, np.zeros((3, 5))), 'has 3 rows, must have one for each of the 1000 ticks'),
    ('empty.npy', lambda path: np.save(path, np.zeros((0, 5))), 'has shape (0, 5), must have (1, 5), with a row'),
    ('narrow.npy', lambda path: np.save(path, np.zeros((1000, 4))), 'has shape (1000, 4), must have (1000, 5)'),
])
def test_efforts_that_do_not_fit_are_one_sentence(tmp_path, capsys, name, content, message):
    if content:
        content(tmp_path / name)
    arguments = [ROBOT, '--effort', str(tmp_path / name), '--duration', '1', '--output', str(tmp_path / 'no')]
    assert rollout.main(arguments) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1 and said.startswith('rollout: ') and message in said, said
    assert not (tmp_path / 'no').exists()


def written(random, rows, joints, time):
    """Return a table as people write them, and the rows and times that it says."""
    separator = random.choice([',', ';', '\t', ' ', ', ', '  '])
    columns = list(range(len(joints)))
    header = random.choice([None, 'plain', 'remark'])
    if header:
        random.shuffle(columns)
        columns = columns[:random.randint(1, len(columns))]
    names = [joints[k] for k in columns]
    table = [[repr(row[k]) for k in columns] for row in rows.tolist()]
    if time is not None:
        place = random.randrange(len(names) + 1) if header else 0
        names.insert(place, random.choice(['time', 't', 'Time', 'time_s', 'time[s]']))
        for line, at in zip(table, time.tolist()):
            line.insert(place, repr(at))
    lines = [separator.join(line) + random.choice(['', '', ' ' if separator.strip() else '']) for line in table]
    if header:
        lines.insert(0, '# ' * (header == 'remark') + separator.join(names))
    for _ in range(random.randrange(4)):     # spare lines
        lines.insert(random.randrange(len(lines) + 1) if header != 'remark' else len(lines),
                     random.choice(['', '   ', '# a remark about it', '#']))
    end = random.choice(['\n', '\r\n'])
    wanted = np.zeros_like(rows)
    wanted[:, columns] = rows[:, columns]
    return random.choice(['', '\ufeff']) + end.join(lines) + random.choice(['', end, 2 * end]), wanted


def test_tables_of_efforts_as_people_write_them(tmp_path):
    """Twin: the rows from which the text was made; each acts from the first tick at or after its time on."""
    chain, path, random = pcs.load_chain(ROBOT), tmp_path / 'efforts.txt', Random(15)
    for k in range(400):
        rows = np.random.default_rng(k).normal(size=(random.randint(1, 9), 5))
        time = np.cumsum([random.choice([1, 2, 5]) for _ in rows]) * 1e-3 - 1e-3 if random.random() < 0.5 else None
        text, wanted = written(random, rows, chain.joint_names, time)
        path.write_bytes(text.encode())
        efforts = effort_table.read_efforts(str(path), chain)
        assert efforts.rows.tobytes() == wanted.tobytes(), text
        assert (efforts.time is None) == (time is None)
        if time is None:
            assert efforts.ticks(1e-3) == len(rows)
            continue
        first = np.round(time * 1e3).astype(int)
        assert efforts.time.tolist() == time.tolist() and efforts.ticks(1e-3) == first[-1] + 1
        by_tick = efforts.by_tick(60, 1e-3, 'it')
        for tick in range(60):
            begun = np.flatnonzero(first <= tick)
            assert (by_tick[tick] == (wanted[begun[-1]] if len(begun) else 0.0)).all()


def test_efforts_by_name_and_below_zero(tmp_path, capsys):
    """Twin: the same efforts in joint order."""
    chain, logs = pcs.load_chain(ROBOT), []
    for k, effort in enumerate((['--effort', '-1,2,0,0,-3.5'], ['--effort=-1,2,0,0,-3.5'],
                                ['--effort', ' side_arm_joint=-3.5,column_slide = -1,column_joint=2e0'])):
        path = tmp_path / f'{k}.mcap'
        assert rollout.main([ROBOT, '--duration', '0.05', '--output', str(path), *effort]) == 0
        logs.append([message.data for message in read_log(path).messages])
        assert resimulation.main([str(path)]) == 0
    assert logs[0] == logs[1] == logs[2]
    run = pcs.rollout(chain, 0.05, effort=[-1.0, 2.0, 0.0, 0.0, -3.5])
    assert decode_joint_state(logs[0][-1]).position.tobytes() == run.position[-1].tobytes()


def test_initial_position_and_velocity(tmp_path, capsys):
    """Twin: the numbers in the chain itself."""
    chain = pcs.load_chain(ROBOT)
    position, velocity = [0.3, 0.1, np.pi / 2, -0.4, -np.pi / 4], [0.0, -0.5, 0.0, 0.0, np.radians(-20.0)]
    there = chain.with_parameters({f'{joint}.{key}': float(value) for key, values in (
        ('position', position), ('velocity', velocity)) for joint, value in zip(chain.joint_names, values)})
    runs = [pcs.rollout(there, 0.2), pcs.rollout(chain, 0.2, position=position, velocity=velocity)]
    assert runs[0].position.tobytes() == runs[1].position.tobytes()
    assert pcs.rollout(chain, 0.1, velocity=velocity).position[0].tolist() == [j.position for j in chain.joints]
    path = tmp_path / 'run.mcap'
    assert rollout.main([ROBOT, '--duration', '0.2', '--output', str(path), '--position',
                         '0.3,0.1,pi/2,-0.4,-45 deg', '--velocity', 'column_joint=-.5,side_arm_joint=-20deg/s',
                         ]) == 0
    states = [decode_joint_state(message.data) for message in read_log(path).messages]
    assert np.array([state.position for state in states]).tobytes() == runs[0].position.tobytes()
    assert resimulation.main([str(path)]) == 0
    with pytest.raises(ValueError, match=r'position has shape \(2,\)'):
        pcs.rollout(chain, 0.1, position=[1.0, 2.0])


def test_rows_beyond_the_end_are_left_out_and_told(tmp_path, capsys):
    np.savetxt(tmp_path / 'efforts.csv', np.ones((30, 5)), delimiter=',')
    arguments = [ROBOT, '--effort', str(tmp_path / 'efforts.csv'), '--output', str(tmp_path / 'run.mcap')]
    assert rollout.main([*arguments, '--duration', '0.02']) == 0
    assert 'has 10 ticks after the end, which are not used' in capsys.readouterr().out
    (tmp_path / 'run.mcap').unlink()
    assert rollout.main(arguments) == 0
    assert '0.03 s simulated' in capsys.readouterr().out


JOINTS = ', '.join(pcs.load_chain(ROBOT).joint_names)


@pytest.mark.parametrize('content, sentence', [
    ('1,2,3,4,5\n1,2,x,4,5\n', " line 2 column 3 (upper_arm_joint) is 'x', must be a finite number"),
    ('1,2,3,4,5\n\n1,2,3,4,nan\n', " line 3 column 5 (side_arm_joint) is 'nan', must be a finite number"),
    ('1,2,3,4,5\n1,2,3,4\n', ' line 2 has 4 columns, must have 5 as the lines before it'),
    ('1,2\n', ' line 1 has 2 columns, must have 5, or 6 with the time first, or a header with the names of joints'),
    ('time;column_slide\n0;1\n0,5;2\n', " line 3 column 1 (time) is '0,5', must be a finite number, with a point"),
    ('time,colum_slide\n0,1\n', " line 1 column 2 is 'colum_slide', no number and no joint of four_link_robot (did "
     f"you mean 'column_slide'?), must be one of time, {JOINTS}"),
    ('column_slide,column_slide\n0,1\n', " line 1 column 2 is 'column_slide' again, must name another joint"),
    ('time\n0\n', ' line 1 has a time alone, must name joints too'),
    ('time column_slide\n0 1\n0 2\n', ' line 3 column 1 (time) is 0, must be later than 0 s before it'),
    ('time column_slide\n-1 1\n', ' line 2 column 1 (time) is -1, must be at least 0 s'),
    ('time column_slide\n99 1\n', ' begins at 99 s, must begin before the end at 1 s'),
    ('1,2,3,4,5\n', ' has 1 row, must have one for each of the 1000 ticks'),
    (b'1,2,3,4,5'.decode().encode('utf-16'), ': is not UTF-8 text, must be 5 numbers joined by commas, joint=number, '
     'or a .csv, .txt or .npy file with a row per tick'),
    ('# nothing\n', ': holds no row of numbers, must be 5 numbers joined by commas, joint=number, or a .csv, .txt or '
     '.npy file with a row per tick'),
])
def test_table_that_does_not_fit_is_one_exact_sentence(tmp_path, monkeypatch, capsys, content, sentence):
    monkeypatch.chdir(tmp_path)
    Path('e.csv').write_bytes(content if isinstance(content, bytes) else content.encode())
    assert rollout.main([ROBOT, '--effort', 'e.csv', '--duration', '1', '--output', 'no.mcap']) == 2
    assert capsys.readouterr().err == f"rollout: --effort 'e.csv'{sentence}\n"
    assert not Path('no.mcap').exists()


@pytest.mark.parametrize('arguments, sentence', [
    (['--effort', 'colum_slide=1'], "--effort 'colum_slide=1' names 'colum_slide', which is not a joint of "
     f"four_link_robot (did you mean 'column_slide'?), must be some of {JOINTS}, each with =number"),
    (['--effort', 'column_slide=1,column_slide=2'],
     "--effort 'column_slide=1,column_slide=2' names 'column_slide' twice, must name it once"),
    (['--effort', 'column_slide=inf'],
     "--effort 'column_slide=inf'[column_slide] is inf, must be finite, a number in N"),
    (['--position', 'column_slide=90deg'],
     "--position 'column_slide=90deg'[column_slide] is 90deg, must be finite, a number in m"),
    (['--position', 'up'], "--position 'up' is not a list of numbers, must be 5 joined by commas, or joint=number for "
     f'some of {JOINTS}'),
    (['--velocity', '-1,2'], f"--velocity '-1,2' has shape (2,), must have (5,): one number for each of {JOINTS}"),
    (['--tolerance', '1e-6', '--method', 'rk4'],
     "--tolerance is for adaptive methods, but method 'rk4' has a fixed step"),
    (['--tolerance', '1e-300'], '--tolerance is 1e-300, must be a number between 1e-20 and 1'),
    (['--duration', '1e300'], '--duration is 1e+300 s, must be below 2.14748e+09 s, the limit of ROS time stamps'),
    (['--duration', '3e9', '--step', '1e3'],
     '--duration is 3e+09 s, must be below 2.14748e+09 s, the limit of ROS time stamps'),
])
def test_argument_that_does_not_fit_is_one_exact_sentence(tmp_path, monkeypatch, capsys, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    assert rollout.main([ROBOT, *arguments]) == 2
    assert capsys.readouterr().err == f'rollout: {sentence}\n'
    assert not list(tmp_path.iterdir())
