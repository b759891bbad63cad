"""
The right-hand sides that heyoka is given: articulated bodies for any tree, the closed form for two rods.

Both in absolute angles, where a planar arm has its fewest terms; symbols as in docs/equations.md and
kernel/forms/recursive.hpp, whose recursion this is, written out as heyoka expressions. A plane vector is a pair (x, y).
"""
from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from ...chain.chain import Chain
from ...mechanics.path_matrix import merge_welded


@dataclass(frozen=True)
class System:
    """`equations`: (variable, right-hand side) of heyoka; to and from joint coordinates by the constant matrix G."""

    equations: list
    to_absolute: np.ndarray    # (coordinates, joints): variables of position from joint positions

    def state(self, position, velocity) -> np.ndarray:
        """Return heyoka's state, positions then rates, for joint positions and velocities."""
        return np.concatenate([self.to_absolute @ position, self.to_absolute @ velocity])

    def joints(self, state) -> tuple[np.ndarray, np.ndarray]:
        """Return joint positions and velocities of heyoka's state."""
        half = len(state) // 2
        back = np.linalg.inv(self.to_absolute)   # entries 0, 1 and -1: exact
        return back @ state[:half], back @ state[half:]


def _perpendicular(v):
    return -v[1], v[0]


def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1]


def _plus(u, v, factor=1.0):
    return u[0] + factor * v[0], u[1] + factor * v[1]


def _scaled(v, factor):
    return v[0] * factor, v[1] * factor


def _turned(constant, cosine, sine):
    """Return the constant vector of a body's frame in world axes."""
    x, y = constant
    return x * cosine - y * sine, x * sine + y * cosine


def links_of(chain: Chain) -> list:
    """Return the chain's links with their vectors as pairs; numbers are float64."""
    def pair(z):
        return z.real, z.imag
    return [SimpleNamespace(carrier=link.carrier, slide=link.slide, rotation=link.rotation, mass=link.mass,
                            inertia=link.inertia, offset=pair(link.offset), slide_axis=pair(link.slide_axis),
                            moment=pair(link.moment)) for link in merge_welded(chain)[0]]


def articulated_bodies(heyoka, chain: Chain, torque=None, links=None) -> System:
    """
    Return the O(n) recursion of equations.md 6.2 for a tree of turning links, any of which may slide too.

    Damping and springs of the joints are included. `torque`: joint efforts, (joints,) of numbers or expressions, zero
    where None. `links`: as links_of returns them, in numbers of another precision. ValueError: a link that doesn't
    turn, or armature, which need the larger recursion of 6.3.
    """
    links = links or links_of(chain)
    if any(link.rotation is None for link in links) or any(joint.armature for joint in chain.joints):
        raise ValueError(f'{chain.name}: heyoka is given turning links without armature only')
    index = {joint.name: k for k, joint in enumerate(chain.joints)}
    q, v = ([heyoka.expression(f'{kind}{k:02d}') for k in range(chain.joint_count)] for kind in 'qv')
    parts = _kinematics(heyoka, links, index, q, v)
    for part, link in zip(parts, links):   # N = S tau, equations.md 4
        tau = _joint_effort(link.rotation, index, torque, *part.relative)
        part.t = part.t + link.rotation.axis * tau
        if part.carrier is not None:
            parts[part.carrier].t = parts[part.carrier].t - link.rotation.axis * tau
        if link.slide:
            part.force = _joint_effort(link.slide, index, torque, q[part.slide], v[part.slide])
    _eliminate(parts)
    accelerations = _accelerations(parts, chain.gravity)
    equations = [(q[k], v[k]) for k in range(len(q))] + [(v[k], accelerations[k]) for k in range(len(q))]

    to_absolute = np.zeros((len(q), chain.joint_count))
    for link, part in zip(links, parts):
        if link.slide:
            to_absolute[part.slide, part.slide] = 1.0
        if part.carrier is not None:
            to_absolute[part.angle] = to_absolute[parts[part.carrier].angle]
        to_absolute[part.angle, part.angle] = link.rotation.axis
    return System(equations, to_absolute)


def _kinematics(heyoka, links, index, q, v):
    """Return one part per link, with the vectors that 6.2 starts from."""
    parts = []
    for link in links:
        part = SimpleNamespace(carrier=link.carrier - 1 if link.carrier else None, angle=index[link.rotation.name],
                               slide=index[link.slide.name] if link.slide else None)
        rate, axis = v[part.angle], link.rotation.axis
        part.cosine, part.sine, part.rate = heyoka.cos(q[part.angle]), heyoka.sin(q[part.angle]), rate
        before = parts[part.carrier] if part.carrier is not None else None
        frame = (before.cosine, before.sine) if before else (1.0, 0.0)
        part.chi = _turned(link.slide_axis, *frame) if link.slide else None
        part.relative = axis * q[part.angle], axis * rate
        if before:
            R = _turned(link.offset, *frame)
            if link.slide:
                R = _plus(R, part.chi, q[part.slide])
            part.s, part.k = _perpendicular(R), _scaled(R, -(before.rate * before.rate))
            if link.slide:
                part.k = _plus(part.k, _perpendicular(part.chi), 2.0 * v[part.slide] * before.rate)
            part.relative = axis * (q[part.angle] - q[before.angle]), axis * (rate - before.rate)
        X = _turned(link.moment, part.cosine, part.sine)
        part.B = [link.mass, 0.0, link.mass]            # xx, xy, yy
        part.h, part.I, part.t = _perpendicular(X), link.inertia, 0.0
        part.q = _scaled(X, -(rate * rate))
        parts.append(part)
    return parts


def _joint_effort(joint, index, torque, position, velocity):
    """Return what acts on a joint: the given effort, damping and spring."""
    effort = torque[index[joint.name]] if torque is not None else 0.0
    if joint.damping:
        effort = effort - joint.damping * velocity
    if joint.stiffness:
        effort = effort - joint.stiffness * (position - joint.rest)
    return effort


def _eliminate(parts):
    """Leaf to root: steps (1) to (3) of 6.2."""
    for part in reversed(parts):
        inverse = 1.0 / part.I
        h = part.h
        g = part.g = (h[0] * inverse, h[1] * inverse)
        part.t_over_I = part.t * inverse
        A = [part.B[0] - h[0] * g[0], part.B[1] - h[0] * g[1], part.B[2] - h[1] * g[1]]
        b = _plus(part.q, g, part.t)
        if part.chi:
            chi = part.chi
            Ax = A[0] * chi[0] + A[1] * chi[1], A[1] * chi[0] + A[2] * chi[1]
            inverse = 1.0 / _dot(chi, Ax)
            part.y = Ax[0] * inverse, Ax[1] * inverse
            nu = part.force - _dot(chi, b)
            part.nu = nu * inverse
            stiff = (A[0] * A[2] - A[1] * A[1]) * inverse
            n = _perpendicular(chi)
            A = [stiff * n[0] * n[0], stiff * n[0] * n[1], stiff * n[1] * n[1]]
            b = _plus(b, part.y, nu)
        if part.carrier is None:
            continue
        before, k, s = parts[part.carrier], part.k, part.s
        beta = A[0] * k[0] + A[1] * k[1] + b[0], A[1] * k[0] + A[2] * k[1] + b[1]
        z = A[0] * s[0] + A[1] * s[1], A[1] * s[0] + A[2] * s[1]
        before.B = [left + right for left, right in zip(before.B, A)]
        before.q, before.h = _plus(before.q, beta), _plus(before.h, z)
        before.I, before.t = before.I + _dot(s, z), before.t - _dot(s, beta)


def _accelerations(parts, gravity):
    """Root to leaf: the accelerations of all variables."""
    result = {}
    for part in parts:
        if part.carrier is None:
            a = -gravity.real, -gravity.imag
        else:
            before = parts[part.carrier]
            a = _plus(_plus(before.a, part.s, result[before.angle]), part.k)
        if part.chi:
            result[part.slide] = part.nu - _dot(part.y, a)
            a = _plus(a, part.chi, result[part.slide])
        part.a = a
        result[part.angle] = part.t_over_I - _dot(part.g, a)
    return result


def two_rods(heyoka, chain: Chain, torque=None) -> System:
    """
    Return the closed form of equations.md 3 for two links in series, their mass centres in line with the joints.

    `torque` as above. ValueError: another chain.
    """
    links, *_ = merge_welded(chain)
    laws = any(joint.damping or joint.stiffness or joint.armature for joint in chain.joints)
    if len(links) != 2 or laws or any(link.slide or link.rotation is None for link in links) or links[1].carrier != 1:
        raise ValueError(f'{chain.name}: the closed form is for two free rods')
    first, second = links
    arm, lever = second.offset, second.moment
    if abs((arm * lever.conjugate()).imag) > 1e-12:
        raise ValueError(f'{chain.name}: the closed form is for rods in line with their joints')
    g = abs(chain.gravity)
    q, v = ([heyoka.expression(f'{kind}{k}') for k in (0, 1)] for kind in 'qv')
    A11, A12, A22 = first.inertia + second.mass * abs(arm)**2, abs(arm) * abs(lever), second.inertia
    D = first.moment + second.mass * arm, lever
    down = [angle + np.angle(d) - np.angle(chain.gravity) for angle, d in zip(q, D)]   # from the direction of g
    c, s = heyoka.cos(q[0] - q[1]), heyoka.sin(q[0] - q[1])
    r1 = -A12 * s * v[1] * v[1] - g * abs(D[0]) * heyoka.sin(down[0])
    r2 = A12 * s * v[0] * v[0] - g * abs(D[1]) * heyoka.sin(down[1])
    if torque is not None:
        tau = [link.rotation.axis * effort for link, effort in zip(links, torque)]
        r1, r2 = r1 + tau[0] - tau[1], r2 + tau[1]     # Q = S tau
    inverse = 1.0 / (A11 * A22 - A12 * A12 * c * c)
    equations = [(q[0], v[0]), (q[1], v[1]), (v[0], (A22 * r1 - A12 * c * r2) * inverse),
                 (v[1], (A11 * r2 - A12 * c * r1) * inverse)]
    axes = [link.rotation.axis for link in links]
    return System(equations, np.array([[axes[0], 0.0], [axes[0], axes[1]]]))
