"""Declares the parameters in ROS from their rows, reads the given values, and accepts changes of live parameters."""
from __future__ import annotations

from difflib import get_close_matches
from typing import Callable

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter

from .parameters import (
    check_for_chain,
    check_quantity,
    check_together,
    checked,
    idle,
    NUMBERS,
    numbers_of,
    PARAMETERS,
    Row,
    ROWS,
    Value,
)
from ..chain.quantities import QUANTITIES
from ..chain.section import clipped
from ..errors import Mistake


class UnknownParameter(ParameterNotDeclaredException):
    """The error for setting unknown parameters, as a sentence; rclpy's own loses the first name."""

    def __init__(self, names):
        super().__init__(names)
        self._name = names[0]

    def __str__(self) -> str:
        name = self._name
        close = get_close_matches(name, ROWS, n=1)
        return f'parameter {name!r:.80} is not known' + (f", did you mean '{close[0]}'?" if close else '')


def overrides(node) -> dict[str, Value]:
    """Return name -> value of all parameters that were given to the node; None for an empty list, of no type in ROS."""
    with node.handle:
        return {name: parameter.value for name, parameter in node.handle.get_parameters(Parameter).items()}


def given_values(node, rows, **told: Value) -> dict[str, Value]:
    """
    Return name -> value of rows, as given or else the default; an integer is accepted where a number is meant.

    `told`: values from the command line's own options. Mistake: a value of the wrong type, outside its range or
    choices, or given in both ways.
    """
    given = overrides(node)
    _warn_of_unknown(node, given, [row.name for row in rows])
    for name, value in told.items():
        if name in given:
            raise Mistake(f'{name} is given twice, as {value!r} and by the parameter, {given[name]!r}: give it once')
    given.update(told)
    return {row.name: checked(row, given[row.name]) if row.name in given else row.default for row in rows
            if not row.of_chain}


def declare_parameters(node, **told: Value) -> dict[str, Value]:
    """Declare the rows that need no chain and return name -> value; `told` and Mistake as given_values()."""
    values = given_values(node, PARAMETERS, **told)
    check_together(values)
    for sentence in idle(overrides(node), values):
        node.get_logger().warning(sentence)
    declare(node, values, ROWS)
    return values


def declare_chain_parameters(node, chain) -> dict[str, Value]:
    """Declare the rows whose default is the chain's; return and Mistake as check_for_chain()."""
    values = check_for_chain(chain, {**overrides(node), 'payload_body': node.get_parameter('payload_body').value})
    strange = [name for name in values['commanded_joints'] if name not in chain.joint_names]
    if strange:   # which the hardware of another's URDF may well have
        node.get_logger().warning(f"parameter 'commanded_joints' names {', '.join(map(repr, strange[:8]))}, not among "
                                  f'the joints {", ".join(chain.joint_names[:32])}: its efforts have no effect')
    defaults = {row.name: row.of_chain[1](chain) for row in PARAMETERS if row.of_chain}
    declare(node, {name: values.get(name, default) for name, default in defaults.items()}, ROWS)
    return values


def accept_changes(node, chain, apply: Callable[[dict[str, Value]], tuple[bool, str]]) -> None:
    """
    Accept changes of live parameters from now on: checked values go to `apply({name: value})` -> (success, sentence).

    All parameters of an atomic set are checked first and applied together.
    """
    def convert(parameters):
        unknown = [parameter.name for parameter in parameters if not node.has_parameter(parameter.name)]
        if unknown:
            raise UnknownParameter(unknown)
        return [_converted(parameter, chain) for parameter in parameters]

    def take(parameters):
        try:
            values = {parameter.name: checked(ROWS[parameter.name], parameter.value) for parameter in parameters
                      if parameter.name in ROWS}
            for name, value in values.items():
                if name in QUANTITIES:
                    check_quantity(chain, name, value)
        except Mistake as mistake:
            return SetParametersResult(successful=False, reason=str(mistake))
        success, sentence = apply(values) if values else (True, '')
        return SetParametersResult(successful=success, reason='' if success else sentence)

    for service in node.services:
        if service.srv_type in (SetParameters, SetParametersAtomically):
            service.callback = _refusing_strange_types(service.callback)
    node.add_pre_set_parameters_callback(convert)
    node.add_on_set_parameters_callback(take)


def declare(node, values: dict[str, Value], rows: dict[str, Row]) -> None:
    """Declare parameters of these values as their rows (by name) describe them, in place of what was given."""
    for name, value in values.items():
        if node.has_parameter(name):
            node.undeclare_parameter(name)
        descriptor, kind = _descriptor(rows[name]), Parameter.Type[rows[name].type]
        if value != []:
            node.declare_parameter(name, value, descriptor, ignore_override=True)
        else:   # of which rclpy would make a list of bytes
            node.declare_parameter(name, [''], ignore_override=True)
            node.set_parameters([Parameter(name, kind, value)])
            descriptor.type = kind.value
            node.set_descriptor(name, descriptor)


def _converted(parameter: Parameter, chain) -> Parameter:
    """Return the parameter in its declared type: integers become numbers, an empty list becomes the default."""
    row = ROWS.get(parameter.name)
    if row is None:
        return parameter
    kind = Parameter.Type[row.type]
    if kind is Parameter.Type.DOUBLE and parameter.type_ is Parameter.Type.INTEGER:
        return Parameter(row.name, kind, float(parameter.value))
    if row.type == NUMBERS and parameter.type_ is Parameter.Type.INTEGER_ARRAY and len(parameter.value):
        return Parameter(row.name, kind, list(map(float, parameter.value)))
    if row.type == NUMBERS and parameter.type_ is Parameter.Type.STRING:   # as `ros2 param set` sends '[0, -1.62]'
        numbers = numbers_of(parameter.value)
        return parameter if numbers is None else Parameter(row.name, kind, numbers)
    if row.of_chain and parameter.type_.name.endswith('ARRAY') and not len(parameter.value):
        return Parameter(row.name, kind, row.of_chain[1](chain))
    return parameter


def _refusing_strange_types(callback):
    """Return rclpy's callback of a service that sets parameters, guarded against parameter types that do not exist."""
    known = {kind.value for kind in Parameter.Type}

    def refuse_or_call(request, response):
        strange = [f'parameter {parameter.name!r} is of a type {parameter.value.type}, which ROS does not have'
                   for parameter in request.parameters if parameter.value.type not in known]
        if not strange:
            return callback(request, response)
        result = SetParametersResult(successful=False, reason=strange[0])
        if isinstance(response, SetParameters.Response):
            response.results = [result] * len(request.parameters)
        else:
            response.result = result
        return response
    return refuse_or_call


def _descriptor(row: Row) -> ParameterDescriptor:
    description = f'{row.description} [{row.unit}]' if row.unit else row.description
    descriptor = ParameterDescriptor(name=row.name, description=description, read_only=not row.live)
    if row.limits and row.type == 'DOUBLE':
        descriptor.floating_point_range = [FloatingPointRange(from_value=row.limits[0], to_value=row.limits[1])]
    if row.smallest or row.limits and row.type == NUMBERS:
        descriptor.additional_constraints = row.range
    if row.choices:
        descriptor.additional_constraints = f'one of {", ".join(row.choices)}'
    elif row.name in QUANTITIES:
        descriptor.additional_constraints = QUANTITIES[row.name].wanted
    return descriptor


def _warn_of_unknown(node, given, known) -> None:
    """Warn of a parameter that looks like a typing mistake; list the others, perhaps of nodes that share a file."""
    others = []
    for name in given:
        if name in known or node.has_parameter(name) or name.startswith('qos_overrides.'):
            continue
        if close := get_close_matches(name, known, n=1):
            node.get_logger().warning(f"parameter '{name}' is not known and has no effect, did you mean '{close[0]}'?")
        else:
            others.append(name)
    if others:
        node.get_logger().info(f'parameters that are not known and have no effect: {clipped(", ".join(others), 300)}')
