"""
hold: joints to weld at a value (rad or m) or at their initial position.

It is a mapping joint -> value or None, a list of joints, or a list of strings 'joint' and 'joint=value', as on
a command line and in a parameter. In a chain file it is the key `hold`. An angle may be a text such as '90 deg'.
"""
from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import isfinite
from typing import Optional, Union

from .section import angle_of, ANGLE_TEXTS, as_number, clipped, plain, shown, suggestion
from .tree import Body
from ..errors import ChainError

WANTED = 'must be a joint, a list of joints or a mapping from joints to values (rad or m)'
Hold = Union[None, str, Iterable[str], Mapping[str, Union[None, float, str]]]


def read_hold(hold: Hold) -> dict:
    """Return joint -> value, as number or text of an angle, None: the initial position; ChainError, one sentence."""
    if hold is None:
        return {}
    if isinstance(hold, str):
        hold = [hold]
    hold = plain(hold, 'hold')
    if isinstance(hold, list):
        pairs = {}
        for item in hold:
            if not isinstance(item, str):
                raise ChainError(f'hold has {shown(item)} in it, {WANTED}')
            name, sign, text = item.rpartition('=')
            try:
                value = float(text) if sign else None
            except ValueError:
                if angle_of(text) is None:
                    raise ChainError(f"hold '{clipped(item)}' has no number after '=', must be JOINT=VALUE (rad or m)"
                                     ) from None
                value = text
            name = name if sign else item
            if name in pairs and pairs[name] != value:
                first, second = ('no value' if each is None else shown(each) for each in (pairs[name], value))
                raise ChainError(f"hold names '{clipped(name)}' twice, with {first} and {second}, must name it once")
            pairs[name] = value
        hold = pairs
    if not isinstance(hold, dict):
        raise ChainError(f'hold is {shown(hold)}, {WANTED}')
    for name, value in hold.items():
        if value is not None and not (isinstance(value, str) and angle_of(value) is not None):
            number = as_number(value)
            if number is None or not isfinite(number):
                raise ChainError(f"hold has {shown(value)} for '{clipped(name)}', must be a finite number (rad or m)"
                                 + (f', {ANGLE_TEXTS}' if isinstance(value, str) else ''))
            hold[name] = number
    return hold


def held_at(name: str, value, slide: bool, file: str = '') -> Optional[float]:
    """Return the value, m or rad, that `hold` gives to a joint; ChainError for an angle where it slides."""
    if not isinstance(value, str):
        return value
    angle = angle_of(value)
    if slide or angle is None or not isfinite(angle):
        wanted = 'a number (m), as it slides' if slide else 'a finite one'
        where = f'{file}: ' if file else ''
        raise ChainError(f"{where}hold gives '{clipped(value)}' to joint '{clipped(name)}', must be {wanted}")
    return angle


def weld(bodies: list[Body], hold: dict) -> list[Body]:
    """Return the bodies with the joints that `hold` names welded; ChainError for one that they do not have."""
    from .._kernel import unit_vector  # load-time trigonometry through the kernel's own functions
    joints = {joint.name: joint for body in bodies for joint in (body.slide, body.rotation) if joint}
    for name, value in hold.items():
        if name not in joints:
            raise ChainError(f"hold names '{clipped(name)}', which is not a joint of this chain"
                             f'{suggestion(name, list(joints))}, must name joints of the chain')
        joint = joints[name]
        value = hold[name] = held_at(name, value, joint.kind == 'slide')
        if value is not None and not joint.lower <= value <= joint.upper:
            raise ChainError(f"hold gives {value!r} to joint '{clipped(name)}', must lie between its stops, "
                             f'{joint.lower!r} and {joint.upper!r}')
    if len(hold) == len(joints):
        raise ChainError('hold names all joints of the chain, must leave one that moves')
    welded = []
    for body in bodies:
        for kind in ('slide', 'rotation'):
            joint = getattr(body, kind)
            if joint is None or joint.name not in hold:
                continue
            value = joint.position if hold[joint.name] is None else hold[joint.name]
            if kind == 'slide':
                body = replace(body, origin=body.origin + value * unit_vector(joint.axis), slide=None)
            else:
                body = replace(body, angle=body.angle + joint.axis * value, rotation=None)
        welded.append(body)
    return welded
