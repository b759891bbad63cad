"""
EVENTS: the events of a run, one row per kind. Node, OfflineLog, resimulation and documents use this table.

An event is {"tick", "kind", "data"}: JSON in a std_msgs/msg/String, on `~/events` and in the log. An event that changes
the run acts on the state at its tick, before the motion to the next. Its data loses no bit and is all that it needs.
`python -m planar_chain_sim.recording.events` prints the table for the documentation.
"""
from __future__ import annotations

import json
from math import inf
import re
from typing import Callable, Mapping, NamedTuple, Optional

from .cdr import CdrError, decode_string, encode_string
from .._kernel import json_list
from ..chain.joint_arrays import initial_state
from ..chain.quantities import changed_chain, QUANTITIES
from ..errors import SimulationError
from ..motion.simulation import JointEvent, Simulation

BOTH, NODE, OFFLINE = 'simulator, rollout', 'simulator', 'OfflineLog'   # who publishes or logs a kind


class Kind(NamedTuple):
    """
    One kind of event: who publishes or logs it, the keys of its data, one sentence of meaning.

    `apply`: changes a simulation at its present tick by this data, ValueError if that is impossible; None for a kind
    that does not change the simulation. `defaults`: for keys that may be missing. `idle`: data that changes nothing as
    long as nothing of this kind acts; then there is no event, nor for data that acts already. The key `effort` has the
    efforts (joints,), N m or N, that act from this tick on, or None if they stay the same.
    """

    by: str
    keys: tuple
    meaning: str
    apply: Optional[Callable[[Simulation, dict], None]] = None
    defaults: Mapping = {}
    idle: Optional[Mapping] = None

    @property
    def changes_run(self) -> bool:
        """Whether resimulation must apply it."""
        return self.apply is not None or 'effort' in self.keys


def _reset(simulation: Simulation, data: dict) -> None:
    simulation.set_state(*initial_state(simulation.chain))
    simulation.clear_wrenches()


def _set_parameter(simulation: Simulation, data: dict) -> None:
    """Set the values of a quantity; other parameters of the node do not change the motion."""
    if data['name'] in list(QUANTITIES):
        values = data['value']
        if not isinstance(values, list) or not all(each is None or isinstance(each, (int, float)) for each in values):
            raise ValueError(f'{data["name"]!r} is {values!r:.80}, must be a list of numbers')
        values = [inf if value is None else value for value in values]
        simulation.replace_chain(changed_chain(simulation.chain, data['name'], values))


def _set_payload(simulation: Simulation, data: dict) -> None:
    """Attach a payload in place of the one of that name; with a mass of 0, only remove that one."""
    before, name = simulation.checkpoint(), data['name']
    if name in simulation.payloads:
        simulation.drop(name)
    try:
        if data['mass']:
            simulation.attach(data['body'], data['mass'], data['position'], data['inertia_com'], name)
    except ValueError:
        simulation.restore(before)
        raise


# Kinds in the bytes of events as they are written here, and their seconds.
KIND = re.compile(rb'"kind": "(\w+)", "data": {(?:"seconds": (\d+(?:\.\d+)?(?:e[-+]\d+)?))?')

WRENCH = ('body', 'force', 'moment', 'axes')
END = ('message', 'reason', 'joint', 'body', 'time', 'position', 'velocity')
AT_JOINT = ('joint', 'time', 'speed')

EVENTS = {
    'command': Kind(BOTH, ('topic', 'effort'), "A command on `topic` ('' in a log of rollout) changed the efforts."),
    'reset': Kind(BOTH, (), 'The initial state is back, efforts and wrenches are zero, parameters and payloads stay.',
                  apply=_reset),
    'state': Kind(OFFLINE, ('position', 'velocity'), 'Joint positions and velocities were set.',
                  apply=lambda simulation, data: simulation.set_state(data['position'], data['velocity'])),
    'parameter': Kind(BOTH, ('name', 'value'), 'A parameter was set; null in a list is no limit.',
                      apply=_set_parameter),
    'payload': Kind(BOTH, ('name', 'body', 'mass', 'position', 'inertia_com', 'plan'),
                    'A payload was attached to `body` in place of the one of that name; a mass of 0 removes it. '
                    '`plan` is how the chain is solved from now on.',
                    apply=_set_payload, defaults={'inertia_com': 0.0, 'plan': ''}),
    'wrench': Kind(BOTH, WRENCH, "A wrench acts on `body` until the next one; `axes` is 'body' or 'world'.",
                   apply=lambda simulation, data: simulation.set_wrench(**{key: data[key] for key in WRENCH}),
                   defaults={'force': [0.0, 0.0], 'moment': 0.0, 'axes': 'body'},
                   idle={'force': [0.0, 0.0], 'moment': 0.0}),
    'pause': Kind(NODE, (), 'Time stands still.'),
    'resume': Kind(NODE, (), 'Time goes on.'),
    'step': Kind(NODE, (), 'One tick was made while paused.'),
    'rejected': Kind(NODE, ('topic', 'reason', 'count'), '`count` messages were refused as a whole.'),
    'ignored': Kind(NODE, ('topic', 'reason', 'message', 'count'),
                    'A message, or a part of it, has no effect; `count` is for this reason since the start.'),
    'controller_loss': Kind(NODE, ('effort',), 'The last publisher of commands has gone, efforts are zero.'),
    'command_timeout': Kind(NODE, ('joints', 'seconds', 'effort'),
                            'No command for `joints` in this time: their efforts are zero (null: lockstep waits).'),
    'dropped_time': Kind(NODE, ('seconds',), 'The machine could not keep up; this wall time is not caught up with.'),
    'held_up': Kind(NODE, ('seconds',), 'The middleware blocked publishing; the node catches up with that.'),
    'divergence': Kind(BOTH, END, 'The state ran away; the motion ended at this last good state.'),
    'stopped': Kind(BOTH, END, 'The motion cannot go on for this `reason`; it ended at this last good state.'),
    'stop_touched': Kind(BOTH, AT_JOINT, 'A joint met its stop at `time`, s, with this speed.'),
    'stop_left': Kind(BOTH, AT_JOINT, 'A joint left its stop.'),
    'stuck': Kind(BOTH, AT_JOINT, 'Dry friction brought a joint to rest.'),
    'slipped': Kind(BOTH, AT_JOINT, 'A joint that friction held began to move.'),
    'log_failure': Kind(NODE, ('message',), 'The log cannot be written, or others have moved or damaged its file.'),
}


def encode_event(tick: int, kind: str, data: dict) -> bytes:
    """Return an event as std_msgs/msg/String (CDR); ValueError: the keys of its data are not those of its row."""
    keys = EVENTS[kind].keys
    if data.keys() != frozenset(keys):
        raise ValueError(f'the event {kind!r} has the data {", ".join(data)}, must have {", ".join(keys) or "none"}')
    return encode_string(json.dumps({'tick': tick, 'kind': kind, 'data': {key: data[key] for key in keys}}))


def encode_command(tick: int, topic: str, effort) -> bytes:
    """
    Return the event 'command' of efforts (joints,), float64: the same as encode_event, in a tenth of the time.

    It may come once a tick. The kernel's plain_command writes the same bytes.
    """
    return encode_string('{"tick": %d, "kind": "command", "data": {"topic": "%s", "effort": %s}}'
                         % (tick, topic, json_list(effort)))


def encode_joint_event(event: JointEvent) -> bytes:
    """Return the event of a stop touched or left, of a joint stuck or slipped, as std_msgs/msg/String (CDR)."""
    return encode_event(event.tick, event.kind, {'joint': event.joint, 'time': event.time, 'speed': event.speed})


def end_event(error: SimulationError) -> tuple[str, dict]:
    """Return kind and data of the event that ends a motion: a divergence where the state ran away, else 'stopped'."""
    return 'divergence' if error.ran_away else 'stopped', {
        'message': str(error), 'reason': error.reason, 'joint': error.joint, 'body': error.body, 'time': error.time,
        'position': error.position.tolist(), 'velocity': error.velocity.tolist()}


def decode_event(data: bytes) -> dict:
    """Return the event of a message (CDR), {'tick': int, 'kind': str, 'data': dict}; ValueError: it is none."""
    try:
        # A number too long for a double is not finite; as an int it would be an error of another kind.
        event = json.loads(decode_string(data), parse_int=lambda text: int(text) if len(text) < 20 else inf)
    except (CdrError, RecursionError) as error:
        raise ValueError(str(error)) from None
    if not isinstance(event, dict) or type(event.get('tick')) is not int or not isinstance(
            event.get('kind'), str) or not isinstance(event.get('data'), dict):
        raise ValueError('it is no event, which has a tick, a kind and data')
    return event


def apply_event(simulation: Simulation, kind: str, data: dict) -> None:
    """Apply an event of a kind with `apply` at the present tick; ValueError: that is impossible, nothing is changed."""
    row = EVENTS[kind]
    data = {**row.defaults, **data}
    for key in row.keys:
        if key not in data:
            raise ValueError(f'the event {kind!r} lacks {key!r}, must have {", ".join(row.keys) or "no data"}')
    assert row.apply is not None, kind
    row.apply(simulation, data)


def table() -> str:
    """Return EVENTS as a Markdown table."""
    lines = ['| kind | data | written by | changes the run | meaning |', '|---|---|---|---|---|']
    for name, kind in EVENTS.items():
        data = ', '.join(f'`{key}`' for key in kind.keys)
        lines.append(f'| `{name}` | {data} | {kind.by} | {"yes" if kind.changes_run else ""} | {kind.meaning} |')
    return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    print(table(), end='')
