"""The style that all pictures share, and the file that a picture becomes."""
from __future__ import annotations

from contextlib import contextmanager, suppress
from io import BytesIO
import os
from typing import Any, Iterator

from ..command_line import PICTURES_NEED
from ..errors import Mistake

INK, FAINT, PAPER = '#1f2933', '#9aa5b1', '#ffffff'
DARK_INK, DARK_FAINT, DARK_PAPER = '#e6e9ee', '#6b7683', '#14181d'   # where the reader's screen is dark
OF_PICTURES = ('matplotlib', 'PIL', 'imageio_ffmpeg')
STYLE: Any = {
    'font.family': 'sans-serif', 'font.sans-serif': ['DejaVu Sans'], 'font.size': 9.0, 'text.color': INK,
    'axes.edgecolor': FAINT, 'axes.labelcolor': INK, 'axes.titlesize': 10.0, 'axes.titlecolor': INK,
    'axes.grid': True, 'axes.axisbelow': True, 'axes.spines.top': False, 'axes.spines.right': False,
    'grid.color': FAINT, 'grid.alpha': 0.3, 'grid.linewidth': 0.6, 'xtick.color': INK, 'ytick.color': INK,
    'legend.edgecolor': 'none', 'legend.framealpha': 0.8,
    'figure.facecolor': PAPER, 'axes.facecolor': PAPER, 'savefig.facecolor': PAPER,
    'svg.hashsalt': 'planar_chain_sim', 'path.simplify_threshold': 0.2}


def pyplot_in_style():
    """Return matplotlib's pyplot, which draws into files in this style; ImportError without matplotlib."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot
    pyplot.rcParams.update(STYLE)
    return pyplot


def picture_of(drawn, kind: str, dpi: int = 130) -> bytes:
    """Return the file of a figure, 'png', 'svg' or 'pdf': equal figures are equal bytes. The figure is closed."""
    from matplotlib import pyplot
    file = BytesIO()
    metadata = {'svg': {'Date': None}, 'pdf': {'CreationDate': None}}.get(kind)
    drawn.savefig(file, format=kind, dpi=dpi, metadata=metadata)
    pyplot.close(drawn)
    return file.getvalue()


@contextmanager
def new_picture(path: str) -> Iterator:
    """
    Open a new file for a picture, and remove it if drawing fails or is interrupted.

    Mistake: a file of this name exists or cannot be made; a library is missing.
    """
    try:
        stream = open(path, 'xb')
    except FileExistsError:
        raise Mistake(f'{path!r}: the file exists and is not overwritten, give a new name') from None
    except (OSError, ValueError) as error:   # ValueError: a NUL in the name
        raise Mistake(f'{path!r}: {getattr(error, "strerror", None) or error}') from None
    try:
        with stream:
            yield stream
    except BaseException as error:
        with suppress(OSError):
            os.unlink(path)
        if isinstance(error, ImportError) and (error.name or '').partition('.')[0] in OF_PICTURES:
            raise Mistake(f'{error}: {PICTURES_NEED}') from None
        raise
