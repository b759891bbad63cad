"""Estimates the stiffness of a chain at its initial state, and the longest stable step of a fixed-step method."""
from __future__ import annotations

from math import inf
from typing import Optional

from .integrators import Method
from ..chain.chain import Chain
from ..chain.joint_arrays import initial_state
from ..mechanics.plan import plan_of


def damping_rate(chain: Chain) -> float:
    """
    Estimate of the fastest decay that joint damping gives the chain at its initial state, 1/s; 0 without damping.

    Power iteration for the largest eigenvalue of H^-1 d, six times an O(n) solution.
    """
    return _largest_rate(chain, 'damping')[0]


def _largest_rate(chain: Chain, law: str) -> tuple[float, int]:
    """
    Return the largest eigenvalue of H^-1 law, the joints' numbers on the diagonal, and the joint that moves most in it.

    It is computed at its first use and then kept with the chain.
    """
    kept = chain.__dict__.setdefault('_largest_rates', {})   # a frozen dataclass lets its cache be written here
    if law not in kept:
        numbers = [getattr(joint, law) for joint in chain.joints]
        kept[law] = plan_of(chain).model.largest_rate(initial_state(chain)[0], numbers) if any(numbers) else (0.0, 0)
    return kept[law]


def step_limit(chain: Chain, method: Method) -> Optional[tuple[float, str]]:
    """
    Return the longest step, s, with which a fixed-step method is stable at the initial state, and the joint to blame.

    It follows from estimates of the fastest decay by dampers and oscillation on springs, and from the method's
    stability region on the negative real and on the imaginary axis. None: nothing is stiff, or there is no such limit.
    """
    real, imaginary = method.stability_limits
    limits = []
    for law, power, extent in (('damping', 1.0, real), ('stiffness', 0.5, imaginary)):
        rate, joint = _largest_rate(chain, law)
        if rate > 0.0 and extent < inf:
            limits.append((extent / rate**power, chain.joint_names[joint]))
    return min(limits, default=None)
