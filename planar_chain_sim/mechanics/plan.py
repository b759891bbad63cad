"""The plan: what a chain needs, what is skipped, and which form of the equations suits it, made once per chain."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any

from .joint_forces import has_stop, JOINT_FORCES
from .kernel_model import kernel_model_of
from .path_matrix import Place
from .solvable import refuse_singular
from .. import _kernel
from ..chain.chain import Chain, check_chain
from ..chain.section import counted

DENSE_LINKS = _kernel.DENSE_LINKS   # up to which the dense form is worth it for a serial chain that only turns


@dataclass(frozen=True)
class Plan:
    """`model`: the kernel's const data; `used`, `skipped`: the scene's features; str() is one line for a log."""

    model: Any
    links: int
    joints: int
    used: tuple[str, ...]
    skipped: tuple[str, ...]
    form: str                 # of the equations, what 'auto' stands for
    why_form: str
    grounded_energy: float    # J, potential energy of bodies welded to the base, which the kernel never sees
    places: tuple[Place, ...]  # of the bodies, in file order
    dense: bool               # whether `form` is 'dense'

    def __repr__(self):
        return f'Plan: {self}; form {self.form}'

    def __str__(self):
        return (f'{counted(self.links, "link")}, {counted(self.joints, "joint")}; '
                f'uses {", ".join(self.used) or "nothing more"}; skips {", ".join(self.skipped) or "nothing"}')


def plan_of(chain: Chain) -> Plan:
    """
    Return the chain's plan, which is made at its first use and then kept with the chain.

    TypeError: no chain. ChainError: an impossible chain that was made by hand.
    """
    try:
        kept = chain.__dict__   # a frozen dataclass lets its cache be written here, and pickles without it
    except AttributeError:
        raise _no_chain(chain) from None
    plan = kept.get('_plan')
    if plan is None:
        if not isinstance(chain, Chain):
            raise _no_chain(chain)
        if '_checked' not in kept:
            check_chain(chain)
        if '_solvable' not in kept:
            refuse_singular(chain)
        plan = kept['_plan'] = _make_plan(chain)
    return plan


def _no_chain(given) -> TypeError:
    """Return the error that says how to make a chain from the given object."""
    made = 'chain_from_dict' if isinstance(given, Mapping) else 'load_chain'
    what = repr(str(given)) if isinstance(given, (str, PathLike)) else 'data' if isinstance(given, Mapping) else 'file'
    return TypeError(f'chain is {given!r:.80}, must be a Chain: {made}({what:.200}) gives one')


def _make_plan(chain: Chain) -> Plan:
    """List the features, choose the form."""
    model, links, grounded, places = kernel_model_of(chain)
    features = {
        'slides': any(link.slide for link in links),
        'branches': len({link.carrier for link in links}) < len(links),
        'bent links': any(link.offset.imag or link.moment.imag for link in links),   # gamma, eta
        'gravity': chain.gravity != 0,
        'armature': any(joint.armature > 0.0 for joint in chain.joints),
        **{law.name: any(map(law.acts_on, chain.joints)) for law in JOINT_FORCES},
        'effort limits': any(joint.effort_limit < float('inf') for joint in chain.joints),
        'stops': any(map(has_stop, chain.joints)),
    }
    used = tuple(name for name, present in features.items() if present)
    skipped = tuple(name for name, present in features.items() if not present)
    welded = len(chain.bodies) - len(links)
    if welded:
        used += (f'welded bodies merged: {welded}',)
    if model.refined:
        used += ('iterative refinement',)
    form, why_form = _choose_form(links, model.refined)
    return Plan(model, len(links), chain.joint_count, used, skipped, form, why_form,
                -(grounded * chain.gravity.conjugate()).real, tuple(places), form == 'dense')


def _choose_form(links, refined: bool) -> tuple[str, str]:
    """Return the form that 'auto' stands for and why, by the shape of the chain alone."""
    if refined:
        return 'recursive', ' (auto: light links carry a heavy one, and the recursion keeps more digits)'
    serial = all(link.carrier == slot - 1 and link.rotation and not link.slide and not link.rotation.armature
                 for slot, link in enumerate(links, start=1))
    if serial and len(links) <= DENSE_LINKS:
        return 'dense', f' (auto: a serial chain of rotations with at most {DENSE_LINKS} links)'
    return 'recursive', (f' (auto: more than {DENSE_LINKS} links)' if serial else
                         ' (auto: not a serial chain of rotations without armature)')
