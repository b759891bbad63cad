"""
Chain: the physical data of a planar tree of rigid bodies, in SI units, frozen and checked at birth.

Symbols are those of the path-matrix method (Arczewski, sections 5.4.5-5.4.9): a body i turns about its joint point P_i,
which may slide on its carrier i-. Plane vectors are complex numbers x + j y.
"""
from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import cached_property
from math import inf
from typing import Mapping, Optional

BASE = -1  # carrier index of a body that the base carries


class ChainError(ValueError):
    """A chain that cannot be: one sentence that says what is wrong, where, what was got and what was wanted."""


@dataclass(frozen=True)
class Joint:
    """One joint of a body and the laws that act on its relative coordinate (rad or m, N m or N)."""

    name: str
    kind: str                   # 'slide' or 'rotation'
    axis: float                 # slide: direction in the carrier's frame, rad; rotation: +1.0 or -1.0
    damping: float = 0.0        # N m s/rad or N s/m
    stiffness: float = 0.0      # N m/rad or N/m
    rest: float = 0.0           # coordinate at which the spring is slack
    friction: float = 0.0       # Coulomb, N m or N
    armature: float = 0.0       # reflected inertia on the relative rate, kg m^2 or kg
    effort_limit: float = inf   # N m or N
    lower: float = -inf         # stops, rad or m
    upper: float = inf
    restitution: float = 0.0    # of the stops: speed after an impact per speed before
    position: float = 0.0       # initial state
    velocity: float = 0.0


@dataclass(frozen=True)
class Body:
    """One rigid body: mass data in its own frame, joint point and offsets in its carrier's frame."""

    name: str
    carrier: int                # index of an earlier body, or BASE
    origin: complex             # m, r e^(j gamma): the joint point at zero slide, carrier's frame
    angle: float                # rad, body frame against carrier frame where the rotation reads 0
    mass: float                 # kg
    center_of_mass: complex     # m, c e^(j eta), own frame
    inertia: float              # kg m^2 about the joint point, J
    inertia_com: float          # kg m^2 about the mass centre, J_C = J - m c^2
    slide: Optional[Joint] = None
    rotation: Optional[Joint] = None
    visual: Mapping = field(default_factory=dict)  # for pictures only


@dataclass(frozen=True)
class Chain:
    """
    A tree of bodies in regular labelling (a carrier comes before the bodies it carries).

    `source` is the YAML text from which the same chain can be loaded again, number by number.
    """

    name: str
    gravity: complex            # m/s^2, x + j y
    bodies: tuple[Body, ...]
    source: str = ''

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """All joints in file order: for each body its slide, then its rotation."""
        return tuple(joint for body in self.bodies for joint in (body.slide, body.rotation) if joint is not None)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Joint names in file order, the order of every array and message."""
        return tuple(joint.name for joint in self.joints)

    @cached_property
    def body_index(self) -> Mapping[str, int]:
        """Index of each body by its name; of several with one name the first."""
        return {body.name: index for index, body in reversed(tuple(enumerate(self.bodies)))}

    def body_of(self, joint: str) -> str:
        """Name of the body that the joint of this name moves."""
        return next(body.name for body in self.bodies for each in (body.slide, body.rotation)
                    if each is not None and each.name == joint)

    @property
    def joint_count(self) -> int:
        """Number of joints, the length of every joint array."""
        return len(self.joints)

    def __getstate__(self):
        return {entry.name: getattr(self, entry.name) for entry in fields(self)}  # what is kept besides is made again
