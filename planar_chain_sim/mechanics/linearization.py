"""linearize: A and B of x' = A x + B u about a state, from the kernel's derivatives of inverse dynamics."""
from __future__ import annotations

from typing import NamedTuple, TYPE_CHECKING

import numpy as np

from .dynamics import no_acceleration
from .plan import plan_of
from .._kernel import REFUSALS
from ..chain.chain import Chain

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_WHY_NOT = {'singular': 'the configuration is singular', 'no_acceleration': 'the acceleration is not finite',
            'no_derivative': 'the derivatives of the acceleration are not finite'}


class Linearization(NamedTuple):
    """`A` (2 joints, 2 joints) and `B` (2 joints, joints) of x' = A x + B u with x = (position, velocity)."""

    A: np.ndarray
    B: np.ndarray


def linearize(chain: Chain, position: ArrayLike, velocity: ArrayLike, effort: ArrayLike) -> Linearization:
    """
    Return A and B of d/dt (x - x0) = f(x0, u0) + A (x - x0) + B (u - u0), x = (position, velocity), u = effort.

    Arrays (joints,) in joint coordinates, SI units. With H q'' + h(q, q') = u, the derivatives of the left side at the
    state's own accelerations, K by position and C by velocity, give q'' by the chain rule:

        A = [[0, 1], [-H^-1 K, -H^-1 C]],   B = [[0], [H^-1]]

    K and C are the kernel's, in closed form (kernel/forms/jacobian.hpp; as in Carpentier and Mansard, Analytical
    derivatives of rigid body dynamics algorithms, 2018), and so are the products with H^-1, by the factors of the
    recursion (kernel/forms/response.hpp; equations.md 6.2). At an equilibrium the eigenvalues of A are those of small
    oscillations. Effort limits and stops are not known. ValueError: bad shape, non-finite value, a joint with friction
    that stands still, where Coulomb's law has no derivative. SimulationError: singular configuration.
    """
    A, B, code, joint = plan_of(chain).model.linearize(position, velocity, effort)
    refusal = REFUSALS[code]
    if refusal == 'standing':
        raise ValueError(f"velocity of joint '{chain.joint_names[joint]}' is 0.0, must not be: its friction has no "
                         'derivative where it stands still')
    if refusal != 'none':
        raise no_acceleration(chain, joint, _WHY_NOT[refusal], position, velocity)
    return Linearization(A, B)
