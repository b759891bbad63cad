"""Peers with a C++ interface: their loops are compiled once, here, and called through ctypes."""
from __future__ import annotations

import ctypes
from hashlib import sha256
import os
from pathlib import Path
import shlex
import shutil
import subprocess
import tempfile


class Missing(Exception):
    """A peer that cannot take part: the reason, one clause."""


def compile_shared(source: Path, flags: list[str], libraries: list[str] = (), headers: list[Path] = ()) -> ctypes.CDLL:
    """
    Return `source` compiled with $CXX, -O3 and no machine flags, as a peer's own users get it; kept for the next run.

    `headers`: our own headers that it includes; it is compiled again if they have changed.

    The folder is $XDG_CACHE_HOME/planar_chain_sim, by default ~/.cache/planar_chain_sim. Missing: no compiler, or it
    refuses.
    """
    compiler = shlex.split(os.environ.get('CXX') or 'c++')
    if shutil.which(compiler[0]) is None:
        raise Missing(f'there is no C++ compiler {compiler[0]}')
    command = [*compiler, '-std=c++17', '-O3', '-DNDEBUG', '-fPIC', '-shared', '-fvisibility=hidden', *flags]
    version = subprocess.run([*compiler, '--version'], capture_output=True).stdout
    text = b''.join(path.read_bytes() for path in (source, *headers))
    key = sha256(text + version + '\n'.join([*command, *libraries]).encode()).hexdigest()[:16]
    folder = Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache', 'planar_chain_sim')
    library = folder / f'{source.stem}-{key}.so'
    if not library.exists():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=folder) as work:   # a run that is interrupted leaves no half file
                made = Path(work, library.name)
                run = subprocess.run([*command, str(source), *libraries, '-o', str(made)],
                                     capture_output=True, text=True)
                if run.returncode:
                    lines = [line for line in run.stderr.splitlines() if 'error' in line] or [f'exit {run.returncode}']
                    raise Missing(f'{compiler[0]} does not compile {source.name}: {lines[0].strip()[:160]}')
                made.replace(library)
        except OSError as error:
            raise Missing(f'{folder} cannot be written: {error.strerror}') from None
    try:
        return ctypes.CDLL(str(library))
    except OSError as error:
        raise Missing(f'{library} cannot be loaded: {error}') from None
