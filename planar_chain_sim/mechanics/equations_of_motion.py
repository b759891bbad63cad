"""
The equations of motion in the reference form: (5.87) for every angle, (5.88) for every slide, as readable matrices.

Source: K. Arczewski, Mathematical Modelling of Complex Mechanical Systems, 5.4.5-5.4.9, as corrected in equations.md.
Plane vectors are complex numbers x + j y; a bold diagonal matrix of vectors is kept as the array of its entries.

======================  ==============  ==================  =================================================
symbol                  name in code    shape               meaning, unit
======================  ==============  ==================  =================================================
S, S_ = I - S, P        S, S_, P        (bodies, bodies)    incidence, carrier, path matrix (path_matrix.py)
M = P m P^T             M               (bodies, bodies)    shared masses, kg; its diagonal is ~M (5.60)
phi, phi', {phi'_}      phi, dphi,      (bodies,)           absolute angles, rates, rates of the carriers,
                        dphi_                               rad and rad/s
x, x'                   x, dx           (bodies,)           slides, 0 where there is none, m and m/s
r r^, r a^              rr, ra          (bodies,) complex   joint offset in the plane, and turned by 90 deg, m
chi, b^                 chi, b          (bodies,) complex   slide direction, and turned by 90 deg
c c^, c u^              cc, cu          (bodies,) complex   mass centre from the joint point, and turned, m
J                       J               (bodies,)           inertia about the joint point, kg m^2
======================  ==============  ==================  =================================================
"""
from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from .joint_forces import passive_effort
from .path_matrix import incidence_matrix, motion_of_joints, path_matrix, shared_mass_matrix
from ..chain.chain import Chain

TURN = 2 * Fraction('3.14159265358979323846264338327950288419716939937510582097494459')


def _dot(left, A, right):
    """(L A R)_ij = A_ij L_i . R_j for diagonal matrices of vectors L, R."""
    return np.real(np.conj(left)[:, None] * A * right[None, :])


@dataclass(frozen=True)
class AbsoluteEquations:
    """(5.87), (5.88) as H [phi''; x''] + bias = gravity + Q, for all bodies as if each could turn and slide."""

    H: np.ndarray          # (2 bodies, 2 bodies)
    bias: np.ndarray       # (2 bodies,), terms in phi'^2 and x' phi'
    gravity: np.ndarray    # (2 bodies,)


def absolute_equations(chain: Chain, phi, dphi, x, dx) -> AbsoluteEquations:
    """
    (5.87) and (5.88) for all angles and slides.

    `phi`, `dphi` (bodies,) absolute angles and rates, rad, rad/s; `x`, `dx` (bodies,) slides, m, m/s, 0 where none is.
    """
    S, P, M = incidence_matrix(chain), path_matrix(chain), shared_mass_matrix(chain)
    S_ = np.eye(len(chain.bodies)) - S
    m = np.array([body.mass for body in chain.bodies])
    J = np.array([body.inertia for body in chain.bodies])
    epsilon = np.array([body.slide.axis if body.slide else 0.0 for body in chain.bodies])
    phi_, dphi_ = S_.T @ phi, S_.T @ dphi                                       # {phi'_} = S_^T {phi'}

    rr = np.array([body.origin for body in chain.bodies]) * np.exp(1j * phi_)   # r r^
    ra = 1j * rr                                                                # r a^
    chi = np.exp(1j * (phi_ + epsilon))                                         # chi
    b = 1j * chi                                                                # b^
    cc = np.array([body.center_of_mass for body in chain.bodies]) * np.exp(1j * phi)
    cu = 1j * cc                                                                # c u^
    lever = ra + x * b                                                          # r a^ + x b^

    # w' = lever phi_'' + chi x'' + w0, the velocity terms of the joint point's relative acceleration (5.83)
    w0 = -(rr + x * chi) * dphi_**2 + 2.0 * b * dx * dphi_
    u0 = -cc * dphi**2                                                          # u' = c u^ phi'' + u0
    force0 = M @ w0 + P @ (m * u0)
    Pm, mPT = P * m, (P * m).T

    H_phi_phi = (S_ @ (_dot(lever, M, lever) @ S_.T + _dot(lever, Pm, cu))
                 + np.diag(J) + _dot(cu, mPT, lever) @ S_.T)                                # (5.87)
    H_phi_x = S_ @ _dot(lever, M, chi) + _dot(cu, mPT, chi)                                 # (5.87)
    bias_phi = S_ @ np.real(np.conj(lever) * force0) + np.real(np.conj(cu) * (mPT @ w0))    # (5.87)
    H_x_phi = _dot(chi, M, lever) @ S_.T + _dot(chi, Pm, cu)                                # (5.88)
    H_x_x = _dot(chi, M, chi)                                                               # (5.88)
    bias_x = np.real(np.conj(chi) * force0)                                                 # (5.88)

    g, M_diagonal = np.conj(chain.gravity), np.diag(M)                          # ~M of (5.60)
    gravity_phi = S_ @ np.real(g * M_diagonal * lever) + np.real(g * m * cu)    # (5.87), right side
    gravity_x = np.real(g * M_diagonal * chi)                                   # (5.88), right side
    return AbsoluteEquations(np.block([[H_phi_phi, H_phi_x], [H_x_phi, H_x_x]]),
                             np.concatenate([bias_phi, bias_x]), np.concatenate([gravity_phi, gravity_x]))


def _without_whole_turns(chain: Chain, position) -> np.ndarray:
    """Leave whole turns out of angles, so that the sums of them lose nothing."""
    return np.array([float(Fraction(q) - TURN * round(Fraction(q) / TURN)) if joint.kind == 'rotation' and abs(q) > 8.0
                     else q for joint, q in zip(chain.joints, position)])


def joint_equations(chain: Chain, position, velocity):
    """
    H (joints, joints) and h (joints,) of H q'' + h = effort: the absolute equations mapped to joint coordinates.

    H_q = G^T H G with the armature of every joint on its diagonal (equations.md 4, 6.3);
    h = G^T (bias - gravity) - passive effort.
    """
    G, offset = motion_of_joints(chain)
    bodies = len(chain.bodies)
    place, rate = G @ _without_whole_turns(chain, position) + offset, G @ velocity
    equations = absolute_equations(chain, place[:bodies], rate[:bodies], place[bodies:], rate[bodies:])
    H = G.T @ equations.H @ G + np.diag([joint.armature for joint in chain.joints])
    h = G.T @ (equations.bias - equations.gravity) - passive_effort(chain, position, velocity)
    return H, h


def forward_dynamics(chain: Chain, position, velocity, effort) -> np.ndarray:
    """Return q'' = H^-1 (effort - h), (joints,), rad/s^2 or m/s^2; numpy.linalg.LinAlgError where H is singular."""
    H, h = joint_equations(chain, position, velocity)
    return np.linalg.solve(H, effort - h)


def inverse_dynamics(chain: Chain, position, velocity, acceleration) -> np.ndarray:
    """Return the effort H q'' + h, (joints,), N m or N."""
    H, h = joint_equations(chain, position, velocity)
    return H @ acceleration + h


def mass_matrix(chain: Chain, position) -> np.ndarray:
    """H (joints, joints) in joint coordinates, armature included, kg m^2, kg m or kg."""
    return joint_equations(chain, position, np.zeros(chain.joint_count))[0]
