"""
The keys of a chain file, what each must be, and which bodies are possible: plain data -> Tree.

Mappings, lists, texts and numbers come in, as `yaml_text` reads them or a program makes them; a frozen Tree comes
out, or one ChainError sentence.
"""
from __future__ import annotations

from dataclasses import fields
from math import isfinite
from typing import Optional

from .hold import read_hold, weld
from .section import clipped, MISSING, plain, Section, shown, suggestion
from .tree import BASE, Body, inertia_about_center, Joint, POINT_MASS, steiner_term, Tree
from .visual import read_visual
from ..errors import ChainError

CHAIN_KEYS = ('name', 'gravity', 'bodies', 'hold')
BODY_KEYS = ('name', 'carrier', 'origin', 'angle', 'mass', 'center_of_mass', 'inertia', 'inertia_com', 'slide',
             'rotation', 'visual')
JOINT_NUMBERS = {   # key: (default, least value, unit of a slide, unit of a rotation)
    each.name: (each.default, *(each.metadata[key] for key in ('least', 'slide', 'rotation')))
    for each in fields(Joint) if each.metadata}
JOINT_KEYS = ('joint', 'axis', *JOINT_NUMBERS)
GRAVITY = complex(0.0, -9.81)


def read_tree(data, file: str) -> tuple[Tree, list[Section]]:
    """
    Return the bodies that plain data describes, checked, and the section of each; ChainError otherwise.

    `file` names the text in sentences ('' for data that is no text).
    """
    top = Section(data, file)
    top.refuse_unknown_keys(CHAIN_KEYS)
    name = top.text('name', default='chain')
    gravity = top.vector('gravity', GRAVITY, 'm/s^2')
    entries = data.get('bodies', MISSING)
    if not isinstance(entries, list) or not entries:
        top.fail('bodies', f'is {shown(entries)}, must be a list of at least one body')

    indices = {'base': BASE}   # body name -> index
    owners = {}                # joint name -> body name
    bodies, sections = [], []
    for index, entry in enumerate(entries):
        if not isinstance(entry, dict):
            top.fail('bodies', f'has {shown(entry)} as entry {index}, must be a list of mappings')
        body_name = entry.get('name')
        label = f"body '{clipped(body_name)}' " if isinstance(body_name, str) else f'bodies[{index}] '
        section = Section(entry, file, f'bodies[{index}]', label)
        bodies.append(read_body(section, entries, indices, owners))
        sections.append(section)
        indices[bodies[-1].name] = index
    if not owners:
        top.fail('bodies', "has no joint, must have a body with 'slide' or 'rotation'")
    if 'hold' in data:
        try:
            bodies = weld(bodies, read_hold(data['hold']))
        except ChainError as error:
            raise ChainError(f'{file}: {error}' if file else str(error)) from None
    return Tree(name, gravity, tuple(bodies)), sections


def read_body(section, entries, indices, owners) -> Body:
    """Return one body; `indices` and `owners` have the bodies and joints before it."""
    section.refuse_unknown_keys(BODY_KEYS, JOINT_KEYS, "under 'slide' or 'rotation'")
    name = section.text('name', wanted='the name of the body, a string')
    if name in indices:
        taken = 'the reserved name of the base' if name == 'base' else 'the name of an earlier body'
        section.fail('name', f'is {shown(name)}, {taken}, must be a name of its own')
    carrier = read_carrier(section, name, entries, indices)
    mass, center_of_mass, inertia, inertia_com = read_mass(section)
    slide = read_joint(section, 'slide', name, owners)
    rotation = read_joint(section, 'rotation', name, owners)
    return Body(name=name, carrier=carrier, origin=section.vector('origin', 0j, 'm'),
                angle=section.number('angle', 0.0, 'rad'), mass=mass, center_of_mass=center_of_mass, inertia=inertia,
                inertia_com=inertia_com, slide=slide, rotation=rotation, visual=read_visual(section),
                given='inertia_com' if 'inertia_com' in section.data else 'inertia')


def read_carrier(section, name, entries, indices) -> int:
    """Return the index of the body's carrier, an earlier body or BASE."""
    carrier = section.text('carrier', wanted="'base' or the name of an earlier body")
    if carrier in indices:
        return indices[carrier]
    names = [entry['name'] for entry in entries if isinstance(entry, dict) and isinstance(entry.get('name'), str)]
    if carrier == name:
        problem = 'the body itself'
    elif carrier in names:
        problem = 'a body that comes later'
    else:
        problem = f'no body of this chain{suggestion(carrier, ["base", *names])}'
    return section.fail('carrier', f"is {shown(carrier)}, {problem}, must be 'base' or the name of an earlier body")


def read_mass(section) -> tuple[float, complex, float, float]:
    """Return mass, mass centre, inertia about the joint point and about the mass centre, J = J_C + m c^2."""
    mass = section.number('mass', unit='kg', least=0.0)
    center = section.vector('center_of_mass', 0j, 'm')
    steiner = steiner_term(mass, center)
    about = 'kg m^2 about the joint point', 'kg m^2 about the mass centre'
    if 'inertia' in section.data and 'inertia_com' in section.data:
        section.fail('inertia_com', "is given together with 'inertia', must be exactly one of the two")
    if 'inertia_com' in section.data:
        inertia_com = section.number('inertia_com', unit=about[1])
        if inertia_com < -POINT_MASS * steiner:
            section.number('inertia_com', unit=about[1], least=0.0)
        inertia_com = max(inertia_com, 0.0)
        inertia = inertia_com + steiner
    else:
        inertia = section.number('inertia', unit=about[0], least=0.0,
                                 wanted='' if 'inertia' in section.data else
                                 f"a number >= 0 ({about[0]}), or 'inertia_com' about the mass centre")
        if isfinite(steiner) and inertia - steiner < -POINT_MASS * steiner:
            section.fail('inertia', f'is {inertia!r}, must be at least mass * |center_of_mass|^2 = {steiner!r} '
                         f"({about[0]}; about the mass centre the key is 'inertia_com')")
        inertia, inertia_com = inertia_about_center(inertia, steiner)
    if not isfinite(inertia) or not isfinite(inertia_com):
        section.fail('center_of_mass', 'is too far out, must keep mass * |center_of_mass|^2 a finite number (kg m^2)')
    return mass, center, inertia, inertia_com


def read_joint(body, kind, body_name, owners) -> Optional[Joint]:
    """Return the body's joint of one kind, None where it has none."""
    section = body.section(kind)
    if section is None:
        return None
    section.refuse_unknown_keys(JOINT_KEYS)
    name = section.text('joint', wanted='the name of the joint, a string')
    if name in owners:
        section.fail('joint', f"is {shown(name)}, the name of a joint of body '{clipped(owners[name])}', "
                     'must be a name of its own')
    owners[name] = body_name
    numbers = {key: section.number(key, default, rotation if kind == 'rotation' else slide, least)
               for key, (default, least, slide, rotation) in JOINT_NUMBERS.items() if key in section.data}
    if kind == 'slide':
        axis = section.number('axis', unit='rad', wanted="a finite number (rad, the direction in the carrier's frame)")
    else:
        axis = section.number('axis', 1.0, wanted='1 (counter-clockwise) or -1 (clockwise)')
        if axis not in (1.0, -1.0):
            section.fail('axis', f'is {axis!r}, must be 1 (counter-clockwise) or -1 (clockwise)')
    joint = Joint(name, kind, axis, **numbers)
    if joint.restitution > 1.0:
        section.fail('restitution', f'is {joint.restitution!r}, must be from 0 to 1')
    if not joint.lower < joint.upper:
        section.fail('lower', f"is {joint.lower!r}, must be below 'upper', {joint.upper!r}")
    if not joint.lower <= joint.position <= joint.upper:
        section.fail('position', f'is {joint.position!r}, must lie between the stops, '
                     f'{joint.lower!r} and {joint.upper!r}')
    return joint


def data_of(chain: Tree) -> dict:
    """Return the plain data from which read_tree makes the same chain; ChainError: there is none."""
    if not isinstance(chain.bodies, (tuple, list)) or not all(isinstance(body, Body) for body in chain.bodies):
        raise ChainError(f'bodies is of type {type(chain.bodies).__name__}, must be a tuple of Body')
    bodies = []
    for index, body in enumerate(chain.bodies):
        label = f"body '{clipped(str(body.name))}'"
        if type(body.carrier) is not int or not BASE <= body.carrier < index:
            raise ChainError(f'{label} has the carrier {body.carrier!r}, must have BASE, which is -1, or the index of '
                             'an earlier body')
        entry = {'name': body.name, 'carrier': 'base' if body.carrier == BASE else chain.bodies[body.carrier].name,
                 'origin': _pair(body.origin, f'{label}: origin'), 'angle': body.angle, 'mass': body.mass,
                 'center_of_mass': _pair(body.center_of_mass, f'{label}: center_of_mass'), **_inertia(body)}
        for kind in ('slide', 'rotation'):
            joint = getattr(body, kind)
            if joint is None:
                continue
            if not isinstance(joint, Joint) or joint.kind != kind:
                raise ChainError(f'{label}: {kind} is {joint!r:.80}, must be None or a Joint of kind {kind!r}')
            entry[kind] = {'joint': joint.name, 'axis': joint.axis, **{
                key: getattr(joint, key) for key, (default, *_) in JOINT_NUMBERS.items()
                if repr(getattr(joint, key)) != repr(default)}}
        if body.visual:
            entry['visual'] = body.visual
        bodies.append({key: value for key, value in entry.items() if repr(value) not in ('[0.0, 0.0]', '0.0')
                       or key in ('mass', 'inertia', 'inertia_com')})
    return plain({'name': chain.name, 'gravity': _pair(chain.gravity, 'gravity'), 'bodies': bodies})


def _pair(vector, label: str) -> list:
    try:
        return [complex(vector).real, complex(vector).imag]
    except (TypeError, ValueError, OverflowError):
        raise ChainError(f'{label} is {vector!r:.80}, must be a complex number, x + j y') from None


def _inertia(body: Body) -> dict:
    """Return the key of an inertia from which the other one follows, if possible the one that the body's text gave."""
    try:
        steiner = steiner_term(body.mass, body.center_of_mass)
        says = {'inertia_com': (body.inertia_com + steiner, body.inertia_com),
                'inertia': inertia_about_center(body.inertia, steiner)}
    except (TypeError, AttributeError, OverflowError):
        says = {}
    both = body.inertia, body.inertia_com
    keys = sorted((key for key in says if says[key] == both), key=lambda key: key != body.given) or ['inertia']
    return {keys[0]: getattr(body, keys[0])}
