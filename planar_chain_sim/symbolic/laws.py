"""LAWS: the term of each law of joint effort in the equations, one row each (equations.md 4)."""
from __future__ import annotations

from typing import NamedTuple


class Law(NamedTuple):
    """
    A number of a joint times what it acts on, a kind of term on the right side of the equation of that joint.

    `number`: its name in chain.tree.Joint. `letters` and `units` are those of a rotation, then of a slide. `acts_on`:
    the relative 'displacement' from the rest of the spring, 'rate' or 'direction', all of which the law works against,
    or 'nothing': the number itself is the effort. `color` is that of its bars.
    """

    kind: str
    number: str
    letters: tuple[str, str]
    units: tuple[str, str]
    acts_on: str
    color: str


LAWS = (   # in the order of terms
    Law('spring', 'stiffness', ('k', 'k_x'), ('N m/rad', 'N/m'), 'displacement', '#E69F00'),
    Law('damping', 'damping', ('d', 'd_x'), ('N m s/rad', 'N s/m'), 'rate', '#CC79A7'),
    Law('friction', 'friction', ('tau_c', 'f_c'), ('N m', 'N'), 'direction', '#999999'),
    Law('preload', 'preload', ('tau_p', 'f_p'), ('N m', 'N'), 'nothing', '#F0E442'),
)
ARMATURE = Law('acceleration', 'armature', ('Ia', 'ma'), ('kg m^2', 'kg'), 'acceleration', '')   # on the left side
