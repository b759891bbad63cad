"""Forward and inverse dynamics, mass matrix and energy of a chain at one state, computed by the kernel."""
from __future__ import annotations

from functools import partial
from typing import Any, TYPE_CHECKING

import numpy as np

from . import equations_of_motion
from .plan import plan_of
from .. import _kernel
from ..chain.chain import Chain
from ..chain.joint_arrays import joint_array
from ..errors import SimulationError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

FORMS = ('reference', 'dense', 'recursive', 'auto')

_GOOD, _SINGULAR, _NOT_FINITE = map(_kernel.OUTCOMES.index, ('good', 'singular', 'not_finite'))
_WHY_NOT = {_SINGULAR: 'the configuration is singular', _NOT_FINITE: 'the acceleration is not finite'}


def resolve_form(chain: Chain, form: str) -> str:
    """Return `form`, 'auto' resolved by the chain's shape; ValueError names the forms."""
    if form not in FORMS:
        raise ValueError(f'form is {form!r}, must be one of {", ".join(map(repr, FORMS))}')
    return plan_of(chain).form if form == 'auto' else form


def no_acceleration(chain: Chain, joint: int, why: str, position: ArrayLike, velocity: ArrayLike) -> SimulationError:
    """Return the error that names this joint, with the state as arrays."""
    shape, name = (chain.joint_count,), chain.joint_names[joint]
    body = chain.body_of(name)
    return SimulationError(f"joint '{name}' of body '{body}' of {chain.name}: {why}", joint=name, body=body,
                           position=joint_array('position', position, shape),
                           velocity=joint_array('velocity', velocity, shape),
                           reason='singular' if 'singular' in why else 'not_finite')


def joint_rows(chain: Chain, **given: Any) -> list[np.ndarray]:
    """Return `given` as finite float64 arrays (..., joints) of one common shape; ValueError names the argument."""
    plan_of(chain)   # which refuses what is none and one that cannot be
    rows = [_kernel.finite_rows(name, values, chain.joint_count) for name, values in given.items()]
    try:
        shape = np.broadcast_shapes(*(row.shape for row in rows))
    except ValueError:
        shapes = ', '.join(f'{name} {row.shape}' for name, row in zip(given, rows))
        raise ValueError(f'the leading axes do not fit: {shapes}') from None
    return [np.broadcast_to(row, shape) for row in rows]


def _for_each(ask: Any, chain: Chain, **given: Any) -> list:
    """
    Return the results of `ask(chain, ...)` for arrays (..., joints), each part with the leading axes.

    Called after the kernel has refused the arrays as a single state, so a single state costs nothing extra.
    ValueError: bad arrays.
    """
    try:
        arrays = joint_rows(chain, **given)
    except ValueError as error:
        raise error from None
    axes = arrays[0].shape[:-1]
    if not all(axes):
        raise ValueError(f'{next(iter(given))} has shape {arrays[0].shape}, must have no axis of length 0')
    answers = [ask(chain, *states) for states in zip(*(array.reshape(-1, chain.joint_count) for array in arrays))]
    parts = zip(*answers) if isinstance(answers[0], tuple) else [answers]
    return [np.array(part).reshape(*axes, *np.shape(part[0])) for part in parts]


def forward_dynamics(chain: Chain, position: ArrayLike, velocity: ArrayLike, effort: ArrayLike,
                     form: str = 'auto') -> np.ndarray:
    """
    Joint accelerations (..., joints), rad/s^2 or m/s^2, under joint efforts in N m or N; leading axes are kept.

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
    try:
        acceleration, outcome, joint = plan.model.forward_dynamics(position, velocity, effort, dense)
    except ValueError:
        return _for_each(partial(forward_dynamics, form=form), chain,
                         position=position, velocity=velocity, effort=effort)[0]
    if form == 'reference' and outcome != _SINGULAR:
        acceleration = equations_of_motion.forward_dynamics(chain, *(
            joint_array('', values, acceleration.shape) for values in (position, velocity, effort)))
        finite = np.isfinite(acceleration)
        outcome, joint = (_GOOD, -1) if finite.all() else (_NOT_FINITE, int(np.argmin(finite)))
    if outcome != _GOOD:
        raise no_acceleration(chain, joint, _WHY_NOT[outcome], position, velocity)
    return acceleration


def inverse_dynamics(chain: Chain, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> np.ndarray:
    """
    Efforts (..., joints), N m or N, for these accelerations: the exact inverse of forward_dynamics (equations.md 6.1).

    Leading axes are kept. ValueError: bad shape or non-finite value.
    """
    try:
        return plan_of(chain).model.inverse_dynamics(position, velocity, acceleration)
    except ValueError:
        return _for_each(inverse_dynamics, chain, position=position, velocity=velocity,
                         acceleration=acceleration)[0]


def mass_matrix(chain: Chain, position: ArrayLike) -> np.ndarray:
    """
    H (..., joints, joints) in joint coordinates, armature included; columns by equations.md 6.1.

    Position (..., joints). ValueError as above.
    """
    try:
        return plan_of(chain).model.mass_matrix(position)
    except ValueError:
        return _for_each(mass_matrix, chain, position=position)[0]


def energy(chain: Chain, position: ArrayLike, velocity: ArrayLike) -> tuple[float, float]:
    """
    Energies T with armature, V = -sum m g . r + springs, in J (equations.md 6.1).

    Floats, or arrays (...,) of states (..., joints). ValueError as above.
    """
    plan = plan_of(chain)
    try:
        kinetic, potential = plan.model.energy(position, velocity)
    except ValueError:
        return tuple(_for_each(energy, chain, position=position, velocity=velocity))
    return kinetic, potential + plan.grounded_energy
