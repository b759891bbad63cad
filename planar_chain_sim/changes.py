"""
CHANGES: what may change a run at a tick besides its efforts, one row per kind; `resimulate` and the node share them.

A change is an event of the log, {"tick", "kind", "data"}: it acts on the state at that tick, before the motion to the
next. Its data is JSON that loses no bit, and all that the change needs.
"""
from __future__ import annotations

from dataclasses import replace
from math import inf, isfinite
from typing import Callable, NamedTuple

from .chain import Chain
from .simulation import initial_state, Simulation


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
        return replace(chain, bodies=bodies)
    return Quantity(unit, lambda chain: [getattr(joint, name) for joint in chain.joints], put, wanted, allowed)


QUANTITIES = {
    'gravity': Quantity('m/s^2, [x, y]', lambda chain: [chain.gravity.real, chain.gravity.imag],
                        lambda chain, values: replace(chain, gravity=complex(*values))),
    'damping': _of_joints('damping', 'N m s/rad or N s/m, in joint order', 'finite numbers >= 0',
                          lambda value: 0.0 <= value < inf),
    'effort_limit': _of_joints('effort_limit', 'N m or N, in joint order; inf is no limit', 'numbers >= 0',
                               lambda value: value >= 0.0),
}


def changed_chain(chain: Chain, name: str, values) -> Chain:
    """
    Return the chain with other values (a list) of a quantity; `source` stays that of the chain it was.

    ValueError: one sentence, for a wrong number of values or one that cannot be.
    """
    quantity = QUANTITIES[name]
    values, count = list(map(float, values)), len(quantity.get(chain))
    if len(values) != count:
        raise ValueError(f'{name!r} has {len(values)} values, must have {count} ({quantity.unit})')
    for value in values:
        if not quantity.allowed(value):
            raise ValueError(f'{name!r} is {value!r} in one place, must be {quantity.wanted} ({quantity.unit})')
    return quantity.put(chain, values)


def to_json(values) -> list:
    """Return a quantity's values as JSON can carry them: null for an effort without limit."""
    return [None if value == inf else float(value) for value in values]


def _reset(simulation: Simulation, data: dict) -> None:
    simulation.set_state(*initial_state(simulation.chain))
    simulation.clear_wrenches()


def _set_parameter(simulation: Simulation, data: dict) -> None:
    """Put the values of a quantity; other parameters of the node do not touch the motion."""
    if data['name'] in QUANTITIES:
        values = [inf if value is None else value for value in data['value']]
        simulation.replace_chain(changed_chain(simulation.chain, data['name'], values))


def _put_payload(simulation: Simulation, data: dict) -> None:
    """Attach a payload in place of the one of that name; with a mass of 0 there is none from then on."""
    before, name = simulation.checkpoint(), data['name']
    if name in simulation.payloads:
        simulation.drop(name)
    try:
        if data['mass']:
            simulation.attach(data['body'], data['mass'], data['position'], data['inertia_com'], name)
    except ValueError:
        simulation.restore(before)
        raise


CHANGES = {
    'reset': _reset,              # initial state of the chain file, zero efforts and wrenches; the rest stays
    'parameter': _set_parameter,  # {"name", "value"}
    'wrench': lambda simulation, data: simulation.set_wrench(**data),  # {"body", "force": [x, y], "moment", "axes"}
    'payload': _put_payload,      # {"name", "body", "mass", "position": [x, y], "inertia_com"}
}


def apply_change(simulation: Simulation, kind: str, data: dict) -> None:
    """Let a change act at the simulation's present tick; ValueError where it can't, and nothing is changed then."""
    CHANGES[kind](simulation, data)
