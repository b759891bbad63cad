"""
Expands a xacro file to URDF with the `xacro` package, where that is installed.

xacro evaluates expressions and reads other files. So only files that the user names are expanded, never a text from a
topic or a log, and in a separate process with limited time, memory and output, without arguments.
"""
from __future__ import annotations

from importlib.util import find_spec
import re
import subprocess
import sys

from ..chain.section import clipped
from ..errors import ChainError

SECONDS = 20
MAX_BYTES = 16 * 2**20
MAX_MEMORY = 2**30
USED = re.compile(r'<xacro:|\$[{(]')   # elements or expressions of xacro; expanded files keep only the namespace
PROGRAM = """
import sys
sys.path.pop(0)   # no modules are imported from the robot's folder
import resource
resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[2]),) * 2)
resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))
import xacro
sys.stdout.write(xacro.process_file(sys.argv[1]).toprettyxml(indent='  '))
"""


def expanded(path, text: bytes, name: str) -> bytes:
    """Return the expanded text of the file at `path`; unchanged if it has no xacro or `xacro` is not installed."""
    if not USED.search(text.decode('utf-8', 'replace')):
        return text
    package = find_spec('xacro')
    if package is None or package.origin is None:   # a folder of this name is not the package
        return text
    wanted = 'must be one that `xacro FILE` expands'
    try:
        done = subprocess.run([sys.executable, '-c', PROGRAM, str(path), str(MAX_MEMORY)], capture_output=True,
                              stdin=subprocess.DEVNULL, timeout=SECONDS)
    except subprocess.TimeoutExpired:
        raise ChainError(f'{name}: cannot be expanded by xacro within {SECONDS} s, {wanted}') from None
    if done.returncode:
        lines = done.stderr.decode('utf-8', 'replace').split('\n')
        reason = next((line for line in reversed(lines) if line.strip()), 'no reason given')
        raise ChainError(f'{name}: cannot be expanded by xacro ({clipped(reason.strip(), 160)}), {wanted}')
    if len(done.stdout) > MAX_BYTES:
        raise ChainError(f'{name}: has more than {MAX_BYTES // 2**20} MiB when expanded by xacro, {wanted}')
    return done.stdout
