"""
URDF -> Chain: a robot whose joints all turn about one direction or slide across it is a planar chain, no other is.

The root link is the base. The plane is normal to the turning axes; in it y points up as far as it can (the world's z),
and gravity is what of 9.81 m/s^2 lies in it. A body's frame is its link's where that has an axis in the plane.
"""
from __future__ import annotations

from contextlib import redirect_stderr
import io
from math import isfinite

import numpy as np

from .chain import Chain, ChainError
from .chain_section import clipped
from .urdf_writer import UNLIMITED

PARALLEL = 1e-6     # rad; texts often have five or six digits
TINY = 1e-12        # m, kg m^2: what is smaller is the rounding of a turned frame
GRAVITY = 9.81      # m/s^2 along -z, as everywhere where URDF is used
NOT_PLANAR = 'the robot is not planar, must be'
KINDS = ('fixed', 'continuous', 'revolute', 'prismatic')


def chain_from_urdf(text: str, name: str = '<text>') -> Chain:
    """
    Return the chain of a URDF text; `name` stands for the file in ChainError sentences.

    `Chain.source` is the YAML text of the same chain. ChainError, one sentence, for a text that is no URDF and for a
    robot that is not planar, with the joint that makes it so.
    """
    from .chain_yaml import chain_from_dict
    robot = _parse(text, name)
    joints = _in_order(robot, name)
    with np.errstate(invalid='ignore'):   # what is not finite is refused where it lands
        places = _place(robot, joints, name)
        plane = _plane(joints, places, name)
        bodies = [_body(robot, joint, places, plane, name) for joint in joints]
    names = {'base'}   # a link may be called so, a body may not
    labels = {robot.get_root(): 'base'}
    for joint in joints:
        labels[joint.child] = _new_name(joint.child, names)
    for joint, body in zip(joints, bodies):
        body.update(name=labels[joint.child], carrier=labels[joint.parent])
    try:
        return chain_from_dict({'name': robot.name or 'robot', 'gravity': _pair(plane[:2] @ [0.0, 0.0, -GRAVITY]),
                                'bodies': bodies})
    except ChainError as error:
        raise ChainError(f'{name}: {error}') from None


def _new_name(name: str, names: set) -> str:
    while name in names:
        name += '_'
    names.add(name)
    return name


def _parse(text: str, name: str):
    """Return the robot that the parser library makes of the text; ChainError."""
    try:
        from urdf_parser_py.urdf import URDF
    except ImportError as error:
        raise ChainError(f'{name}: is a URDF, which is read with urdf_parser_py ({error}), must be a chain file in '
                         'YAML where that is not installed') from None
    if '<!' in text.replace('<!--', ''):
        raise ChainError(f'{name}: has a DOCTYPE, ENTITY or CDATA, must be plain URDF')
    try:
        with redirect_stderr(io.StringIO()):   # it tells of every tag that it does not know
            robot = URDF.from_xml_string(text.encode())
            robot.get_root()
    except Exception as error:  # of no common class
        reason = clipped(' '.join(str(error).split()) or type(error).__name__, 160)
        raise ChainError(f'{name}: is not valid URDF ({reason}), must be that of a robot') from None
    return robot


def _in_order(robot, name: str) -> list:
    """Return the joints, a carrier's before those it carries, else in the order of the text; ChainError: no tree."""
    placed, waiting, ordered = {robot.get_root()}, list(robot.joints), []
    links = {link.name for link in robot.links}
    if len(links) < len(robot.links) or len({joint.name for joint in waiting}) < len(waiting):
        raise ChainError(f'{name}: has two links or two joints of the same name, must have different ones')
    for joint in waiting:
        where = f"{name}: joint '{clipped(joint.name)}'"
        if joint.type not in KINDS:
            raise ChainError(f'{where} is of type {joint.type!r}, must be one of {", ".join(KINDS)}: '
                             f'{NOT_PLANAR}')
        if joint.mimic is not None:
            raise ChainError(f"{where} mimics '{clipped(joint.mimic.joint)}', must move on its own")
        if not {joint.parent, joint.child} <= links:
            raise ChainError(f'{where} names a link that is not there, must name two of the robot')
    while waiting:
        joint = next((joint for joint in waiting if joint.parent in placed and joint.child not in placed), None)
        if joint is None:
            raise ChainError(f"{name}: joint '{clipped(waiting[0].name)}' closes a loop or hangs in the air, "
                             'must be one tree of links')
        placed.add(joint.child)
        waiting.remove(joint)
        ordered.append(joint)
    return ordered


def _rotation(rpy) -> np.ndarray:
    """Return the rotation matrix of roll, pitch, yaw about fixed axes: Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                     [-sp, cp * sr, cp * cr]])


def _frame(origin) -> tuple[np.ndarray, np.ndarray]:
    """Return rotation and translation of an origin element, which may be missing."""
    rpy = (origin.rpy if origin is not None else None) or (0.0, 0.0, 0.0)
    xyz = (origin.xyz if origin is not None else None) or (0.0, 0.0, 0.0)
    return _rotation(rpy), np.array(xyz, dtype=float)


def _place(robot, joints, name: str) -> dict:
    """Return link -> (rotation, position) against the root where all joints read 0."""
    places = {robot.get_root(): (np.eye(3), np.zeros(3))}
    for joint in joints:
        turn, shift = places[joint.parent]
        own_turn, own_shift = _frame(joint.origin)
        places[joint.child] = turn @ own_turn, shift + turn @ own_shift
        if not all(np.isfinite(part).all() for part in places[joint.child]):
            raise ChainError(f"{name}: joint '{clipped(joint.name)}' has an origin that is not finite, must be")
    return places


def _axis(joint, places, name: str) -> np.ndarray:
    """Return the joint's axis in the root's frame."""
    axis = np.array(joint.axis if joint.axis is not None else (1.0, 0.0, 0.0), dtype=float)
    length = np.linalg.norm(axis)
    if not isfinite(length) or length < 1e-9:
        raise ChainError(f"{name}: joint '{clipped(joint.name)}' has the axis {axis.tolist()}, must be a direction")
    return places[joint.child][0] @ (axis / length)


def _plane(joints, places, name: str) -> np.ndarray:
    """Return x, y and normal of the plane, rows in the root's frame; ChainError names a joint that leaves it."""
    turning = [joint for joint in joints if joint.type in ('continuous', 'revolute')]
    sliding = [joint for joint in joints if joint.type == 'prismatic']
    if not turning and not sliding:
        raise ChainError(f'{name}: has no joint that moves, must have one')
    up = np.array([0.0, 0.0, 1.0])
    if turning:
        normal = _axis(turning[0], places, name)
    else:
        first = _axis(sliding[0], places, name)
        others = [np.cross(first, _axis(joint, places, name)) for joint in sliding[1:]]
        others += [np.cross(first, up), np.cross(first, [1.0, 0.0, 0.0])]
        normal = next(other for other in others if np.linalg.norm(other) > PARALLEL)
        normal = normal / np.linalg.norm(normal)
    normal = normal * np.sign(normal[np.argmax(abs(normal))]) * (-1.0 if np.argmax(abs(normal)) == 1 else 1.0)
    for joint in turning:
        if np.linalg.norm(np.cross(normal, _axis(joint, places, name))) > PARALLEL:
            raise ChainError(f"{name}: joint '{clipped(joint.name)}' does not turn parallel to "
                             f"'{clipped(turning[0].name)}': {NOT_PLANAR}")
    for joint in sliding:
        if abs(normal @ _axis(joint, places, name)) > PARALLEL:
            raise ChainError(f"{name}: joint '{clipped(joint.name)}' slides out of the plane of the others: "
                             f'{NOT_PLANAR}')
    y = up - (up @ normal) * normal
    if np.linalg.norm(y) < PARALLEL:
        y = np.cross(normal, [1.0, 0.0, 0.0])
    y /= np.linalg.norm(y)
    return np.array([np.cross(y, normal), y, normal])


def _heading(turn: np.ndarray, plane: np.ndarray) -> float:
    """Return the angle in the plane of the first axis of a frame that lies in it, 0 where none does."""
    for axis in turn.T:
        if abs(plane[2] @ axis) < PARALLEL:
            return float(np.arctan2(plane[1] @ axis, plane[0] @ axis))
    return 0.0


def _pair(vector) -> list:
    return [float(value) if abs(value) > TINY else 0.0 for value in vector]


def _body(robot, joint, places, plane, name: str) -> dict:
    """Return what a chain file says of the joint's child: frame, inertia and laws, all but names."""
    (_, carrier_shift), (turn, shift) = places[joint.parent], places[joint.child]
    carrier_heading, heading = (_heading(places[link][0], plane) for link in (joint.parent, joint.child))
    angle = heading - carrier_heading

    def seen_from(vector, own):   # a vector of the root's frame, in the plane, from a body's frame
        own = np.array([[np.cos(own), np.sin(own)], [-np.sin(own), np.cos(own)]])
        return own @ (plane[:2] @ vector)

    body = {'origin': _pair(seen_from(shift - carrier_shift, carrier_heading)),
            'angle': float(angle) if abs(angle) > TINY else 0.0, 'mass': 0.0, 'inertia_com': 0.0}
    inertial = robot.link_map[joint.child].inertial
    if inertial is not None:
        own_turn, center = _frame(inertial.origin)
        normal = (turn @ own_turn).T @ plane[2]
        matrix = np.array(inertial.inertia.to_matrix() if inertial.inertia else np.zeros((3, 3)), dtype=float)
        moment = float(normal @ matrix @ normal)
        body.update(mass=float(inertial.mass or 0.0), center_of_mass=_pair(seen_from(turn @ center, heading)),
                    inertia_com=moment)
    if joint.type != 'fixed':
        axis = _axis(joint, places, name)
        laws = {'joint': joint.name, **_laws(joint)}
        if joint.type == 'prismatic':
            along = _pair(seen_from(axis, carrier_heading))
            body['slide'] = {**laws, 'axis': float(np.arctan2(along[1], along[0]))}
        else:
            body['rotation'] = {**laws, 'axis': float(np.sign(plane[2] @ axis))}
    return body


def _laws(joint) -> dict:
    laws, limit, dynamics = {}, joint.limit, joint.dynamics
    if limit is not None:
        if joint.type != 'continuous':
            laws.update(lower=limit.lower or 0.0, upper=limit.upper or 0.0)
            laws['position'] = min(max(0.0, laws['lower']), laws['upper'])   # 0 may lie beyond a stop
        laws['effort_limit'] = limit.effort
    if dynamics is not None:
        laws.update(damping=dynamics.damping or 0.0, friction=dynamics.friction or 0.0)
    return {key: float(value) for key, value in laws.items() if value is not None and abs(value) < UNLIMITED
            and (value or key in ('lower', 'upper', 'effort_limit'))}
