"""
The node's parameters, one row each: name, default, description, unit, range, and whether it can change at run time.

Rows with an `of_chain` take their default from the chain and are declared when it has been loaded. Nothing here needs
ROS, so --help works without it; declaration.py makes ROS parameters from the rows.
"""
from __future__ import annotations

from array import array
from math import inf
import re
import textwrap
from typing import Any, Callable, Iterator, NamedTuple, Optional, Union

from ..chain.quantities import changed_chain, QUANTITIES
from ..errors import Mistake
from ..motion.integrators import LEAST_TOLERANCE, METHODS

Value = Any   # bool, float, str or a list, as the default of the parameter
NUMBERS, TEXTS = 'DOUBLE_ARRAY', 'STRING_ARRAY'   # types are named as in rclpy.parameter.Parameter.Type
TYPES = {bool: 'BOOL', float: 'DOUBLE', str: 'STRING', list: TEXTS}
WANTED = {'BOOL': 'true or false', 'DOUBLE': 'a number', 'STRING': 'a string', NUMBERS: 'a list of numbers',
          TEXTS: 'a list of strings'}
TINY = re.compile(r'[-+]?\d+\.?\d*[eE][-+]?\d+')   # beyond 1e-308 and 1e308 ROS takes a number for a text
FARTHEST = 1e6   # m; the inertia of a payload farther out would make all other inertias vanish in rounding


class Row(NamedTuple):
    """
    A parameter; its type is that of its default.

    A list that depends on the chain has `of_chain`: (type, default by the chain); its `default` is then only a
    description.

    `limits`: least and greatest number, of each number of a list; `smallest`: least number but 0. `choices`: of a text.
    `live`: may be set while the node runs.
    """

    name: str
    default: Value
    description: str
    limits: Optional[tuple[float, float]] = None
    choices: tuple[str, ...] = ()
    live: bool = False
    of_chain: Optional[tuple[str, Callable]] = None
    unit: str = ''
    smallest: float = 0.0

    @property
    def type(self) -> str:
        """Return the name of the type that ROS knows the parameter by."""
        return self.of_chain[0] if self.of_chain else TYPES[type(self.default)]

    @property
    def range(self) -> str:
        """Return in words what `limits` and `smallest` allow."""
        least, greatest = self.limits or (-inf, inf)
        return f'{f"0 or from {self.smallest:g}" if self.smallest else f"from {least:g}"} to {greatest:g}'


PARAMETERS = (
    Row('chain_file', 'four_link_robot.yaml',
        'Chain to simulate (YAML, or URDF or MJCF of a planar robot); a relative path is looked for in the working '
        "directory, then in the package. With 'robot_description' the node waits for the URDF on that topic."),
    Row('hold', [], "Joints to weld: 'joint' at its initial position, 'joint=value' at the value (rad or m)."),
    Row('method', 'auto', "Integration method, or 'auto'.", choices=('auto', *METHODS)),
    Row('rate', 1000.0, 'Ticks per simulated second. Commands act at ticks, and each tick is logged.', (1.0, 1e5),
        unit='Hz'),
    Row('tolerance', 0.0, 'Bound of the estimated local error per step of an adaptive method, relative to '
        'max(1, |value|). 0 means 1e-9; a method of fixed step needs 0.', (0.0, 1.0),
        smallest=LEAST_TOLERANCE),
    Row('publish_rate', 0.0, 'States published per simulated second; must be rate divided by a whole number. 0 means '
        'rate.', (0.0, 1e5), unit='Hz', smallest=1e-3),
    # At 1e-6 and 1 Hz a tick takes 11 days.
    Row('real_time_factor', 1.0, 'Simulated seconds per second of wall time; 0: as fast as possible.', (0.0, 1e3),
        live=True, unit='s/s', smallest=1e-6),
    Row('start_paused', False, 'Start paused, so that nothing moves before a controller is there.'),
    Row('lockstep', False, 'Publish a state, then wait until every joint of lockstep_joints has a command for it.'),
    Row('command_timeout', 0.0, 'Simulated time without a new command after which a joint gets zero effort; 0: never. '
        'In lockstep: wall time after which missing commands are reported; 0: 1 s.', (0.0, 1e6), live=True, unit='s'),
    Row('on_controller_loss', 'zero', "Efforts when the last publisher of commands has gone: 'zero' or 'hold'.",
        choices=('zero', 'hold'), live=True),
    Row('payload_mass', 0.0, 'Mass of the payload that payload_body carries; 0: none.', (0.0, 1e9), live=True,
        unit='kg', smallest=1e-12),
    Row('payload_body', '', 'Body that carries the payload; empty: the last one of the chain.'),
    Row('payload_position', '[0.0, 0.0]', 'Mass centre of the payload, [x, y] in the frame of that body.',
        (-FARTHEST, FARTHEST), of_chain=(NUMBERS, lambda chain: [0.0, 0.0]), unit='m'),
    Row('publish_clock', False, 'Publish simulated time on /clock and stamp states with it.'),
    Row('publish_markers', False, 'Publish the bodies on ~/markers, 30 times a second at most.'),
    Row('publish_tf', False, 'Publish the frames of all links on /tf and /tf_static, 50 times a second at most, when '
        'no robot_state_publisher runs.'),
    Row('publish_robot_description', True, "Publish the chain's URDF on robot_description."),
    Row('frame_id', '', 'header.frame_id of joint states and markers. Markers are drawn in that frame: world (the '
        'plane stands upright), base_link (the plane is x-y) or a body; empty: world, for markers only.'),
    Row('record', '', 'MCAP log to write, a new file; empty: no log.'),
    Row('record_flush_period', 0.5, 'Longest part of the log that is lost when the process is killed.', (0.01, 3600.0),
        unit='s'),
    Row('record_tf', False, "Record the chain's URDF and, 60 times a simulated second at most, the frames of its links "
        'too: Foxglove then draws the arm from the log alone.'),
    Row('on_log_failure', 'go_on', 'What to do when the log cannot be written, as on a full disk: report it and go on, '
        'or stop with exit code 2.', choices=('go_on', 'stop')),
    Row('record_compression', 'none', 'Compression of the log.', choices=('none', 'lz4', 'zstd')),
    Row('lockstep_joints', 'all joints', 'Joints whose commands lockstep waits for; an empty list means all.',
        of_chain=(TEXTS, lambda chain: list(chain.joint_names))),
    Row('commanded_joints', '[]', 'For a JointState with fewer efforts than names: the joints that its efforts are '
        'for, in order. With an empty list such a message is rejected.', of_chain=(TEXTS, lambda chain: [])),
    *(Row(name, "the chain's", f'{name.replace("_", " ").capitalize()}: {quantity.unit.partition(", ")[2]}.', live=True,
          unit=quantity.unit.partition(', ')[0], of_chain=(NUMBERS, quantity.get))
      for name, quantity in QUANTITIES.items()),
)
ROWS = {row.name: row for row in PARAMETERS}
NEEDED = {'lockstep_joints': 'lockstep', 'record_compression': 'record', 'record_flush_period': 'record',
          'record_tf': 'record',
          'on_log_failure': 'record'}   # what has no effect without what


def parameter_table(rows=PARAMETERS, width: int = 80) -> str:
    """Return the parameters as a text of at most `width` columns: name, default, live or not, unit; the meaning."""
    cells = [('parameter', 'default', 'live', 'unit')]
    for row in rows:
        default = str(row.default)
        default = default.lower() if row.type == 'BOOL' else default or "''"
        cells.append((row.name, default, 'yes' if row.live else 'no', row.unit))
    names, defaults = (max(len(cell[column]) for cell in cells) + 2 for column in (0, 1))
    lines = []
    for row, (name, default, live, unit) in zip((None, *rows), cells):
        lines.append(f'{name:{names}}{default:{defaults}}{live:6}{unit}'.rstrip())
        if row:
            meaning = row.description
            meaning += f' Range: {row.range}.' if row.limits else ''
            meaning += f' Choices: {", ".join(row.choices)}.' if row.choices else ''
            lines += textwrap.wrap(meaning, width, initial_indent='    ', subsequent_indent='    ')
    return '\n'.join(lines)


def checked(row: Row, value) -> Value:
    """Return the value in the row's type, an integer as a float where a number is meant; Mistake: another type."""
    if row.type == 'DOUBLE' and (type(value) is int or isinstance(value, str) and TINY.fullmatch(value)):
        value = _number(row, value)
    if type(row.default) is list and (value is None or type(value) is str):   # ROS gives an empty list no type
        value = [value] if value else []
    if row.type in (NUMBERS, TEXTS) and isinstance(value, (list, tuple, array)):
        kinds = {type(item) for item in value}
        if row.type == NUMBERS and kinds <= {int, float}:
            values = [_number(row, item) for item in value]
            for item in values if row.limits else ():
                _refuse_outside(row, item, values)
            return values
        if row.type == TEXTS and kinds <= {str}:
            return list(value)
    if row.of_chain or row.type == TEXTS or type(value) is not type(row.default):
        shown = list(value) if isinstance(value, array) else value
        got = 'is an empty list' if value is None else f'is {shown!r:.80}'   # which ROS can give no type
        raise Mistake(f'parameter {row.name!r} {got}, must be {WANTED[row.type]}')
    if row.limits:
        _refuse_outside(row, value, value)
    if row.choices and value not in row.choices:
        raise Mistake(f'parameter {row.name!r} is {value!r:.80}, must be one of {", ".join(map(repr, row.choices))}')
    if row.type == 'STRING' and '\0' in str(value):
        raise Mistake(f'parameter {row.name!r} is {value!r:.80}, must be a string without NUL')
    return value


def numbers_of(text: str) -> Optional[list]:
    """Return the numbers of a text like '[0, -1.62]', None where it is none."""
    inside = re.fullmatch(r'\s*\[(.*)\]\s*', text)
    try:
        return [float(part.strip().replace('.inf', 'inf')) for part in inside.group(1).split(',')] if inside else None
    except ValueError:
        return None


def check_quantity(chain, name: str, values) -> None:
    """Raise Mistake for values of a quantity that the chain cannot have."""
    try:
        changed_chain(chain, name, values)
    except ValueError as error:
        raise Mistake(f'parameter {error}') from None


def check_together(values: dict[str, Value]) -> None:
    """Raise Mistake for values that do not go together; replace a `publish_rate` of 0 by `rate`."""
    if values['tolerance'] == 1.0:
        raise Mistake("parameter 'tolerance' is 1.0, must be below 1")
    if not values['chain_file']:
        raise Mistake("parameter 'chain_file' is '', must be a chain file")
    method = values['method']
    if values['tolerance'] and method != 'auto' and not METHODS[method].adaptive:
        raise Mistake(f"parameter 'tolerance' is {values['tolerance']}, must be 0: method {method!r} has a fixed step")
    values['publish_rate'] = values['publish_rate'] or values['rate']
    ticks = values['rate'] / values['publish_rate']
    if ticks < 0.5 or abs(ticks - round(ticks)) > 1e-9 * ticks:
        raise Mistake(f"parameter 'publish_rate' is {values['publish_rate']}, must be 0 or `rate` "
                      f"({values['rate']}) divided by a whole number")


def idle(given: dict[str, Value], values: dict[str, Value]) -> Iterator[str]:
    """Yield a sentence for each given parameter that has no effect with these values of the others."""
    for name, needed in NEEDED.items():
        if given.get(name) and not values[needed]:
            yield f'parameter {name!r} has no effect without {needed!r}'


def check_for_chain(chain, given: dict[str, Value]) -> dict[str, Value]:
    """
    Return the given values of rows whose default comes from the chain, checked against the chain; Mistake.

    `given`: these, and `payload_body`. An empty list stands for the default. The result always has `lockstep_joints`,
    `commanded_joints`, `payload_body` and `payload_position`.
    """
    values = {}
    for row in PARAMETERS:
        if row.of_chain and row.name in given:
            value = [] if given[row.name] is None else checked(row, given[row.name])
            if value:
                values[row.name] = value
                if row.name in QUANTITIES:
                    check_quantity(chain, row.name, value)
    joints = values.setdefault('lockstep_joints', list(chain.joint_names))
    for name in joints:
        if name not in chain.joint_names:
            raise Mistake(f"parameter 'lockstep_joints' names {name!r}, must name joints of the chain: "
                          f'{", ".join(chain.joint_names[:32])}')
    commanded = values.setdefault('commanded_joints', [])
    if len(set(commanded)) < len(commanded):
        raise Mistake(f"parameter 'commanded_joints' is {commanded}, must name each joint once")
    bodies = [body.name for body in chain.bodies]
    values['payload_body'] = given['payload_body'] or bodies[-1]
    if values['payload_body'] not in bodies:
        raise Mistake(f"parameter 'payload_body' is {values['payload_body']!r}, must be a body of the chain: "
                      f'{", ".join(bodies[:32])}')
    place = values.setdefault('payload_position', [0.0, 0.0])
    if len(place) != 2:
        raise Mistake(f"parameter 'payload_position' is {place}, must be two numbers, [x, y]")
    return values


def _number(row: Row, value: Union[int, float, str]) -> float:
    try:
        return float(value)
    except OverflowError:
        raise Mistake(f'parameter {row.name!r} is {value!r:.80}, must be a number up to 1e308') from None


def _refuse_outside(row: Row, number: Any, shown: Value) -> None:
    numbers = 'numbers ' if isinstance(shown, list) else ''
    least, greatest = row.limits or (-inf, inf)
    if not least <= number <= greatest:
        raise Mistake(f'parameter {row.name!r} is {shown}, must be {numbers}from {least:g} to {greatest:g}')
    if 0.0 < number < row.smallest:
        raise Mistake(f'parameter {row.name!r} is {shown}, must be 0 or at least {row.smallest:g}')
