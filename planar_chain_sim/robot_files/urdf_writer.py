"""
Chain -> URDF: links, joints, inertials and simple visuals, for robot_state_publisher, RViz, Foxglove and others.

The plane stands upright: the chain's x is the world's x, its y the world's z; `world` to `base_link` is rpy
(pi/2, 0, 0). A link's frame is the body's. Springs and rotors are left out, since URDF has none. All three moments
of inertia are set to the one about the plane's normal, the only one that acts.

A body that slides and turns gets a link in between, the carriage. MuJoCo needs mass and inertia in every moving link,
so the carriage has a little of its body's mass, at the joint point, and of its carrier's inertia. Body and carrier have
that much less, so the motion is the same.

A slide without stops has a <limit> without lower and upper: urdfdom requires the element.
"""
from __future__ import annotations

import cmath
from math import hypot, inf, pi
import re
from typing import Any, NamedTuple
from xml.etree import ElementTree

from ..chain.chain import Chain
from ..chain.section import clipped
from ..chain.tree import BASE, Joint
from ..chain.visual import body_color, visual_ends
from ..mechanics.plan import plan_of

UNLIMITED = 1e9  # N m, N, rad/s, m/s: stands for no limit where URDF demands one; the reader takes it as such
THICKNESS = 0.08  # of a visual, by its length
SHARE = 2.0**-10  # of mass and inertia that a carriage gets, where its body has as much to give
LEAST_SHARE = 2.0**-44  # share of a point mass, which has no inertia to give: too small to change other numbers
HARDWARE = 'topic_based_ros2_control/TopicBasedSystem'
GRAVITY = complex(0.0, -9.81)   # m/s^2, which readers of URDF take
PLANE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)   # the chain's x and y in the frame of `world`
TOPIC = re.compile('(~/|/)?[A-Za-z_][A-Za-z0-9_/]*')
COMMANDS, STATES = '/simulator/joint_commands', '/joint_states'


def urdf_of(chain: Chain, commands: str = COMMANDS, states: str = STATES) -> str:
    """
    Return the URDF text of a chain; joint names are those of the joints, link names those of the bodies (`link_names`).

    `commands`, `states`: the topics that stand in its <ros2_control> block. TypeError: no chain. ValueError: no topic.
    """
    plan_of(chain)   # which checks it
    for name, topic in (('commands', commands), ('states', states)):
        if not isinstance(topic, str) or not TOPIC.fullmatch(topic):
            raise ValueError(f'{name} is {topic!r:.80}, must be a topic such as /joint_states')
    robot = ElementTree.Element('robot', name=chain.name)
    names, carriages = link_names(chain)
    joints = _Names(*chain.joint_names)
    for name in ('world', 'base_link'):
        ElementTree.SubElement(robot, 'link', name=name)
    _joint(robot, joints.new('world_to_base_link'), 'fixed', 'world', 'base_link', rpy=(pi / 2, 0.0, 0.0))
    masses, carriage_masses = _shared_masses(chain)
    ends = visual_ends(chain)
    for index, body in enumerate(chain.bodies):
        parent, origin = names[body.carrier], body.origin
        if body.slide and body.rotation:
            carriage = ElementTree.SubElement(robot, 'link', name=carriages[index])
            _inertial(carriage, carriage_masses[index])
            _slide(robot, body.slide, parent, carriages[index], origin, 0.0)
            parent, origin = carriages[index], 0j
        link = ElementTree.SubElement(robot, 'link', name=names[index])
        _inertial(link, masses[index])
        _visuals(link, names[index], ends[index], body_color(chain, index))
        if body.rotation:
            _rotation(robot, body.rotation, parent, names[index], origin, body.angle)
        elif body.slide:
            _slide(robot, body.slide, parent, names[index], origin, body.angle)
        else:
            _joint(robot, joints.new(f'{body.name}_weld'), 'fixed', parent, names[index], origin,
                   (0.0, 0.0, body.angle))
    _ros2_control(robot, chain, commands, states)
    ElementTree.indent(robot)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(robot, encoding='unicode') + '\n'


def link_names(chain: Chain) -> tuple[dict, dict]:
    """Return body index -> name of its link (BASE: base_link), and -> name of its carriage where it has one."""
    links = _Names('world', 'base_link')
    names = {BASE: 'base_link', **{index: links.new(body.name) for index, body in enumerate(chain.bodies)}}
    return names, {index: links.new(f'{body.name}_carriage') for index, body in enumerate(chain.bodies)
                   if body.slide and body.rotation}


class _Names:
    """Names that are all different."""

    def __init__(self, *taken: Any) -> None:
        self._taken = set(taken)

    def new(self, name: str) -> str:
        while name in self._taken:
            name += '_'
        self._taken.add(name)
        return name


class _Mass(NamedTuple):
    """Mass, kg, mass centre, m, own frame, and moment of inertia about it, kg m^2."""

    mass: float
    center: complex
    inertia: float


def _shared_masses(chain: Chain) -> tuple[list, dict]:
    """Return the mass data of each body's link, and of each carriage by its body's index."""
    turns, sharers = [], [0] * len(chain.bodies)   # whether it ever turns; how many carriages it carries
    for body in chain.bodies:
        turns.append(body.rotation is not None or (body.carrier != BASE and turns[body.carrier]))
        if body.slide and body.rotation and body.carrier != BASE:
            sharers[body.carrier] += 1
    masses = [_Mass(body.mass, body.center_of_mass, body.inertia_com) for body in chain.bodies]
    carriages = {}
    for index, body in enumerate(chain.bodies):
        if not turns[index] and body.mass and not body.inertia_com:   # which never acts, and MuJoCo wants some
            masses[index] = masses[index]._replace(inertia=SHARE * body.mass)
        if not (body.slide and body.rotation and body.mass):
            continue
        # s m at the joint point, the rest at c / (1 - s): the same first moment; J_C is less by m c^2 s / (1 - s).
        steiner = body.mass * abs(body.center_of_mass)**2
        share = min(SHARE, 0.5 * body.inertia_com / steiner) if steiner else SHARE
        share = max(share / (1.0 + share), LEAST_SHARE)
        rest = 1.0 - share
        inertia = max(masses[index].inertia - steiner * share / rest, 0.0)
        masses[index] = _Mass(body.mass * rest, body.center_of_mass / rest, inertia)
        carriages[index] = _Mass(body.mass * share, 0j, share * body.mass)
        if body.carrier != BASE and turns[body.carrier]:
            carrier = masses[body.carrier]
            part = SHARE / sharers[body.carrier] * carrier.inertia
            masses[body.carrier] = carrier._replace(inertia=carrier.inertia - part)
            carriages[index] = carriages[index]._replace(inertia=part or LEAST_SHARE * body.inertia)
    return masses, carriages


def _numbers(*values: float) -> str:
    return ' '.join(repr(float(value) + 0.0) for value in values)  # + 0.0: no -0.0


def _origin(element: Any, offset: complex, rpy: Any = (0.0, 0.0, 0.0)) -> None:
    ElementTree.SubElement(element, 'origin', xyz=_numbers(offset.real, offset.imag, 0.0), rpy=_numbers(*rpy))


def _joint(robot: Any, name: str, kind: str, parent: str, child: str, origin: complex = 0j,
           rpy: tuple = (0.0, 0.0, 0.0)) -> Any:
    joint = ElementTree.SubElement(robot, 'joint', name=name, type=kind)
    ElementTree.SubElement(joint, 'parent', link=parent)
    ElementTree.SubElement(joint, 'child', link=child)
    _origin(joint, origin, rpy)
    return joint


def _rotation(robot: Any, joint: Joint, parent: str, child: str, origin: complex, angle: float) -> None:
    kind = 'revolute' if _stopped(joint) else 'continuous'
    element = _joint(robot, joint.name, kind, parent, child, origin, (0.0, 0.0, angle))
    ElementTree.SubElement(element, 'axis', xyz=_numbers(0.0, 0.0, joint.axis))
    _laws(element, joint)


def _slide(robot: Any, joint: Joint, parent: str, child: str, origin: complex, angle: float) -> None:
    element = _joint(robot, joint.name, 'prismatic', parent, child, origin, (0.0, 0.0, angle))
    along = cmath.rect(1.0, joint.axis - angle)  # in the joint's frame, which is the child's
    ElementTree.SubElement(element, 'axis', xyz=_numbers(along.real, along.imag, 0.0))
    _laws(element, joint)


def _stopped(joint: Joint) -> bool:
    return joint.lower > -inf or joint.upper < inf


def _laws(element: Any, joint: Joint) -> None:
    limits = {'lower': joint.lower, 'upper': joint.upper} if _stopped(joint) else {}
    if limits or joint.kind == 'slide' or joint.effort_limit < UNLIMITED:
        limits.update(effort=joint.effort_limit, velocity=UNLIMITED)
        ElementTree.SubElement(element, 'limit', {
            key: _numbers(min(max(value, -UNLIMITED), UNLIMITED)) for key, value in limits.items()})
    ElementTree.SubElement(element, 'dynamics', damping=_numbers(joint.damping), friction=_numbers(joint.friction))


def _inertial(link: Any, mass: _Mass) -> None:
    if mass is not None and (mass.mass or mass.inertia):
        inertial = ElementTree.SubElement(link, 'inertial')
        _origin(inertial, mass.center)
        ElementTree.SubElement(inertial, 'mass', value=_numbers(mass.mass))
        moment = _numbers(mass.inertia)
        ElementTree.SubElement(inertial, 'inertia', ixx=moment, iyy=moment, izz=moment, ixy='0.0', ixz='0.0', iyz='0.0')


def _visuals(link: Any, name: str, ends: list, color: tuple) -> None:
    for number, end in enumerate(ends):
        length = hypot(end.real, end.imag)
        visual = ElementTree.SubElement(link, 'visual')
        _origin(visual, 0.5 * end, (0.0, 0.0, cmath.phase(end) if length else 0.0))
        width = max(THICKNESS * length, 0.01)
        geometry = ElementTree.SubElement(visual, 'geometry')
        ElementTree.SubElement(geometry, 'box', size=_numbers(max(length, width), width, width))
        material = ElementTree.SubElement(visual, 'material', name=f'{name}_color')
        if number == 0:  # a material is described once, then named
            ElementTree.SubElement(material, 'color', rgba=_numbers(*color))


def _ros2_control(robot: Any, chain: Chain, commands: str, states: str) -> None:
    """Add what a controller_manager beside the simulator needs: its hardware is our two topics."""
    control = ElementTree.SubElement(robot, 'ros2_control', name='planar_chain_sim', type='system')
    hardware = ElementTree.SubElement(control, 'hardware')
    ElementTree.SubElement(hardware, 'plugin').text = HARDWARE
    for name, value in (('joint_commands_topic', commands), ('joint_states_topic', states),
                        ('trigger_joint_command_threshold', '-1')):    # -1: a command that stays the same is sent too
        ElementTree.SubElement(hardware, 'param', name=name).text = value
    for joint in chain.joints:
        element = ElementTree.SubElement(control, 'joint', name=joint.name)
        if joint.kind == 'slide' and not _stopped(joint):
            ElementTree.SubElement(element, 'limits', enable='false')   # a limit without lower and upper reads 0 to 0
        command = ElementTree.SubElement(element, 'command_interface', name='effort')
        if joint.effort_limit < UNLIMITED:
            for name, value in (('min', -joint.effort_limit), ('max', joint.effort_limit)):
                ElementTree.SubElement(command, 'param', name=name).text = _numbers(value)
        for name, value in (('position', joint.position), ('velocity', joint.velocity), ('effort', 0.0)):
            state = ElementTree.SubElement(element, 'state_interface', name=name)
            ElementTree.SubElement(state, 'param', name='initial_value').text = _numbers(value)


def left_out(chain: Chain) -> list[str]:
    """Return the laws and other numbers of the chain that a URDF cannot have, with their joints."""
    lost = []
    for key, what in (('stiffness', 'springs'), ('armature', 'rotors'), ('preload', 'preloads'),
                      ('restitution', 'restitution')):
        names = [joint.name for joint in chain.joints if getattr(joint, key)]
        if names:
            lost.append(f'{what} of {", ".join(map(clipped, names[:6]))}'
                        + (f' and {len(names) - 6} more' if len(names) > 6 else ''))
    if chain.gravity != GRAVITY:
        lost.append(f'gravity [{chain.gravity.real:g}, {chain.gravity.imag:g}] m/s^2, readers take [0, -9.81]')
    return lost
