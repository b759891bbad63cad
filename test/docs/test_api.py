"""`make docs` writes a page that has every public name, without a warning."""
from pathlib import Path
import re
import subprocess
import sys

import pytest

import planar_chain_sim as pcs

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_page_has_every_public_name(tmp_path):
    pytest.importorskip('pdoc')
    done = subprocess.run([sys.executable, ROOT / 'docs/api.py', tmp_path], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0 and not done.stderr, done.stderr
    page = (tmp_path / 'planar_chain_sim.html').read_text()
    assert set(pcs.__all__) <= set(re.findall(r'<section id="(\w+)"', page))
