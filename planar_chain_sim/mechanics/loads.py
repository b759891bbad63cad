"""Loads on bodies while a chain moves: wrenches from outside and payloads."""
from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple, TYPE_CHECKING

from .._kernel import plane_vector
from ..chain.chain import altered, Chain
from ..chain.joint_arrays import joint_array
from ..chain.tree import Body

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class Wrench(NamedTuple):
    """A load on a body from outside: force x + j y, N, in the axes of the 'body' or the 'world', and moment, N m."""

    force: complex
    moment: float
    axes: str


def _number(name: str, value: Any) -> float:
    return float(joint_array(name, [value], (1,))[0])


def index_of(chain: Chain, body: str) -> int:
    """Return the index of a body by its name; ValueError has the names of all bodies."""
    index = chain.body_index.get(body) if isinstance(body, str) else None
    if index is None:
        names = ', '.join(each.name for each in chain.bodies[:32])
        raise ValueError(f'body is {body!r:.80}, must be one of {names}')
    return index


def with_payload(chain: Chain, body: str, mass: float, position: ArrayLike, inertia_com: float, name: str) -> Chain:
    """
    Return the chain with a payload welded to a body: its mass centre, m, in that body's frame, inertia about that.

    ValueError: no such body, a name that a body has, a number that is not finite or too small.
    """
    carrier = index_of(chain, body)
    place = plane_vector('position', position)
    mass, inertia_com = _number('mass', mass), _number('inertia_com', inertia_com)
    if not mass > 0.0 or not inertia_com >= 0.0:
        raise ValueError(f'payload {name!r:.80} has a mass of {mass!r} kg and an inertia of {inertia_com!r} kg m^2, '
                         'must be > 0 and >= 0')
    if not isinstance(name, str) or not name or name in [each.name for each in chain.bodies]:
        raise ValueError(f'name is {name!r:.80}, must be a string and not the name of a body of {chain.name}')
    return altered(chain, bodies=(*chain.bodies, Body(name, carrier, place, 0.0, mass, 0j, inertia_com, inertia_com)))


def without_payload(chain: Chain, own: int, name: str) -> Chain:
    """Return the chain without a payload; the first `own` bodies are none. ValueError: no such payload, one in use."""
    bodies = chain.bodies
    payloads = [body.name for body in bodies[own:]]
    if name not in payloads:
        there = ', '.join(payloads) or 'there is none'
        raise ValueError(f'payload is {name!r:.80}, must be one that is attached: {there}')
    gone = own + payloads.index(name)
    if any(body.carrier == gone for body in bodies):
        raise ValueError(f'payload {name!r} carries another one, which must be dropped first')
    return altered(chain, bodies=tuple(
        replace(body, carrier=body.carrier - 1) if body.carrier > gone else body
        for k, body in enumerate(bodies) if k != gone))
