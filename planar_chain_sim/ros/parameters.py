"""
The node's parameters, one row each: name, default, description, range, and whether a change while running acts.

Rows with an `of_chain` take their default from the chain and are declared when it has been loaded.
"""
from __future__ import annotations

from array import array
from difflib import get_close_matches
from math import isfinite
from typing import Callable, NamedTuple, Optional, Union

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.parameter import Parameter

from ..command_line import Mistake
from ..quantities import changed_chain, QUANTITIES

Value = Union[bool, float, str, list]
NUMBERS, TEXTS = Parameter.Type.DOUBLE_ARRAY, Parameter.Type.STRING_ARRAY
TYPES = {bool: Parameter.Type.BOOL, float: Parameter.Type.DOUBLE, str: Parameter.Type.STRING}
WANTED = {Parameter.Type.BOOL: 'true or false', Parameter.Type.DOUBLE: 'a number', Parameter.Type.STRING: 'a text',
          NUMBERS: 'a list of numbers', TEXTS: 'a list of texts'}


class Row(NamedTuple):
    """
    A parameter; its type is that of its default, or a list, `of_chain`: (type, default by the chain).

    `limits`: least and greatest number. `choices`: of a text. `live`: may be set while the node runs.
    """

    name: str
    default: Optional[Value]
    description: str
    limits: Optional[tuple[float, float]] = None
    choices: tuple[str, ...] = ()
    live: bool = False
    of_chain: Optional[tuple[Parameter.Type, Callable]] = None

    @property
    def type(self) -> Parameter.Type:
        """Return the type that ROS knows the parameter by."""
        return self.of_chain[0] if self.of_chain else TYPES[type(self.default)]


PARAMETERS = (
    Row('chain_file', 'four_link_robot.yaml',
        'Chain to simulate (YAML, or URDF of a planar robot); a relative path is looked for in the working directory, '
        "then in the package; 'robot_description' waits for the URDF on that topic."),
    Row('method', 'auto', "Integration method, or 'auto'."),
    Row('rate', 1000.0, 'Ticks per simulated second, Hz: commands act and states are logged by ticks.', (1.0, 1e5)),
    Row('tolerance', 0.0, 'Bound of the estimated local error per step of an adaptive method, relative to '
        'max(1, |value|); 0 stands for 1e-9, and is a must where the method has a fixed step.', (0.0, 1.0)),
    Row('publish_rate', 0.0, 'States published per simulated second, Hz: rate divided by a whole number; default or 0: '
        'rate.', (0.0, 1e5)),
    Row('real_time_factor', 1.0, 'Simulated seconds per second of wall time; 0: as fast as possible.', (0.0, 1e3),
        live=True),
    Row('start_paused', False, 'Start paused, so that nothing falls before a controller is there.'),
    Row('lockstep', False, 'Publish a state, advance only when every joint of lockstep_joints has a command for it.'),
    Row('command_timeout', 0.0, 'Seconds after which a joint that gets no command any more has zero effort, simulated '
        'time; in lockstep seconds of wall time after which silence is reported; 0: never.', (0.0, 1e6), live=True),
    Row('on_controller_loss', 'zero', "Efforts when the last publisher of commands has gone: 'zero' or 'hold'.",
        choices=('zero', 'hold'), live=True),
    Row('payload_mass', 0.0, 'Mass of the payload that payload_body carries, kg; 0: none.', (0.0, 1e9), live=True),
    Row('payload_body', '', 'Body that carries the payload; empty: the last one of the chain.'),
    Row('payload_position', None, 'Where the payload has its mass centre, m, [x, y] in the frame of that body.',
        of_chain=(NUMBERS, lambda chain: [0.0, 0.0])),
    Row('publish_clock', False, 'Publish simulated time on /clock and stamp states with it.'),
    Row('publish_markers', False, 'Publish the bodies on ~/markers, 30 times a second at most.'),
    Row('frame_id', '', 'header.frame_id of the joint states.'),
    Row('record', '', 'MCAP log to write, a new file; empty: no log.'),
    Row('record_flush_period', 0.5, 'Seconds of log that a killed process can lose at most.', (0.01, 3600.0)),
    Row('record_compression', 'none', 'Compression of the log.', choices=('none', 'lz4', 'zstd')),
    Row('lockstep_joints', None, 'Joints whose commands lockstep waits for; default or empty: all.',
        of_chain=(TEXTS, lambda chain: list(chain.joint_names))),
    *(Row(name, None, f'{name.replace("_", " ").capitalize()}: {quantity.unit}.', live=True,
          of_chain=(NUMBERS, quantity.get)) for name, quantity in QUANTITIES.items()),
)
ROWS = {row.name: row for row in PARAMETERS}


def given_values(node, rows) -> dict[str, Value]:
    """
    Return name -> value of rows, as given or else the default; an integer is taken where a number is meant.

    The node must have declared its overrides itself (automatically_declare_parameters_from_overrides): only so does
    rclpy show them before it fixes their types. Mistake on a value of the wrong type, outside its range or choices.
    """
    given = {name: parameter.value for name, parameter in node.get_parameters_by_prefix('').items()}
    _warn_of_unknown(node, given, [row.name for row in rows])
    return {row.name: _checked(row, given[row.name]) if row.name in given else row.default for row in rows
            if not row.of_chain}


def declare_parameters(node) -> dict[str, Value]:
    """Declare the rows that need no chain and return name -> value; Mistake as given_values()."""
    values = given_values(node, PARAMETERS)
    values['publish_rate'] = values['publish_rate'] or values['rate']
    ticks = values['rate'] / values['publish_rate']
    if ticks < 0.5 or abs(ticks - round(ticks)) > 1e-9 * ticks:
        raise Mistake(f"parameter 'publish_rate' is {values['publish_rate']}, must be 0 or `rate` "
                      f"({values['rate']}) divided by a whole number")
    declare(node, values, ROWS)
    return values


def declare_chain_parameters(node, chain) -> dict[str, Value]:
    """
    Declare the rows whose default is the chain's and return the values that were given; Mistake as above.

    `lockstep_joints`, `payload_body` and `payload_position` are always among them.
    """
    given, values = {}, {}
    for row in PARAMETERS:
        if row.of_chain:
            values[row.name] = row.of_chain[1](chain)
            if node.has_parameter(row.name):
                given[row.name] = _checked(row, node.get_parameter(row.name).value)
                if row.name in QUANTITIES:
                    check_quantity(chain, row.name, given[row.name])
    given['lockstep_joints'] = given.get('lockstep_joints') or values['lockstep_joints']
    for name in given['lockstep_joints']:
        if name not in chain.joint_names:
            raise Mistake(f"parameter 'lockstep_joints' names {name!r}, must name joints of the chain: "
                          f'{", ".join(chain.joint_names[:32])}')
    bodies = [body.name for body in chain.bodies]
    payload_body = node.get_parameter('payload_body').value or bodies[-1]
    if payload_body not in bodies:
        raise Mistake(f"parameter 'payload_body' is {payload_body!r}, must be a body of the chain: "
                      f'{", ".join(bodies[:32])}')
    place = given.setdefault('payload_position', values['payload_position'])
    if len(place) != 2 or not all(map(isfinite, place)):
        raise Mistake(f"parameter 'payload_position' is {place}, must be two finite numbers, [x, y]")
    declare(node, {**values, **given}, ROWS)
    return {**given, 'payload_body': payload_body}


def check_quantity(chain, name: str, values) -> None:
    """Refuse values of a quantity that the chain cannot have; Mistake."""
    try:
        changed_chain(chain, name, values)
    except ValueError as error:
        raise Mistake(f'parameter {error}') from None


def let_set(node, chain, apply: Callable[[str, Value], tuple[bool, str]]) -> None:
    """
    From now on let live parameters be set: what passes the checks goes to `apply(name, value)` -> (success, sentence).

    All parameters of an atomic set are checked before the first is applied.
    """
    def convert(parameters):
        return [_converted(parameter) for parameter in parameters]

    def take(parameters):
        mine = [parameter for parameter in parameters if parameter.name in ROWS]
        try:
            values = [_checked(ROWS[parameter.name], parameter.value) for parameter in mine]
            for parameter, value in zip(mine, values):
                if parameter.name in QUANTITIES:
                    check_quantity(chain, parameter.name, value)
        except Mistake as mistake:
            return SetParametersResult(successful=False, reason=str(mistake))
        for parameter, value in zip(mine, values):
            success, sentence = apply(parameter.name, value)
            if not success:
                return SetParametersResult(successful=False, reason=sentence)
        return SetParametersResult(successful=True)

    node.add_pre_set_parameters_callback(convert)
    node.add_on_set_parameters_callback(take)


def declare(node, values: dict[str, Value], rows: dict[str, Row]) -> None:
    """Declare parameters of these values as their rows (by name) describe them, in place of what was given."""
    for name, value in values.items():
        if node.has_parameter(name):
            node.undeclare_parameter(name)
        node.declare_parameter(name, value, _descriptor(rows[name]), ignore_override=True)


def _converted(parameter: Parameter) -> Parameter:
    """Return the parameter with integers as floats where numbers are meant: their type is fixed by declaration."""
    row = ROWS.get(parameter.name)
    if row and row.type is Parameter.Type.DOUBLE and parameter.type_ is Parameter.Type.INTEGER:
        return Parameter(row.name, row.type, float(parameter.value))
    if row and row.type is NUMBERS and parameter.type_ is Parameter.Type.INTEGER_ARRAY:
        return Parameter(row.name, row.type, list(map(float, parameter.value)))
    return parameter


def _checked(row: Row, value) -> Value:
    if row.type is Parameter.Type.DOUBLE and type(value) is int:
        value = float(value)
    if row.of_chain and isinstance(value, (list, tuple, array)):
        kinds = {type(item) for item in value}
        if row.type is NUMBERS and kinds <= {int, float}:
            return list(map(float, value))
        if row.type is TEXTS and kinds <= {str}:
            return list(value)
    if row.of_chain or type(value) is not type(row.default):
        shown = list(value) if isinstance(value, array) else value
        raise Mistake(f'parameter {row.name!r} is {shown!r:.80}, must be {WANTED[row.type]}')
    if row.limits and not row.limits[0] <= value <= row.limits[1]:
        raise Mistake(f'parameter {row.name!r} is {value}, must be from {row.limits[0]:g} to {row.limits[1]:g}')
    if row.choices and value not in row.choices:
        raise Mistake(f'parameter {row.name!r} is {value!r}, must be one of {", ".join(map(repr, row.choices))}')
    return value


def _descriptor(row: Row) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(name=row.name, description=row.description, read_only=not row.live)
    if row.limits:
        descriptor.floating_point_range = [FloatingPointRange(from_value=row.limits[0], to_value=row.limits[1])]
    if row.choices:
        descriptor.additional_constraints = f'one of {", ".join(row.choices)}'
    elif row.name in QUANTITIES:
        descriptor.additional_constraints = QUANTITIES[row.name].wanted
    return descriptor


def _warn_of_unknown(node, given, known) -> None:
    """Warn of a parameter that looks like a slip; others may be meant for other nodes of a shared file."""
    for name in given:
        close = get_close_matches(name, known, n=1)
        if close and name not in known:
            node.get_logger().warning(f"parameter '{name}' is not known and has no effect, did you mean '{close[0]}'?")
