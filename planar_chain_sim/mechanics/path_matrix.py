"""
Topology as matrices: incidence S, path P, shared masses M; the joint map; welded bodies merged (equations.md 1, 4, 5).

Rows and columns are bodies in file order, welded ones included; the base has no row.
"""
from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple, Optional

import numpy as np

from .._kernel import unit_vector  # load-time trigonometry through the kernel's own functions
from ..chain.chain import Chain
from ..chain.tree import BASE, Joint
from ..errors import ChainError


def incidence_matrix(chain: Chain) -> np.ndarray:
    """
    S (bodies, bodies): S[i, i] = 1 and S[i-, i] = -1, one column per body (equations.md 1).

    (S^T v)_i = v_i - v_i- is the difference along the joint; S_ = I - S picks the carrier's value,
    {phi'_} = S_^T {phi'}.
    """
    S = np.eye(len(chain.bodies))
    for i, body in enumerate(chain.bodies):
        if body.carrier != BASE:
            S[body.carrier, i] = -1.0
    return S


def path_matrix(chain: Chain) -> np.ndarray:
    """P = S^-1 (bodies, bodies), equations.md 1: P[i, j] = 1 if body i is on the path from j (included) to the root."""
    P = np.eye(len(chain.bodies))
    for j, body in enumerate(chain.bodies):
        if body.carrier != BASE:
            P[:, j] += P[:, body.carrier]  # regular labelling: the carrier's column is complete
    return P


def shared_mass_matrix(chain: Chain) -> np.ndarray:
    """M = P m P^T (bodies, bodies), kg: the mass that bodies i and j both carry; its diagonal is M_i of (5.60)."""
    P = path_matrix(chain)
    return P @ np.diag([body.mass for body in chain.bodies]) @ P.T


def motion_of_joints(chain: Chain) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the constant map from joint coordinates q to absolute ones: [phi; x] = G q + offset.

    phi = P^T theta (equations.md 4) with theta_i = angle_i + axis_i q_i, and q_i left out where body i cannot turn on
    its carrier: its column is then missing from P^T, which is the group matrix E of equations.md 5 in joint
    coordinates. Virtual work gives the rest: H_q = G^T H G and G^T Q = tau.

    Returns G (2 bodies, joints) and offset (2 bodies,), rad and m.
    """
    bodies, PT = len(chain.bodies), path_matrix(chain).T
    G, offset = np.zeros((2 * bodies, chain.joint_count)), np.zeros(2 * bodies)
    offset[:bodies] = PT @ np.array([body.angle for body in chain.bodies])
    column = 0
    for i, body in enumerate(chain.bodies):
        if body.slide is not None:
            G[bodies + i, column] = 1.0
            column += 1
        if body.rotation is not None:
            G[:bodies, column] = body.rotation.axis * PT[:, i]
            column += 1
    return G, offset


@dataclass
class Link:
    """A body merged with what is welded to it, in a frame with phi_i = phi_i- + axis q_i; the kernel's unit."""

    carrier: int             # slot of the carrying link, 0 is the base
    offset: complex          # rho_i, carrier's frame, m
    slide_axis: complex      # e^(j epsilon_i), carrier's frame; 0 where the link does not slide
    slide: Optional[Joint]
    rotation: Optional[Joint]
    mass: float              # m_i, kg
    moment: complex          # m_i c_i, own frame, kg m: a merged link may be massless and then has no c_i
    inertia: float           # J_i about the joint point, kg m^2


class Place(NamedTuple):
    """Where a body's frame lies in its link's: slot (0: base), joint point, m, angle, rad, and `turn`, e^(j angle)."""

    slot: int
    position: complex
    angle: float
    turn: complex


def _inertia_about_carrier(body, origin: complex, moment: complex, chain: Chain) -> float:
    """Moment of inertia, kg m^2, of a welded body about its carrier's joint point; ChainError: it overflows."""
    try:
        inertia = body.inertia + body.mass * abs(origin)**2 + 2.0 * (origin.conjugate() * moment).real
    except OverflowError:
        inertia = inf
    if not isfinite(inertia):
        raise ChainError(f"body '{body.name}' of {chain.name} is welded on too far from a joint: its moment of inertia "
                         'about that is not finite')
    return inertia


def merge_welded(chain: Chain) -> tuple[list[Link], complex, list[Place]]:
    """
    Return the chain's links in regular labelling: welded bodies merged into their carriers (equations.md 5).

    Bodies welded to the base never move and are dropped; their first moment sum m r_C, kg m, is returned for the
    potential energy. Every fixed angle is absorbed into the constants; the place of each body comes last.
    """
    links: list[Link] = []
    grounded = 0j
    placed: list[Place] = []
    for body in chain.bodies:
        slot, position, angle, carried = placed[body.carrier] if body.carrier != BASE else (0, 0j, 0.0, 1.0 + 0j)
        origin = position + carried * body.origin
        own_angle = angle + body.angle
        turn = unit_vector(own_angle)
        moment = body.mass * turn * body.center_of_mass
        if body.slide is None and body.rotation is None:
            placed.append(Place(slot, origin, own_angle, turn))
            if slot == 0:
                grounded += body.mass * origin + moment
                continue
            link = links[slot - 1]
            link.inertia += _inertia_about_carrier(body, origin, moment, chain)
            link.moment += body.mass * origin + moment
            link.mass += body.mass
            continue
        axis = unit_vector(angle + body.slide.axis) if body.slide is not None else 0j
        links.append(Link(slot, origin, axis, body.slide, body.rotation, body.mass, moment, body.inertia))
        placed.append(Place(len(links), 0j, own_angle, turn))
    return links, grounded, placed
