"""The panels of a picture against time: joints, energy, events; and those in the plane: paths and arms."""
from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .energies import energies, energy_error
from .figure import FAINT, INK, picture_of, pyplot_in_style
from .source import Source
from ..chain.tree import BASE
from ..chain.visual import body_color, COLORS
from ..mechanics.body_lines import body_lines
from ..mechanics.body_poses import body_poses
from ..recording.events import EVENTS

WHAT = {'position': ('rad', 'm'), 'velocity': ('rad/s', 'm/s'), 'effort': ('N m', 'N'), 'energy': (), 'error': (),
        'events': (), 'path': (), 'arm': ()}
PLANE = ('path', 'arm')
LINES: Any = ('-', '--', ':', '-.')     # of the sources
MARKS = ('o', 'x', '^', 's')
BINS = 1200          # of a curve: each keeps its smallest and its largest value
ROWS = 200_000       # of a motion, of which energies and paths are computed
MARKED = 40          # events that are lines in all panels; more would cover the curves
ARMS = 24            # moments at which an arm is drawn
NAMED = 30           # joints in the legend


class Panel(NamedTuple):
    """What a panel shows: a name of WHAT, and of joints whether those that slide."""

    what: str
    slides: bool = False


def draw(sources: list, traces: list, what: list, joints: list, kind: str) -> bytes:
    """
    Return a picture of sources over one another, 'png', 'svg' or 'pdf'; traces: for each, as of read_trace.

    `what`: names of WHAT; `joints`: names of those drawn. LogError: an event that is impossible.
    """
    kinds = {joint.name: joint.kind for each in reversed(sources) for joint in each.chain.joints}
    panels = [panel for name in WHAT if name in what for panel in (
        [Panel(name, slides) for slides in (False, True) if any((kinds[each] == 'slide') == slides for each in joints)]
        if WHAT[name] else [Panel(name)])]
    plane = [panel for panel in panels if panel.what in PLANE]
    timed = [panel for panel in panels if panel.what not in PLANE]
    drawn, places, wide = _places(len(timed), len(plane))
    for panel, axes in zip(timed + plane, places):
        for k, source in enumerate(sources):
            _draw(axes, panel, source, traces[k], joints, k)
        if panel.what not in PLANE:
            axes.set_xlim(min(each.time[0] for each in sources), max(each.time[-1] for each in sources))
            axes.set_xlabel('time, s')
            _mark_events(axes, sources)
    _legend(drawn, sources, joints if any(WHAT[each.what] for each in panels) else [], wide)
    return picture_of(drawn, kind)


def _places(timed: int, plane: int) -> tuple:
    """Return a figure, axes for panels against time, in one or two columns, then in the plane; its width, inches."""
    columns = min(timed, 1 if timed < 4 else 2)
    rows = max(1, -(-timed // max(columns, 1)))
    across = 1 if columns else max(plane, 1)      # columns of those in the plane
    width = 5.2 * columns + (4.6 * across if plane else 1.0)
    height = max(2.1 * rows, 3.9 * (plane if columns else 1) if plane else 0.0)
    drawn = pyplot_in_style().figure(figsize=(width, height + 0.5), layout='constrained')
    left, right = drawn.add_gridspec(1, 2, width_ratios=(5.2 * columns, 4.6 * across)) if plane and columns else (
        2 * [drawn.add_gridspec(1, 1)[0]])
    places = []
    if columns:
        grid = left.subgridspec(rows, columns)
        places += [drawn.add_subplot(grid[divmod(k, columns)]) for k in range(timed)]
    if plane:
        spare = max(height - 4.2 * plane, 0.0) if columns else 0.0     # below them: they are not to be tall and empty
        grid = right.subgridspec(plane + 1, 1, height_ratios=(*plane * [4.2], spare)) if spare else (
            right.subgridspec(*((plane, 1) if columns else (1, plane))))
        places += [drawn.add_subplot(grid[k]) for k in range(plane)]
    return drawn, places, width


def _draw(axes, panel: Panel, source: Source, traces: list, joints: list, number: int) -> None:
    """Draw a source into a panel."""
    if WHAT[panel.what]:
        _draw_joints(axes, panel, source, joints, LINES[number])
    else:
        {'energy': _draw_energy, 'error': _draw_error, 'events': _draw_events, 'path': _draw_paths,
         'arm': _draw_arms}[panel.what](axes, source, traces, number)


def _draw_joints(axes, panel: Panel, source: Source, joints: list, line: str) -> None:
    values = getattr(source, panel.what)
    for k, joint in enumerate(source.chain.joints):
        if joint.name in joints and (joint.kind == 'slide') == panel.slides:
            if panel.what == 'effort':      # it acts from its tick to the next
                time, rows = thinned(source.time, np.append(values[:, k], values[-1:, k]))
                axes.step(time, rows, line, where='post', color=_color(source, joint.name), linewidth=1.2)
            else:
                axes.plot(*thinned(source.time, values[:, k]), line, color=_color(source, joint.name), linewidth=1.2)
    axes.set_title(f'{"slides" if panel.slides else "rotations"}: {panel.what}, {WHAT[panel.what][panel.slides]}')


def _color(source: Source, joint: str) -> tuple:
    return body_color(source.chain, source.chain.body_index[source.chain.body_of(joint)])


def _draw_energy(axes, source: Source, traces: list, number: int) -> None:
    rows = _some(source)
    kinetic, potential = energies(source, rows)
    for values, color, name in ((kinetic, COLORS[1], 'kinetic'), (potential, COLORS[0], 'potential'),
                                (kinetic + potential, INK, 'sum')):
        axes.plot(*thinned(source.time[rows], values), LINES[number], color=color, linewidth=1.2,
                  label=None if number else name)
    axes.set_title('energy, J')
    axes.legend(fontsize=8, loc='upper right')


def _draw_error(axes, source: Source, traces: list, number: int) -> None:
    axes.plot(*energy_error(source), LINES[number], color=INK, linewidth=1.0)
    axes.set_title('energy beyond work and losses, J')


def _draw_events(axes, source: Source, traces: list, number: int) -> None:
    """Draw a dot for each event in the row of its kind; of many at one place of the picture, one."""
    rows = axes.__dict__.setdefault('rows_of_kinds', {})
    width = max(source.time[-1] - source.time[0], 1e-9) / BINS
    for kind in EVENTS:
        times = np.array([each['tick'] * source.step for each in source.events if each['kind'] == kind])
        times = times[(times >= source.time[0] - 0.5 * source.step) & (times <= source.time[-1] + 0.5 * source.step)]
        if times.size:
            row = rows.setdefault(kind, len(rows))
            times = times[np.unique(np.round(times / width), return_index=True)[1]]
            axes.plot(times, np.full(times.size, row + 0.2 * number), MARKS[number], color=INK, markersize=3.5,
                      markerfacecolor='none' if number else INK, linestyle='none', clip_on=False)
    axes.set_yticks(range(len(rows)), list(rows))
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_title('events' if rows else 'no events')


def _mark_events(axes, sources: list) -> None:
    """Draw thin lines at events other than commands, if they are few."""
    marked = [each['tick'] * source.step for source in sources for each in source.events if each['kind'] != 'command'
              and source.time[0] <= each['tick'] * source.step <= source.time[-1]]
    for time in sorted(set(marked)) if len(marked) <= MARKED else ():
        axes.axvline(time, color=FAINT, linewidth=0.7, zorder=0)


def _draw_paths(axes, source: Source, traces: list, number: int) -> None:
    """Draw the ways of the traced points, with a dot at their ends."""
    position = source.position[_some(source)]
    poses, lines = body_poses(source.chain, position), body_lines(source.chain, position)
    points, turns = poses.point @ (1.0, 1.0j), np.exp(1j * poses.angle)
    for body, point in traces:
        way = lines[body][-1][1] if point is None else points[:, body] + point * turns[:, body]
        color, name = body_color(source.chain, body), _text(source.chain.bodies[body].name)
        rows = np.unique(np.concatenate([kept_rows(way.real), kept_rows(way.imag)]))
        axes.plot(way[rows].real, way[rows].imag, LINES[number], color=color, linewidth=1.1,
                  label=None if number or len(traces) > NAMED else name)
        axes.plot(way[-1].real, way[-1].imag, 'o', color=color, markersize=4.5)
    _in_plane(axes, source, 'paths')
    if traces and len(traces) <= NAMED:
        axes.legend(fontsize=8, loc='best')


def _draw_arms(axes, source: Source, traces: list, number: int) -> None:
    """Draw the arm at ARMS moments, the later the darker."""
    rows = np.linspace(0, len(source.time) - 1, ARMS).round().astype(int)
    dot = min(2.5, 30.0 / len(source.chain.bodies))
    for k, lines in enumerate(body_lines(source.chain, source.position[rows])):
        color = body_color(source.chain, k)
        for start, end in lines:
            for moment, (first, last) in enumerate(zip(start, end)):
                share = moment / (ARMS - 1)
                axes.plot([first.real, last.real], [first.imag, last.imag], f'{LINES[number]}o', color=color[:3],
                          alpha=color[3] * (0.12 + 0.88 * share**2), markersize=dot, zorder=2 + share,
                          linewidth=3.0 if moment == ARMS - 1 else 1.4, solid_capstyle='round')
    _in_plane(axes, source, f'{source.time[0]:g} to {source.time[-1]:g} s')


def _in_plane(axes, source: Source, title: str) -> None:
    base = np.array([body.origin for body in source.chain.bodies if body.carrier == BASE])
    axes.plot(base.real, base.imag, '^', color=FAINT, markersize=8, zorder=1)
    axes.set(aspect='equal', adjustable='datalim', xlabel='x, m', ylabel='y, m', title=title)


def _legend(drawn, sources: list, joints: list, wide: float) -> None:
    """Name the joints by their colours, and the files by their lines, above all panels."""
    from matplotlib.lines import Line2D
    entries: list[Any] = []
    for name in joints[:NAMED]:
        source = next(each for each in sources if name in each.chain.joint_names)
        entries.append(Line2D([], [], color=_color(source, name), label=_text(name)))
    if len(joints) > NAMED:
        entries.append(Line2D([], [], linestyle='none', label=f'and {len(joints) - NAMED} more'))
    if len(sources) > 1:
        entries += [Line2D([], [], color=INK, linestyle=line, marker=mark, markersize=3.5, label=_text(each.name),
                           markerfacecolor=INK if mark == MARKS[0] else 'none')
                    for each, line, mark in zip(sources, LINES, MARKS)]
    if entries:
        longest = max(len(each.get_label()) for each in entries)
        columns = max(1, min(len(entries), int(13.5 * wide) // (longest + 7)))
        drawn.legend(handles=entries, loc='upper left', fontsize=8, ncols=columns)
        height = 0.1 + 0.175 * -(-len(entries) // columns)    # inches
        drawn.get_layout_engine().set(rect=(0.0, 0.0, 1.0, 1.0 - height / drawn.get_size_inches()[1]))


def _text(name: str) -> str:
    """Return a name for matplotlib, which would leave out one that begins with _, and set mathematics between $."""
    return f'{" " if name[:1] == "_" else ""}{name}'.replace('$', r'\$')


def _some(source: Source) -> np.ndarray:
    """Return at most ROWS rows, equally far apart, for what takes time to be computed of each."""
    return np.arange(0, len(source.time), -(-len(source.time) // ROWS))


def kept_rows(values: np.ndarray) -> np.ndarray:
    """Return the rows of the smallest and the largest value in each of BINS parts; all rows if they are few."""
    count = len(values)
    if count <= 4 * BINS:
        return np.arange(count)
    size = count // BINS
    blocks = values[:count // size * size].reshape(-1, size)
    starts = size * np.arange(len(blocks))
    return np.unique(np.concatenate([[0, count - 1], starts + blocks.argmin(axis=1), starts + blocks.argmax(axis=1),
                                     np.arange(len(blocks) * size, count)]))


def thinned(time: np.ndarray, values: np.ndarray) -> tuple:
    """Return times and values of kept_rows."""
    rows = kept_rows(values)
    return time[rows], values[rows]
