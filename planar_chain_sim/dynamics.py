"""Forward and inverse dynamics, mass matrix and energy of a chain at one state: asked of the kernel, refused here."""
from __future__ import annotations

import numpy as np

from . import _kernel, equations_of_motion
from .chain import Chain
from .plan import plan_of

FORMS = ('reference', 'dense', 'recursive', 'auto')


class SimulationError(RuntimeError):
    """
    A state that ran away or met a singular configuration: one sentence, and where it stopped.

    `time` s, `tick`, `joint` and `body` (names), `position` and `velocity` (joints,): the last good state.
    `time` and `tick` are None where there is no simulation.
    """

    def __init__(self, message, *, joint=None, body=None, time=None, tick=None, position=None, velocity=None):
        super().__init__(message)
        self.joint, self.body, self.time, self.tick = joint, body, time, tick
        self.position, self.velocity = position, velocity


def joint_array(name: str, values, shape: tuple) -> np.ndarray:
    """`values` as finite C-ordered float64 of the wanted shape; ValueError names argument, got and wanted."""
    return _kernel.finite_array(name, values, shape)


def resolve_form(chain: Chain, form: str) -> str:
    """`form`, with what the chain's shape makes of 'auto'; ValueError names the forms there are."""
    if form not in FORMS:
        raise ValueError(f'form is {form!r}, must be one of {", ".join(map(repr, FORMS))}')
    return plan_of(chain).form if form == 'auto' else form


def no_acceleration(chain: Chain, joint: int, why: str, position, velocity) -> SimulationError:
    """Return the error that names this joint, with the state as arrays."""
    shape, name = (chain.joint_count,), chain.joint_names[joint]
    body = chain.body_of(name)
    return SimulationError(f"joint '{name}' of body '{body}' of {chain.name}: {why}", joint=name, body=body,
                           position=joint_array('position', position, shape),
                           velocity=joint_array('velocity', velocity, shape))


def forward_dynamics(chain: Chain, position, velocity, effort, form: str = 'auto') -> np.ndarray:
    """
    Joint accelerations (joints,), rad/s^2 or m/s^2, under joint efforts in N m or N.

    Gravity, damping, springs and the friction of moving joints act; the effort is not clamped and stops are not known.
    `form`: 'recursive', O(n) elimination by equations.md 6.2 and 6.3; 'dense', the mass matrix of equations.md 3,
    O(n^3); 'reference', (5.87) and (5.88) as matrices in NumPy; 'auto', what suits the chain's shape: the plan says.
    ValueError: bad shape, non-finite value, unknown form. SimulationError: singular configuration, names the joint.
    """
    plan = plan_of(chain)
    if form == 'auto':
        dense = plan.dense
    else:
        dense = resolve_form(chain, form) == 'dense'
    acceleration, joint = plan.model.forward_dynamics(position, velocity, effort, dense)
    if joint >= 0:
        raise no_acceleration(chain, joint, 'the configuration is singular', position, velocity)
    if form == 'reference':
        acceleration = equations_of_motion.forward_dynamics(chain, *(
            joint_array('', values, acceleration.shape) for values in (position, velocity, effort)))
        joint = -1 if np.isfinite(acceleration).all() else -2 - int(np.argmin(np.isfinite(acceleration)))
    if joint < -1:
        raise no_acceleration(chain, -2 - joint, 'the acceleration is not finite', position, velocity)
    return acceleration


def inverse_dynamics(chain: Chain, position, velocity, acceleration) -> np.ndarray:
    """
    Efforts (joints,), N m or N, for these accelerations: the exact inverse of forward_dynamics (equations.md 6.1).

    ValueError: bad shape or non-finite value.
    """
    return plan_of(chain).model.inverse_dynamics(position, velocity, acceleration)


def mass_matrix(chain: Chain, position) -> np.ndarray:
    """H (joints, joints) in joint coordinates, armature included; columns by equations.md 6.1. ValueError as above."""
    return plan_of(chain).model.mass_matrix(position)


def energy(chain: Chain, position, velocity) -> tuple[float, float]:
    """Energies T with armature, V = -sum m g . r + springs, in J (equations.md 6.1). ValueError as above."""
    plan = plan_of(chain)
    kinetic, potential = plan.model.energy(position, velocity)
    return kinetic, potential + plan.grounded_energy
