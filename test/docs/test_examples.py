"""The examples do what they say; those with ROS are run by the test of the documents."""
from pathlib import Path

import numpy as np
import pytest

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


def test_every_example_is_in_this_test_or_in_a_document():
    pages = ''.join(path.read_text() for path in [FOLDER.parent / 'README.md', *(FOLDER.parent / 'docs').glob('*.md')])
    here = Path(__file__).read_text()
    table = (FOLDER / 'README.md').read_text()
    for path in FOLDER.glob('*.py'):
        assert f"'{path.stem}'" in here or f'python examples/{path.name}' in pages, path.name
        assert f'| `{path.name}' in table, path.name
