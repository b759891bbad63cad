"""The library that logs are written and read with, which may not be installed."""
from __future__ import annotations

from importlib.util import find_spec

from ..errors import LogError

NEEDED = ('mcap', 'lz4', 'zstandard')   # the latter two come with the first


def require_mcap(path) -> None:
    """Raise LogError for the log of this path where the library that logs are written and read with is missing."""
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise LogError(f'log {str(path)!r}: logs need the Python package {missing[0]}, which is not installed; '
                       'run `rosdep install --from-paths . --ignore-src` or `pip install mcap`')
