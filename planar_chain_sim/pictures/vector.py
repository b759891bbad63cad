"""A scene as an SVG that moves by itself, or as a page around it with buttons; both ask no other file or machine."""
from __future__ import annotations

from html import escape
from importlib.resources import files
from itertools import groupby
from string import Template
from typing import Callable

import numpy as np

from .figure import DARK_FAINT, DARK_INK, DARK_PAPER, FAINT, INK, PAPER
from .scene import SAMPLE, Scene, Stroke, Trail

EVERY = 4        # rows from frame to frame; between them the browser interpolates
LABELS = 400     # texts of the time at most
EARLY = 2e-6     # of the whole time: a text changes so much before its frame, as browsers round times


def write_svg(scene: Scene, stream, done: Callable[[int], object]) -> None:
    """Write a scene as SVG with animations (SMIL), in UTF-8; done(frames) is called at its end."""
    stream.write(_document(scene, done).encode())


def write_html(scene: Scene, stream, done: Callable[[int], object]) -> None:
    """Write a page with the scene, a button, a slider, and a choice of the speed, in UTF-8."""
    page = Template(files(__package__).joinpath('page.html').read_text())
    stream.write(page.substitute(title=escape(scene.title), drawing=_document(scene, done), style=_style(scene, 'html'),
                                 frame=f'{EVERY * SAMPLE:.6g}', last=f'{(scene.rows - 1) * SAMPLE:.6g}').encode())


def _document(scene: Scene, done: Callable[[int], object]) -> str:
    rows = range(0, scene.rows, EVERY)
    moves = f'dur="{(len(rows) - 1) * EVERY * SAMPLE:.6g}s" repeatCount="indefinite"'
    drawn = [*_strokes(scene, scene.behind, rows, moves),
             *(_in_world(scene, _trail(scene, each, rows, moves), rows, moves) for each in scene.trails),
             *_strokes(scene, scene.strokes, rows, moves)]
    done(len(rows))
    texts = [f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
             for x, y, anchor, text in scene.labels]
    return '\n'.join([
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {scene.width} {scene.height}" width="{scene.width}" '
        f'height="{scene.height}" role="img">', f'<title>{escape(scene.title)}</title>',
        f'<style>{_style(scene, "svg")}</style>', '<rect class="sheet" width="100%" height="100%"/>',
        f'<clipPath id="plane"><rect y="{scene.head:.1f}" width="100%" height="100%"/></clipPath>',
        '<g clip-path="url(#plane)" fill="none" stroke-linecap="round" stroke-linejoin="round">', *drawn, '</g>',
        *texts, *_times(scene, rows, moves), '</svg>\n'])


def _style(scene: Scene, of: str) -> str:
    """Return the colours on light and on dark paper, for the drawing or for the page around it."""
    def colors(ink, faint, paper):
        if of == 'html':
            return f'body{{background:{paper};color:{ink};accent-color:{faint}}}'
        return (f'.ink{{stroke:{ink};fill:{ink}}}.faint{{stroke:{faint}}}.grid{{stroke:{faint};stroke-opacity:.3}}'
                f'.paper{{stroke:{paper};fill:{paper}}}.sheet{{fill:{paper}}}text{{fill:{ink}}}')
    font = f'text{{font:{scene.font:.1f}px system-ui,"DejaVu Sans",sans-serif;font-variant-numeric:tabular-nums}}'
    return (f'{font if of == "svg" else ""}{colors(INK, FAINT, PAPER)}@media(prefers-color-scheme:dark){{'
            f'{colors(DARK_INK, DARK_FAINT, DARK_PAPER)}}}')


def _in_world(scene: Scene, element: str, rows: range, moves: str) -> str:
    """Return an element that stands in the world, moved with it where an arm is followed."""
    if not scene.shift.any():
        return element
    shifts = ';'.join(f'{shift.real:.2f} {shift.imag:.2f}' for shift in scene.shift[list(rows)])
    return f'<g><animateTransform attributeName="transform" type="translate" values="{shifts}" {moves}/>{element}</g>'


def _strokes(scene: Scene, strokes: list, rows: range, moves: str):
    """Yield the elements of strokes: of a row of those that stand still one, and one of dots that move together."""
    for kind, group in groupby(strokes, key=lambda each: 'still' if len(each.points) == 1 else id(each.points)):
        row = list(group)
        if kind == 'still':
            yield _in_world(scene, '\n'.join(_dots([each], rows, moves) if each.points.size == 1 else
                                             _line(each, rows, moves) for each in row), rows, moves)
        else:
            yield _dots(row, rows, moves) if row[0].points.shape[1] == 1 else _line(row[0], rows, moves)


def _paint(color, what: str) -> str:
    if isinstance(color, str):
        return f'class="{color}"'
    code = ''.join(f'{round(255 * part):02x}' for part in color[:3])
    return f'{what}="#{code}"' + (f' {what}-opacity="{color[3]:g}"' if color[3] < 1.0 else '')


def _line(stroke: Stroke, rows: range, moves: str) -> str:
    ways = [_way(stroke.points[row]) for row in (rows if len(stroke.points) > 1 else [0])]
    head = f'<path {_paint(stroke.color, "stroke")} stroke-width="{stroke.width:.2f}" fill="none" d="{ways[0]}"'
    return f'{head}/>' if len(ways) == 1 else (
        f'{head}><animate attributeName="d" values="{";".join(ways)}" {moves}/></path>')


def _dots(strokes: list, rows: range, moves: str) -> str:
    places = strokes[0].points[list(rows) if len(strokes[0].points) > 1 else [0], 0]
    circles = ''.join(f'<circle r="{each.width / 2:.2f}" stroke="none" {_paint(each.color, "fill")}/>'
                      for each in strokes)
    at = [f'{place.real:.2f} {place.imag:.2f}' for place in places]
    moving = '' if len(at) == 1 else (
        f'<animateTransform attributeName="transform" type="translate" values="{";".join(at)}" {moves}/>')
    return f'<g transform="translate({at[0]})">{moving}{circles}</g>'


def _way(points: np.ndarray) -> str:
    return 'M' + 'L'.join(f'{point.real:.2f} {point.imag:.2f}' for point in points)


def _trail(scene: Scene, trail: Trail, rows: range, moves: str) -> str:
    """Return the whole way of a point, of which a dash shows the last part."""
    along = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(np.round(trail.points, 2))))))
    ends = along[list(rows)]
    starts = along[np.maximum(0, np.array(rows) - round(scene.look.trail / SAMPLE))]
    far = along[-1] + 1.0
    dashes = ';'.join(f'0 {start:.2f} {end - start:.2f} {far:.2f}' for start, end in zip(starts, ends))
    return (f'<path {_paint(trail.color, "stroke")} opacity=".5" stroke-width="{1.4 * scene.unit:.2f}" '
            f'stroke-linecap="butt" stroke-dasharray="0 {far:.2f}" d="{_way(trail.points)}">'
            f'<animate attributeName="stroke-dasharray" values="{dashes}" {moves}/></path>')


def _times(scene: Scene, rows: range, moves: str):
    """Yield a text for each time, of which one is seen at a time."""
    count = len(rows) - 1
    shown = [*range(0, count, -(-count // LABELS)), count]
    for start, end in zip(shown, shown[1:]):
        values = ['hidden', 'visible', 'hidden']
        times = [0.0, start / count - EARLY, end / count - EARLY * (end < count)]
        skip = start == 0     # it is visible from the beginning
        yield (f'<text x="{0.7 * scene.font:.1f}" y="{1.35 * scene.font:.1f}" visibility="{values[skip]}">'
               f'{scene.time(rows[start])}<animate attributeName="visibility" calcMode="discrete" '
               f'values="{";".join(values[skip:])}" '
               f'keyTimes="{";".join(f"{max(time, 0.0):.6f}" for time in times[skip:])}" {moves}/></text>')
