"""
JOINT_FORCES: the laws of joint effort, one per row, each on the relative coordinate (equations.md 4).

A row says which joints have the law, what effort it adds (N m or N), what energy it stores (J), and the numbers that
the kernel's header of the same law takes (kernel/model/laws/).
"""
from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, Callable, Optional

import numpy as np

from ..chain.chain import Chain
from ..chain.tree import Joint


@dataclass(frozen=True)
class JointForce:
    """
    One law: `effort(joint, position, velocity)` in N m or N, of numbers or arrays, and `energy(joint, position)` in J.

    `energy` is None where the law stores none: then its effort depends on the velocity alone.
    """

    name: str
    formula: str
    acts_on: Callable[[Joint], bool]
    effort: Callable[[Joint, Any, Any], Any]
    numbers: Callable[[Joint], tuple]     # in the order of the kernel's header
    energy: Optional[Callable[[Joint, float], float]] = None


JOINT_FORCES = (
    JointForce('damping', "-d theta'", lambda joint: joint.damping > 0.0,
               lambda joint, position, velocity: -joint.damping * velocity,
               lambda joint: (joint.damping,)),
    JointForce('spring', '-k (theta - theta_0)', lambda joint: joint.stiffness > 0.0,
               lambda joint, position, velocity: -joint.stiffness * (position - joint.rest),
               lambda joint: (joint.stiffness, joint.rest),
               lambda joint, position: 0.5 * joint.stiffness * (position - joint.rest) ** 2),
    JointForce('preload', 'tau_p', lambda joint: joint.preload != 0.0,
               lambda joint, position, velocity: joint.preload,
               lambda joint: (joint.preload,),
               lambda joint, position: -joint.preload * position),
    JointForce('friction', "-tau_c sgn(theta')", lambda joint: joint.friction > 0.0,
               lambda joint, position, velocity: -joint.friction * np.sign(velocity),
               lambda joint: (joint.friction,)),
)


def has_stop(joint: Joint) -> bool:
    """Whether the joint has a stop on at least one side."""
    return isfinite(joint.lower) or isfinite(joint.upper)


def passive_effort(chain: Chain, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Sum of all laws on each joint, (joints,), N m or N: equations.md 4."""
    return np.array([
        sum((law.effort(joint, q, v) for law in JOINT_FORCES if law.acts_on(joint)), 0.0)
        for joint, q, v in zip(chain.joints, position, velocity)])


def stored_energy(chain: Chain, position: np.ndarray) -> float:
    """Energy in the springs and of the preloads, J."""
    return sum((law.energy(joint, q)
                for joint, q in zip(chain.joints, position) for law in JOINT_FORCES
                if law.energy is not None and law.acts_on(joint)), 0.0)


def add_laws_to_kernel(model, chain: Chain) -> None:
    """Give the kernel's model the list of joints of every law, and of effort limits and stops."""
    for index, joint in enumerate(chain.joints):
        for law in JOINT_FORCES:
            if law.acts_on(joint):
                model.add_law(law.name, index, law.numbers(joint))
        if joint.effort_limit < inf:
            model.add_law('effort_limit', index, (joint.effort_limit,))
        if has_stop(joint):
            model.add_law('stop', index, (joint.lower, joint.upper, joint.restitution))
