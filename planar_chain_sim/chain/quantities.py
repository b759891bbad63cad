"""QUANTITIES: the numbers of a chain that may change while it moves, one row each."""
from __future__ import annotations

from dataclasses import replace
from math import inf, isfinite
from typing import Callable, NamedTuple

from .chain import altered, Chain


class Quantity(NamedTuple):
    """A number of a chain, or one for each joint, that may change while it moves: how to get it and to replace it."""

    unit: str
    get: Callable[[Chain], list]               # -> list of float
    put: Callable[[Chain, list], Chain]
    wanted: str = 'finite numbers'
    allowed: Callable[[float], bool] = isfinite


def _of_joints(name: str, unit: str, wanted: str, allowed: Callable[[float], bool]) -> Quantity:
    """Return the quantity of the joints' attribute `name`, in joint order."""
    def put(chain: Chain, values: list) -> Chain:
        numbers = iter(values)
        bodies = tuple(replace(body, **{
            kind: replace(getattr(body, kind), **{name: next(numbers)})
            for kind in ('slide', 'rotation') if getattr(body, kind) is not None}) for body in chain.bodies)
        return altered(chain, bodies=bodies)
    return Quantity(unit, lambda chain: [getattr(joint, name) for joint in chain.joints], put, wanted, allowed)


QUANTITIES = {
    'gravity': Quantity('m/s^2, [x, y]', lambda chain: [chain.gravity.real, chain.gravity.imag],
                        lambda chain, values: altered(chain, gravity=complex(*values))),
    'damping': _of_joints('damping', 'N m s/rad or N s/m, in joint order', 'finite numbers >= 0',
                          lambda value: 0.0 <= value < inf),
    'effort_limit': _of_joints('effort_limit', 'N m or N, in joint order; inf is no limit', 'numbers >= 0',
                               lambda value: value >= 0.0),
}


def changed_chain(chain: Chain, name: str, values) -> Chain:
    """
    Return the chain with other values (a list) of a quantity.

    ValueError: one sentence, for a wrong number of values or an impossible one.
    """
    quantity = QUANTITIES[name]
    values, count = list(map(float, values)), len(quantity.get(chain))
    if len(values) != count:
        raise ValueError(f'{name!r} has {len(values)} values, must have {count} ({quantity.unit})')
    for value in values:
        if not quantity.allowed(value):
            raise ValueError(f'{name!r} is {value!r} in one place, must be {quantity.wanted} ({quantity.unit})')
    return quantity.put(chain, values)


def same_but_for_quantities(chain: Chain, other: Chain) -> bool:
    """Whether the chains differ at most in values of QUANTITIES."""
    if [body.name for body in chain.bodies] != [body.name for body in other.bodies] or (
            chain.joint_names != other.joint_names):
        return False
    for quantity in QUANTITIES.values():
        other = quantity.put(other, quantity.get(chain))
    return chain == other


def to_json(values) -> list:
    """Return a quantity's values as JSON can carry them: null for an effort without limit."""
    return [None if value is None or value == inf else float(value) for value in values]
