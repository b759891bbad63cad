"""The numbers of a chain by name, `forearm.mass`, `elbow.damping`, `gravity.y`: to read them, and to vary a chain."""
from __future__ import annotations

from collections.abc import Mapping
from math import isinf
from numbers import Integral

from .checks import data_of, JOINT_NUMBERS
from .section import as_number, clipped, plain, shown, suggestion
from .tree import POINT_MASS, steiner_term, Tree
from ..errors import ChainError

AXES = {'x': 0, 'y': 1}
OF_BODIES = ('mass', 'center_of_mass.x', 'center_of_mass.y', 'inertia', 'inertia_com', 'origin.x', 'origin.y', 'angle')
OF_JOINTS = tuple(key for key in JOINT_NUMBERS if key != 'restitution')


def places_of(chain: Tree) -> dict[str, tuple]:
    """Return name -> place of every parameter: index of the body or None, kind of the joint or None, key, 0 or 1."""
    places: dict[str, tuple] = {f'gravity.{axis}': (None, None, 'gravity', part) for axis, part in AXES.items()}
    bodies, joints = {body.name for body in chain.bodies}, set(chain.joint_names)

    def prefix(name: str, what: str) -> str:
        both = name in bodies and name in joints
        return f'{what}:' if both or name.startswith(('body:', 'joint:')) else ''

    for index, body in enumerate(chain.bodies):
        for name in OF_BODIES:
            key, _, axis = name.partition('.')
            places[f'{prefix(body.name, "body")}{body.name}.{name}'] = index, None, key, AXES.get(axis)
        for kind in ('slide', 'rotation'):
            joint = getattr(body, kind)
            if joint is not None:
                for key in OF_JOINTS:
                    places[f'{prefix(joint.name, "joint")}{joint.name}.{key}'] = index, kind, key, None
    return places


def parameters_of(chain: Tree) -> dict[str, float]:
    """Return all parameters, name -> value."""
    values = {}
    for name, (index, kind, key, part) in places_of(chain).items():
        owner = chain if index is None else chain.bodies[index]
        value = getattr(owner if kind is None else getattr(owner, kind), key)
        values[name] = float(value if part is None else (value.real, value.imag)[part])
    return values


def changed_data(chain: Tree, values: Mapping[str, float]) -> dict:
    """Return the chain's data with these values; ChainError: an unknown name, a value that is no number."""
    if not isinstance(values, Mapping):
        raise ChainError(f'the parameters are of type {type(values).__name__}, must be a mapping of names to numbers')
    places, data, inertias = places_of(chain), data_of(chain), {}
    for name, given in values.items():
        if name not in places:
            raise ChainError(f'parameter {shown_name(name)} is not one of {chain.name}{_likely(name, places)}, must be '
                             'one of Chain.parameters')
        value = as_number(plain(given, name))
        if value is None:
            raise ChainError(f'parameter {shown_name(name)} is {shown(plain(given, name))}, must be a number')
        if isinf(value) and isinstance(given, Integral):
            raise ChainError(f'parameter {shown_name(name)} is too large, must be a number below 1.8e308')
        index, kind, key, part = places[name]
        owner = data if index is None else data['bodies'][index]
        if part is not None:
            owner.setdefault(key, [0.0, 0.0])[part] = value
        elif key in ('inertia', 'inertia_com'):
            inertias.setdefault(index, {})[key] = value
        else:
            (owner if kind is None else owner[kind])[key] = value
    for index, pair in inertias.items():
        _put_inertia(data['bodies'][index], pair)
    return data


def _put_inertia(body: dict, pair: dict) -> None:
    """Put one inertia, or two with J = J_C + m c^2, into a body's data."""
    key = 'inertia' if 'inertia' in body else 'inertia_com'
    if len(pair) == 2:
        center = body.get('center_of_mass', [0.0, 0.0])
        steiner = steiner_term(body['mass'], complex(*center))
        inertia, inertia_com = pair['inertia'], pair['inertia_com']
        if not abs(inertia - inertia_com - steiner) <= POINT_MASS * max(abs(inertia), steiner):
            raise ChainError(
                f"parameters '{clipped(body['name'])}.inertia' and '.inertia_com' are {inertia!r} and {inertia_com!r}, "
                f'must differ by mass * |center_of_mass|^2 = {steiner!r}, or be one of the two')
        pair = {key: pair[key]}
    body.pop(key)
    body.update(pair)


def shown_name(name) -> str:
    """Return how a sentence names a parameter."""
    return f"'{clipped(name)}'" if isinstance(name, str) else repr(name)[:48]


def _likely(name, places) -> str:
    """Return the suggestion of a known name for an unknown one."""
    if not isinstance(name, str):
        return ''
    prefixed = [f'{what}:{name}' for what in ('body', 'joint') if f'{what}:{name}' in places]
    return f" (did you mean '{clipped(prefixed[0])}'?)" if prefixed else suggestion(name, list(places))
