"""A scene as an SVG that moves by itself, or as a page around it with buttons; both ask no other file or machine."""
from __future__ import annotations

from html import escape
from typing import Callable

import numpy as np

from .figure import DARK_FAINT, DARK_INK, DARK_PAPER, FAINT, INK, PAPER
from .scene import SAMPLE, Scene, Stroke, Trail

EVERY = 4        # rows from frame to frame; between them the browser interpolates
LABELS = 400     # texts of the time at most


def write_svg(scene: Scene, stream, done: Callable[[int], object]) -> None:
    """Write a scene as SVG with animations (SMIL), in UTF-8; done(1) is called after each frame's share of the work."""
    stream.write(_document(scene, done).encode())


def write_html(scene: Scene, stream, done: Callable[[int], object]) -> None:
    """Write a page with the scene, a button, a slider, and a choice of the speed, in UTF-8."""
    stream.write(PAGE.format(title=escape(scene.title), drawing=_document(scene, done), style=_style(scene, 'html'),
                             frame=EVERY * SAMPLE, last=(scene.rows - 1) * SAMPLE).encode())


def _document(scene: Scene, done: Callable[[int], object]) -> str:
    rows = range(0, scene.rows, EVERY)
    moves = f'dur="{(len(rows) - 1) * EVERY * SAMPLE:.6g}s" repeatCount="indefinite"'
    parts = [*_strokes(scene.behind, rows, moves), *(_trail(scene, each, rows, moves) for each in scene.trails),
             *_strokes(scene.strokes, rows, moves)]
    drawn = []
    for k, part in enumerate(parts):
        drawn.append(part)
        done(len(rows) * (k + 1) // len(parts) - len(rows) * k // len(parts))
    texts = [f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
             for x, y, anchor, text in scene.labels]
    return '\n'.join([
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {scene.width} {scene.height}" width="{scene.width}" '
        f'height="{scene.height}" role="img">', f'<title>{escape(scene.title)}</title>',
        f'<style>{_style(scene, "svg")}</style>', '<rect class="sheet" width="100%" height="100%"/>',
        '<g fill="none" stroke-linecap="round" stroke-linejoin="round">', *drawn, '</g>', *texts,
        *_times(scene, rows, moves), '</svg>\n'])


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


def _strokes(strokes: list, rows: range, moves: str):
    """Yield the elements of strokes; dots at one place are one element, which is moved."""
    k = 0
    while k < len(strokes):
        same = k
        while same < len(strokes) and strokes[same].points is strokes[k].points:
            same += 1
        yield _dots(strokes[k:same], rows, moves) if strokes[k].points.shape[1] == 1 else _line(strokes[k], rows, moves)
        k = same


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
    every = -(-len(rows) // LABELS)
    shown = list(range(0, len(rows), every))
    for k, start in enumerate(shown):
        first, last = start / (len(rows) - 1), (shown[k + 1] / (len(rows) - 1) if k + 1 < len(shown) else 1.0)
        values, times = zip(*[(value, time) for value, time, wanted in (
            ('hidden', 0.0, first > 0.0), ('visible', first, first < 1.0), ('hidden', last, last < 1.0)) if wanted])
        yield (f'<text x="{0.7 * scene.font:.1f}" y="{1.35 * scene.font:.1f}" '
               f'visibility="{"hidden" if k else "visible"}">{scene.time(rows[start])}<animate '
               f'attributeName="visibility" calcMode="discrete" values="{";".join(values)}" '
               f'keyTimes="{";".join(f"{time:.6g}" for time in times)}" {moves}/></text>')


PAGE = '''<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
:root{{color-scheme:light dark}}
body{{margin:0;font:15px system-ui,sans-serif}}
main{{max-width:max-content;margin:0 auto;padding:12px;box-sizing:border-box}}
svg{{display:block;width:auto;height:auto;max-width:100%;min-width:min(100%,70vmin);max-height:calc(100vh - 80px);margin:0 auto}}
div{{display:flex;gap:10px;align-items:center;padding-top:8px}}
button,select{{font:inherit;padding:4px 10px}}
button{{min-width:5.2em}}
input{{flex:1;min-width:60px}}
{style}
</style>
<main>
{drawing}
<div><button id="run" title="space">Pause</button>
<input id="at" type="range" min="0" max="{last:.6g}" step="any" value="0" aria-label="time" title="arrow keys: one frame">
<select id="pace" aria-label="speed"><option value="0.1">&#215; 0.1<option value="0.25">&#215; 0.25
<option value="0.5">&#215; 0.5<option value="1" selected>&#215; 1<option value="2">&#215; 2<option value="4">&#215; 4</select></div>
</main>
<script>
const [svg, run, at, pace] = ['svg', '#run', '#at', '#pace'].map(name => document.querySelector(name));
const last = {last:.6g}, frame = {frame:.6g};
let time = 0, before, running = !matchMedia('(prefers-reduced-motion: reduce)').matches;
svg.pauseAnimations();
function show() {{
  svg.setCurrentTime(Math.min(time, last * (1 - 1e-9)));   // at the end itself it begins again
  at.value = time;
  run.textContent = running ? 'Pause' : 'Play';
}}
function go(now) {{
  if (running && before !== undefined) time = (time + (now - before) / 1000 * pace.value) % last;
  before = now;
  show();
  requestAnimationFrame(go);
}}
function step(frames) {{
  running = false;
  time = Math.max(0, Math.min(last, (Math.round(time / frame) + frames) * frame));
}}
run.onclick = () => {{ running = !running; }};
at.oninput = () => {{ running = false; time = +at.value; }};
onkeydown = event => {{
  const act = {{' ': run.onclick, ArrowLeft: () => step(-1), ArrowRight: () => step(1),
               Home: () => {{ time = 0; }}, End: () => {{ running = false; time = last; }}}}[event.key];
  if (!act || event.ctrlKey || event.metaKey || event.altKey || event.target === pace) return;
  event.preventDefault();
  act();
}};
requestAnimationFrame(go);
</script>
'''
