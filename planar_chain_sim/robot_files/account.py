"""The line that says how a robot file was read, and the lists in it."""
from __future__ import annotations

import numpy as np

from .spatial_robot import Plane, SpatialRobot
from ..chain.section import clipped

EXACT = 1e-6        # rad; above it the line names the largest angle


def account(robot: SpatialRobot, chain, plane: Plane) -> list:
    """Return the parts of the line about a robot file: joints, plane, gravity and changes to them."""
    x, y, _ = plane.basis
    parts = [f'joints {quoted(chain.joint_names, 16)}',
             f'plane with x along {_direction(x)} and y along {_direction(y)} of link '
             f"'{clipped(robot.root)}'",
             f'gravity [{chain.gravity.real:.6g}, {chain.gravity.imag:.6g}] m/s^2']
    if plane.largest_angle > EXACT:
        parts.append(f'axes projected on the plane, from which they differ by up to {plane.largest_angle:.2g} rad')
    if plane.across:
        sliding = [name for name in chain.joint_names if name in plane.across]
        parts.append(f'along its normal, on their own, slide {quoted(sliding)}')
    welded = [f"'{clipped(each.name)}' at {each.welded_at:g}" for each in robot.joints if each.welded_at is not None]
    if welded:
        parts.append('welded: ' + listed(welded))
    return parts


def listed(texts: list, most: int = 6) -> str:
    """Return texts joined by commas, the first `most` of them."""
    return ', '.join(texts[:most]) + (f' and {len(texts) - most} more' if len(texts) > most else '')


def _direction(vector: np.ndarray) -> str:
    for sign in ('', '-'):
        for axis, unit in zip('xyz', np.eye(3)):
            if np.allclose(vector, unit if not sign else -unit, rtol=0.0, atol=5e-4):
                return sign + axis
    return '(' + ', '.join(f'{part + 0.0:.3g}' for part in vector) + ')'


def quoted(names, most: int = 6) -> str:
    """Return names in quotes, joined by commas, the first `most` of them."""
    names = list(names)
    rest = f' and {len(names) - most} more' if len(names) > most else ''
    return ', '.join(f"'{clipped(name)}'" for name in names[:most]) + rest
