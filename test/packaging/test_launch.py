"""Launch files: they compile, say what they need where it is missing, and describe something where it is installed."""
from importlib.util import find_spec
from pathlib import Path
import runpy
import subprocess
import sys

import pytest

FOLDER = Path(__file__).resolve().parents[2] / 'launch'
NAMES = ('two_arms', 'view')


def test_these_are_all():
    assert tuple(sorted(path.name.partition('.')[0] for path in FOLDER.glob('*.launch.py'))) == NAMES


@pytest.mark.parametrize('name', NAMES)
def test_a_launch_file_describes_what_to_start_or_says_what_it_needs(name):
    path = FOLDER / f'{name}.launch.py'
    done = subprocess.run([sys.executable, path], capture_output=True, text=True, timeout=600)
    if find_spec('launch_ros') is None:
        assert done.returncode == 2 and done.stderr.count('\n') == 1, done.stderr
        assert done.stderr.startswith(f'{path.name}: needs launch and launch_ros') and ', must' in done.stderr
    else:
        assert done.returncode == 0, done.stderr
        assert runpy.run_path(str(path))['generate_launch_description']().entities
