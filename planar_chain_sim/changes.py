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
    if data['name'] in list(QUANTITIES):
        values = data['value']
        if not isinstance(values, list) or not all(each is None or isinstance(each, (int, float)) for each in values):
            raise ValueError(f'{data["name"]!r} is {values!r:.80}, must be a list of numbers')
        values = [inf if value is None else value for value in values]
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


WRENCH = ('body', 'force', 'moment', 'axes')   # of the data; force: [x, y]
CHANGES = {
    'reset': _reset,              # initial state of the chain file, zero efforts and wrenches; the rest stays
    'parameter': _set_parameter,
    'wrench': lambda simulation, data: simulation.set_wrench(**{key: data[key] for key in WRENCH if key in data}),
    'payload': _put_payload,
}
NEEDED = {   # of the data
    'reset': (),
    'parameter': ('name', 'value'),
    'wrench': WRENCH[:1],
    'payload': ('name', 'body', 'mass', 'position', 'inertia_com'),
}


def apply_change(simulation: Simulation, kind: str, data: dict) -> None:
    """Let a change act at the simulation's present tick; ValueError where it can't, and nothing is changed then."""
    for key in NEEDED[kind]:
        if key not in data:
            raise ValueError(f'the change {kind!r} lacks {key!r}, must have {", ".join(NEEDED[kind])}')
    CHANGES[kind](simulation, data)
