"""
MJCF -> Chain: MuJoCo's model format, of mechanisms whose joints all turn about one direction or slide across it.

What the motion needs and a chain cannot have is refused (contacts that can happen, constraints, servos, fluids); what
has no part in the motion is listed in the notes. Stops and friction are hard here, in MuJoCo they are soft.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import Optional
import warnings

import numpy as np

from .chain import Chain, ChainError, RobotFileNote
from .chain_section import clipped, suggestion
from .mjcf_document import Classes, Compiler, Element, parse
from .mjcf_geoms import Geom, inertia_of, mass_of, read_geom, Touching
from .planar_robot import account, Link, planar_data, SpatialJoint, SpatialRobot, turn_about

SECTIONS = ('compiler', 'option', 'size', 'statistic', 'visual', 'default', 'custom', 'extension', 'asset', 'worldbody',
            'deformable', 'contact', 'equality', 'tendon', 'actuator', 'sensor', 'keyframe', 'include')
JOINT_KNOWN = ('name class type group pos axis springdamper limited actuatorfrclimited solreflimit solimplimit '
               'solreffriction solimpfriction stiffness range actuatorfrcrange actuatorgravcomp margin ref springref '
               'springyield armature damping frictionloss user').split()
BODY_KNOWN = ('name childclass mocap pos quat axisangle xyaxes zaxis euler gravcomp user fuse simple sleep').split()
INERTIAL_KNOWN = 'pos quat axisangle xyaxes zaxis euler mass diaginertia fullinertia'.split()
OPTION_NUMBERS = {'gravity': 3, 'wind': 3, 'density': 1, 'viscosity': 1}
LOOKS = ('skybox.xml', 'visual.xml', 'materials.xml', 'materials_white_floor.xml')   # of dm_control: no mechanics
UNSEEN = ('site', 'camera', 'light')             # in a body: of no weight
JOINT_MOTORS = ('general', 'motor')
IDLE_ACTUATORS = ('damper', 'adhesion', 'cylinder')   # of no force while nobody commands them
TRANSMISSIONS = ('joint', 'jointinparent', 'tendon', 'site', 'body', 'cranksite', 'slidersite')


@dataclass
class Hinge:
    """One joint of a body, hinge or slide, in the root's frame as the file draws it."""

    element: Element
    name: str
    kind: str                    # 'rotation' or 'slide'
    axis: np.ndarray
    point: np.ndarray
    drawn_at: float              # rad or m
    start: float                 # initial position as the file has it
    laws: dict

    @property
    def way(self) -> float:
        """Return how far the joint goes at most from where it is drawn."""
        return max(abs(self.laws.get('lower', -inf) - self.drawn_at), abs(self.laws.get('upper', inf) - self.drawn_at))


@dataclass
class SpaceBody:
    """One body, its joints and its mass, in the root's frame as the file draws it."""

    element: Element
    name: str
    parent: int                  # -1: the world
    weld: int                    # the body that it is fixed to: itself where it has joints, -1 the world
    turn: np.ndarray
    point: np.ndarray
    joints: list = field(default_factory=list)
    inertial: Optional[Element] = None
    geoms: list = field(default_factory=list)
    mass: float = 0.0
    center: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))


def chain_from_mjcf(text: str, name: str, hold: dict) -> Chain:
    """
    Return the chain of an MJCF text; `name` stands for the file in ChainError sentences.

    `hold`: joint -> where it is welded, None for its initial position. A RobotFileNote tells in one line what was done,
    and what of the file has no part in the motion. ChainError, one sentence, for what is no planar mechanism.
    """
    from .chain_yaml import chain_from_dict
    with np.errstate(all='ignore'):   # what is not finite is refused where it lands
        reader = _Reader(text, name)
        robot = reader.robot(hold)
        data, plane = planar_data(robot, name)
        reader.refuse_contacts(plane)
        reader.refuse_uneven_gravcomp(plane)
    try:
        chain = chain_from_dict(data)
    except ChainError as error:
        raise ChainError(f'{name}: {error}') from None
    told = '; '.join([*account(robot, chain, plane), *reader.account()])
    warnings.warn(f'{name}: {told}', RobotFileNote, stacklevel=5)
    return chain


class _Reader:
    """One text while it is read."""

    def __init__(self, text: str, name: str):
        self.file, self.notes, self.unused, self.uneven = name, [], [], None
        root = parse(text, name)
        if root.tag != 'mujoco':
            root.fail('is not the root of an MJCF, must be <mujoco>')
        self.model = root.text('model')
        self.sections = {key: [] for key in SECTIONS}
        for element in root.children:
            if element.tag not in SECTIONS:
                element.fail(f'is unknown{suggestion(element.tag, SECTIONS)}, must be a section of MJCF')
            self.sections[element.tag].append(element)
        self._includes(root)
        self.compiler = Compiler(self.sections['compiler'])
        self.classes = Classes(self.sections['default'])
        self.bodies: list[SpaceBody] = []
        self.joint_names: set[str] = set()
        self.world_geoms: list[Geom] = []
        self._read_options()

    def entries(self, section: str) -> list:
        """Return the elements of a section, which may stand in several parts."""
        return [child for element in self.sections[section] for child in element.children]

    def robot(self, hold: dict) -> SpatialRobot:
        """Return the tree of links; joints that `hold` names are welded."""
        self._read_bodies()
        self._give_masses()
        self._compensate_gravity()
        self._refuse_constraints()
        self._read_actuators()
        self._read_keyframe()
        for joint in hold:
            if joint not in self.joint_names:
                raise ChainError(f"{self.file}: hold names '{clipped(joint)}', of which the mechanism has none"
                                 f'{suggestion(joint, sorted(self.joint_names))}, must name its joints')
        return self._robot(hold)

    def account(self) -> list:
        """Return what is to be told of the file."""
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

    # ---- the file as a whole

    def _includes(self, root: Element) -> None:
        stack, at_top = list(root.children), {id(child) for child in root.children}
        while stack:
            element = stack.pop()
            stack.extend(element.children)
            if element.tag == 'include':
                path = element.text('file')
                if id(element) not in at_top or path.replace('\\', '/').rpartition('/')[2] not in LOOKS:
                    element.fail(f"takes in '{clipped(path)}', other files are not read, must be one file (MuJoCo "
                                 'writes one: mj_saveLastXML)')
        includes = [element.text('file') for element in self.sections['include']]
        self.unused += [clipped(path) for path in includes]

    def _read_options(self) -> None:
        option = {'gravity': [0.0, 0.0, -9.81], 'wind': [0.0] * 3, 'density': [0.0], 'viscosity': [0.0]}
        self.disabled, unused = set(), []
        for element in self.sections['option']:
            for key in element.attributes:
                if key in OPTION_NUMBERS:
                    option[key] = element.numbers(key, OPTION_NUMBERS[key], OPTION_NUMBERS[key])
                elif key not in ('magnetic',):
                    unused.append(key)
            for flag in element.children:
                if flag.tag != 'flag':
                    flag.fail('is unknown here, must be <flag>')
                for key in flag.attributes:
                    if flag.word(key, ('enable', 'disable'), 'enable') == 'disable':
                        self.disabled.add(key)
        if option['density'][0] or option['viscosity'][0]:
            self.sections['option'][0].fail('has a density or viscosity of the air, which is not simulated, must have '
                                            'none')
        self.gravity = np.array(option['gravity'])
        if 'constraint' in self.disabled:
            self.disabled |= {'equality', 'frictionloss', 'limit', 'contact'}
        if 'passive' in self.disabled:
            self.disabled |= {'spring', 'damper'}
        if 'gravity' in self.disabled:
            self.gravity = np.zeros(3)
        if unused:
            self.unused.append(f"option {' '.join(dict.fromkeys(unused))}")

    # ---- bodies, joints, masses

    def _read_bodies(self) -> None:
        world = self.entries('worldbody')
        if not world:
            raise ChainError(f'{self.file}: has no body in <worldbody>, must have one')
        root = Element('worldbody', {}, self.sections['worldbody'][0].line, self.file)
        root.children = world
        names, joint_names = set(), self.joint_names
        waiting = [(root, -2, np.eye(3), np.zeros(3), self.sections['worldbody'][0].text('childclass') or None)]
        while waiting:
            element, parent, turn, shift, inherited = waiting.pop()
            if parent == -2:
                index, own_turn, own_shift = -1, turn, shift
            else:
                element.refuse_unknown(BODY_KNOWN)
                own_turn, own_shift = self.compiler.pose(element)
                own_turn, own_shift = turn @ own_turn, shift + turn @ own_shift
                inherited = element.text('childclass') or inherited
                index = len(self.bodies)
                name = element.text('name')
                if name in names:
                    element.fail('has the name of another body, must have one of its own')
                if name:
                    names.add(name)
                self.bodies.append(SpaceBody(element, name, parent, -1, own_turn, own_shift))
            inner = []
            for child, child_depth, frame_turn, frame_shift, child_class in self._contents(element, inherited):
                at_turn, at_shift = own_turn @ frame_turn, own_shift + own_turn @ frame_shift
                if child.tag == 'body':
                    inner.append((child, index, at_turn, at_shift, child_class))
                elif child.tag == 'geom':
                    geom = read_geom(self.classes.resolve(child, child_class), self.compiler, at_turn, at_shift, index)
                    (self.bodies[index].geoms if index >= 0 else self.world_geoms).append(geom)
                elif child.tag == 'joint' and index >= 0:
                    self._read_joint(self.classes.resolve(child, child_class), index, at_turn, at_shift, joint_names)
                elif child.tag == 'inertial' and index >= 0 and child_depth == 1 and not self.bodies[index].inertial:
                    self.bodies[index].inertial = child
                elif child.tag == 'freejoint':
                    child.fail('lets its body move freely: the robot is not planar, must be')
                elif child.tag not in UNSEEN:
                    child.fail('is not read here, must be a body, geom, joint, inertial or frame')
            if index >= 0:
                body = self.bodies[index]
                if body.joints:
                    body.weld = index
                elif parent >= 0:
                    body.weld = self.bodies[parent].weld
                self._name_joints(body, joint_names)
            waiting.extend(reversed(inner))
        for index, body in enumerate(self.bodies):
            if not body.name:
                body.name = _new_name(f'body_{index + 1}', names)
        for body in self.bodies:
            for joint in body.joints:
                if not joint.name:
                    joint.name = _new_name(f'{body.name}_{joint.kind}', joint_names)

    def _name_joints(self, body, joint_names) -> None:
        for joint in body.joints:
            if joint.name:
                if joint.name in joint_names:
                    joint.element.fail('has the name of another joint, must have one of its own')
                joint_names.add(joint.name)

    def _contents(self, element: Element, inherited: Optional[str]):
        """Yield (child, depth, turn, shift, class) of a body's own elements, frames resolved, in the text's order."""
        stack = [(iter(element.children), np.eye(3), np.zeros(3), inherited)]
        while stack:
            children, turn, shift, own_class = stack[-1]
            child = next(children, None)
            if child is None:
                stack.pop()
            elif child.tag == 'frame':
                own_turn, own_shift = self.compiler.pose(child)
                stack.append((iter(child.children), turn @ own_turn, shift + turn @ own_shift,
                              child.text('childclass') or own_class))
            else:
                yield child, len(stack), turn, shift, own_class

    def _read_joint(self, element: Element, index: int, turn, shift, names) -> None:
        element.refuse_unknown(JOINT_KNOWN)
        kind = element.word('type', ('hinge', 'slide', 'ball', 'free'), 'hinge')
        if kind in ('ball', 'free'):
            element.fail(f'is of type {kind}, must be hinge or slide: the robot is not planar')
        axis = np.array(element.numbers('axis', 3, 3) or (0.0, 0.0, 1.0))
        length = np.linalg.norm(axis)
        if not 1e-14 < length < inf:
            element.fail(f"has the axis '{clipped(element.text('axis'))}', must be a direction")
        point = np.array(element.numbers('pos', 3, 3) or (0.0, 0.0, 0.0))
        scale = self.compiler.angle if kind == 'hinge' else float
        drawn_at = scale(element.number('ref', 0.0))
        joint = Hinge(element, element.text('name'), 'rotation' if kind == 'hinge' else 'slide', turn @ (axis / length),
                      shift + turn @ point, drawn_at, drawn_at, self._joint_laws(element, scale, drawn_at))
        self.bodies[index].joints.append(joint)

    def _joint_laws(self, element: Element, scale, drawn_at: float) -> dict:
        """Return damping, spring, friction, rotor and stops of a joint as keys of a chain file."""
        for key in ('springdamper', 'springyield'):
            if any(element.numbers(key, 0, 10) or ()):
                element.fail(f'has {key}, which is not read, must have stiffness and damping')
        laws = {'armature': element.number('armature', 0.0, 0.0)}
        for ours, key, flag in (('damping', 'damping', 'damper'), ('stiffness', 'stiffness', 'spring'),
                                ('friction', 'frictionloss', 'frictionloss')):
            values = element.numbers(key, 1, 3) or [0.0]
            if any(values[1:]):
                element.fail(f'has a {key} that is not linear, must be one number')
            if values[0] < 0.0:
                element.fail(f'has {key} {values[0]:g}, must be at least 0')
            laws[ours] = values[0] if flag not in self.disabled else 0.0
        if laws['stiffness']:
            laws['rest'] = scale(element.number('springref', 0.0))
        if (stops := self._range(element, 'range', 'limited')) and 'limit' not in self.disabled:
            lower, upper = map(scale, stops)
            laws.update(lower=lower, upper=upper, position=min(max(drawn_at, lower), upper))
        elif drawn_at:
            laws['position'] = drawn_at
        if force := self._range(element, 'actuatorfrcrange', 'actuatorfrclimited'):
            laws['force'] = max(map(abs, force))
        return {key: value for key, value in laws.items() if value or key in ('lower', 'upper', 'force')}

    def _range(self, element: Element, key: str, limited: str) -> Optional[list]:
        """Return the two numbers of a range that is in force, None where there is none."""
        says = element.word(limited, ('true', 'false', 'auto'), 'auto')
        values = element.numbers(key, 2, 2)
        if says == 'false' or says == 'auto' and (values is None or not values[0] < values[1]):
            return None
        if says == 'auto' and not self.compiler.autolimits:
            element.fail(f'has a {key} and no {limited}, must say {limited} true or false where autolimits is false')
        if values is None or not values[0] < values[1]:
            element.fail(f"has the {key} '{element.text(key)}', must be a smaller and a larger number")
        return values

    def _give_masses(self) -> None:
        """Give every body its mass, mass centre and inertia as MuJoCo's compiler does."""
        compiler = self.compiler
        for body in self.bodies:
            from_geoms = compiler.from_geoms == 'true' or compiler.from_geoms == 'auto' and body.inertial is None
            if not (from_geoms and self._mass_from_geoms(body)):
                if body.inertial is not None:
                    self._mass_from_inertial(body)
                else:   # where MuJoCo puts a mass that boundmass makes: as far from the body as that from its parent
                    turn, point = (np.eye(3), np.zeros(3)) if body.parent < 0 else (
                        self.bodies[body.parent].turn, self.bodies[body.parent].point)
                    body.center = body.point + body.turn @ turn.T @ (body.point - point)
            body.mass = max(body.mass, compiler.bound_mass)
            moments, axes = np.linalg.eigh(body.inertia) if np.isfinite(body.inertia).all() else (np.zeros(3), None)
            bounded = np.maximum(moments, compiler.bound_inertia)
            if compiler.balance and 2.0 * bounded.max() > bounded.sum() * (1.0 + 1e-12):
                body.inertia = np.eye(3) * bounded.mean()
            elif axes is not None and (bounded != moments).any():
                body.inertia = (axes * bounded) @ axes.T
        total = sum(body.mass for body in self.bodies)
        if compiler.total_mass > 0.0 and total > 0.0:
            for body in self.bodies:
                body.mass *= compiler.total_mass / total
                body.inertia = body.inertia * (compiler.total_mass / total)

    def _mass_from_inertial(self, body: SpaceBody) -> None:
        element = body.inertial
        element.refuse_unknown(INERTIAL_KNOWN)
        turn, shift = self.compiler.pose(element)
        body.mass = element.number('mass', 0.0, 0.0)
        body.center = body.point + body.turn @ shift
        full, diagonal = element.numbers('fullinertia', 6, 6), element.numbers('diaginertia', 3, 3)
        if full:
            if diagonal:
                element.fail('has fullinertia and diaginertia, must have one of them')
            xx, yy, zz, xy, xz, yz = full
            inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            inertia = np.diag(diagonal or [0.0] * 3)
        turn = body.turn @ turn
        body.inertia = turn @ inertia @ turn.T

    def _mass_from_geoms(self, body: SpaceBody) -> bool:
        """Take the mass of the body's geoms; False where they have none."""
        low, high = self.compiler.groups
        parts = [(geom, mass_of(geom)) for geom in body.geoms if low <= geom.element.number('group', 0.0) <= high]
        parts = [(geom, mass) for geom, mass in parts if mass > 0.0]
        if not parts:
            return False
        body.mass = sum(mass for _, mass in parts)
        body.center = sum(mass * geom.point for geom, mass in parts) / body.mass
        for geom, mass in parts:
            arm = geom.point - body.center
            body.inertia = body.inertia + inertia_of(geom, mass) + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return True

    # ---- what acts besides

    def _compensate_gravity(self) -> None:
        """Take from gravity what gravcomp does, where that is the same for all bodies."""
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
            self.unused.append(f"equality {clipped(element.text('name') or element.tag)}")
        for element in self.entries('tendon'):
            tag = Element('tendon', element.attributes, element.line, self.file)
            resolved = self.classes.resolve(tag)
            acts = [key for key in ('stiffness', 'damping', 'frictionloss', 'armature') if any(
                resolved.numbers(key, 1, 3) or ())]
            if self._range(resolved, 'range', 'limited') and 'limit' not in self.disabled:
                acts.append('range')
            if acts:
                element.fail(f'is a tendon with {acts[0]}, which is not read, must have none')
            self.unused.append(f"tendon {clipped(element.text('name') or element.tag)}")
        for element in self.entries('deformable'):
            if element.tag == 'flex':
                element.fail('is a flexible body, must be rigid bodies only')

    def _read_actuators(self) -> None:
        joints = {joint.name: joint for body in self.bodies for joint in body.joints}
        limits: dict = {}
        for element in self.entries('actuator'):
            resolved = self.classes.resolve(element)
            name = clipped(element.text('name') or element.tag)
            target = resolved.text('joint') or resolved.text('jointinparent')
            if 'actuation' in self.disabled:
                self.unused.append(f'actuator {name} (actuation is disabled)')
                continue
            if element.tag not in Classes.ACTUATORS:
                element.fail('is no actuator that MJCF knows, must be a motor')
            if element.tag in IDLE_ACTUATORS:
                if any(resolved.numbers('bias', 1, 3) or ()):
                    self._servo(element, name)
                self.unused.append(f'{element.tag} {name}')
                continue
            if element.tag not in JOINT_MOTORS or (element.tag == 'general' and self._has_bias(resolved)):
                self._servo(element, name)
            if not target:
                self.unused.append(f'{element.tag} {name} (not at a joint)')
                continue
            if target not in joints:
                element.fail(f"names the joint '{clipped(target)}', which is not there"
                             f'{suggestion(target, list(joints))}, must name a joint of the file')
            gear = abs((resolved.numbers('gear', 1, 6) or [1.0])[0])
            joint = joints[target]
            for ours, key in (('armature', 'armature'), ('damping', 'damping')):   # the motor's own, behind its gear
                values = resolved.numbers(key, 1, 3) or [0.0]
                if any(values[1:]):
                    element.fail(f'has a {key} that is not linear, must be one number')
                if values[0] and not (key == 'damping' and 'damper' in self.disabled):
                    joint.laws[ours] = joint.laws.get(ours, 0.0) + gear**2 * values[0]
            limits.setdefault(target, []).append(gear * self._force_limit(resolved, element.tag, name))
        for name, joint in joints.items():
            force = joint.laws.pop('force', inf)
            force = min(force, sum(limits[name]) if name in limits else inf)
            if force < inf:
                joint.laws['effort_limit'] = force
        if limits:
            self.notes.append('commands are efforts, N m or N, gears applied; limits by motors: ' + ', '.join(
                f"{clipped(name)} {joints[name].laws.get('effort_limit', inf):g}" for name in list(limits)[:16]))
            idle = [clipped(name) for name in joints if name not in limits]
            if idle:
                self.notes.append(f"no motor, but takes commands here: {', '.join(idle[:16])}")

    def _has_bias(self, element: Element) -> bool:
        if element.text('biastype', 'none') == 'none' and not element.text('servo'):
            return False
        return bool(element.text('servo')) or any(element.numbers('biasprm', 0, 20) or ())

    def _servo(self, element: Element, name: str) -> None:
        element.fail(f'moves its joint without a command ({clipped(element.tag)} actuator), which is not read, must be '
                     'a motor')

    def _force_limit(self, element: Element, kind: str, name: str) -> float:
        """Return the largest force, N m or N before the gear, that a motor gives."""
        limit, gain = inf, 1.0
        if kind == 'general':
            for key, usual in (('gaintype', 'fixed'), ('dyntype', 'none')):
                if element.text(key, usual) != usual:
                    self.unused.append(f'{key} of {name}')
                    gain = inf if key == 'gaintype' else gain
            gain *= abs((element.numbers('gainprm', 0, 20) or [1.0])[0])
        command = self._range(element, 'ctrlrange', 'ctrllimited')
        if command and 'clampctrl' not in self.disabled and 0.0 < gain < inf:
            limit = gain * self._symmetric(command, 'ctrlrange', name)
        if force := self._range(element, 'forcerange', 'forcelimited'):
            limit = min(limit, self._symmetric(force, 'forcerange', name))
        return limit

    def _symmetric(self, values: list, key: str, name: str) -> float:
        if values[0] != -values[1]:
            self.notes.append(f'{key} of {name} is taken as symmetric, by its larger side')
        return max(map(abs, values))

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

    # ---- contacts

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

    # ---- the robot

    def _robot(self, hold: dict) -> SpatialRobot:
        """Return the tree of links and joints: of several joints in one body all but the last carry an empty link."""
        names = {body.name for body in self.bodies}
        root = _new_name('world', names)
        links, joints, frames, at = {root: Link(root)}, [], {root: (np.eye(3), np.zeros(3))}, {-1: root}
        for index, body in enumerate(self.bodies):
            parent = at[body.parent]
            steps = [(joint, joint.point if joint.kind == 'rotation' else body.point) for joint in body.joints]
            for number, (joint, point) in enumerate(steps or [(None, body.point)]):
                last = number + 1 >= len(steps)
                name = body.name if last else _new_name(f'{body.name}_{joint.name}', names)
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
            return SpatialJoint(_new_name(f'{child}_weld', self.joint_names), 'fixed', parent, child,
                                turn.T @ own_turn, turn.T @ (own_shift - shift), np.array([1.0, 0.0, 0.0]), {})
        axis = own_turn.T @ joint.axis
        if joint.kind == 'rotation':         # back to where it reads 0
            own_turn = own_turn @ turn_about(axis, -joint.drawn_at)
        else:
            own_shift = own_shift - joint.drawn_at * joint.axis
        held = None
        if joint.name in hold:
            held = joint.laws.get('position', 0.0) if hold[joint.name] is None else hold[joint.name]
        return SpatialJoint(joint.name, joint.kind, parent, child, turn.T @ own_turn, turn.T @ (own_shift - shift),
                            axis, joint.laws, held)


def _new_name(name: str, names: set) -> str:
    while name in names:
        name += '_'
    names.add(name)
    return name
