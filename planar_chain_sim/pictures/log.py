"""A picture of a log: positions and efforts of its joints against time."""
from __future__ import annotations

import numpy as np

from .figure import figure, finish
from ..chain.visual import COLORS
from ..errors import LogError
from ..recording.cdr import CdrError, decode_joint_state
from ..recording.run_settings import simulation_of


def draw_log(log, path: str) -> None:
    """
    Write a picture of a log (PNG or SVG by the ending of `path`): positions and efforts of its joints against time.

    OSError where the file cannot be written; LogError where the log cannot be read.
    """
    chain, topic = simulation_of(log).chain, log.settings['state_topic']
    try:
        states = [decode_joint_state(message.data) for message in log.messages if message.topic == topic]
    except CdrError as error:
        raise LogError(f'log {str(log.path)!r}: a state cannot be read ({error})') from None
    if any(state.names != chain.joint_names or not len(state.position) == len(state.effort) == chain.joint_count
           for state in states):
        raise LogError(f'log {str(log.path)!r}: a state is not of the joints of its chain')
    if len(states) < 2:
        raise LogError(f'log {str(log.path)!r}: it holds {len(states)} states, must hold two to draw them')
    time = np.array([state.stamp - states[0].stamp for state in states]) * 1e-9
    drawn, axes = figure(2, 1, (9.0, 5.4), sharex=True)
    for rows, quantity, units in zip(axes, ('position', 'effort'), (('m', 'rad'), ('N', 'N m'))):
        values = np.array([getattr(state, quantity) for state in states])
        for k, joint in enumerate(chain.joints):
            slide = joint.kind == 'slide'
            rows.plot(time, values[:, k], '--' if slide else '-', color=COLORS[k % len(COLORS)], linewidth=1.2,
                      label=f'{joint.name}, {units[0 if slide else 1]}')
        rows.set(title=f'joint {quantity}s', xlim=(0.0, time[-1]))
        rows.legend(frameon=False, fontsize=8, loc='upper right', ncols=2)
    axes[-1].set(xlabel='time, s')
    finish(drawn, axes, path, 110)
