"""
MJCF -> Chain: MuJoCo's model format, of mechanisms whose joints all turn about one direction or slide across it.

Anything that would change the motion and that a chain cannot have is refused (possible contacts, constraints, servos,
fluids). Anything without effect on the motion is listed in the notes. Stops and friction are hard here, soft in MuJoCo.
"""
from __future__ import annotations

from math import inf
from typing import Optional, Sequence
import warnings

import numpy as np

from .account import account, quoted
from .mjcf_bodies import Hinge, Mechanism, new_name
from .mjcf_contacts import Touching
from .mjcf_document import Classes, Element
from .planar_robot import chain_of, planar_data
from .spatial_robot import Link, SpatialJoint, SpatialRobot, turn_about
from ..chain.chain import Chain
from ..chain.hold import held_at
from ..chain.section import clipped, suggestion
from ..errors import ChainError, RobotFileNote

JOINT_MOTORS = ('general', 'motor')
IDLE_ACTUATORS = ('damper', 'adhesion', 'cylinder')   # of no force while nobody commands them


def chain_from_mjcf(text: str, name: str, hold: dict) -> Chain:
    """
    Return the chain of an MJCF text; `name` stands for the file in ChainError sentences.

    `hold`: joint -> where it is welded, None for its initial position. A RobotFileNote says in one line what was done
    and which parts of the file are not used. ChainError, one sentence, for anything but a planar mechanism.
    """
    with np.errstate(all='ignore'):   # what is not finite is refused where it lands
        reader = Reader(text, name)
        robot = reader.robot(hold)
        data, plane = planar_data(robot, name)
        reader.refuse_contacts(plane)
        reader.refuse_uneven_gravcomp(plane)
    chain = chain_of(data, name)
    told = '; '.join([*account(robot, chain, plane), *reader.account()])
    warnings.warn(f'{name}: {told}', RobotFileNote, stacklevel=5)
    return chain


class Reader(Mechanism):
    """Reads forces and limits, refuses what a chain cannot have, and makes the tree of links in space."""

    def robot(self, hold: dict) -> SpatialRobot:
        """Return the tree of links; joints that `hold` names are welded."""
        self._compensate_gravity()
        self._refuse_constraints()
        self._read_actuators(hold)
        self._read_keyframe()
        kinds = {joint.name: joint.kind for body in self.bodies for joint in body.joints}
        for joint in hold:
            if joint not in self.joint_names:
                raise ChainError(f"{self.file}: hold names '{clipped(joint)}', which the file does not have"
                                 f'{suggestion(joint, sorted(self.joint_names))}, must name its joints')
            hold[joint] = held_at(joint, hold[joint], kinds[joint] == 'slide', self.file)
        return self._robot(hold)

    def account(self) -> list:
        """Return the parts of the line about the file."""
        if self.entries('sensor'):
            self.unused.append('sensors')
        joints = [joint for body in self.bodies for joint in body.joints]
        moved = [f"'{clipped(joint.name)}' ({joint.laws.get('position', 0.0):g})" for joint in joints
                 if joint.laws.get('position', 0.0) != joint.start]
        if moved:
            self.notes.append(f"initial position moved to the stop at {', '.join(moved[:6])}")
        if any('lower' in joint.laws or 'friction' in joint.laws for joint in joints):
            self.notes.append('stops and friction are hard here, soft in MuJoCo')
        unused = [f"not used: {', '.join(self.unused[:16])}"] if self.unused else []
        return self.notes + unused

    def _compensate_gravity(self) -> None:
        """Reduce gravity by gravcomp, if that is the same for all bodies."""
        heavy = [body for body in self.bodies if body.mass > 0.0 and body.weld >= 0]
        shares = [body.element.number('gravcomp', 0.0) for body in heavy]
        if not any(shares) or {'spring', 'damper'} <= self.disabled:
            return
        self.uneven = next((body.element for body, share in zip(heavy, shares) if share != shares[0]), None)
        if self.uneven is None:
            self.gravity = (1.0 - shares[0]) * self.gravity
            self.notes.append(f'gravity times {1.0 - shares[0]:g}, by gravcomp')

    def refuse_uneven_gravcomp(self, plane) -> None:
        """Refuse bodies of different gravcomp, unless gravity does not act in the plane at all."""
        if self.uneven and (abs(plane.gravity[:2]).max() > 0.0 or plane.across):
            self.uneven.fail(f'has gravcomp {self.uneven.number("gravcomp", 0.0):g}, which is not that of the bodies '
                             'before it, must be the same for all')

    def _refuse_constraints(self) -> None:
        for element in self.entries('equality'):
            resolved = self.classes.resolve(element)
            own_class = {'class': element.text('class')} if element.text('class') else {}
            usual = self.classes.resolve(Element('equality', own_class, element.line, self.file))
            active = resolved.text('active') or usual.text('active') or 'true'
            if active != 'false' and 'equality' not in self.disabled:
                element.fail(f'is a constraint (equality {clipped(element.tag)}), which is not read, must be removed '
                             'or have active="false"')
            self.unused.append(_label(element, 'equality'))
        for element in self.entries('tendon'):
            tag = Element('tendon', element.attributes, element.line, self.file)
            resolved = self.classes.resolve(tag)
            acts = [key for key in ('stiffness', 'damping', 'frictionloss', 'armature') if any(
                resolved.numbers(key, 1, 3) or ())]
            if self.range_of(resolved, 'range', 'limited') and 'limit' not in self.disabled:
                acts.append('range')
            if acts:
                element.fail(f'is a tendon with {acts[0]}, which is not read, must have none')
            self.unused.append(_label(element, 'tendon'))
        for element in self.entries('deformable'):
            if element.tag == 'flex':
                element.fail('is a flexible body, must be rigid bodies only')

    def _read_actuators(self, hold: dict) -> None:
        joints = {joint.name: joint for body in self.bodies for joint in body.joints}
        forces: dict = {}   # joint -> least and largest force, N m or N, that its motors give together
        for element in self.entries('actuator'):
            resolved = self.classes.resolve(element)
            target = resolved.text('joint') or resolved.text('jointinparent')
            if 'actuation' in self.disabled:
                self.unused.append(f"{_label(element, 'actuator')} (actuation is disabled)")
                continue
            if element.tag not in Classes.ACTUATORS:
                element.fail('is not an actuator of MJCF, must be a motor')
            if element.tag in IDLE_ACTUATORS:
                if any(resolved.numbers('bias', 1, 3) or ()):
                    self._servo(element)
                self.unused.append(_label(element))
                continue
            if element.tag not in JOINT_MOTORS or (element.tag == 'general' and self._has_bias(resolved)):
                self._servo(element)
            if not target:
                self.unused.append(f'{_label(element)} (not at a joint)')
                continue
            if target not in joints:
                element.fail(f"names the joint '{clipped(target)}', which is not there"
                             f'{suggestion(target, list(joints))}, must name a joint of the file')
            gear = (resolved.numbers('gear', 1, 6) or [1.0])[0]
            joint = joints[target]
            for ours, key in (('armature', 'armature'), ('damping', 'damping')):   # the motor's own, behind its gear
                values = resolved.numbers(key, 1, 3) or [0.0]
                if any(values[1:]):
                    element.fail(f'has a {key} that is not linear, must be one number')
                if values[0] and not (key == 'damping' and 'damper' in self.disabled):
                    joint.laws[ours] = joint.laws.get(ours, 0.0) + gear**2 * values[0]
            force = _times(self._forces(resolved, element), gear)
            if not any(force):
                self.notes.append(f'{_label(element)} gives no force')
            forces[target] = tuple(sum(both) for both in zip(forces.get(target, (0.0, 0.0)), force))
        uneven = []
        for name, joint in joints.items():
            force = _within(forces.get(name, (-inf, inf)), joint.laws.pop('force', (-inf, inf)))
            if not force[0] <= 0.0 <= force[1]:
                joint.element.fail('has an actuatorfrcrange that moves it without a command, must have one with 0 in '
                                   'it')
            if -force[0] != force[1] and name not in hold:
                uneven.append(name)
            if max(-force[0], force[1]) < inf:
                joint.laws['effort_limit'] = max(0.0, -force[0], force[1])
        if uneven:
            self.notes.append(f'effort limits taken as symmetric, by their larger side, at {quoted(uneven)}')
        moved = [name for name in forces if name not in hold]
        if moved:
            self.notes.append('commands are efforts, N m or N, gears applied; limits by motors: ' + ', '.join(
                f"{clipped(name)} {joints[name].laws.get('effort_limit', inf):g}" for name in moved[:16]))
            idle = [clipped(name) for name in joints if name not in forces and name not in hold]
            if idle:
                self.notes.append(f"without a motor, but can be commanded here: {', '.join(idle[:16])}")

    def _has_bias(self, element: Element) -> bool:
        if element.text('biastype', 'none') == 'none' and not element.text('servo'):
            return False
        return bool(element.text('servo')) or any(element.numbers('biasprm', 0, 20) or ())

    def _servo(self, element: Element) -> None:
        element.fail(f'moves its joint without a command ({clipped(element.tag)} actuator), which is not read, must be '
                     'a motor')

    def _forces(self, resolved: Element, element: Element) -> tuple[float, float]:
        """Return the least and the largest force, N m or N before the gear, that a motor gives."""
        gain = 1.0
        if element.tag == 'general':
            for key, usual in (('gaintype', 'fixed'), ('dyntype', 'none')):
                if resolved.text(key, usual) != usual:
                    self.unused.append(f'{key} of {_label(element)}')
                    gain = inf if key == 'gaintype' else gain
            gain *= (resolved.numbers('gainprm', 0, 20) or [1.0])[0] or (0.0 if gain < inf else 1.0)
        force = -inf, inf
        command = self.range_of(resolved, 'ctrlrange', 'ctrllimited')
        if command and 'clampctrl' not in self.disabled and abs(gain) < inf:
            force = tuple(command)
        force = _times(force, gain)
        if limits := self.range_of(resolved, 'forcerange', 'forcelimited'):
            force = _within(force, limits)
        if not force[0] <= 0.0 <= force[1]:
            element.fail('moves its joint without a command, as its range does not have 0 in it, must be a motor with '
                         '0 in its range')
        return force

    def _read_keyframe(self) -> None:
        keys = self.entries('keyframe')
        if not keys:
            return
        joints = [joint for body in self.bodies for joint in body.joints]
        key, *others = keys
        for entry, zero in (('qpos', None), ('qvel', 0.0)):
            values = key.numbers(entry, len(joints), len(joints))
            for joint, value in zip(joints, values or ()):
                if entry == 'qvel':
                    joint.laws['velocity'] = value
                else:
                    lower, upper = joint.laws.get('lower', -inf), joint.laws.get('upper', inf)
                    joint.laws['position'] = min(max(value, lower), upper)
                    joint.start = value
        self.notes.append(f"starts at keyframe '{clipped(key.text('name') or '0')}'")
        if others:
            self.unused.append('other keyframes')

    def refuse_contacts(self, plane) -> None:
        """Refuse a mechanism whose geoms could touch as it moves."""
        normal = None if plane.across or plane.largest_angle > 1e-9 else plane.basis[2]
        geoms = self.world_geoms + [geom for body in self.bodies for geom in body.geoms]
        by_name = {geom.name: geom for geom in geoms if geom.name}
        body_names = {body.name: index for index, body in enumerate(self.bodies)}
        excluded, pairs = set(), []
        for element in self.entries('contact'):
            if element.tag == 'exclude':
                ends = [body_names.get(element.text(key), -1) for key in ('body1', 'body2')]
                excluded.add((min(ends), max(ends)))
            elif element.tag == 'pair':
                pairs.append([by_name.get(element.text(key)) for key in ('geom1', 'geom2')])
                if None in pairs[-1]:
                    element.fail('names a geom that is not there, must name two')
        if 'contact' in self.disabled:
            self.unused.append('contacts (disabled in the file)')
            return
        touching = Touching(self.bodies, normal, 'filterparent' not in self.disabled)
        found = touching.first(geoms, excluded, pairs)
        if found:
            one, other = (geom.element for geom in found)
            labels = [f"'{clipped(geom.name)}'" if geom.name else f'of line {geom.element.line}' for geom in found]
            (one if found[0].body >= 0 else other).fail(
                f'could touch another: {labels[0]} and {labels[1]}, contacts are not simulated, must be kept apart or '
                'have <option><flag contact="disable"/></option> for the motion without them')

    def _robot(self, hold: dict) -> SpatialRobot:
        """Return the tree of links and joints: of several joints in one body all but the last carry an empty link."""
        names = {body.name for body in self.bodies}
        root = new_name('world', names)
        links, joints, frames, at = {root: Link(root)}, [], {root: (np.eye(3), np.zeros(3))}, {-1: root}
        for index, body in enumerate(self.bodies):
            parent = at[body.parent]
            steps = [(joint, joint.point if joint.kind == 'rotation' else body.point) for joint in body.joints]
            for number, (joint, point) in enumerate(steps or [(None, body.point)]):
                last = number + 1 >= len(steps)
                name = body.name if last else new_name(f'{body.name}_{joint.name}', names)
                links[name], frames[name] = Link(name), (body.turn, point)
                joints.append(self._joint(joint, parent, name, frames, hold))
                parent = name
            links[parent] = Link(parent, body.mass, body.turn.T @ (body.center - point) if body.mass else np.zeros(3),
                                 body.turn.T @ body.inertia @ body.turn)
            at[index] = parent
        return SpatialRobot(self.model or 'mechanism', root, links, joints, tuple(self.gravity))

    def _joint(self, joint: Optional[Hinge], parent: str, child: str, frames: dict, hold: dict) -> SpatialJoint:
        """Return a joint of the tree, or a weld; `frames`: where the links are as the file draws them."""
        (turn, shift), (own_turn, own_shift) = frames[parent], frames[child]
        if joint is None:
            return SpatialJoint(new_name(f'{child}_weld', self.joint_names), 'fixed', parent, child,
                                turn.T @ own_turn, turn.T @ (own_shift - shift), np.array([1.0, 0.0, 0.0]), {})
        axis = own_turn.T @ joint.axis
        if joint.kind == 'rotation':         # back to where it reads 0
            own_turn = own_turn @ turn_about(axis, -joint.drawn_at)
        else:
            own_shift = own_shift - joint.drawn_at * joint.axis
        welded_at = None
        if joint.name in hold:
            welded_at = joint.laws.get('position', 0.0) if hold[joint.name] is None else hold[joint.name]
        return SpatialJoint(joint.name, joint.kind, parent, child, turn.T @ own_turn, turn.T @ (own_shift - shift),
                            axis, joint.laws, welded_at)


def _label(element: Element, kind: str = '') -> str:
    """Return how a note names an element: by its name, else by its line."""
    if name := element.text('name'):
        return f'{kind or clipped(element.tag)} {clipped(name)}'
    return f"{clipped(element.tag)}{f' {kind}' if kind else ''} on line {element.line}"


def _times(ends: tuple, factor: float) -> tuple[float, float]:
    """Return the ends of a range times a factor; 0 times infinity is 0."""
    products = [end * factor if factor and end else 0.0 for end in ends]
    return min(products), max(products)


def _within(ends: tuple, limits: Sequence) -> tuple[float, float]:
    """Return the ends of what is clamped to limits."""
    return tuple(min(max(end, limits[0]), limits[1]) for end in ends)
