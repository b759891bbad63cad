"""linearize: A and B of x' = A x + B u about a state, from the kernel's derivatives of inverse dynamics."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .chain import Chain
from .dynamics import forward_dynamics, joint_array
from .plan import plan_of


class Linearization(NamedTuple):
    """`A` (2 joints, 2 joints) and `B` (2 joints, joints) of x' = A x + B u with x = (position, velocity)."""

    A: np.ndarray
    B: np.ndarray


def linearize(chain: Chain, position, velocity, effort) -> Linearization:
    """
    Return A and B of d/dt (x - x0) = f(x0, u0) + A (x - x0) + B (u - u0), x = (position, velocity), u = effort.

    Arrays (joints,) in joint coordinates, SI units. With H q'' + h(q, q') = u, the derivatives of the left side at the
    state's own accelerations, K by position and C by velocity, give q'' by the chain rule:

        A = [[0, 1], [-H^-1 K, -H^-1 C]],   B = [[0], [H^-1]]

    K and C are the kernel's, in closed form (kernel/jacobian.hpp; as in Carpentier and Mansard, Analytical derivatives
    of rigid body dynamics algorithms, 2018). At an equilibrium the eigenvalues of A are those of small oscillations.
    Effort limits and stops are not known. ValueError: bad shape, non-finite value, a joint with friction that stands
    still, where Coulomb's law has no derivative. SimulationError: singular configuration.
    """
    joints = chain.joint_count
    position, velocity, effort = (joint_array(name, values, (joints,)) for name, values in (
        ('position', position), ('velocity', velocity), ('effort', effort)))
    for joint, rate in zip(chain.joints, velocity):
        if joint.friction > 0.0 and rate == 0.0:
            raise ValueError(f"velocity of joint '{joint.name}' is 0.0, must not be: its friction has no derivative "
                             'where it stands still')
    acceleration = forward_dynamics(chain, position, velocity, effort)
    H, K, C = plan_of(chain).model.derivatives(position, velocity, acceleration)
    rows = np.linalg.solve(H, np.hstack([-K, -C, np.eye(joints)]))
    A, B = np.zeros((2 * joints, 2 * joints)), np.zeros((2 * joints, joints))
    A[:joints, joints:] = np.eye(joints)
    A[joints:], B[joints:] = rows[:, :2 * joints], rows[:, 2 * joints:]
    return Linearization(A, B)
