"""Checks that the equations of a chain can be solved: a joint that moves no inertia of its own makes them singular."""
from __future__ import annotations

from typing import Optional

import numpy as np

from .kernel_model import kernel_model_of
from ..chain.chain import Chain, FURTHER_CHECKS
from ..chain.checks import data_of, read_tree
from ..chain.section import clipped, Section
from ..errors import ChainError


class SingularError(ChainError):
    """A chain whose mass matrix is singular in every configuration: the `joint` to blame, and `why`."""

    def __init__(self, sentence: str, joint: str = '', why: str = ''):
        super().__init__(sentence)
        self.joint, self.why = joint, why


def refuse_singular(chain: Chain, sections: Optional[list[Section]] = None) -> None:
    """
    Raise SingularError for a joint that no configuration gives any inertia of its own (equations.md 7).

    `sections` of the bodies name the place in a file.
    """
    name = singular_joint(chain)
    if name is None:
        chain.__dict__['_solvable'] = True
        return
    index = next(i for i, body in enumerate(chain.bodies) if name in [j.name for j in (body.slide, body.rotation) if j])
    slide = chain.bodies[index].slide
    kind = 'slide' if slide and slide.name == name else 'rotation'
    sections = sections or read_tree(data_of(chain), '')[1]
    why = lack_of_inertia(chain.bodies, index, kind)
    try:
        sections[index].fail(kind, f"has the joint '{clipped(name)}', which makes the mass matrix singular in every "
                             f"configuration because {why}, must have mass, inertia or 'armature' to move")
    except ChainError as error:
        raise SingularError(str(error), name, why) from None


def lack_of_inertia(bodies, index: int, kind: str) -> str:
    """Return the reason why a joint has no inertia of its own."""
    outboard = {index}
    for i in range(index + 1, len(bodies)):
        if bodies[i].carrier in outboard:
            outboard.add(i)
    if not any(bodies[i].mass for i in outboard):
        if kind == 'slide' or not any(bodies[i].inertia_com for i in outboard):
            return 'nothing on this body or outboard of it has mass'
    return 'it moves no mass, beyond rounding, that the other joints do not move in the same way'


def singular_joint(chain: Chain) -> Optional[str]:
    """
    Name of a joint whose pivot vanishes at each of a few fixed irregular configurations, else None (equations.md 7).

    Pivots are analytic in q: zero at all of them is zero everywhere, and then the chain has no motion to compute.
    """
    count = chain.joint_count
    zero, joint = np.zeros(count), -1
    for trial in range(1, 5):
        position = np.sin(1.0 + 2.399963 * trial * np.arange(1, count + 1)) * (0.7 + 0.2 * trial)
        joint = kernel_model_of(chain).model.forward_dynamics(position, zero, zero)[2]
        if joint < 0:
            return None
    return chain.joint_names[joint]


FURTHER_CHECKS.append(refuse_singular)
