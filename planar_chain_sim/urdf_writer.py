"""
Chain -> URDF: links, joints, inertials and simple visuals, for robot_state_publisher, RViz, Foxglove and others.

The plane stands upright: the chain's x is the world's x, its y the world's z; `world` to `base_link` is rpy
(pi/2, 0, 0).
A link's frame is the body's. A body that slides and turns gets a massless link between. Springs and rotors are left
out, URDF knows none. All three moments of inertia are given that about the plane's normal, the only one that acts.
"""
from __future__ import annotations

import cmath
from math import hypot, inf, pi
from xml.etree import ElementTree

from .chain import BASE, Body, Chain, Joint

UNLIMITED = 1e9  # N m, N, m, rad/s: stands for no limit where URDF demands one; the reader takes it as such
COLORS = ((0.04, 0.43, 0.60), (0.85, 0.45, 0.05), (0.27, 0.51, 0.38), (0.56, 0.40, 0.69), (0.76, 0.30, 0.54))
THICKNESS = 0.08  # of a visual, by its length


def urdf_of(chain: Chain) -> str:
    """Return the URDF text of a chain; link names are those of the bodies, joint names those of the joints."""
    robot = ElementTree.Element('robot', name=chain.name)
    links = _Names('world', 'base_link')
    joints = _Names(*chain.joint_names)
    for name in ('world', 'base_link'):
        ElementTree.SubElement(robot, 'link', name=name)
    _joint(robot, joints.new('world_to_base_link'), 'fixed', 'world', 'base_link', rpy=(pi / 2, 0.0, 0.0))
    names = {BASE: 'base_link'}
    for index, body in enumerate(chain.bodies):
        names[index] = links.new(body.name)
    for index, body in enumerate(chain.bodies):
        parent, origin = names[body.carrier], body.origin
        if body.slide and body.rotation:
            carriage = links.new(f'{body.name}_carriage')
            ElementTree.SubElement(robot, 'link', name=carriage)
            _slide(robot, body.slide, parent, carriage, origin, 0.0)
            parent, origin = carriage, 0j
        _link(robot, names[index], body, visual_ends(chain, index), COLORS[index % len(COLORS)])
        if body.rotation:
            _rotation(robot, body.rotation, parent, names[index], origin, body.angle)
        elif body.slide:
            _slide(robot, body.slide, parent, names[index], origin, body.angle)
        else:
            _joint(robot, joints.new(f'{body.name}_weld'), 'fixed', parent, names[index], origin,
                   (0.0, 0.0, body.angle))
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding='unicode') + '\n'


def visual_ends(chain: Chain, index: int) -> list[complex]:
    """Return where the lines end that picture a body, from its joint point, own frame, m: at what it carries, or so."""
    body = chain.bodies[index]
    length = body.visual.get('length')
    if isinstance(length, (int, float)) and not isinstance(length, bool):
        return [complex(length, 0.0)]
    return [other.origin for other in chain.bodies if other.carrier == index] or [2.0 * body.center_of_mass]


class _Names:
    """Names that are all different."""

    def __init__(self, *taken):
        self._taken = set(taken)

    def new(self, name: str) -> str:
        while name in self._taken:
            name += '_'
        self._taken.add(name)
        return name


def _numbers(*values: float) -> str:
    return ' '.join(repr(float(value) + 0.0) for value in values)  # + 0.0: no -0.0


def _origin(element, offset: complex, rpy=(0.0, 0.0, 0.0)) -> None:
    ElementTree.SubElement(element, 'origin', xyz=_numbers(offset.real, offset.imag, 0.0), rpy=_numbers(*rpy))


def _joint(robot, name: str, kind: str, parent: str, child: str, origin: complex = 0j, rpy=(0.0, 0.0, 0.0)):
    joint = ElementTree.SubElement(robot, 'joint', name=name, type=kind)
    ElementTree.SubElement(joint, 'parent', link=parent)
    ElementTree.SubElement(joint, 'child', link=child)
    _origin(joint, origin, rpy)
    return joint


def _rotation(robot, joint: Joint, parent: str, child: str, origin: complex, angle: float) -> None:
    stopped = joint.lower > -inf or joint.upper < inf
    element = _joint(robot, joint.name, 'revolute' if stopped else 'continuous', parent, child, origin,
                     (0.0, 0.0, angle))
    ElementTree.SubElement(element, 'axis', xyz=_numbers(0.0, 0.0, joint.axis))
    _laws(element, joint, stopped)


def _slide(robot, joint: Joint, parent: str, child: str, origin: complex, angle: float) -> None:
    element = _joint(robot, joint.name, 'prismatic', parent, child, origin, (0.0, 0.0, angle))
    along = cmath.rect(1.0, joint.axis - angle)  # in the joint's frame, which is the child's
    ElementTree.SubElement(element, 'axis', xyz=_numbers(along.real, along.imag, 0.0))
    _laws(element, joint, True)


def _laws(element, joint: Joint, range_too: bool) -> None:
    limits = {'effort': joint.effort_limit, 'velocity': UNLIMITED}
    if range_too:
        limits = {'lower': joint.lower, 'upper': joint.upper, **limits}
    ElementTree.SubElement(element, 'limit', {
        key: _numbers(min(max(value, -UNLIMITED), UNLIMITED)) for key, value in limits.items()})
    ElementTree.SubElement(element, 'dynamics', damping=_numbers(joint.damping), friction=_numbers(joint.friction))


def _link(robot, name: str, body: Body, ends: list, color: tuple) -> None:
    link = ElementTree.SubElement(robot, 'link', name=name)
    if body.mass or body.inertia_com:
        inertial = ElementTree.SubElement(link, 'inertial')
        _origin(inertial, body.center_of_mass)
        ElementTree.SubElement(inertial, 'mass', value=_numbers(body.mass))
        moment = _numbers(body.inertia_com)
        ElementTree.SubElement(inertial, 'inertia', ixx=moment, iyy=moment, izz=moment, ixy='0.0', ixz='0.0', iyz='0.0')
    for number, end in enumerate(ends):
        length = hypot(end.real, end.imag)
        visual = ElementTree.SubElement(link, 'visual')
        _origin(visual, 0.5 * end, (0.0, 0.0, cmath.phase(end) if length else 0.0))
        width = max(THICKNESS * length, 0.01)
        geometry = ElementTree.SubElement(visual, 'geometry')
        ElementTree.SubElement(geometry, 'box', size=_numbers(max(length, width), width, width))
        material = ElementTree.SubElement(visual, 'material', name=f'{name}_color')
        if number == 0:  # a material is described once, then named
            ElementTree.SubElement(material, 'color', rgba=_numbers(*body_color(body, color), 1.0))


def body_color(body: Body, otherwise: tuple) -> tuple:
    """Return red, green and blue, 0 to 1, of `visual: {color: [r, g, b]}`, or the one given."""
    color = body.visual.get('color')
    if isinstance(color, list) and len(color) >= 3 and all(
            type(part) in (int, float) and 0 <= part <= 1 for part in color[:3]):
        return tuple(float(part) for part in color[:3])
    return otherwise
