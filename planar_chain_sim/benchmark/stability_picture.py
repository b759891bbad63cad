"""The picture of `benchmark stability`: four scenes over time, and every check against its limit."""
from __future__ import annotations

import re

import numpy as np

from .charts import INK, LOOKS
from .scenes import MuJoCoRun, one_joint, sampled
from .scenes.friction import GRIP, stick_and_slip
from .scenes.motion import pendulum_energy
from .work_precision import OWN
from ..motion.simulation import Simulation

OURS, THEIRS, WRONG = LOOKS[OWN][0], LOOKS['MuJoCo'][0], LOOKS['heyoka'][0]   # WRONG: vermilion, no library here
PALE = '#9aa5b1'
DECADES = 10   # of the ratios shown; what lies beyond stands at the edge
LEGENDS = {'energy': {'loc': 'upper center', 'ncols': 2}, 'stop': {'loc': 'upper right'},
           'bounce': {'loc': 'upper right'}, 'slip': {'loc': 'upper right'},
           'checks': {'loc': 'upper center', 'bbox_to_anchor': (0.35, -0.07), 'ncols': 3}}


def draw(table: list[tuple], path) -> None:
    """Write PNG or SVG by the ending of `path`; ImportError where there is no matplotlib."""
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot
    peer = any(row[5] is not None for row in table)
    figure = pyplot.figure(figsize=(13.6, 7.4), facecolor='white', layout='constrained')
    places = figure.subplot_mosaic([['energy', 'stop', 'checks'], ['bounce', 'slip', 'checks']],
                                   gridspec_kw={'width_ratios': [1.0, 1.0, 1.15]})
    _draw_energy(places['energy'], _pendulum_ticks(table), peer)
    _draw_stop(places['stop'], peer)
    _draw_bouncing(places['bounce'], peer)
    _draw_slip(places['slip'], peer)
    _draw_checks(places['checks'], table, peer)
    for axes in places.values():
        axes.title.set(fontsize=10, color=INK)
        axes.spines[['top', 'right']].set_visible(False)
        axes.grid(alpha=0.25)
    for name, look in LEGENDS.items():
        places[name].legend(fontsize=8, frameon=False, **look)
    svg = str(path).endswith('.svg')
    figure.savefig(path, dpi=90, **({'metadata': {'Date': None}} if svg else {'pil_kwargs': {'optimize': True}}))
    pyplot.close(figure)


def _pendulum_ticks(table: list[tuple]) -> int:
    """Return how many ticks the long run of the table had."""
    found = next(re.search(r'(\d+) ticks of 5 ms', row[1]) for row in table if row[0] == 'double pendulum')
    return int(found[1])


def _draw_energy(axes, ticks: int, peer: bool) -> None:
    lines = [('', 'gauss6', OURS, '-', 'gauss6 (fixed step)'), ('', 'auto', OURS, ':', 'auto (tolerance 1e-9)')]
    if peer:
        lines += [('MuJoCo', 'RK4', THEIRS, '-', 'MuJoCo, RK4'),
                  ('MuJoCo', 'implicitfast', THEIRS, ':', 'MuJoCo, implicitfast')]
    for library, method, color, style, label in lines:
        time, errors, _ = pendulum_energy(library, method, ticks)
        axes.plot(time[1:], np.maximum(np.abs(errors[1:]), 1e-16), style, color=color, linewidth=1.3, label=label)
    axes.set(xscale='log', yscale='log', ylim=(1e-16, 1e6), xlabel='simulated time, s', ylabel='energy error / range',
             title=f'double pendulum, {ticks:.0e} ticks of 5 ms'.replace('e+0', 'e'))
    axes.set_yticks(10.0**np.arange(-16, 1, 4))
    axes.minorticks_off()


def _draw_stop(axes, peer: bool) -> None:
    chain = one_joint(upper=0.5, lower=-0.5, restitution=0.8, velocity=100.0)
    if peer:
        axes.plot(np.arange(401) * 0.25, MuJoCoRun(chain, 2.5e-4).sampled(400)[:, 0, 0], color=THEIRS, label='MuJoCo')
    axes.plot(np.arange(1001) * 0.1, sampled(Simulation(chain, step=1e-4), 1000)[:, 0, 0], color=OURS, linewidth=1.2,
              label=OWN)
    for k, place in enumerate((-0.5, 0.5)):
        axes.axhline(place, color=INK, linewidth=0.9, linestyle='--', label='stop' if k else None)
    axes.set(title='stops hit at 100 rad/s, restitution 0.8', xlabel='time, ms', ylabel='angle, rad')


def _draw_bouncing(axes, peer: bool) -> None:
    chain = one_joint('slide', lower=0.0, position=0.1, restitution=0.9)
    simulation = Simulation(chain)
    axes.plot(np.arange(3001) * 1e-3, sampled(simulation, 3000)[:, 0, 0] * 1e3, color=OURS, linewidth=1.0, label=OWN)
    times = [event.time for event in simulation.take_events()]
    axes.plot(times, np.zeros(len(times)), '|', color=INK, markersize=9, label=f'{len(times)} impacts, then rest')
    if peer:
        axes.plot(np.arange(3001) * 1e-3, MuJoCoRun(chain, 1e-3).sampled(3000)[:, 0, 0] * 1e3, color=THEIRS,
                  linewidth=1.0, label='MuJoCo (its limits have no restitution)')
    axes.set(title='bouncing to rest, restitution 0.9', xlabel='time, s', ylabel='height above the stop, mm')


def _draw_slip(axes, peer: bool) -> None:
    ticks = 6000
    time, floor = np.arange(ticks + 1) * 1e-3, 3e-4
    efforts, states, _ = stick_and_slip(ticks)
    if peer:
        theirs = stick_and_slip(ticks, 'implicitfast')[1]
        axes.plot(time, np.maximum(np.abs(theirs[:, 1]), floor), color=THEIRS, linewidth=1.2, label='MuJoCo')
    axes.plot(time, np.maximum(np.abs(states[:, 1]), floor), color=OURS, linewidth=1.2, label=OWN)
    for k, (start, end) in enumerate(_runs(np.abs(efforts) <= GRIP)):
        axes.axvspan(start * 1e-3, end * 1e-3, color=PALE, alpha=0.3, linewidth=0.0,
                     label=None if k else 'effort below break-away')
    axes.set(yscale='log', ylim=(floor, 10.0), title='stick and slip: friction 1 N m, ramp 2 N m/s',
             xlabel='time, s', ylabel='|rate|, rad/s')
    axes.set_yticks([floor, *10.0**np.arange(-3, 2)], ['0', '0.001', '0.01', '0.1', '1', '10'])
    axes.minorticks_off()


def _runs(true: np.ndarray) -> list[tuple[int, int]]:
    """Return where stretches of true values start and end."""
    edges = np.flatnonzero(np.diff(np.r_[0, true.astype(int), 0]))
    return list(zip(edges[::2], edges[1::2]))


def _draw_checks(axes, table: list[tuple], peer: bool) -> None:
    scenes = list(dict.fromkeys(row[0] for row in table))

    def place(value, limit):
        """Return decades above the limit; at the left edge exact zeros and what is far below, at the right the rest."""
        if value <= 0.0:
            return -DECADES
        return float(np.clip(np.log10(value / limit), -DECADES, DECADES)) if limit > 0.0 else DECADES
    kinds = {'holds': (OURS, 'o', {'markersize': 6}), 'does not hold': (WRONG, 'X', {'markersize': 9}),
             'MuJoCo': (THEIRS, 'D', {'markersize': 5, 'fillstyle': 'none'})}
    points = {kind: [] for kind in kinds}
    for scene, _, limit, measured, holds, theirs in table:
        row = scenes.index(scene)
        if measured is not None:
            points['holds' if holds == 'yes' else 'does not hold'].append((place(measured, limit), row - 0.15))
        if isinstance(theirs, float):
            points['MuJoCo'].append((place(theirs, limit), row + 0.2))
    for kind, found in points.items():
        if found:
            color, marker, look = kinds[kind]
            axes.plot(*zip(*found), marker, color=color, label=kind if kind == 'MuJoCo' else f'{OWN}: {kind}', **look)
    axes.axvline(0.0, color=INK, linewidth=1.2)
    axes.set(title='every check: measured / limit', xlim=(-DECADES - 0.6, DECADES + 0.6),
             ylim=(len(scenes) - 0.4, -0.6))
    axes.set_yticks(range(len(scenes)), scenes, fontsize=8.5)
    axes.set_xticks([-DECADES, -5, 0, 5, DECADES], ['0', '1e-5', 'limit', '1e5', 'beyond'])
