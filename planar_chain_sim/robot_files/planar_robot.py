"""
Turns a tree of links in space into the data of a planar chain, if all motion is in one plane.

Each moving joint must turn about the plane's normal, slide in the plane, or slide along the normal. The root link is
the base. In the plane, y points up as far as possible (the world's z) and x is y x normal; if the plane is horizontal,
x is the world's x as far as possible. Gravity is the part of 9.81 m/s^2 that lies in the plane. A body's frame is its
link's if that has an axis in the plane. Axes may be off by PARALLEL: the robot is then straightened and projected.

A slide along the normal and the motion in the plane do not affect each other. The slide gets a body of its own beside
the arm, with the inertia of everything it carries and the weight along the normal as `preload`.
"""
from __future__ import annotations

import re
from typing import Any

import numpy as np

from .account import quoted
from .spatial_robot import child_place, places_of, Plane, SpatialRobot, turn_about
from ..chain.chain import chain_from_dict
from ..chain.section import clipped
from ..errors import ChainError
from ..mechanics.solvable import SingularError

PARALLEL = 5e-3     # rad; files have angles such as 1.57
TINY = 1e-12        # m, kg m^2: what is smaller is the rounding of a turned frame
DIRECTIONS = 64     # of axes that are tried as the plane's normal
UP = np.array([0.0, 0.0, 1.0])
HERE = 'on this body or outboard of it'
KEYS, IN_LINK = re.compile(r"bodies\[\d+\]\S*: body '(.*?)' key '([^']*)'"), r"link '\1': \2"   # of a chain file


def planar_data(robot: SpatialRobot, name: str) -> tuple[dict, Plane]:
    """Return the chain as the data of a chain file, and its plane; ChainError for a robot that is not planar."""
    with np.errstate(all='ignore'):   # what is not finite is refused where it lands
        places = places_of(robot, name)
        plane = _plane(robot, places, name)
        places = _straightened(robot, places, plane)
        carried = _carried(robot)
        _refuse_idle(robot, carried, name)
        bodies = {joint.child: _body(robot, joint, places, plane, name) for joint in robot.joints}
        lifts = _lifts(robot, places, plane, carried)
    names = body_names(robot)
    taken = set(names.values())
    lift_names = {joint: _new_name(f'{joint}_load', taken) for joint in lifts}
    listed = []
    for joint in robot.joints:
        listed.append({'name': names[joint.child], 'carrier': names[joint.parent], **bodies[joint.child]})
        if joint.name in lifts:
            carrier, body = lifts[joint.name]
            listed.append({'name': lift_names[joint.name], 'carrier': lift_names.get(carrier, 'base'), **body})
    return {'name': robot.name, 'gravity': _pair(plane.gravity[:2]), 'bodies': listed}, plane


def body_names(robot: SpatialRobot) -> dict:
    """Return link -> name of its body, 'base' for the root: a link may have that name, a body may not."""
    taken = {'base'}
    return {robot.root: 'base', **{joint.child: _new_name(joint.child, taken) for joint in robot.joints}}


def chain_of(data: dict, name: str):
    """Return the chain of planar_data; ChainError names links and joints of the robot, not keys of a chain file."""
    try:
        return chain_from_dict(data)
    except SingularError as error:
        joint = clipped(error.joint)
        raise ChainError(f"{name}: joint '{joint}' makes the mass matrix singular in every configuration because "
                         f'{error.why.replace(HERE, "that it carries")}, must move some or be welded (hold \'{joint}\')'
                         ) from None
    except ChainError as error:
        raise ChainError(f'{name}: {KEYS.sub(IN_LINK, str(error))}') from None


def _new_name(name: str, taken: set) -> str:
    while name in taken:
        name += '_'
    taken.add(name)
    return name


def _straightened(robot, places, plane: Plane) -> dict:
    """
    Return the places with the axes of all rotations along the normal.

    What a joint carries is turned by the angle of its axis, about the point of the axis at the height of the carried
    mass centre. So that mass centre and its distance from the axis change only by the square of the angle.
    """
    normal = plane.basis[2]
    if plane.largest_angle < TINY:
        return places
    sums = {}
    for link, (turn, shift) in places.items():
        body = robot.links[link]
        sums[link] = np.append(body.mass * (shift + turn @ body.center), body.mass)
    for joint in reversed(robot.joints):
        sums[joint.parent] = sums[joint.parent] + sums[joint.child]
    straight = {robot.root: places[robot.root]}
    for joint in robot.joints:
        (turn, shift), (whole, place) = (child_place(joint, *where[joint.parent]) for where in (straight, places))
        if joint.moves and joint.kind == 'rotation':
            axis, wanted = turn @ joint.axis, np.sign(normal @ turn @ joint.axis) * normal
            total = sums[joint.child]
            level = normal @ (total[:3] / total[3] - place) / (normal @ whole @ joint.axis) if total[3] else 0.0
            across = np.cross(axis, wanted)
            sine = np.linalg.norm(across)
            if sine > TINY:
                turn = turn_about(across / sine, np.arctan2(sine, axis @ wanted)) @ turn
                shift = shift + level * (axis - wanted)
        straight[joint.child] = turn, shift
    return straight


def _plane(robot, places, name: str) -> Plane:
    """Return the plane of most joints; ChainError names the others."""
    moving = [joint for joint in robot.joints if joint.moves]
    if not moving:
        raise ChainError(f'{name}: has no joint that moves, must have one')
    axes = np.array([places[joint.child][0] @ joint.axis for joint in moving])
    turns = np.array([joint.kind == 'rotation' for joint in moving])
    best: Any = None
    for normal in _candidates(axes, turns):
        along = np.linalg.norm(np.cross(normal, axes), axis=1)   # sine of the angle to the normal
        across = abs(axes @ normal)                              # and to the plane
        off = np.where(turns, along, np.minimum(along, across))
        fits = int((off <= PARALLEL).sum())
        if best is None or fits > best[0]:
            best = fits, normal, off, along
    fits, normal, off, along = best
    if fits < len(moving):
        _refuse_odd([joint for joint, angle in zip(moving, off) if angle > PARALLEL],
                    [joint for joint, angle in zip(moving, off) if angle <= PARALLEL], name)
    lengthwise = frozenset(joint.name for joint, angle in zip(moving, along)
                           if joint.kind == 'slide' and angle <= PARALLEL)
    largest = np.argmax(abs(normal))
    normal = normal * np.sign(normal[largest]) * (-1.0 if largest == 1 else 1.0)
    y = UP - (UP @ normal) * normal
    if np.linalg.norm(y) > PARALLEL:
        y /= np.linalg.norm(y)
        x = np.cross(y, normal)
    else:   # horizontal: a slight tilt must not turn x and y
        x = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
        x /= np.linalg.norm(x)
        y = np.cross(normal, x)
    basis = np.array([x, y, normal])
    return Plane(basis, lengthwise, float(off.max()), basis @ robot.gravity)


def _candidates(axes: np.ndarray, turns: np.ndarray) -> list:
    """Return candidates for the plane's normal, later joints' axes first: the one that differs is often the root's."""
    if turns.any():
        directions = axes[turns][::-1]
    else:
        crossed = [np.cross(axes[0], other) for other in axes[1:]]
        crossed += [np.cross(axes[0], UP), np.cross(axes[0], [1.0, 0.0, 0.0]), axes[0]]   # the last: across the others
        directions = np.array([other / np.linalg.norm(other) for other in crossed if np.linalg.norm(other) > PARALLEL])
    found = []
    while len(directions) and len(found) < DIRECTIONS:
        same = np.linalg.norm(np.cross(directions[0], directions), axis=1) <= PARALLEL
        found.append(directions[same][-1] if turns.any() else directions[0])
        directions = directions[~same]
    return found


def _refuse_odd(odd, others, name: str):
    """Raise ChainError for the joints that leave the plane of the others."""
    slide = all(joint.kind == 'slide' for joint in odd)
    turns = [joint.name for joint in others if joint.kind == 'rotation']
    if len(odd) == 1:
        what = f"joint '{clipped(odd[0].name)}' " + ('slides' if slide else 'turns')
    else:
        what = f'{len(odd)} joints, {quoted(joint.name for joint in odd)}, ' + ('slide' if slide else 'turn or slide')
    way = 'askew to the plane' if slide else 'about another direction than'
    others = quoted(turns or [joint.name for joint in others])
    raise ChainError(f'{name}: {what} {way}{" of" if slide else ""} {others}: the robot is not planar, must be welded '
                     f'there to make it so (hold {quoted(joint.name for joint in odd)})')


def _carried(robot) -> dict:
    """Return joint -> (mass, largest moment of inertia) of all that it carries."""
    sums = {link.name: [link.mass, float(abs(link.inertia).max())] for link in robot.links.values()}
    for joint in reversed(robot.joints):
        for k in range(2):
            sums[joint.parent][k] += sums[joint.child][k]
    return {joint.name: sums[joint.child] for joint in robot.joints}


def _refuse_idle(robot, carried, name: str):
    """Raise ChainError for joints that move no mass."""
    idle = [joint for joint in robot.joints if joint.moves and not carried[joint.name][0]
            and (joint.kind == 'slide' or not carried[joint.name][1])]
    if not idle:
        return
    if not any(link.mass or link.inertia.any() for link in robot.links.values()):
        raise ChainError(f'{name}: has no link with a mass (element inertial), must have one to move')
    joints, links = (quoted(getattr(joint, what) for joint in idle) for what in ('name', 'child'))
    what = f'joint {joints} moves no mass, as link' if len(idle) == 1 else f'joints {joints} move no mass, as links'
    raise ChainError(f'{name}: {what} {links} and what they carry have none, must move some or be welded '
                     f'(hold {joints})')


def _heading(turn: np.ndarray, basis: np.ndarray) -> float:
    """Return the angle in the plane of the first axis of a frame that lies in it, 0 where none does."""
    for axis in turn.T:
        if abs(basis[2] @ axis) < PARALLEL:
            return float(np.arctan2(basis[1] @ axis, basis[0] @ axis))
    return 0.0


def _pair(vector) -> list:
    return [float(value) if abs(value) > TINY else 0.0 for value in vector]


def _body(robot, joint, places, plane: Plane, name: str) -> dict:
    """Return the keys of a chain file for the joint's child: frame, inertia and laws, all but names."""
    basis = plane.basis
    (_, carrier_shift), (turn, shift) = places[joint.parent], places[joint.child]
    heading = _heading(turn, basis)
    carrier_heading = 0.0 if joint.parent == robot.root else _heading(places[joint.parent][0], basis)
    angle = float(np.remainder(heading - carrier_heading + np.pi, 2.0 * np.pi) - np.pi)

    def seen_from(vector, own):   # a vector of the root's frame, in the plane, from a body's frame
        own = np.array([[np.cos(own), np.sin(own)], [-np.sin(own), np.cos(own)]])
        return _pair(own @ (basis[:2] @ vector))

    link = robot.links[joint.child]
    normal = turn.T @ basis[2]
    moment = float(normal @ link.inertia @ normal)
    if not 0.0 <= moment < np.inf:
        if not -TINY * (abs(link.inertia).max() + link.mass) <= moment < np.inf:   # else the rounding of an exporter
            raise ChainError(f"{name}: link '{clipped(link.name)}' has the moment of inertia {moment:.6g} kg m^2 about "
                             "the plane's normal, must have a finite one >= 0")
        moment = 0.0
    body = {'origin': seen_from(shift - carrier_shift, carrier_heading), 'angle': angle if abs(angle) > TINY else 0.0,
            'mass': link.mass, 'center_of_mass': seen_from(turn @ link.center, heading), 'inertia_com': moment}
    if not joint.moves or joint.name in plane.across:
        return body
    axis = turn @ joint.axis
    laws = {'joint': joint.name, **joint.laws}
    if joint.kind == 'slide':
        along = seen_from(axis, carrier_heading)
        body['slide'] = {**laws, 'axis': float(np.arctan2(along[1], along[0]))}
    else:
        body['rotation'] = {**laws, 'axis': float(np.sign(basis[2] @ axis))}
    return body


def _lifts(robot, places, plane: Plane, carried) -> dict:
    """
    Return slide along the normal -> (the one that carries it or None, its body beside the arm).

    A single slide is a body without mass whose joint's armature is the carried mass. Slides that carry each other are
    bodies with their own parts of the mass, which slide across gravity.
    """
    above, parts, joints = {robot.root: None}, {}, {}
    for joint in robot.joints:
        above[joint.child] = above[joint.parent]
        if joint.name in plane.across:
            joints[joint.name] = joint, above[joint.parent]
            above[joint.child] = joint.name
        if above[joint.child]:
            parts[above[joint.child]] = parts.get(above[joint.child], 0.0) + robot.links[joint.child].mass
    stacked = {carrier for _, carrier in joints.values() if carrier} | {
        name for name, (_, carrier) in joints.items() if carrier}
    gravity = plane.gravity
    across = float(np.arctan2(gravity[1], gravity[0]) + 0.5 * np.pi) if np.hypot(*gravity[:2]) > TINY else 0.0
    lifts = {}
    for name, (joint, carrier) in joints.items():
        mass = carried[name][0]
        sense = float(np.sign(plane.basis[2] @ places[joint.child][0] @ joint.axis))
        slide = {'joint': name, **joint.laws, 'axis': 0.0}
        if abs(gravity[2]) > TINY:
            slide['preload'] = sense * mass * float(gravity[2])
        if name in stacked:
            slide['axis'] = across if sense > 0.0 else across + np.pi
        else:
            slide['armature'] = slide.get('armature', 0.0) + mass
        lifts[name] = carrier, {'mass': parts[name] if name in stacked else 0.0, 'inertia_com': 0.0, 'slide': slide}
    return lifts
