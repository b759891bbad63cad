"""
An MJCF text as elements with lines and default classes; numbers, texts and poses of their attributes.

No entities, no files, bounded size and depth: a text of any content ends in an Element or one ChainError sentence.
"""
from __future__ import annotations

from math import isfinite, radians
import re
from typing import Any, NoReturn, Optional

import numpy as np

from .spatial_robot import turn_about
from .xml_elements import read_xml
from ..chain.section import clipped, suggestion
from ..errors import ChainError

MAX_DEPTH = 4200       # of nested elements
MAX_ELEMENTS = 100_000
MAX_LENGTH = 100_000   # characters of one attribute
NUMBER = re.compile(r'[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?')
ORIENTATIONS = ('quat', 'axisangle', 'xyaxes', 'zaxis', 'euler')


class Element:
    """One element: tag, attributes, children and line; it reads its attributes, and its errors say where it is."""

    __slots__ = ('tag', 'attributes', 'children', 'line', 'file')

    def __init__(self, tag: str, attributes: dict, line: int, file: str):
        """Start with no children."""
        self.tag, self.attributes, self.line, self.file, self.children = tag, attributes, line, file, []

    def with_defaults(self, defaults: dict) -> Element:
        """Return the element with its class's values for the attributes that it lacks."""
        own = self.attributes
        if any(key in own for key in ORIENTATIONS):   # one way of saying it puts another out of force
            defaults = {key: value for key, value in defaults.items() if key not in ORIENTATIONS}
        merged = Element(self.tag, {**defaults, **own}, self.line, self.file)
        merged.children = self.children
        return merged

    def fail(self, problem: str) -> NoReturn:
        """Raise the ChainError sentence."""
        name = self.attributes.get('name')
        label = f"{self.tag} '{clipped(name)}'" if name else f'<{clipped(self.tag)}>'
        raise ChainError(f'{self.file} line {self.line}: {label} {problem}')

    def refuse_unknown(self, known) -> None:
        """Refuse the first attribute that MJCF does not know here."""
        for key in self.attributes:
            if key not in known:
                self.fail(f"has the attribute '{clipped(key)}', which is unknown{suggestion(key, known)}, must be one "
                          'that MJCF knows')

    def text(self, key: str, otherwise: str = '') -> str:
        """Return an attribute unchanged."""
        return self.attributes.get(key, otherwise)

    def word(self, key: str, choices: tuple, otherwise: str) -> str:
        """Return an attribute that is one of a few words."""
        value = self.attributes.get(key, otherwise)
        if value not in choices:
            self.fail(f"has {key} '{clipped(value)}', must be one of {', '.join(choices)}")
        return value

    def numbers(self, key: str, least: int, most: int) -> Any:
        """Return the list of an attribute's numbers, `least` to `most` of them; None where it is not there."""
        value = self.attributes.get(key)
        if value is None:
            return None
        wanted = f'{least}' if least == most else f'{least} to {most}'
        words = value.split() if len(value) <= MAX_LENGTH else []
        if least <= len(words) <= most and all(NUMBER.fullmatch(word) for word in words):
            numbers = [float(word) for word in words]
            if all(map(isfinite, numbers)):
                return numbers
        self.fail(f"has {key} '{clipped(value)}', must be {wanted} finite number{'s' if most > 1 else ''}")

    def number(self, key: str, otherwise: float, least: Optional[float] = None) -> float:
        """Return the one number of an attribute."""
        numbers = self.numbers(key, 1, 1)
        if numbers is None:
            return otherwise
        if least is not None and numbers[0] < least:
            self.fail(f'has {key} {numbers[0]:g}, must be at least {least:g}')
        return numbers[0]


def parse(text: str, file: str) -> Element:
    """Return the root of an XML text; ChainError for what is no plain XML, is too large or nested too deep."""
    top = []
    waiting = [(read_xml(text, file, 'MJCF', MAX_DEPTH, MAX_ELEMENTS), top)]
    while waiting:
        xml, place = waiting.pop()
        element = Element(xml.tag, xml.attributes, xml.line, file)
        place.append(element)
        waiting.extend((child, element.children) for child in reversed(xml.children))
    return top[0]


class Compiler:
    """The settings of <compiler> for the whole file."""

    KNOWN = ('alignfree angle assetdir autolimits balanceinertia boundinertia boundmass conflict coordinate '
             'discardvisual eulerseq fitaabb fusestatic inertiafromgeom inertiagrouprange meshdir passthrough '
             'savecanonical savecompiled saveinertial settotalmass strippath texturedir usethread exactmeshinertia '
             'convexhull').split()

    def __init__(self, elements: list):
        """Read the elements, of which a later one overrides."""
        self.degrees, self.eulerseq, self.autolimits, self.balance = True, 'xyz', True, False
        self.bound_mass = self.bound_inertia = 0.0
        self.total_mass, self.from_geoms, self.groups = -1.0, 'auto', (0.0, 5.0)
        for element in elements:
            element.refuse_unknown(self.KNOWN)
            self.degrees = element.word('angle', ('degree', 'radian'),
                                        'degree' if self.degrees else 'radian') == 'degree'
            self.eulerseq = element.text('eulerseq', self.eulerseq)
            if len(self.eulerseq) != 3 or not set(self.eulerseq) <= set('xyzXYZ'):
                element.fail(f"has eulerseq '{clipped(self.eulerseq)}', must be three letters of x, y, z, X, Y, Z")
            if element.word('coordinate', ('local', 'global'), 'local') == 'global':
                element.fail("has coordinate 'global', must be 'local'")
            self.autolimits = _truth(element, 'autolimits', self.autolimits)
            self.balance = _truth(element, 'balanceinertia', self.balance)
            self.bound_mass = element.number('boundmass', self.bound_mass, 0.0)
            self.bound_inertia = element.number('boundinertia', self.bound_inertia, 0.0)
            self.total_mass = element.number('settotalmass', self.total_mass)
            self.from_geoms = element.word('inertiafromgeom', ('false', 'true', 'auto'), self.from_geoms)
            self.groups = element.numbers('inertiagrouprange', 2, 2) or self.groups

    def angle(self, value: float) -> float:
        """Return an angle of the file in rad."""
        return radians(value) if self.degrees else value

    def turn(self, element: Element) -> np.ndarray:
        """Return the rotation matrix that an element says in one of five ways."""
        given = [key for key in ORIENTATIONS if key in element.attributes]
        if len(given) > 1:
            element.fail(f'has {given[0]} and {given[1]}, must have one of them')
        if not given:
            return np.eye(3)
        if given[0] == 'quat':
            return turn_of(self._direction(element, 'quat', 4))
        if given[0] == 'axisangle':
            *axis, angle = element.numbers('axisangle', 4, 4)
            return turn_about(self._unit(element, 'axisangle', axis), self.angle(angle))
        if given[0] == 'zaxis':
            return turn_to(self._direction(element, 'zaxis', 3))
        if given[0] == 'euler':
            turn = np.eye(3)
            for letter, angle in zip(self.eulerseq, element.numbers('euler', 3, 3)):
                step = turn_about(np.eye(3)['xyz'.index(letter.lower())], self.angle(angle))
                turn = turn @ step if letter.islower() else step @ turn
            return turn
        values = element.numbers('xyaxes', 6, 6)
        x = self._unit(element, 'xyaxes', values[:3])
        y = self._unit(element, 'xyaxes', np.array(values[3:]) - (x @ values[3:]) * x)
        return np.array([x, y, np.cross(x, y)]).T

    def pose(self, element: Element) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation matrix and position of an element."""
        return self.turn(element), np.array(element.numbers('pos', 3, 3) or (0.0, 0.0, 0.0))

    def _direction(self, element: Element, key: str, count: int) -> np.ndarray:
        return self._unit(element, key, element.numbers(key, count, count))

    def _unit(self, element: Element, key: str, vector) -> np.ndarray:
        length = np.linalg.norm(vector)
        if not isfinite(length) or length < 1e-14:
            element.fail(f"has {key} '{clipped(element.text(key))}', must be a direction")
        return np.array(vector) / length


def _truth(element: Element, key: str, otherwise: bool) -> bool:
    return element.word(key, ('true', 'false'), 'true' if otherwise else 'false') == 'true'


def turn_of(quat) -> np.ndarray:
    """Return the rotation matrix of a unit quaternion w, x, y, z."""
    w, x, y, z = quat
    return np.array([[w*w + x*x - y*y - z*z, 2.0 * (x*y - w*z), 2.0 * (x*z + w*y)],
                     [2.0 * (x*y + w*z), w*w - x*x + y*y - z*z, 2.0 * (y*z - w*x)],
                     [2.0 * (x*z - w*y), 2.0 * (y*z + w*x), w*w - x*x - y*y + z*z]])


def turn_to(direction: np.ndarray) -> np.ndarray:
    """Return the shortest rotation that brings the z axis to a unit direction."""
    axis = np.cross([0.0, 0.0, 1.0], direction)
    sine = np.linalg.norm(axis)
    if sine < 1e-10:
        return np.eye(3) if direction[2] > 0.0 else np.diag([1.0, -1.0, -1.0])
    return turn_about(axis / sine, float(np.arctan2(sine, direction[2])))


class Classes:
    """The default classes of a file: the attributes that each gives to the elements of a tag."""

    ACTUATORS = ('general', 'motor', 'position', 'velocity', 'intvelocity', 'orientation', 'pid', 'damper', 'cylinder',
                 'muscle', 'adhesion', 'dcmotor', 'plugin')

    def __init__(self, sections: list):
        """Read the <default> sections of a file."""
        self._classes = {'main': {}}
        waiting: list = [(section, None) for section in reversed(sections)]
        while waiting:
            section, parent = waiting.pop()
            name = section.text('class') if parent is not None else 'main'
            if not name:
                section.fail('has no class, must have one')
            if parent is not None and name in self._classes:
                section.fail(f"has the class '{clipped(name)}', which exists already, must have one of its own")
            says = self._classes.setdefault(name, {})
            if parent is None and section.text('class'):     # another name of the outermost class
                self._classes[section.text('class')] = says
            if parent is not None:
                says.update({key: dict(value) for key, value in self._classes[parent].items()})
            nested = []
            for child in section.children:
                if child.tag == 'default':
                    nested.append((child, name))
                    continue
                key = 'actuator' if child.tag in self.ACTUATORS else child.tag
                entry = says.setdefault(key, {})
                if any(word in child.attributes for word in ORIENTATIONS):
                    for word in ORIENTATIONS:
                        entry.pop(word, None)
                entry.update(child.attributes)
                if key == 'actuator' and child.tag not in ('general', 'motor'):
                    entry['servo'] = child.tag
            waiting.extend(reversed(nested))

    def resolve(self, element: Element, inherited: Optional[str] = None) -> Element:
        """Return an element with what its class says; `inherited`: the class of its surroundings, childclass."""
        name = element.text('class') or inherited or 'main'
        if name not in self._classes:
            element.fail(f"has the class '{clipped(name)}', which the file does not define"
                         f'{suggestion(name, self._classes)}, must be one that it does')
        key = 'actuator' if element.tag in self.ACTUATORS else element.tag
        return element.with_defaults(self._classes[name].get(key, {}))
