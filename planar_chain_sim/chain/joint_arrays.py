"""Arrays with a number for each joint: checked, of the chain's initial state, and within its stops."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .tree import Tree
from .. import _kernel

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def joint_array(name: str, values: ArrayLike, shape: tuple) -> np.ndarray:
    """`values` as finite C-ordered float64 of the wanted shape; ValueError names argument, got and wanted."""
    return _kernel.finite_array(name, values, shape)


def initial_state(chain: Tree) -> tuple[np.ndarray, np.ndarray]:
    """`position` and `velocity` of the chain file, (joints,) each."""
    return (np.array([joint.position for joint in chain.joints], dtype=np.float64),
            np.array([joint.velocity for joint in chain.joints], dtype=np.float64))


def beyond_stop(chain: Tree, index: int, position: float) -> ValueError:
    """Return the error that names a joint and a position of it beyond one of its stops."""
    joint = chain.joints[index]
    return ValueError(f"position of joint '{joint.name}' of {chain.name} is {float(position)!r}, must lie "
                      f'between its stops, {joint.lower!r} and {joint.upper!r}')


def refuse_beyond_stops(chain: Tree, position: np.ndarray) -> None:
    """Raise ValueError that names the first joint of positions (..., joints) that lies beyond one of its stops."""
    for index, joint in enumerate(chain.joints):
        beyond = position[..., index][(position[..., index] < joint.lower) | (position[..., index] > joint.upper)]
        if beyond.size:
            raise beyond_stop(chain, index, beyond.flat[0])
