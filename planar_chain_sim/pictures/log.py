"""A picture of a log: positions and efforts of its joints against time."""
from __future__ import annotations

from .figure import figure, finish
from ..chain.visual import COLORS
from ..errors import LogError
from ..recording.log import Log


def draw_log(log: Log, path: str) -> None:
    """
    Write a picture of a log (PNG or SVG by the ending of `path`): positions and efforts of its joints against time.

    OSError where the file cannot be written; LogError where the log has fewer than two states.
    """
    if len(log.time) < 2:
        raise LogError(f'log {str(log.path)!r}: it holds {len(log.time)} states, must hold two to draw them')
    time = log.time - log.time[0]
    drawn, axes = figure(2, 1, (9.0, 5.4), sharex=True)
    for rows, quantity, units in zip(axes, ('position', 'effort'), (('m', 'rad'), ('N', 'N m'))):
        values = getattr(log, quantity)
        for k, joint in enumerate(log.chain.joints):
            slide = joint.kind == 'slide'
            rows.plot(time[-len(values):], values[:, k], '--' if slide else '-', color=COLORS[k % len(COLORS)],
                      linewidth=1.2, label=f'{joint.name}, {units[0 if slide else 1]}')
        rows.set(title=f'joint {quantity}s', xlim=(0.0, time[-1]))
        rows.legend(frameon=False, fontsize=8, loc='upper right', ncols=2)
    axes[-1].set(xlabel='time, s')
    finish(drawn, axes, path, 110)
