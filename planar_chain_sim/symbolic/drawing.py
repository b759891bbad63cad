"""Pictures: equations as they are set in print, and the terms of an equation as bars; matplotlib is an extra."""
from __future__ import annotations

from typing import Optional, Sequence

from .contributions import contributions, term_text
from .equations import Equations
from .factors import State
from .latex_document import equation_rows, WRITER
from .laws import LAWS
from .notation import LATEX
from .terms import Equation

INK, PAPER = '#1f2933', '#ffffff'
# Okabe and Ito's palette (2008), which the colour-blind can tell
COLORS = {'acceleration': '#0072B2', 'squared rate': '#56B4E9', 'Coriolis': '#009E73', 'gravity': '#D55E00',
          **{law.kind: law.color for law in LAWS}, 'effort': '#000000'}
BARS = 12          # of one equation; what is smaller is one bar
LONGEST = 65000    # pixels that the renderer takes in one direction
DPI = 130


def draw_equations(equations: Equations, chosen: Optional[Sequence[Equation]], path) -> None:
    """Write the equations as a picture, PNG or SVG by the ending of `path`; OSError, ImportError, ValueError."""
    rows = []
    for equation in chosen or equations:
        symbol = LATEX.coordinate(equation.coordinate)
        joint = equation.coordinate.joint.replace('$', r'\$')
        rows += [(0.0, f'({equation.number})  ${symbol}$, {joint}', True)]
        rows += [(0.25 + 0.16 * indent, f'${{}} {text}$', False) for indent, text in equation_rows(equation)]
    pyplot = _pyplot()
    height = 0.27 * len(rows) + 0.3
    _refuse_long(height, len(chosen or equations))
    width = 1.0 + max(indent + 0.078 * (LATEX.width(text) if not bold else len(text)) for indent, text, bold in rows)
    figure = pyplot.figure(figsize=(width, height), facecolor=PAPER)
    with pyplot.rc_context({'mathtext.fontset': 'cm'}):
        for k, (indent, text, bold) in enumerate(rows):
            figure.text((0.2 + indent) / width, 1.0 - (0.3 + 0.27 * k) / height, text, fontsize=9 if bold else 12,
                        color='#0b6e99' if bold else INK, va='center')
        _save(pyplot, figure, path)


def draw_contributions(equations: Equations, chosen: Optional[Sequence[Equation]], state: State, title: str,
                       path) -> None:
    """Write bars of the terms of each equation at a state, largest first; errors as above."""
    panels = [(equation, contributions(equation, state)) for equation in chosen or equations]
    counts = [max(1, min(len(rows), BARS + 1)) for _, rows in panels]
    height = 0.24 * sum(counts) + 0.75 * len(panels) + 0.9
    _refuse_long(height, len(panels))
    pyplot = _pyplot()
    figure, all_axes = pyplot.subplots(len(panels), 1, figsize=(9.0, height), height_ratios=[n + 1.5 for n in counts],
                                       squeeze=False, facecolor=PAPER, layout='constrained')
    for axes, (equation, rows) in zip(all_axes[:, 0], panels):
        _draw_bars(axes, equation, rows)
    kinds = [kind for kind in COLORS if any(row.term.kind == kind for _, rows in panels for row in rows)]
    handles = [pyplot.Rectangle((0, 0), 1, 1, color=COLORS[kind]) for kind in kinds]
    if any(row.term.side == 'right' for _, rows in panels for row in rows):
        kinds.append('on the right side')
        handles.append(pyplot.Rectangle((0, 0), 1, 1, facecolor=INK, edgecolor=PAPER, hatch='///', linewidth=0.0))
    figure.suptitle(f'{equations.chain.name} {title}'.replace('$', r'\$'), color=INK, fontsize=11)
    if handles:
        figure.legend(handles, kinds, loc='outside lower center', ncols=len(kinds), frameon=False, fontsize=8)
    _save(pyplot, figure, path)


def _draw_bars(axes, equation: Equation, rows) -> None:
    """Draw one equation: bars to the right are positive; hatched ones stand on the right side."""
    shown, rest = rows[:BARS], rows[BARS:]
    labels = [f'${term_text(row.term, WRITER)}$' for row in shown]
    values = [row.value for row in shown]
    axes.barh(range(len(shown)), values, color=[COLORS[row.term.kind] for row in shown], height=0.72,
              hatch=['///' if row.term.side == 'right' else '' for row in shown], edgecolor=PAPER, linewidth=0.0)
    if rest:
        largest = max(abs(row.value) for row in rest)
        labels.append(f'{len(rest)} more terms, each up to {largest:.3g}')
        axes.barh(len(shown), largest, color='#d0d5da', height=0.72)
    axes.set_yticks(range(len(labels)), labels, fontsize=9)
    axes.invert_yaxis()
    axes.axvline(0.0, color=INK, linewidth=0.8)
    coordinate = equation.coordinate
    name = coordinate.joint.replace('$', r'\$')
    axes.set_title(f'({equation.number})  ${LATEX.coordinate(coordinate)}$, {name}, {coordinate.unit}'
                   + ('' if rows else ': every term is zero here'), loc='left', fontsize=9, color=INK)
    axes.grid(axis='x', alpha=0.25)
    axes.tick_params(labelsize=8)
    axes.spines[['top', 'right', 'left']].set_visible(False)


def _refuse_long(height: float, panels: int) -> None:
    if height * DPI > LONGEST:
        raise ValueError(f'a picture of {panels} equations would be {height * DPI:.0f} pixels high, must be at most '
                         f'{LONGEST}: choose one with --coordinate')


def _pyplot():
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot
    return pyplot


def _save(pyplot, figure, path) -> None:
    figure.savefig(path, dpi=DPI, metadata={'Date': None} if str(path).endswith('.svg') else None)
    pyplot.close(figure)
