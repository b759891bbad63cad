"""Estimates the stiffness of a chain at its initial state, and the longest stable step of a fixed-step method."""
from __future__ import annotations

from typing import Optional

import numpy as np

from .integrators import Method
from ..chain.chain import Chain
from ..mechanics.plan import plan_of


def damping_rate(chain: Chain) -> float:
    """
    Estimate of the fastest decay that joint damping gives the chain at its initial state, 1/s; 0 without damping.

    Power iteration for the largest eigenvalue of H^-1 d, six times an O(n) solution.
    """
    return _largest_rate(chain, np.array([joint.damping for joint in chain.joints]))[0]


def _largest_rate(chain: Chain, law: np.ndarray) -> tuple[float, int]:
    """Return the largest eigenvalue of H^-1 law, law (joints,) on the diagonal, and the joint that moves most in it."""
    if not law.any():
        return 0.0, 0
    position = np.array([joint.position for joint in chain.joints])
    return plan_of(chain).model.largest_rate(position, law)


def step_limit(chain: Chain, method: Method) -> Optional[tuple[float, str]]:
    """
    Return the longest step, s, with which a fixed-step method is stable at the initial state, and the joint to blame.

    It follows from estimates of the fastest decay by dampers and oscillation on springs, and from the method's
    stability region on the negative real and on the imaginary axis. None: nothing is stiff, or there is no such limit.
    """
    real, imaginary = method.stability_limits
    limits = []
    for law, power, extent in (('damping', 1.0, real), ('stiffness', 0.5, imaginary)):
        rate, joint = _largest_rate(chain, np.array([getattr(joint, law) for joint in chain.joints]))
        if rate > 0.0 and extent < np.inf:
            limits.append((extent / rate**power, chain.joint_names[joint]))
    return min(limits, default=None)
