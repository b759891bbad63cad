"""Accelerations to 50 digits: whatever solves inverse dynamics, in mpmath, is right."""
import dataclasses

from mpmath import mp, mpc, mpf
import numpy as np

import planar_chain_sim as pcs
from planar_chain_sim.chain.tree import BASE

DIGITS = 50


def _turned(angle):
    return mpc(mp.cos(angle), mp.sin(angle))


def inverse_dynamics(chain, position, velocity, acceleration):
    """Efforts (joints,) of mpf: equations.md 6.1, body by body, welded ones included, and the laws of joint effort."""
    index = {joint.name: k for k, joint in enumerate(chain.joints)}
    bodies, effort = chain.bodies, [mpf(0)] * chain.joint_count
    phi, rate, turning, place = ([None] * (len(bodies) + 1) for _ in range(4))   # the last one, BASE = -1, is the base
    phi[BASE], rate[BASE], turning[BASE], place[BASE] = mpf(0), mpf(0), mpf(0), -mpc(chain.gravity)
    unit, lever, axis, force, torque = ([None] * (len(bodies) + 1) for _ in range(5))
    unit[BASE] = mpc(1)
    for i, body in enumerate(bodies):
        p = body.carrier
        phi[i], rate[i], turning[i] = phi[p] + mpf(body.angle), rate[p], turning[p]
        if body.rotation:
            k, sign = index[body.rotation.name], mpf(body.rotation.axis)
            phi[i] += sign * position[k]
            rate[i] += sign * velocity[k]
            turning[i] += sign * acceleration[k]
        unit[i] = _turned(phi[i])
        lever[i], moved = mpc(body.origin) * unit[p], 0
        if body.slide:
            k, axis[i] = index[body.slide.name], unit[p] * _turned(mpf(body.slide.axis))
            lever[i] += position[k] * axis[i]
            moved = (acceleration[k] + 2j * velocity[k] * rate[p]) * axis[i]
        place[i] = place[p] + (1j * turning[p] - rate[p]**2) * lever[i] + moved
        center = mpc(body.center_of_mass) * unit[i]
        force[i] = mpf(body.mass) * (place[i] + (1j * turning[i] - rate[i]**2) * center)
        inertia = mpf(body.inertia)
        torque[i] = inertia * turning[i] + mpf(body.mass) * mp.im(mp.conj(center) * place[i])
    for i, body in reversed(list(enumerate(bodies))):
        if body.rotation:
            effort[index[body.rotation.name]] = mpf(body.rotation.axis) * torque[i]
        if body.slide:
            effort[index[body.slide.name]] = mp.re(mp.conj(axis[i]) * force[i])
        if body.carrier != BASE:
            force[body.carrier] += force[i]
            torque[body.carrier] += torque[i] + mp.im(mp.conj(lever[i]) * force[i])
    for k, joint in enumerate(chain.joints):
        effort[k] += (mpf(joint.armature) * acceleration[k] + mpf(joint.damping) * velocity[k]
                      + mpf(joint.stiffness) * (position[k] - mpf(joint.rest)))
    return effort


def forward_dynamics(chain, position, velocity, effort):
    """
    Accelerations (joints,) of mpf whose efforts by inverse_dynamics are `effort` to 10^-40 of the largest term.

    The kernel only proposes corrections: a solution is known by its residual.
    """
    with mp.workdps(DIGITS + 15):
        position, velocity, wanted = ([mpf(float(x)) for x in values] for values in (position, velocity, effort))
        bare = dataclasses.replace(chain, gravity=0j, bodies=tuple(
            dataclasses.replace(body, **{kind: dataclasses.replace(joint, damping=0.0, stiffness=0.0)
                                         for kind in ('slide', 'rotation') if (joint := getattr(body, kind))})
            for body in chain.bodies))
        still, at = np.zeros(chain.joint_count), [float(x) for x in position]
        acceleration = [mpf(0)] * chain.joint_count
        for _ in range(40):
            got = inverse_dynamics(chain, position, velocity, acceleration)
            residual = [w - g for w, g in zip(wanted, got)]
            largest = max(map(abs, residual))
            if largest < mpf(10)**-45:
                return acceleration
            scaled = [float(r / largest) for r in residual]
            step = pcs.forward_dynamics(bare, at, still, scaled, 'recursive')
            acceleration = [a + largest * mpf(float(d)) for a, d in zip(acceleration, step)]
        raise AssertionError('the corrections do not converge')


def error(got, exact):
    """Largest error of `got` relative to the largest acceleration."""
    return float(max(abs(mpf(float(g)) - e) for g, e in zip(got, exact)) / max(map(abs, exact)))
