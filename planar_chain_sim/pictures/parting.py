"""A picture of two motions that part: the differences of their joints against time."""
from __future__ import annotations

from typing import Sequence

import numpy as np

from .figure import figure, finish, INK
from ..chain.tree import Joint
from ..chain.visual import COLORS

FLOOR = 1e-17   # rad, m, rad/s or m/s: what is drawn for no difference


def draw_parting(joints: Sequence[Joint], time: np.ndarray, differences: np.ndarray, threshold: float,
                 path: str) -> None:
    """
    Write a picture (PNG, SVG or PDF by the ending of `path`) of |differences| (times, 2, joints), on logarithmic axes.

    `time` s; the two rows are positions and velocities; `threshold`, rad or m, is a line among positions. OSError where
    the file cannot be written.
    """
    drawn, axes = figure(2, 1, (9.0, 5.4), sharex=True)
    quantities = ('position', ('m', 'rad')), ('velocity', ('m/s', 'rad/s'))
    for row, (rows, (quantity, units)) in enumerate(zip(axes, quantities)):
        for k, joint in enumerate(joints):
            slide = joint.kind == 'slide'
            rows.plot(time, np.maximum(differences[:, row, k], FLOOR), '--' if slide else '-',
                      color=COLORS[k % len(COLORS)], linewidth=1.2, label=f'{joint.name}, {units[0 if slide else 1]}')
        rows.set(title=f'difference of joint {quantity}', yscale='log',
                 xlim=(time[0], max(time[-1], time[0] + 1e-9)))
    if threshold > 0.0:
        axes[0].axhline(threshold, color=INK, linewidth=0.8, linestyle=':')
    if len(joints) <= 10:
        axes[0].legend(frameon=False, fontsize=8, loc='lower right', ncols=2)
    axes[-1].set(xlabel='time, s')
    finish(drawn, axes, path, 110)
