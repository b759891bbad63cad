"""The node's parameters, one row each: name, default, description, range. All are read once and read-only."""
from __future__ import annotations

from difflib import get_close_matches
from typing import NamedTuple, Optional, Union

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor

from ..command_line import Mistake

Value = Union[bool, float, str]


class Row(NamedTuple):
    """A parameter; its type is that of its default. `limits`: least and greatest number. `choices`: of a text."""

    name: str
    default: Value
    description: str
    limits: Optional[tuple[float, float]] = None
    choices: tuple[str, ...] = ()


PARAMETERS = (
    Row('chain_file', 'four_link_robot.yaml',
        'Chain to simulate (YAML); a relative path is looked for in the working directory, then in the package.'),
    Row('method', 'auto', "Integration method, or 'auto'."),
    Row('rate', 1000.0, 'Ticks per simulated second, Hz: commands act and states are logged by ticks.', (1.0, 1e5)),
    Row('publish_rate', 0.0,
        'States published per simulated second, Hz: rate divided by a whole number; 0 is every tick.', (0.0, 1e5)),
    Row('real_time_factor', 1.0, 'Simulated seconds per second of wall time.', (1e-3, 1e3)),
    Row('start_paused', False, 'Start paused, so that nothing falls before a controller is there.'),
    Row('frame_id', '', 'header.frame_id of the joint states.'),
    Row('on_controller_loss', 'zero', "Efforts when the last publisher of commands has gone: 'zero' or 'hold'.",
        choices=('zero', 'hold')),
    Row('record', '', 'MCAP log to write, a new file; empty: no log.'),
    Row('record_flush_period', 0.5, 'Seconds of log that a killed process can lose at most.', (0.01, 3600.0)),
    Row('record_compression', 'none', 'Compression of the log.', choices=('none', 'lz4', 'zstd')),
)


def declare_parameters(node) -> dict[str, Value]:
    """
    Declare every row on a node and return name -> value; an integer is taken where a number is meant.

    The node must have declared its overrides itself (automatically_declare_parameters_from_overrides): only so does
    rclpy show them before it fixes their types. Mistake on a value of the wrong type, outside its range or choices.
    """
    given = {name: parameter.value for name, parameter in node.get_parameters_by_prefix('').items()}
    values = {}
    for row in PARAMETERS:
        value = row.default
        if row.name in given:
            value = _checked(row, given[row.name])
            node.undeclare_parameter(row.name)
        node.declare_parameter(row.name, value, _descriptor(row), ignore_override=True)
        values[row.name] = value
    _warn_of_unknown(node, given)
    if values['publish_rate']:
        ticks = values['rate'] / values['publish_rate']
        if ticks < 0.5 or abs(ticks - round(ticks)) > 1e-9 * ticks:
            raise Mistake(f"parameter 'publish_rate' is {values['publish_rate']}, must be 0 or `rate` "
                          f"({values['rate']}) divided by a whole number")
    return values


def _checked(row: Row, value) -> Value:
    wanted = {bool: 'true or false', float: 'a number', str: 'a text'}[type(row.default)]
    if type(row.default) is float and type(value) is int:
        value = float(value)
    if type(value) is not type(row.default):
        raise Mistake(f'parameter {row.name!r} is {value!r}, must be {wanted}')
    if row.limits and not row.limits[0] <= value <= row.limits[1]:
        raise Mistake(f'parameter {row.name!r} is {value}, must be from {row.limits[0]:g} to {row.limits[1]:g}')
    if row.choices and value not in row.choices:
        raise Mistake(f'parameter {row.name!r} is {value!r}, must be one of {", ".join(map(repr, row.choices))}')
    return value


def _descriptor(row: Row) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(name=row.name, description=row.description, read_only=True)
    if row.limits:
        descriptor.floating_point_range = [FloatingPointRange(from_value=row.limits[0], to_value=row.limits[1])]
    if row.choices:
        descriptor.additional_constraints = f'one of {", ".join(row.choices)}'
    return descriptor


def _warn_of_unknown(node, given) -> None:
    """Warn of a parameter that looks like a slip; others may be meant for other nodes of a shared file."""
    known = [row.name for row in PARAMETERS]
    for name in given:
        close = get_close_matches(name, known, n=1)
        if close and name not in known:
            node.get_logger().warning(f"parameter '{name}' is not known and has no effect, did you mean '{close[0]}'?")
