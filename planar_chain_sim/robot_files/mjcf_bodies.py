"""The bodies of an MJCF with joints and masses, by MuJoCo's rules, in the root's frame as the file draws them."""
from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import Any, Optional

import numpy as np

from .mjcf_document import Classes, Compiler, Element, parse
from .mjcf_geoms import Geom, inertia_of, mass_of, read_geom
from ..chain.section import clipped, suggestion
from ..errors import ChainError

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


class Mechanism:
    """One text while it is read: options and bodies; `notes` and `unused` are for the line about the file."""

    def __init__(self, text: str, name: str):
        self.file, self.notes, self.unused = name, [], []
        self.uneven: Optional[Element] = None
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
        self._read_bodies()
        self._give_masses()

    def entries(self, section: str) -> list:
        """Return the elements of a section, which may stand in several parts."""
        return [child for element in self.sections[section] for child in element.children]

    def _includes(self, root: Element) -> None:
        stack, at_top = list(root.children), {id(child) for child in root.children}
        while stack:
            element = stack.pop()
            stack.extend(element.children)
            if element.tag == 'include':
                path = element.text('file')
                if id(element) not in at_top or path.replace('\\', '/').rpartition('/')[2] not in LOOKS:
                    element.fail(f"includes '{clipped(path)}', other files are not read, must be one file (MuJoCo "
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

    def _read_bodies(self) -> None:
        world = self.entries('worldbody')
        if not world:
            raise ChainError(f'{self.file}: is an MJCF with nothing in its <worldbody>, must have a body with a joint')
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
                    child.fail('lets its body move freely: the robot is not planar, must be a hinge or slide, or be '
                               'removed, which fixes the body where it is drawn')
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
                body.name = new_name(f'body_{index + 1}', names)
        for body in self.bodies:
            for joint in body.joints:
                if not joint.name:
                    joint.name = new_name(f'{body.name}_{joint.kind}', joint_names)

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
            element.fail(f'is of type {kind}: the robot is not planar, must be a hinge or slide, or be removed, which '
                         'fixes the body where it is drawn')
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
        laws: dict[str, Any] = {'armature': element.number('armature', 0.0, 0.0)}
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
        if (stops := self.range_of(element, 'range', 'limited')) and 'limit' not in self.disabled:
            lower, upper = map(scale, stops)
            laws.update(lower=lower, upper=upper, position=min(max(drawn_at, lower), upper))
        elif drawn_at:
            laws['position'] = drawn_at
        if force := self.range_of(element, 'actuatorfrcrange', 'actuatorfrclimited'):
            laws['force'] = force
        return {key: value for key, value in laws.items() if value or key in ('lower', 'upper', 'force')}

    def range_of(self, element: Element, key: str, limited: str) -> Optional[list]:
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
                else:   # where MuJoCo puts a mass that boundmass makes: at `pos` as written, without frames around it
                    body.center = body.point + body.turn @ self.compiler.pose(body.element)[1]
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
        element: Element = body.inertial   # type: ignore[assignment]
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


def new_name(name: str, names: set) -> str:
    """Return a name that is not in `names`, which has it then."""
    while name in names:
        name += '_'
    names.add(name)
    return name
