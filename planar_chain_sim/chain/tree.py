"""
Tree: the bodies of a planar chain, their joints and gravity, in SI units, frozen; names and indices of them.

Symbols are those of the path-matrix method (Arczewski, sections 5.4.5-5.4.9): a body i turns about its joint point P_i,
which may slide on its carrier i-. Plane vectors are complex numbers x + j y.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import inf, isfinite
from typing import Any, Mapping, Optional

BASE = -1  # carrier index of a body that the base carries
POINT_MASS = 1e-9     # relative: an inertia that falls short of m c^2 by less is rounding, the body is a point mass
ROUNDING = 1e-15      # relative: the same for an inertia above m c^2, where only the last bits can be doubted


def _number(default: float, least: Optional[float], slide: str, rotation: str) -> float:
    """Return the field of an optional number of a chain file: its default, its least value, its units."""
    return field(default=default, metadata={'least': least, 'slide': slide, 'rotation': rotation})


@dataclass(frozen=True)
class Joint:
    """One joint of a body and the laws that act on its relative coordinate (rad or m, N m or N)."""

    name: str
    kind: str                   # 'slide' or 'rotation'
    axis: float                 # slide: direction in the carrier's frame, rad; rotation: +1.0 or -1.0
    damping: float = _number(0.0, 0.0, 'N s/m', 'N m s/rad')
    stiffness: float = _number(0.0, 0.0, 'N/m', 'N m/rad')
    rest: float = _number(0.0, None, 'm', 'rad')             # coordinate at which the spring is slack
    friction: float = _number(0.0, 0.0, 'N', 'N m')          # Coulomb
    preload: float = _number(0.0, None, 'N', 'N m')          # effort that always acts
    armature: float = _number(0.0, 0.0, 'kg', 'kg m^2')      # reflected inertia on the relative rate
    effort_limit: float = _number(inf, 0.0, 'N', 'N m')
    lower: float = _number(-inf, None, 'm', 'rad')           # stops
    upper: float = _number(inf, None, 'm', 'rad')
    restitution: float = _number(0.0, 0.0, '', '')           # of the stops: speed after an impact per speed before
    position: float = _number(0.0, None, 'm', 'rad')         # initial state
    velocity: float = _number(0.0, None, 'm/s', 'rad/s')


@dataclass(frozen=True)
class Body:
    """
    One rigid body: mass data in its own frame, joint point and offsets in its carrier's frame.

    The two inertias must satisfy J = J_C + m c^2; if they differ by rounding, `inertia` counts.
    """

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
    visual: Mapping = field(default_factory=dict, hash=False)  # for pictures only
    given: str = field(default='inertia_com', compare=False, repr=False)  # the inertia that its text gives

    def __post_init__(self) -> None:
        try:
            settled = settled_inertia(self.mass, self.center_of_mass, self.inertia, self.inertia_com)
        except (TypeError, AttributeError, OverflowError):
            return   # not numbers: refused when the body is used
        if settled is not None:
            for name, value in zip(('inertia', 'inertia_com'), settled):
                object.__setattr__(self, name, value)


def steiner_term(mass: float, center: complex) -> float:
    """Return m c^2, kg m^2: the inertia about the joint point less that about the mass centre."""
    return mass * (center.real * center.real + center.imag * center.imag)


def inertia_about_center(inertia: float, steiner: float) -> tuple[float, float]:
    """Return J and J_C for J and m c^2; if J is m c^2 up to rounding, the body is a point mass."""
    inertia_com = inertia - steiner
    return (steiner, 0.0) if inertia_com <= ROUNDING * steiner else (inertia, inertia_com)


def settled_inertia(mass: Any, center: Any, inertia: Any, inertia_com: Any) -> Optional[tuple[float, float]]:
    """Return J and J_C as a text can give them, for two that miss J = J_C + m c^2 by rounding; None for all others."""
    steiner = steiner_term(mass, center)
    from_inertia = inertia_about_center(inertia, steiner)
    if (inertia, inertia_com) in (from_inertia, (inertia_com + steiner, max(inertia_com, 0.0))):
        return None
    off = abs(inertia - steiner - inertia_com)
    return from_inertia if isfinite(off) and off <= POINT_MASS * max(abs(inertia), steiner) else None


@dataclass(frozen=True)
class Tree:
    """Bodies in regular labelling: a carrier comes before the bodies it carries. `Chain` is one that has a text."""

    name: str
    gravity: complex            # m/s^2, x + j y
    bodies: tuple[Body, ...]

    def __post_init__(self) -> None:
        if isinstance(self.bodies, list):   # which has no hash and is equal to no tuple
            self.__dict__['bodies'] = tuple(self.bodies)

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
        """Index of each body by its name; if several have one name, that of the first."""
        return {body.name: index for index, body in reversed(tuple(enumerate(self.bodies)))}

    def body_of(self, joint: str) -> str:
        """Name of the body that the joint of this name moves."""
        return next(body.name for body in self.bodies for each in (body.slide, body.rotation)
                    if each is not None and each.name == joint)

    @property
    def joint_count(self) -> int:
        """Number of joints, the length of every joint array."""
        return len(self.joints)
