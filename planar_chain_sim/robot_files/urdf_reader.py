"""
URDF -> Chain: links, inertials, joints, origins, axes, limits, dynamics, mimics, and whatever else affects the motion.

One line, a Python warning of the class RobotFileNote, says what is not used, and gives joints, plane and gravity.
"""
from __future__ import annotations

import heapq
from math import inf, isfinite
import re
from typing import NoReturn
import warnings

import numpy as np

from .account import account, listed, quoted
from .planar_robot import chain_of, planar_data
from .spatial_robot import Link, SpatialJoint, SpatialRobot
from .urdf_writer import UNLIMITED
from .xml_elements import Element, read_xml
from ..chain.chain import Chain
from ..chain.hold import held_at
from ..chain.section import clipped, suggestion
from ..errors import ChainError, RobotFileNote

KINDS = {'fixed': 'fixed', 'continuous': 'rotation', 'revolute': 'rotation', 'prismatic': 'slide'}
FREE = ('floating', 'planar')
MAX_JOINTS = 10_000
NUMBER = re.compile(r'[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(inf|nan|infinity)', re.ASCII | re.IGNORECASE)
PART_OF_ROBOT = ('link', 'joint', 'material', 'transmission', 'gazebo', 'ros2_control', 'sensor')
PART_OF_JOINT = ('parent', 'child', 'origin', 'axis', 'limit', 'dynamics', 'mimic')
TAKEN = {'limit': ('lower', 'upper', 'effort', 'velocity'), 'dynamics': ('damping', 'friction')}
SPRINGS = ('springStiffness', 'springReference')   # of a joint, in <gazebo>; and others there that change a motion
OFF, ON = ('', '0', '0.0', 'false'), ('', '1', '1.0', 'true')
OF_GAZEBO = {'gravity': ON, 'turnGravityOff': OFF, 'kinematic': OFF, 'dampingFactor': OFF, 'static': OFF}   # usual
NOT_THERE = 'which the robot does not have'


def chain_from_urdf(text: str, name: str, hold: dict) -> Chain:
    """
    Return the chain of a URDF text; `name` stands for the file in ChainError sentences.

    `hold`: joint -> where it is welded, None for its initial position. `Chain.source` is the YAML text of the same
    chain. ChainError, one sentence, for a text that is no URDF and for a robot that is not planar, with the joints that
    make it so.
    """
    reader = Reader(read_xml(text, name), name)
    robot = reader.robot(dict(hold))
    data, plane = planar_data(robot, name)
    chain = chain_of(data, name)
    warnings.warn(f'{name}: {reader.account(robot, chain, plane)}', RobotFileNote, stacklevel=5)
    for limit, joints in reader.powerless.items():
        warnings.warn(f'{name}: effort limit {limit} at {quoted(joints)}, taken as no limit', stacklevel=5)
    return chain


class Reader:
    """Reads the elements of one URDF; every refusal is a ChainError sentence."""

    def __init__(self, root: Element, name: str):
        """Refuse a text that is no URDF, or a URDF with more than a tree of links."""
        self.name, self.root = name, root
        self.welded = {}      # link that <gazebo> welds to the world -> how to refuse that
        self.unused = {}      # what is dropped -> names of where it stands, in the order of the text
        self.unstopped, self.moved = [], []
        self.powerless = {}   # effort limit that is none, as text -> joints
        if root.tag != 'robot':
            self.fail(f"is XML with the root element '{clipped(root.tag)}', must be the URDF of a robot")
        self._refuse_xacro()
        self._refuse_loops()
        self._look_over()

    def fail(self, problem) -> NoReturn:
        """Raise the ChainError sentence."""
        raise ChainError(f'{self.name}: {problem}')

    def drop(self, what: str, where: str = '') -> None:
        """Note a part that is not used."""
        self.unused.setdefault(what, {})[where] = None

    # What must not be dropped in silence

    def _refuse_xacro(self) -> None:
        prefixes = {key.partition(':')[2] + ':' for key, value in self.root.attributes.items()
                    if key.startswith('xmlns:') and 'xacro' in value} | {'xacro:'}
        old = [child for child in self.root.children if child.tag in ('macro', 'include', 'property')]
        for element in [*old, *self.root.walk()]:
            texts = (element.text, *element.attributes.values())
            if element in old or element.tag.partition(':')[0] + ':' in prefixes and ':' in element.tag:
                what = f'the element {clipped(element.tag)}'
            else:
                what = next((clipped(text.strip()) for text in texts if '${' in text or '$(' in text), None)
            if what:
                self.fail(f'holds {what} of xacro on line {element.line}, must be expanded first: '
                          'xacro FILE > robot.urdf')

    def _refuse_loops(self) -> None:
        for block in (*self.root.all('gazebo'), *self.root.all('mujoco')):
            for element in block.walk():
                where = f'in <{block.tag}>, line {element.line}'
                if element.tag == 'joint' and element.find('parent') and element.find('child'):
                    parent, child = (_text_or_link(element.find(end)) for end in ('parent', 'child'))
                    what = f"joint '{clipped(element.get('name') or '')}'", parent, child, where
                    if element.get('type') != 'fixed' or 'world' not in (parent, child):
                        self._refuse_loop(*what)
                    self.welded[child if parent == 'world' else parent] = what
                elif element.tag == 'plugin' and any(   # by name, or by file alone: ...-detachable-joint-system.so
                        'detachablejoint' in re.sub('[-_]', '', text).lower() for text in element.attributes.values()):
                    parent, child = (_text_or_link(element.find(end)) for end in ('parent_link', 'child_link'))
                    what = f"DetachableJoint '{clipped(element.get('name') or element.get('filename') or '')}'"
                    if child in [link.get('name') for link in self.root.all('link')]:
                        self._refuse_loop(what, parent, child, where)
                    self.fail(f"{what} ({where}) ties link '{clipped(parent)}' to another model, must not have it")
                elif element.tag == 'equality' and element.children:
                    first = element.children[0]
                    self._refuse_loop(f"{clipped(first.tag)} '{clipped(first.get('name') or '')}'",
                                      first.get('body1') or '', first.get('body2') or '', where)
        for element in self.root.all('loop_joint'):
            self._refuse_loop(f"joint '{clipped(element.get('name') or '')}'", '', '', f'on line {element.line}')

    def _refuse_loop(self, what: str, parent: str, child: str, where: str) -> NoReturn:
        between = f" between '{clipped(parent)}' and '{clipped(child)}'" if parent and child else ''
        self.fail(f'{what}{between} ({where}) closes a loop, must be a robot without loops')

    def _look_over(self) -> None:
        """Note the parts that are dropped."""
        for child in self.root.children:
            if child.tag not in PART_OF_ROBOT:
                self.drop(f'element {clipped(child.tag)}')
            for part in child.walk() if child.tag == 'gazebo' else ():
                if part.tag in SPRINGS and part.text.strip() not in ('', '0', '0.0'):
                    self.drop('springs', child.get('reference') or '')
                elif part.tag in OF_GAZEBO and part.text.strip().lower() not in OF_GAZEBO[part.tag]:
                    self.drop(f'{part.tag} of gazebo', child.get('reference') or '')

    # Numbers

    def numbers(self, element, key: str, default: tuple, where: str) -> np.ndarray:
        """Return the numbers of an attribute, as many as the default has, which stands for one that is missing."""
        text = element.get(key) if element is not None else None
        if text is None:
            return np.array(default, dtype=float)
        words = text.replace(',', ' ').split(None, 32)
        if len(words) != len(default) or not all(map(NUMBER.fullmatch, words)):
            count = 'a number' if len(default) == 1 else f'{len(default)} numbers'
            self.fail(f"{where} has {key} '{clipped(text)}', must be {count}")
        return np.array([float(word) for word in words])

    def number(self, element, key: str, where: str, least=-inf, default: float = 0.0) -> float:
        """Return one finite number of an attribute."""
        value = float(self.numbers(element, key, (default,), where)[0])
        if not least <= value < inf:
            self.fail(f"{where} has {key} '{clipped(element.get(key))}', must be a finite number"
                      + (f' >= {least:g}' if least > -inf else ''))
        return value

    def frame(self, owner: Element, where: str) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation and translation of the origin of an element, which may be missing."""
        origin = owner.find('origin')
        rpy, xyz = (self.numbers(origin, key, (0.0, 0.0, 0.0), where) for key in ('rpy', 'xyz'))
        return _rotation(rpy), xyz

    def named(self, tag: str) -> dict:
        """Return name -> element of the robot's links or joints."""
        found = {}
        for element in self.root.all(tag):
            name = element.get('name')
            if not name or not name.isprintable():
                what = f"the name '{clipped(name)}'" if name else 'no name'
                self.fail(f'{tag} on line {element.line} has {what}, must have a printable one')
            if name in found:
                self.fail(f"has two {tag}s '{clipped(name)}', on lines {found[name].line} and {element.line}, "
                          'must have different names')
            found[name] = element
        return found

    # The robot

    def robot(self, hold: dict) -> SpatialRobot:
        """Return the tree of links; joints that `hold` names are welded."""
        links, joints = self.named('link'), self.named('joint')
        if len(joints) > MAX_JOINTS:
            self.fail(f'has {len(joints)} joints, must have at most {MAX_JOINTS}')
        for name in hold:
            if name not in joints:
                self.fail(f"hold names '{clipped(name)}', {NOT_THERE}{suggestion(name, list(joints))}, must name its "
                          'joints')
            hold[name] = held_at(name, hold[name], joints[name].get('type') == 'prismatic', self.name)
        ends = self._ends(joints, links)
        order, root = self._in_order(joints, ends, links)
        initial = self._initial_states(joints)
        self._hold_followers(joints, hold, initial)
        made = {}
        for name in order:
            made[name] = self._joint(name, joints[name], ends[name], hold, initial.get(name, {}))
        still = {root, 'world'}   # what stands may be welded to the world
        still.update(joint.child for joint in made.values() if joint.parent in still and not joint.moves)
        for link, what in self.welded.items():
            if link not in still:
                self._refuse_loop(*what)
        bodies = {name: self._link(name, element) for name, element in links.items()}
        bodies.setdefault('world', Link('world'))
        if bodies[root].mass:
            self.drop(f"the mass of the root link '{clipped(root)}', which is the base")
        reached = {root, *(joint.child for joint in made.values())}
        title = self.root.get('name') or ''
        return SpatialRobot(title if title and title.isprintable() else 'robot', root,
                            {name: bodies[name] for name in bodies if name in reached}, list(made.values()))

    def _ends(self, joints, links) -> dict:
        """Return joint -> (parent, child)."""
        ends, owner = {}, {}
        for name, element in joints.items():
            parent, child = (_text_or_link(element.find(end)) for end in ('parent', 'child'))
            for end, link in (('parent', parent), ('child', child)):
                if link not in links and not (end == 'parent' and link == 'world'):
                    what = f"the {end} '{clipped(link)}', {NOT_THERE}{suggestion(link, list(links))}" if link else \
                        f'no {end}'
                    self.fail(f"joint '{clipped(name)}' has {what}, must join two links of the robot")
            if child in owner or child == parent:
                other = f", which '{clipped(owner[child])}' carries" if child in owner else ''
                self.fail(f"joint '{clipped(name)}' closes a loop at link '{clipped(child)}'{other}, must be a robot "
                          'without loops')
            owner[child] = name
            ends[name] = parent, child
        return ends

    def _in_order(self, joints, ends, links) -> tuple[list, str]:
        """Return the joints' names, a carrier's first, else in the order of the text; and the root."""
        children = {child for _, child in ends.values()}
        roots = dict.fromkeys(parent for parent, _ in ends.values() if parent not in children)
        if not ends:
            self.fail('has no joint that moves, must have one')
        if not roots:
            self.fail(f'joints {quoted(ends)} close a loop, must be a robot without loops')
        if len(roots) > 1:
            self.fail(f'has {len(roots)} links that no joint carries, {quoted(roots)}, must be one tree')
        root = next(iter(roots))
        for link in links:
            if link not in children and link != root:
                self.drop(f"link '{clipped(link)}', which no joint joins to the others")
        place = {name: index for index, name in enumerate(joints)}
        carried = {}
        for name, (parent, _) in ends.items():
            carried.setdefault(parent, []).append(name)
        order, ready = [], [(place[name], name) for name in carried[root]]
        heapq.heapify(ready)
        while ready:
            _, name = heapq.heappop(ready)
            order.append(name)
            for other in carried.get(ends[name][1], ()):
                heapq.heappush(ready, (place[other], other))
        if len(order) < len(joints):
            left = [name for name in joints if name not in set(order)]
            self.fail(f'joints {quoted(left)} close a loop, must be a robot without loops')
        return order, root

    def _hold_followers(self, joints, hold, initial) -> None:
        """Weld the joints that mimic welded joints at the matching values; ChainError: the mimicked joint moves."""
        leaders = {name: element.find('mimic') for name, element in joints.items() if element.find('mimic')}
        for follower, mimic in self._other_mimics():
            if follower in joints:
                leaders.setdefault(follower, mimic)
            else:
                self.drop(f"mimic at '{clipped(follower or '')}', {NOT_THERE}")
        for name in leaders:
            way, at = [], name
            while at in leaders and at not in hold and at not in way:
                way.append(at)
                at = leaders[at].get('joint')
            if at not in hold:
                leader = leaders[name].get('joint') or ''
                if leader not in joints:
                    whom = f"'{clipped(leader)}', {NOT_THERE}{suggestion(leader, list(joints))}" if leader else \
                        'a joint that it does not name'
                    self.fail(f"joint '{clipped(name)}' mimics {whom}, must move on its own or be welded (hold "
                              f"'{clipped(name)}')")
                self.fail(f"joint '{clipped(name)}' mimics '{clipped(leader)}', must move on its own or be welded "
                          f"(hold '{clipped(name)}', or '{clipped(leader)}' and with it all that mimic it)")
            for follower in reversed(way):
                where = f"mimic of joint '{clipped(follower)}'"
                mimic = leaders[follower]
                hold[follower] = (self.number(mimic, 'multiplier', where, default=1.0)
                                  * self._held_at(at, joints[at], hold, initial)
                                  + self.number(mimic, 'offset', where))
                at = follower

    def _other_mimics(self):
        """Yield (follower, element mimic) of what <gazebo> and <ros2_control> say instead of the element."""
        for plugin in (part for block in self.root.all('gazebo') for part in block.walk() if part.find('mimicJoint')):
            values = {part.tag: part.text.strip() for part in plugin.children}
            # the names of roboticsgroup_gazebo_plugins: `joint` leads, `mimicJoint` follows
            yield values['mimicJoint'], Element('mimic', {**values, 'joint': values.get('joint', '')}, plugin.line)
        for joint in (joint for block in self.root.all('ros2_control') for joint in block.all('joint')):
            values = {param.get('name'): param.text.strip() for param in joint.all('param')}
            says = (joint.get('mimic') or 'false').lower()
            if says in ('true', '1') or 'mimic' in values:
                yield joint.get('name'), Element('mimic', {**values, 'joint': values.get('mimic', '')}, joint.line)

    def _held_at(self, name, element, hold, initial) -> float:
        if hold[name] is None:
            laws = self._laws(name, element, KINDS.get(element.get('type')), initial.get(name, {}), False)
            hold[name] = laws.get('position', 0.0)
        return hold[name]

    def _joint(self, name: str, element: Element, ends, hold, initial) -> SpatialJoint:
        where, kind = f"joint '{clipped(name)}'", element.get('type')
        turn, shift = self.frame(element, where)
        welded = name in hold
        if kind in FREE:
            if not welded:
                self.fail(f"{where} is of type '{kind}', must be one of {', '.join(KINDS)}, or be welded where it is "
                          f"(hold '{clipped(name)}')")
            if hold[name]:
                self.fail(f"{where} is of type '{kind}', must be welded without a value")
            hold[name], kind = None, 'fixed'
        if kind not in KINDS:
            self.fail(f"{where} is of type '{clipped(kind or '')}', must be one of {', '.join(KINDS)}")
        axis = np.array([1.0, 0.0, 0.0])
        laws, kind = {}, KINDS[kind]
        if kind != 'fixed':
            axis = self.numbers(element.find('axis'), 'xyz', (1.0, 0.0, 0.0), where)
            if 1e100 < abs(axis).max() < inf:   # whose square is too large
                axis = axis / abs(axis).max()
            length = np.linalg.norm(axis)
            if not isfinite(length) or length < 1e-9:
                self.fail(f'{where} has the axis {axis.tolist()}, must be a direction')
            axis = axis / length
            laws = self._laws(name, element, kind, initial, not welded)
        if welded:
            value = hold[name]
            if kind == 'fixed' and value:
                self.fail(f"hold gives the value {value!r} to joint '{clipped(name)}', which is fixed, must be a joint "
                          'that moves')
            welded_at = laws.get('position', 0.0) if value is None else value
            lower, upper = laws.get('lower', -inf), laws.get('upper', inf)
            if not lower <= welded_at <= upper:
                self.fail(f"hold gives {welded_at!r} to joint '{clipped(name)}', must lie between its limits, "
                          f'{lower!r} and {upper!r}')
        return SpatialJoint(name, kind, ends[0], ends[1], turn, shift, axis, laws, welded_at if name in hold else None)

    def _laws(self, name: str, element: Element, kind, initial: dict, told: bool) -> dict:
        """Return the keys of a chain file for the joint's limits, damping, friction and initial state."""
        where, laws = f"joint '{clipped(name)}'", {}
        limit, dynamics = element.find('limit'), element.find('dynamics')
        if element.get('type') != 'continuous':
            lower, upper = (float(self.numbers(limit, key, (0.0,), where)[0]) for key in ('lower', 'upper'))
            if lower < upper:
                laws.update(lower=lower, upper=upper)
            elif told and (element.get('type') == 'revolute' or limit is None or limit.get('lower') or
                           limit.get('upper')):    # a slide whose limit has no ends is one without, as ours are
                self.unstopped.append(f"'{clipped(name)}' ({lower:g} to {upper:g})" if limit is not None else
                                      f"'{clipped(name)}' (no limits)")
        if limit is not None and limit.get('effort') is not None:
            effort = float(self.numbers(limit, 'effort', (0.0,), where)[0])
            if effort > 0.0:
                laws['effort_limit'] = effort
            elif told:
                self.powerless.setdefault(f'{effort:g}', []).append(name)
        if dynamics is not None:
            laws.update({key: self.number(dynamics, key, where, 0.0) for key in ('damping', 'friction')})
        laws.update({key: value for key, value in initial.items() if value})
        laws = {key: value for key, value in laws.items()
                if abs(value) < UNLIMITED and (value or key in TAKEN['limit'])}
        start = laws.get('position', 0.0)
        start = min(max(start, laws.get('lower', -inf)), laws.get('upper', inf))   # 0 may lie beyond a stop
        if start != laws.get('position', 0.0) and told:
            self.moved.append(f"'{clipped(name)}' ({start:g})")
        if start:
            laws['position'] = start
        if told:
            self._look_over_joint(name, element)
        return laws

    def _look_over_joint(self, name: str, element: Element) -> None:
        velocity = self.numbers(element.find('limit'), 'velocity', (0.0,), f"joint '{clipped(name)}'")[0]
        if 0.0 < velocity < UNLIMITED:
            self.drop('velocity limits', name)
        for part in element.children:
            if part.tag not in PART_OF_JOINT:
                self.drop(clipped(part.tag), name)
            for key in part.attributes if part.tag in TAKEN else ():
                if key not in TAKEN[part.tag]:
                    self.drop(f'{clipped(key)} of {part.tag}', name)

    def _initial_states(self, joints) -> dict:
        """Return joint -> position and velocity by ros2_control's `initial_value` and `initial_position`."""
        found = {}
        for block in self.root.all('ros2_control'):
            for joint in block.all('joint'):
                values = found.setdefault(joint.get('name'), {})
                where = f"joint '{clipped(joint.get('name') or '')}' of ros2_control"
                for owner in (joint, *joint.all('command_interface'), *joint.all('state_interface')):
                    for param in owner.all('param'):
                        quantity = owner.get('name') if param.get('name') == 'initial_value' else \
                            (param.get('name') or '').removeprefix('initial_')
                        if quantity not in ('position', 'velocity') or owner is joint and (
                                param.get('name') == quantity):
                            continue
                        word = param.text.strip()
                        if not NUMBER.fullmatch(word) or not isfinite(float(word)):
                            self.fail(f"{where} has {param.get('name')} '{clipped(word)}', must be a finite number")
                        value = float(word)
                        if joint.get('name') not in joints:
                            self.drop(f"initial {quantity} of '{clipped(joint.get('name') or '')}', {NOT_THERE}")
                        elif values.get(quantity, value) != value:
                            self.drop(f"initial {quantity} {values[quantity]:g} of '{clipped(joint.get('name'))}', "
                                      f'which a later one, {value:g}, replaces')
                        values[quantity] = value
        return found

    def _link(self, name: str, element: Element) -> Link:
        inertial, where = element.find('inertial'), f"link '{clipped(name)}'"
        if inertial is None:
            return Link(name)
        turn, center = self.frame(inertial, where)
        mass = self.number(inertial.find('mass'), 'value', where, 0.0)
        part = inertial.find('inertia')
        xx, yy, zz, xy, xz, yz = (self.number(part, f'i{axes}', where) for axes in ('xx', 'yy', 'zz', 'xy', 'xz', 'yz'))
        if not np.isfinite(center).all() or not np.isfinite(turn).all():
            self.fail(f'{where} has a mass centre that is not finite, must have a finite one')
        if mass and part is None:
            self.drop(f"inertia, none is given, of link '{clipped(name)}'")
        matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        return Link(name, mass, center, turn @ matrix @ turn.T)

    # The line about the file

    def account(self, robot: SpatialRobot, chain: Chain, plane) -> str:
        """Return the line about the file: joints, plane, gravity, changes to them, and what is not used."""
        parts = account(robot, chain, plane)
        for what, which in (('no stops at ', self.unstopped),
                            ('initial position moved to the stop at ', self.moved)):
            if which:
                parts.append(what + listed(which))
        if self.unused:
            parts.append('not used: ' + ', '.join(
                what + (f' ({len(where)})' if len(where) > 1 else '') for what, where in
                list(self.unused.items())[:12]))
        return '; '.join(parts)


def _text_or_link(element) -> str:
    """Return the link that a parent or child element names, by attribute or, as in SDF, by text."""
    return '' if element is None else element.get('link') or element.text.strip()


def _rotation(rpy) -> np.ndarray:
    """Return the rotation matrix of roll, pitch, yaw about fixed axes: Rz(yaw) Ry(pitch) Rx(roll)."""
    with np.errstate(invalid='ignore'):
        (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                     [-sp, cp * sr, cp * cr]])
