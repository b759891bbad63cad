"""Forward and inverse dynamics, mass matrix and energy of a chain at one state: where arguments are checked."""
from __future__ import annotations

import numpy as np

from . import equations_of_motion
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


class Interrupted(RuntimeError):
    """Simulation.interrupt() ended a call; the simulation is at the last whole tick and can go on from there."""


def joint_array(name: str, values, shape: tuple) -> np.ndarray:
    """`values` as finite, aligned, C-ordered float64 of the wanted shape; ValueError names argument, got and wanted."""
    try:
        array = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f'{name} must be numbers of shape {shape}, got {values!r:.80}') from None
    if array.shape != shape:
        raise ValueError(f'{name} has shape {array.shape}, must have {shape}')
    if not array.flags.aligned:
        array = array.copy()
    if not np.isfinite(array).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f'{name}{list(where)} is {array[where]}, must be finite')
    return array


def resolve_form(chain: Chain, form: str) -> str:
    """`form`, with what the chain's shape makes of 'auto'; ValueError names the forms there are."""
    if form not in FORMS:
        raise ValueError(f'form is {form!r}, must be one of {", ".join(map(repr, FORMS))}')
    return plan_of(chain).form if form == 'auto' else form


def _joint_arrays(chain: Chain, **arrays):
    return [joint_array(name, values, (chain.joint_count,)) for name, values in arrays.items()]


def forward_dynamics(chain: Chain, position, velocity, effort, form: str = 'auto') -> np.ndarray:
    """
    Joint accelerations (joints,), rad/s^2 or m/s^2, under joint efforts in N m or N.

    Gravity, damping, springs and the friction of moving joints act; the effort is not clamped and stops are not known.
    `form`: 'recursive', O(n) elimination by equations.md 6.2 and 6.3; 'dense', the mass matrix of equations.md 3,
    O(n^3); 'reference', (5.87) and (5.88) as matrices in NumPy; 'auto', what suits the chain's shape: the plan says.
    ValueError: bad shape, non-finite value, unknown form. SimulationError: singular configuration, names the joint.
    """
    position, velocity, effort = _joint_arrays(chain, position=position, velocity=velocity, effort=effort)
    form = resolve_form(chain, form)
    acceleration, joint = plan_of(chain).model.forward_dynamics(position, velocity, effort, form == 'dense')
    if joint < 0 and form == 'reference':
        acceleration = equations_of_motion.forward_dynamics(chain, position, velocity, effort)
    if joint >= 0 or not np.isfinite(acceleration).all():
        name = chain.joint_names[joint if joint >= 0 else int(np.argmin(np.isfinite(acceleration)))]
        why = 'the configuration is singular' if joint >= 0 else 'the acceleration is not finite'
        body = chain.body_of(name)
        raise SimulationError(f"joint '{name}' of body '{body}' of {chain.name}: {why}",
                              joint=name, body=body, position=position, velocity=velocity)
    return acceleration


def inverse_dynamics(chain: Chain, position, velocity, acceleration) -> np.ndarray:
    """
    Efforts (joints,), N m or N, for these accelerations: the exact inverse of forward_dynamics (equations.md 6.1).

    ValueError: bad shape or non-finite value.
    """
    arrays = _joint_arrays(chain, position=position, velocity=velocity, acceleration=acceleration)
    return plan_of(chain).model.inverse_dynamics(*arrays)


def mass_matrix(chain: Chain, position) -> np.ndarray:
    """H (joints, joints) in joint coordinates, armature included; columns by equations.md 6.1. ValueError as above."""
    return plan_of(chain).model.mass_matrix(*_joint_arrays(chain, position=position))


def energy(chain: Chain, position, velocity) -> tuple[float, float]:
    """Energies T with armature, V = -sum m g . r + springs, in J (equations.md 6.1). ValueError as above."""
    kinetic, potential = plan_of(chain).model.energy(*_joint_arrays(chain, position=position, velocity=velocity))
    return kinetic, potential + plan_of(chain).grounded_energy
