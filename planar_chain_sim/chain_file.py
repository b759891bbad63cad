"""
Loads chains from a file, a text or plain data, and checks them.

A text is YAML, or a robot file (URDF, MJCF) that describes a planar robot.
"""
from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import site
import stat
import sys
from typing import Union

from .chain.chain import build_chain, Chain, chain_from_dict
from .chain.hold import Hold, read_hold
from .chain.section import clipped, plain, suggestion
from .chain.yaml_text import data_from_text, decoded, MAX_BYTES, refuse_unprintable, text_of
from .errors import ChainError
from .mechanics import solvable  # noqa: F401 (the check of a chain that it adds)
from .robot_files.robot_file import refuse_other_formats

__all__ = ['chain_from_dict', 'chain_from_text', 'config_folders', 'find_chain_file', 'load_chain']


def load_chain(path: Union[str, os.PathLike], hold: Hold = None) -> Chain:
    """
    Return the chain of a YAML file, or of a robot file (URDF, MJCF) of a planar robot.

    A relative path is looked for in the working directory, then among the chains that come with the package (see
    `find_chain_file`). `hold`: joints that are welded, see hold.py. ChainError, one sentence, for a file that cannot be
    read or an impossible chain.
    """
    return load_chain_and_text(path, hold)[0]


def load_chain_and_text(path: Union[str, os.PathLike], hold: Hold = None) -> tuple[Chain, str]:
    """Return the chain of a file as load_chain does, and the text of the file as it stands there."""
    path = find_chain_file(path)
    name = clipped(str(path), 400)
    try:
        mode = os.stat(path).st_mode
        if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):   # a pipe would be waited for
            raise OSError(0, 'Not a regular file')
        with open(path, 'rb') as stream:
            text = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:   # ValueError: a NUL in the path, in words that change with Python's version
        reason = getattr(error, 'strerror', None) or 'its name holds a NUL'
        raise ChainError(f'{name}: cannot be read ({reason}), must be a chain file in YAML') from None
    given = text
    if b'xacro' in text and text.lstrip().startswith(b'<'):
        from .robot_files.xacro_file import expanded
        text = expanded(path, text, name)
    return chain_from_text(text, name, hold), decoded(given, name)


def chain_from_text(text: Union[str, bytes], name: str = '<text>', hold: Hold = None) -> Chain:
    """Return the chain of a text, YAML, URDF or MJCF (bytes: UTF-8); `name` stands for the file in errors."""
    if not isinstance(text, (str, bytes)):
        raise TypeError(f'text is {text!r:.80}, must be the text of a chain: load_chain reads a file, '
                        'chain_from_dict data')
    if len(text) > MAX_BYTES:
        raise ChainError(f'{name}: is longer than {MAX_BYTES // 2**20} MiB, must be a chain file in YAML')
    refuse_other_formats(text[:16], name)
    if isinstance(text, bytes):
        text = decoded(text, name)
    refuse_unprintable(text, name)
    if text.lstrip().startswith('<'):   # no YAML mapping does
        from .robot_files.robot_file import chain_from_robot_file  # which most users of chain files do not need
        return chain_from_robot_file(text, name, read_hold(hold))
    data = data_from_text(text, name)
    if hold:
        data['hold'] = {**read_hold(data.get('hold')), **read_hold(hold)}
        text = text_of(plain(data))
    return build_chain(data, name, text)


def find_chain_file(path: Union[str, os.PathLike]) -> Path:
    """
    Return the full path of the chain file `path`: an absolute path unchanged, a relative one in the first place found.

    The places: the working directory, then the package's config folder (with or without a leading `config/`) in the
    ament index, under `sys.prefix`, in the source tree, under the base of `pip --user`. ChainError: nowhere.
    """
    path = Path(path)
    if path.is_absolute() or os.path.exists(path):
        return path
    name = path.relative_to('config') if path.parts[:1] == ('config',) else path
    folders = list(config_folders())
    for folder in folders:
        if os.path.isfile(folder / name):
            return folder / name
    places = ', '.join(['the working directory', *map(str, folders)])
    shipped = sorted({each.name for folder in folders for each in folder.glob('*.yaml')})
    raise ChainError(f'{clipped(str(path), 400)}: was not found in {places}{suggestion(name.name, shipped)}, must be a '
                     f'chain file in YAML; the package has {", ".join(shipped) or "none"}')


def config_folders() -> Iterator[Path]:
    """Yield the folders where the package's chain files can lie: ament index, sys.prefix, source tree, user's own."""
    package = __name__.partition('.')[0]
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if prefix and Path(prefix, 'share/ament_index/resource_index/packages', package).exists():
            yield Path(prefix, 'share', package, 'config')
    yield Path(sys.prefix, 'share', package, 'config')
    yield Path(__file__).resolve().parents[1] / 'config'
    if site.ENABLE_USER_SITE:
        yield Path(site.getuserbase(), 'share', package, 'config')
