"""A picture of how far two motions differ: the differences of their joints against time."""
from __future__ import annotations

from typing import Sequence

import numpy as np

from .figure import INK, picture_of, pyplot_in_style
from ..chain.tree import Joint
from ..chain.visual import COLORS

MOST = 10   # joints that are named


def draw_deviation(joints: Sequence[Joint], time: np.ndarray, differences: np.ndarray, threshold: float,
                   kind: str) -> bytes:
    """
    Return a picture, 'png', 'svg' or 'pdf', of differences (times, 2, joints) >= 0, on logarithmic axes.

    `time` s; the two rows are positions and velocities; `threshold`, rad or m, is a line among positions.
    Differences of 0 are not drawn. ImportError without matplotlib.
    """
    drawn, axes = pyplot_in_style().subplots(2, 1, figsize=(9.0, 5.4), sharex=True, layout='constrained')
    shown = np.where(differences > 0.0, differences, np.nan)
    quantities = ('position', ('m', 'rad')), ('velocity', ('m/s', 'rad/s'))
    for row, (rows, (quantity, units)) in enumerate(zip(axes, quantities)):
        for k, joint in enumerate(joints):
            slide = joint.kind == 'slide'
            rows.plot(time, shown[:, row, k], '--' if slide else '-',
                      color=COLORS[k % len(COLORS)], linewidth=1.2, label=f'{joint.name}, {units[0 if slide else 1]}')
        rows.set(title=f'difference of joint {quantity}', yscale='log',
                 xlim=(time[0], max(time[-1], time[0] + 1e-9)))
    if threshold > 0.0:
        if not differences[:, 0].any():   # there will be only the line
            axes[0].set_ylim(max(threshold / 10.0, 1e-300), min(threshold * 10.0, 1e300))
        axes[0].axhline(threshold, color=INK, linewidth=0.8, linestyle=':')
    if len(joints) <= MOST:
        drawn.legend(*axes[0].get_legend_handles_labels(), loc='outside upper center', ncols=5)
    axes[-1].set(xlabel='time, s')
    return picture_of(drawn, kind)
