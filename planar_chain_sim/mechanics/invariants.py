"""
Kinetic and potential energy and power in the reference form, as matrices: (5.65), (5.71), (5.72).

Symbols as in equations_of_motion.py. The kernel's twin is Recursion::energy in kernel/forms/recursive.hpp.
"""
from __future__ import annotations

import numpy as np

from .joint_forces import passive_effort, stored_energy
from .path_matrix import motion_of_joints, path_matrix, shared_mass_matrix
from ..chain.chain import Chain


def energy(chain: Chain, position, velocity) -> tuple[float, float]:
    """T with armature, V = -sum m g . r_C + spring energy, both in J; position, velocity (joints,): (5.65), (5.72)."""
    P, M = path_matrix(chain), shared_mass_matrix(chain)
    G, offset = motion_of_joints(chain)
    bodies = len(chain.bodies)
    (phi, x), (dphi, dx) = np.split(G @ position + offset, [bodies]), np.split(G @ velocity, [bodies])
    phi_ = np.array([phi[body.carrier] if body.carrier >= 0 else 0.0 for body in chain.bodies])
    dphi_ = np.array([dphi[body.carrier] if body.carrier >= 0 else 0.0 for body in chain.bodies])
    m = np.array([body.mass for body in chain.bodies])
    J = np.array([body.inertia for body in chain.bodies])
    chi = np.array([np.exp(1j * body.slide.axis) if body.slide else 0.0 for body in chain.bodies]) * np.exp(1j * phi_)

    p = np.array([body.origin for body in chain.bodies]) * np.exp(1j * phi_) + x * chi   # r + p of (5.71)
    c = np.array([body.center_of_mass for body in chain.bodies]) * np.exp(1j * phi)
    w = 1j * p * dphi_ + chi * dx                                                        # (5.73)
    u = 1j * c * dphi
    kinetic = (0.5 * np.real(np.conj(w) @ M @ w) + np.real(np.conj(w) @ (P @ (m * u)))
               + 0.5 * dphi @ (J * dphi))                                                # (5.65)
    r_C = P.T @ p + c                                                                    # (5.71)
    potential = -np.real(np.conj(chain.gravity) * (m @ r_C))                             # (5.72)
    armature = np.array([joint.armature for joint in chain.joints])
    return float(kinetic + 0.5 * armature @ velocity**2), float(potential + stored_energy(chain, position))


def dissipated_power(chain: Chain, position, velocity) -> float:
    """Power dissipated by damping and friction, W, >= 0: dE/dt = effort . velocity - this (equations.md 4)."""
    springs = passive_effort(chain, position, np.zeros(chain.joint_count))
    return float(-(passive_effort(chain, position, velocity) - springs) @ velocity)
