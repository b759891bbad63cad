"""
Chain: the physical data of a planar tree of rigid bodies, in SI units, frozen.

A chain from a file or from data was checked when it was read. One that was made by hand, for example by
dataclasses.replace, is checked at its first use, by `plan.plan_of`. Both have a text from which they can be loaded.

Symbols are those of the path-matrix method (Arczewski, sections 5.4.5-5.4.9): a body i turns about its joint point P_i,
which may slide on its carrier i-. Plane vectors are complex numbers x + j y.
"""
from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, isfinite
from types import MappingProxyType
from typing import Mapping, Optional

BASE = -1  # carrier index of a body that the base carries
POINT_MASS = 1e-9     # relative: an inertia that falls short of m c^2 by less is rounding, the body is a point mass
ROUNDING = 1e-15      # relative: the same for an inertia above m c^2, where only the last bits can be doubted


class ChainError(ValueError):
    """A chain that cannot be: one sentence that says what is wrong, where, what was got and what was wanted."""


class RobotFileNote(UserWarning):
    """One line about a robot file that was read: joints, plane, gravity, and what is not used."""


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
    preload: float = 0.0        # effort that always acts, N m or N
    armature: float = 0.0       # reflected inertia on the relative rate, kg m^2 or kg
    effort_limit: float = inf   # N m or N
    lower: float = -inf         # stops, rad or m
    upper: float = inf
    restitution: float = 0.0    # of the stops: speed after an impact per speed before
    position: float = 0.0       # initial state
    velocity: float = 0.0


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

    def __post_init__(self):
        try:
            settled = settled_inertia(self.mass, self.center_of_mass, self.inertia, self.inertia_com)
        except (TypeError, AttributeError, OverflowError):
            return   # not numbers: refused when the body is used
        if settled is not None:
            for name, value in zip(('inertia', 'inertia_com'), settled):
                object.__setattr__(self, name, value)


def steiner_term(mass: float, center: complex) -> float:
    """Return m c^2, kg m^2: what the inertia about the joint point has more than that about the mass centre."""
    return mass * (center.real * center.real + center.imag * center.imag)


def inertia_about_center(inertia: float, steiner: float) -> tuple[float, float]:
    """Return J and J_C for J and m c^2; within rounding of it the body is a point mass."""
    inertia_com = inertia - steiner
    return (steiner, 0.0) if inertia_com <= ROUNDING * steiner else (inertia, inertia_com)


def settled_inertia(mass, center, inertia, inertia_com) -> Optional[tuple[float, float]]:
    """Return J and J_C that a text can say, for two that differ by rounding; None where they do not, or by more."""
    steiner = steiner_term(mass, center)
    from_inertia = inertia_about_center(inertia, steiner)
    if (inertia, inertia_com) in (from_inertia, (inertia_com + steiner, max(inertia_com, 0.0))):
        return None
    off = abs(inertia - steiner - inertia_com)
    return from_inertia if isfinite(off) and off <= POINT_MASS * max(abs(inertia), steiner) else None


class _Text:
    """
    `Chain.source`: the given text if it describes the same chain, number by number, else a text that does.

    It is computed at the first access.
    """

    def __get__(self, chain, owner=None):
        if chain is None:
            return self
        kept = chain.__dict__
        if '_text' not in kept:
            from .chain_yaml import own_text
            kept['_text'] = own_text(chain, kept.get('_given', ''))
        return kept['_text']

    def __set__(self, chain, text):
        chain.__dict__['_given'] = '' if text is self else text   # itself: the default


@dataclass(frozen=True)
class Chain:
    """
    A tree of bodies in regular labelling (a carrier comes before the bodies it carries).

    `source` is the YAML text from which the same chain can be loaded again, number by number. Equality and hash are
    those of the numbers and names; `visual` is compared too.
    """

    name: str
    gravity: complex            # m/s^2, x + j y
    bodies: tuple[Body, ...]
    source: str = field(default=_Text(), compare=False, repr=False)

    def __post_init__(self):
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

    @property
    def parameters(self) -> Mapping[str, float]:
        """
        Every number that `with_parameters` can change, by its name: `gravity.x`, `BODY.mass`, `JOINT.damping` ...

        Read-only. A name that a body and a joint have gets `body:` or `joint:` in front.
        """
        from .chain_parameters import parameters_of
        return MappingProxyType(parameters_of(self))

    def with_parameters(self, values: Mapping[str, float]) -> Chain:
        """
        Return a checked chain with other values of `parameters`; its `source` says so.

        Where a mass or a mass centre changes, the inertia stays that the chain file gives, `inertia` or `inertia_com`,
        unless one of them is given here. ChainError: an unknown name, a value that cannot be.
        """
        from .chain_parameters import with_parameters
        return with_parameters(self, values)

    def __getstate__(self):
        # What is kept besides is made again.
        return {key: value for key, value in self.__dict__.items()
                if key in ('name', 'gravity', 'bodies', '_given', '_text', '_checked')}


def altered(chain: Chain, **changes) -> Chain:
    """Return a chain with changes after which it need not be checked again."""
    fresh = replace(chain, source='', **changes)
    fresh.__dict__.update({key: True for key in ('_checked',) if key in chain.__dict__})
    return fresh
