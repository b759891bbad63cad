"""
How a body looks: `visual: {length: 0.4, color: [0.8, 0.2, 0.1]}`, the same in URDF, markers and pictures.

It never changes the motion.
"""
from __future__ import annotations

from collections.abc import Mapping
import re

from .section import plain, shown, suggestion
from .tree import BASE, Body, Tree

KEYS = ('length', 'color')
# As far apart as seven can be for readers with all kinds of colour vision, on white and on dark paper: test_visual.
COLORS = ((0.196, 0.416, 0.6), (0.808, 0.592, 0.161), (0.361, 0.686, 0.682), (0.475, 0.392, 0.4),
          (0.565, 0.541, 0.929), (0.639, 0.294, 0.102), (0.627, 0.643, 0.518))
NAMES = {'black': '#000000', 'silver': '#c0c0c0', 'gray': '#808080', 'grey': '#808080', 'white': '#ffffff',
         'maroon': '#800000', 'red': '#ff0000', 'purple': '#800080', 'fuchsia': '#ff00ff', 'green': '#008000',
         'lime': '#00ff00', 'olive': '#808000', 'yellow': '#ffff00', 'navy': '#000080', 'blue': '#0000ff',
         'teal': '#008080', 'aqua': '#00ffff', 'orange': '#ffa500'}    # as in CSS
HEX = re.compile('#[0-9a-fA-F]{6}')


def read_visual(section) -> Mapping:
    """Return the checked mapping under `visual` in a body's section, {} if there is none; ChainError."""
    visual = section.section('visual')
    if visual is None:
        return {}
    visual.refuse_unknown_keys(KEYS)
    if 'length' in visual.data:
        visual.number('length', unit='m', least=0.0)
    if 'color' in visual.data and _rgba(color := visual.data['color']) is None:
        near = suggestion(color, NAMES) if isinstance(color, str) else ''
        visual.fail('color', f'is {shown(color)}{near}, must be [red, green, blue], numbers from 0 to 1, '
                    f'optionally with the opacity as a fourth, #rrggbb in quotes, or one of {", ".join(NAMES)}')
    return plain(visual.data)


def _rgba(color):
    """Return red, green, blue and opacity of what stands under `color`, None where it is none."""
    if isinstance(color, str):
        color = NAMES.get(color, color)
        if not HEX.fullmatch(color):
            return None
        return tuple(int(color[k:k + 2], 16) / 255 for k in (1, 3, 5)) + (1.0,)
    if isinstance(color, list) and len(color) in (3, 4) and all(
            type(part) in (int, float) and 0 <= part <= 1 for part in color):
        return (*map(float, color), 1.0)[:4]
    return None


def body_color(chain: Tree, index: int) -> tuple:
    """Return red, green, blue and opacity of a body, 0 to 1: its own, or one of COLORS by its place in the chain."""
    color = chain.bodies[index].visual.get('color')
    return _rgba(list(COLORS[index % len(COLORS)]) if color is None else color)


def own_end(body: Body) -> list:
    """Return the end of the line of `length`, [complex] in the body's frame, m; [] without `length`."""
    return [complex(body.visual['length'], 0.0)] if 'length' in body.visual else []


def visual_ends(chain: Tree) -> list[list[complex]]:
    """Return for each body the ends of the lines that draw it, from its joint point, own frame, m, at zero slides."""
    carried = [[] for _ in chain.bodies]
    for body in chain.bodies:
        if body.carrier != BASE:
            carried[body.carrier].append(body.origin)
    return [own_end(body) or ends or [2.0 * body.center_of_mass] for body, ends in zip(chain.bodies, carried)]
