"""
Chain: the physical data of a planar tree of rigid bodies, in SI units, frozen, with the text that describes it.

A chain from a file or from data was checked when it was read. One that was made by hand, for example by
dataclasses.replace, is checked at its first use, by `plan.plan_of`. Both have a text from which they can be loaded.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Callable, Optional

from .checks import data_of, read_tree
from .parameters import changed_data, parameters_of
from .section import clipped, plain
from .tree import steiner_term, Tree
from .yaml_text import data_from_text, MAX_BYTES, text_of
from ..errors import ChainError

# Further checks of a whole chain: check(chain, sections), ChainError. Mechanics adds its own, so that a chain whose
# equations cannot be solved is refused as soon as it is made.
FURTHER_CHECKS: list[Callable] = []
PASSED = ('_checked', '_solvable')   # what a chain notes of the checks that it passed: of its data, of mechanics


class _Text:
    """
    `Chain.source`: the given text if it describes the same chain, number by number, else a text that does.

    It is computed at the first access.
    """

    def __get__(self, chain: Any, owner: Any = None) -> Any:
        if chain is None:
            return self
        kept = chain.__dict__
        if '_text' not in kept:
            kept['_text'] = own_text(chain, kept.get('_given', ''))
        return kept['_text']

    def __set__(self, chain: Any, text: Any) -> None:
        chain.__dict__['_given'] = '' if text is self else text   # itself: the default


@dataclass(frozen=True)
class Chain(Tree):
    """
    A tree of bodies in regular labelling (a carrier comes before the bodies it carries).

    `source` is the YAML text from which the same chain can be loaded again, number by number. Equality and hash are
    those of the numbers and names; `visual` is compared too.
    """

    source: str = field(default=_Text(), compare=False, repr=False)   # type: ignore[assignment]

    @property
    def parameters(self) -> Mapping[str, float]:
        """
        Every number that `with_parameters` can change, by its name: `gravity.x`, `BODY.mass`, `JOINT.damping` ...

        Read-only. A name that a body and a joint have gets `body:` or `joint:` in front.
        """
        return MappingProxyType(parameters_of(self))

    def with_parameters(self, values: Mapping[str, float]) -> Chain:
        """
        Return a checked chain with other values of `parameters`; its `source` says so.

        If a mass or a mass centre changes, the inertia that the chain file gives, `inertia` or `inertia_com`, stays the
        same unless one of them is given here. ChainError: an unknown name, an impossible value.
        """
        return build_chain(changed_data(self, values), '')

    def __getstate__(self) -> dict:
        # All else that is kept with a chain can be computed again. Another thread may add it now: copy() comes first.
        return {key: value for key, value in self.__dict__.copy().items()
                if key in ('name', 'gravity', 'bodies', '_given', '_text', *PASSED)}


def altered(chain: Chain, **changes: Any) -> Chain:
    """Return a chain with changes after which it need not be checked again."""
    fresh = replace(chain, source='', **changes)
    fresh.__dict__.update({key: True for key in PASSED if key in chain.__dict__})
    return fresh


def build_chain(data: Any, file: str, source: Optional[str] = None) -> Chain:
    """
    Return the chain that plain data describes, checked; ChainError otherwise.

    `file` names the text in sentences ('' for data that is no text). `source` becomes `Chain.source`; without it a text
    is written at its first use.
    """
    tree, sections = read_tree(data, file)
    chain = Chain(tree.name, tree.gravity, tree.bodies)
    chain.__dict__.update({'_checked': True} if source is None else {'_checked': True, '_text': source})
    for check in FURTHER_CHECKS:
        check(chain, sections)
    return chain


def check_chain(chain: Chain) -> None:
    """Check a chain that was made by hand, once; ChainError, with the sentence for a chain file of the same content."""
    rebuilt = build_chain(data_of(chain), '')
    for body, again in zip(chain.bodies, rebuilt.bodies):
        if body != again:
            steiner = steiner_term(body.mass, body.center_of_mass)
            raise ChainError(
                f"body '{clipped(body.name)}' has the inertia {body.inertia!r:.40} about its joint point and "
                f'{body.inertia_com!r:.40} about its mass centre, must have two that differ by mass * '
                f'|center_of_mass|^2 = {steiner!r}; Chain.with_parameters keeps them consistent')
    chain.__dict__.update({key: True for key in PASSED if key in rebuilt.__dict__})


def chain_from_dict(data: Mapping) -> Chain:
    """
    Return the chain of plain data with the keys of a chain file; numpy numbers and arrays and tuples are taken too.

    `Chain.source` is a YAML text that loads back to the same bits. ChainError names the place by its path in the data.
    """
    data = plain(data)
    if not isinstance(data, dict):
        raise ChainError(f"the chain is of type {type(data).__name__}, must be a mapping with the key 'bodies'")
    source = text_of(data)
    if len(source) > MAX_BYTES:
        raise ChainError(f'the text of the chain is longer than {MAX_BYTES // 2**20} MiB, must be shorter')
    return build_chain(data, '', source)


def own_text(chain: Chain, given: str) -> str:
    """Return `given` if it is a text of this chain, number by number, else a text that is; ChainError as data_of."""
    if given:
        try:
            if repr(build_chain(data_from_text(given, '<text>'), '<text>')) == repr(chain):
                return given
        except (ChainError, TypeError):   # TypeError: no text
            pass
    return text_of(data_of(chain))
