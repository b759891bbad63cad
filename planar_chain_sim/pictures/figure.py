"""The style that all pictures share."""
from __future__ import annotations

INK, PAPER = '#1f2933', '#ffffff'


def figure(rows: int, columns: int, size: tuple, **settings):
    """Return a figure of inches `size` with its axes, to be written into a file; ImportError without matplotlib."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot
    return pyplot.subplots(rows, columns, figsize=size, facecolor=PAPER, **settings)


def finish(drawn, axes, path: str, dpi: int) -> None:
    """Give the axes a light grid and no frame, and write the figure; OSError where the file cannot be written."""
    from matplotlib import pyplot
    for each in axes:
        each.grid(alpha=0.25)
        each.spines[['top', 'right']].set_visible(False)
    drawn.tight_layout()
    drawn.savefig(path, dpi=dpi)
    pyplot.close(drawn)
