"""A tree of links in space, as robot files describe it, where its links are, and the plane in which it moves."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Optional

import numpy as np

from ..chain.section import clipped
from ..errors import ChainError

GRAVITY = 9.81      # m/s^2 along -z, as everywhere where URDF is used


@dataclass
class Link:
    """A rigid body: mass, kg; mass centre (3,), m; moments of inertia (3, 3) about it, kg m^2; in its own frame."""

    name: str
    mass: float = 0.0
    center: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))


@dataclass
class SpatialJoint:
    """
    A joint: the child's frame in the parent's where it reads 0, and the unit axis in the child's.

    `kind`: 'rotation', 'slide' or 'fixed'. `welded_at`: where it is welded, None where it moves.
    """

    name: str
    kind: str
    parent: str
    child: str
    turn: np.ndarray
    shift: np.ndarray
    axis: np.ndarray
    laws: dict
    welded_at: Optional[float] = None

    @property
    def moves(self) -> bool:
        """Whether it is neither fixed nor welded."""
        return self.kind != 'fixed' and self.welded_at is None


class SpatialRobot(NamedTuple):
    """
    A tree: `links` by name, `joints` in an order in which a parent comes before its children.

    `gravity`: m/s^2 in the root's frame.
    """

    name: str
    root: str
    links: dict
    joints: list
    gravity: tuple = (0.0, 0.0, -GRAVITY)


class Plane(NamedTuple):
    """
    `basis` (3, 3): rows x, y and normal in the root's frame; `across`: the slides along the normal, by name.

    `gravity` (3,): its components along x, y and the normal, m/s^2.
    """

    basis: np.ndarray
    across: frozenset
    largest_angle: float
    gravity: np.ndarray


def turn_about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation matrix by an angle about a unit axis."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def child_place(joint, turn: np.ndarray, shift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation and position of a joint's child from those of its parent."""
    turn, shift = turn @ joint.turn, shift + turn @ joint.shift
    if joint.welded_at is not None and joint.kind == 'rotation':
        turn = turn @ turn_about(joint.axis, joint.welded_at)
    elif joint.welded_at is not None:
        shift = shift + turn @ (joint.axis * joint.welded_at)
    return turn, shift


def places_of(robot: SpatialRobot, name: str) -> dict:
    """Return link -> (rotation, position) against the root where all joints that move read 0."""
    places = {robot.root: (np.eye(3), np.zeros(3))}
    for joint in robot.joints:
        turn, shift = child_place(joint, *places[joint.parent])
        if not (np.isfinite(turn).all() and np.isfinite(shift).all()):
            raise ChainError(f"{name}: joint '{clipped(joint.name)}' has a position that is not finite, must have a "
                             'finite one')
        places[joint.child] = turn, shift
    return places
