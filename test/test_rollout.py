"""The executable rollout: what it says, and the efforts it reads."""
import re
import signal
import subprocess
import sys
from time import monotonic, sleep

import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.recording import effort_table, rollout
from planar_chain_sim.recording.log_reader import read_log

ROBOT = 'four_link_robot.yaml'


def test_ten_seconds_into_a_log_of_the_chain_files_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert rollout.main([ROBOT]) == 0
    chain = pcs.load_chain(ROBOT)
    first, last = capsys.readouterr().out.splitlines()
    assert first == f'{chain.name}: {pcs.Simulation(chain).plan}'
    assert re.fullmatch(r'four_link_robot\.mcap: 10 s simulated in \d+\.\d\d s, 10001 states', last)
    assert sum(1 for _ in read_log(tmp_path / 'four_link_robot.mcap').messages) == 10001


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_run_and_closes_the_log(tmp_path, number):
    path = tmp_path / 'run.mcap'
    process = subprocess.Popen([sys.executable, '-m', 'planar_chain_sim.recording.rollout', ROBOT, '--duration', '1e5',
                                '--output', str(path)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        started = monotonic()
        while not (path.exists() and path.stat().st_size > 1_000_000) and monotonic() - started < 30.0:
            sleep(0.01)
        process.send_signal(number)
        assert process.communicate(timeout=30)[1] == 'rollout: interrupted\n'
    finally:
        process.kill()
    assert process.returncode == 130 and read_log(path).complete


def test_progress_is_shown_tick_by_tick_in_the_end(tmp_path):
    simulation, shown = pcs.Simulation(pcs.load_chain(ROBOT)), []
    with rollout.OfflineLog(tmp_path / 'run.mcap', simulation) as log:
        rollout.roll_to_log(simulation, 2500, None, log, shown.append)
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
