"""The examples do what they say; those with ROS are run by the test of the documents."""
import os
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest

import planar_chain_sim as pcs

FOLDER = Path(__file__).resolve().parents[2] / 'examples'


@pytest.fixture(autouse=True)
def examples_can_be_imported(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)


def example(name):
    return __import__(name)


def test_the_lqr_balances():
    assert example('lqr_balance').main() < 1e-7     # rad or m; from 0.1 rad, ten seconds at -1.9 1/s


def test_the_acrobot_swings_up():
    assert example('acrobot_swing_up').main() < 1e-6     # rad from upright


def test_computed_torque_follows_better_than_pd():
    pd, computed_torque = example('computed_torque').main()
    assert computed_torque < 1e-4 < 1e-2 < pd < 0.1      # rad


def test_arms_spread():
    position = example('ten_thousand_arms').main(arms=200)
    assert np.ptp(position[:, 0]) > 1.0     # rad, from 2e-6


def test_the_pushed_pendulum_rests_where_statics_says():
    released, expected = example('wrench').main()
    assert abs(released) < 1e-9 and 0.5 < expected < 0.6


def test_a_log_is_read(tmp_path, monkeypatch, capsys):
    from planar_chain_sim.recording import rollout
    monkeypatch.chdir(tmp_path)
    assert rollout.main(['four_link_robot.yaml', '--duration', '2', '--output', 'swing.mcap']) == 0
    example('read_log').main('swing.mcap')
    assert 'column_joint' in capsys.readouterr().out


@pytest.mark.parametrize('content', [None, b'', b'hello', bytes(range(256))])
def test_what_is_no_log_is_told_in_a_sentence(tmp_path, content):
    log = tmp_path / 'other.mcap'
    if content is not None:
        log.write_bytes(content)
    ended = subprocess.run([sys.executable, FOLDER / 'read_log.py', log], capture_output=True, text=True,
                           env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    assert ended.returncode == 2 and not ended.stdout and 'Traceback' not in ended.stderr, ended.stderr
    assert f"read_log.py: error: log '{log}': it " in ended.stderr


def test_logs_of_one_state_and_of_none(tmp_path, capsys):
    log = tmp_path / 'run.mcap'
    simulation = pcs.Simulation(pcs.load_chain('double_pendulum.yaml'))
    with pcs.OfflineLog(log, simulation):   # nothing is in the file before it is flushed
        with pytest.warns(RuntimeWarning, match='not closed'), pytest.raises(pcs.LogError, match='holds no states'):
            example('read_log').main(str(log))
    assert example('read_log').main(str(log))[0] == pytest.approx(sum(pcs.energy(
        simulation.chain, simulation.position, simulation.velocity)))


def test_every_example_is_in_this_test_or_in_a_document():
    pages = ''.join(path.read_text() for path in [FOLDER.parent / 'README.md', *(FOLDER.parent / 'docs').glob('*.md')])
    here = Path(__file__).read_text()
    table = (FOLDER / 'README.md').read_text()
    for path in FOLDER.glob('*.py'):
        assert f"'{path.stem}'" in here or f'python examples/{path.name}' in pages, path.name
        assert f'| `{path.name}' in table, path.name
