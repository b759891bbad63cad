"""
Where the bodies of a chain are, how they move, and what their joints carry: kinematics and Newton's laws body by body.

Joint points are prefix sums along the path, r_P = P^T (r + x chi) as in (5.71); rates and accelerations are their
derivatives (5.83). Plane vectors are complex inside, [x, y] outside. Arrays (..., joints) keep their leading
axes: a whole run at once. Bodies are in file order, welded ones included; points are in m in the plane of the chain.
"""
from __future__ import annotations

from typing import Any, NamedTuple, TYPE_CHECKING

import numpy as np

from .dynamics import forward_dynamics, joint_rows
from .loads import index_of
from .path_matrix import motion_of_joints
from .._kernel import plane_vector
from ..chain.chain import Chain
from ..chain.tree import BASE

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class BodyPoses(NamedTuple):
    """
    Of every body the joint point and the mass centre, m, in the plane, and the angle of its frame, rad, not wrapped.

    Shapes (..., bodies, 2), (..., bodies) and (..., bodies, 2). Of body_velocities: their rates, m/s and rad/s.
    """

    point: np.ndarray
    angle: np.ndarray
    center_of_mass: np.ndarray


class _Motion:
    """Positions of all bodies and, as far as rates and accelerations are given, their derivatives; complex, m."""

    def __init__(self, chain: Chain, position: Any, velocity: Any = None, acceleration: Any = None) -> None:
        G, offset = motion_of_joints(chain)
        count = len(chain.bodies)
        self.position = position
        self.angle, slide = _halves(position @ G.T + offset, count)
        self.turn = np.exp(1j * self.angle)
        shape = self.angle.shape
        self.rate, sliding = _halves(velocity @ G.T, count) if velocity is not None else (np.zeros(shape), None)
        self.spin, slid = _halves(acceleration @ G.T, count) if acceleration is not None else (np.zeros(shape), None)
        self.point, self.velocity, self.acceleration = (np.zeros(shape, complex) for _ in range(3))
        self.axis = np.zeros(shape, complex)                        # chi, of bodies that slide
        for i, body in enumerate(chain.bodies):
            w = body.carrier
            grounded = w == BASE
            turn, rate, spin = (1.0, 0.0, 0.0) if grounded else (self.turn[..., w], self.rate[..., w],
                                                                 self.spin[..., w])
            arm, first, second = body.origin * turn, 0.0, 0.0
            if body.slide is not None:
                self.axis[..., i] = chi = np.exp(1j * body.slide.axis) * turn
                arm = arm + slide[..., i] * chi
                first = chi * sliding[..., i] if sliding is not None else 0.0
                second = chi * slid[..., i] if slid is not None else 0.0
            before = (0.0, 0.0, 0.0) if grounded else (self.point[..., w], self.velocity[..., w],
                                                       self.acceleration[..., w])
            self.point[..., i] = before[0] + arm
            self.velocity[..., i] = before[1] + 1j * rate * arm + first
            self.acceleration[..., i] = before[2] + (1j * spin - rate**2) * arm + 2j * rate * first + second
        self.arm = np.array([body.center_of_mass for body in chain.bodies]) * self.turn   # c c^

    def center(self) -> Any:
        """Return the mass centres, their velocities and accelerations."""
        return (self.point + self.arm, self.velocity + 1j * self.rate * self.arm,
                self.acceleration + (1j * self.spin - self.rate**2) * self.arm)


def _halves(absolute: Any, count: Any) -> Any:
    return absolute[..., :count], absolute[..., count:]


def _plane(vectors: Any) -> np.ndarray:
    return np.stack([vectors.real, vectors.imag], axis=-1)


def _cross(left: Any, right: Any) -> Any:
    return (np.conj(left) * right).imag


def body_poses(chain: Chain, position: ArrayLike) -> BodyPoses:
    """Return where every body is, position (..., joints), rad or m. ValueError: bad shape, non-finite value."""
    motion = _Motion(chain, *joint_rows(chain, position=position))
    return BodyPoses(_plane(motion.point), motion.angle, _plane(motion.center()[0]))


def body_velocities(chain: Chain, position: ArrayLike, velocity: ArrayLike) -> BodyPoses:
    """Return the rates of body_poses, m/s and rad/s (5.83). ValueError: bad shape, non-finite value."""
    motion = _Motion(chain, *joint_rows(chain, position=position, velocity=velocity))
    return BodyPoses(_plane(motion.velocity), motion.rate, _plane(motion.center()[1]))


def jacobian(chain: Chain, position: ArrayLike, body: str, point: ArrayLike = (0.0, 0.0)) -> np.ndarray:
    """
    Return d (x, y, angle) / d joint positions of a point that moves with a body, (..., 3, joints).

    `point` [x, y], m, in the body's own frame; the default is its joint point. ValueError: no such body, bad shape,
    non-finite value.
    """
    position, = joint_rows(chain, position=position)
    index = index_of(chain, body)
    place = plane_vector('point', point)
    motion = _Motion(chain, position)
    reached = motion.point[..., index] + place * motion.turn[..., index]
    found = np.zeros((*position.shape[:-1], 3, chain.joint_count))
    columns = {joint.name: column for column, joint in enumerate(chain.joints)}
    while index != BASE:
        own = chain.bodies[index]
        if own.rotation is not None:   # turns all that is outboard about the joint point
            moved = 1j * own.rotation.axis * (reached - motion.point[..., index])
            column = columns[own.rotation.name]
            found[..., 0, column], found[..., 1, column] = moved.real, moved.imag
            found[..., 2, column] = own.rotation.axis
        if own.slide is not None:
            moved, column = motion.axis[..., index], columns[own.slide.name]
            found[..., 0, column], found[..., 1, column] = moved.real, moved.imag
        index = own.carrier
    return found


def center_of_mass(chain: Chain, position: ArrayLike) -> np.ndarray:
    """Return the mass centre of the whole chain, (..., 2), m. ValueError: bad shape, non-finite value."""
    motion = _Motion(chain, *joint_rows(chain, position=position))
    mass = np.array([body.mass for body in chain.bodies])
    return _plane(motion.center()[0] @ mass / mass.sum())


def momentum(chain: Chain, position: ArrayLike, velocity: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """
    Return linear momentum of the bodies, (..., 2), kg m/s, and angular about the origin of the base, (...,), kg m^2/s.

    The rotors that `armature` describes are not included. ValueError: bad shape, non-finite value.
    """
    motion = _Motion(chain, *joint_rows(chain, position=position, velocity=velocity))
    mass, inertia = (np.array([getattr(body, name) for body in chain.bodies]) for name in ('mass', 'inertia_com'))
    place, rate, _ = motion.center()
    return _plane(rate @ mass), _cross(place, rate) @ mass + motion.rate @ inertia


def reaction_forces(chain: Chain, position: ArrayLike, velocity: ArrayLike, effort: ArrayLike) -> np.ndarray:
    """
    Return the load of each carrier on its body at the joint point: force x, y, N, moment, N m, (..., bodies, 3).

    It is in the plane's axes and includes actuator, spring, damper and friction. Accelerations are forward_dynamics'
    (Newton and Euler, from the leaves to the root, equations.md 6.1). ValueError: bad shape, non-finite value.
    SimulationError: singular configuration.
    """
    position, velocity, effort = joint_rows(chain, position=position, velocity=velocity, effort=effort)
    acceleration = forward_dynamics(chain, position, velocity, effort)
    motion = _Motion(chain, position, velocity, acceleration)
    gained = motion.center()[2] - chain.gravity
    force = np.array([body.mass for body in chain.bodies]) * gained
    moment = np.array([body.inertia_com for body in chain.bodies]) * motion.spin + _cross(motion.arm, force)
    for i in reversed(range(len(chain.bodies))):
        w = chain.bodies[i].carrier
        if w != BASE:
            force[..., w] += force[..., i]
            moment[..., w] += moment[..., i] + _cross(motion.point[..., i] - motion.point[..., w], force[..., i])
    return np.concatenate([_plane(force), moment[..., None]], axis=-1)
