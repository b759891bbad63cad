"""A picture of a motion: the arm at several times, drawn over one another, and its joints against time."""
from __future__ import annotations

import numpy as np

from .figure import figure, finish, INK
from ..chain.chain import Chain
from ..chain.visual import body_color
from ..mechanics.body_lines import body_lines
from ..motion.rollout import Run


def draw_motion(chain: Chain, run: Run, path: str, moments: int = 26, shown: float = 1.3) -> None:
    """
    Write a picture (PNG or SVG by the ending of `path`): the arm at `moments` times of its first `shown` s; its joints.

    OSError where the file cannot be written.
    """
    drawn, (left, right) = figure(1, 2, (11.0, 4.6), width_ratios=(1.0, 1.35))
    last = min(len(run.time) - 1, round(shown / (run.time[1] - run.time[0])))
    ticks = np.linspace(0, last, moments).round().astype(int)
    colors = [body_color(chain, i) for i in range(len(chain.bodies))]
    for k, tick in enumerate(ticks):
        for i, segments in enumerate(body_lines(chain, run.position[tick])):
            for start, end in segments:
                left.plot([start.real, end.real], [start.imag, end.imag], '-o', color=colors[i][:3],
                          alpha=colors[i][3] * (0.12 + 0.88 * (k / (moments - 1))**2),
                          linewidth=3.2 if tick == last else 1.6, markersize=3.0, solid_capstyle='round', zorder=k)
    left.plot([0], [0], marker='^', color=INK, markersize=9, zorder=0)
    left.set(aspect='equal', xlabel='x, m', ylabel='y, m', title=f'the first {run.time[last]:g} s')
    names = list(chain.joint_names)
    for i, body in enumerate(chain.bodies):   # a joint has the colour of its body, a slide is dashed
        for joint, style, unit in ((body.slide, '--', 'm'), (body.rotation, '-', 'rad')):
            if joint is not None:
                right.plot(run.time, run.position[:, names.index(joint.name)], style, color=colors[i][:3],
                           label=f'{joint.name}, {unit}')
    right.set(xlabel='time, s', title='joint positions', xlim=(0.0, run.time[-1]))
    if len(names) <= 10:   # more would cover what they name
        right.legend(frameon=False, fontsize=8, loc='upper right')
    finish(drawn, (left, right), path, 130)
