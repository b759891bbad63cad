"""
CHANGES: what may change a run at a tick besides its efforts, one row per kind; `resimulate` and the node share them.

A change is an event of the log, {"tick", "kind", "data"}: it acts on the state at that tick, before the motion to the
next. Its data is JSON that loses no bit, and all that the change needs.
"""
from __future__ import annotations

from math import inf

from .quantities import changed_chain, QUANTITIES
from .simulation import initial_state, Simulation


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
