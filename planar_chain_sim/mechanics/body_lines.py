"""The lines that draw the bodies of a chain at one position, or along a motion."""
from __future__ import annotations

import numpy as np

from .body_poses import body_poses
from ..chain.chain import Chain
from ..chain.tree import BASE
from ..chain.visual import own_end


def body_lines(chain: Chain, position) -> list:
    """
    Return for each body its segments (start, end), complex (...), m: from its joint point to what it carries.

    Or as far as its `visual` says; a body that carries nothing ends as far beyond its mass centre as that lies from the
    joint point. Position (..., joints); ValueError: bad shape, non-finite value.
    """
    point, angle, _ = body_poses(chain, position)
    points, turns = point @ (1.0, 1.0j), np.exp(1j * angle)
    carried = [[] for _ in chain.bodies]
    for k, body in enumerate(chain.bodies):
        if body.carrier != BASE:
            carried[body.carrier].append(points[..., k])
    lines = []
    for k, (body, outboard) in enumerate(zip(chain.bodies, carried)):
        place, own = points[..., k], own_end(body) or ([] if outboard else [2.0 * body.center_of_mass])
        lines.append([(place, end) for end in [place + end * turns[..., k] for end in own] or outboard])
    return lines
