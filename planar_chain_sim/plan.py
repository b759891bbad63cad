"""The plan: what a chain needs, what is skipped, and the kernel model made for it, once, when the chain is loaded."""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Optional

import numpy as np

from . import _kernel
from .chain import Chain
from .integrators import Method
from .joint_forces import has_stop, JOINT_FORCES, teach_kernel
from .path_matrix import merge_welded, Place

# Links up to which the dense form is worth it for a serial chain that only turns. Measured once: uniform rods, gcc 12,
# a 3 GHz x86-64 core with AVX2, dense and recursion in ns: 170, 194 at 6 links, 205, 215 at 7, 243, 241 at 8. The
# recursion keeps about a digit more, so what is nearly a tie goes to it.
DENSE_LINKS = 6


@dataclass(frozen=True)
class Plan:
    """`model`: the kernel's const data; `used`, `skipped`: the scene's features; str() is one line for a log."""

    model: object
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
        return (f'{self.links} links, {self.joints} joints; '
                f'uses {", ".join(self.used) or "nothing more"}; skips {", ".join(self.skipped) or "nothing"}')


def kernel_arrays(chain: Chain, links) -> tuple[np.ndarray, np.ndarray]:
    """Return topology (links, 3) and numbers (links, 12) of merged links; M_i of (5.60) is summed from the leaves."""
    index = {joint.name: k for k, joint in enumerate(chain.joints)}
    outboard = [0.0] * (len(links) + 1)
    for slot in range(len(links), 0, -1):
        outboard[slot] += links[slot - 1].mass
        outboard[links[slot - 1].carrier] += outboard[slot]
    topology = np.array([
        (link.carrier, index[link.slide.name] if link.slide else -1, index[link.rotation.name] if link.rotation else -1)
        for link in links], dtype=np.int32).reshape(len(links), 3)
    constants = np.array([
        (link.rotation.axis if link.rotation else 1.0, link.mass, outboard[slot], link.moment.real, link.moment.imag,
         link.inertia, link.offset.real, link.offset.imag, link.slide_axis.real, link.slide_axis.imag,
         link.rotation.armature if link.rotation else 0.0, link.slide.armature if link.slide else 0.0)
        for slot, link in enumerate(links, start=1)]).reshape(len(links), 12)
    return topology, constants


def _kernel_model(chain: Chain, links) -> object:
    """Hand the merged links and the laws of their joints to the kernel."""
    topology, constants = kernel_arrays(chain, links)
    model = _kernel.Model(topology, constants, (chain.gravity.real, chain.gravity.imag), chain.joint_count)
    teach_kernel(model, chain)
    return model


def plan_of(chain: Chain) -> Plan:
    """
    Return the chain's plan, made when it is first asked for and kept with the chain from then on.

    TypeError: no chain. ChainError: a chain that was made by hand and cannot be.
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
            from .chain_checks import check_chain
            check_chain(chain)
        plan = kept['_plan'] = _make_plan(chain)
    return plan


def _no_chain(given) -> TypeError:
    """Return the error that says how a chain is made of what was given."""
    made = 'chain_from_dict' if isinstance(given, Mapping) else 'load_chain'
    what = repr(str(given)) if isinstance(given, (str, PathLike)) else 'data' if isinstance(given, Mapping) else 'file'
    return TypeError(f'chain is {given!r:.80}, must be a Chain: {made}({what:.200}) gives one')


def _make_plan(chain: Chain) -> Plan:
    """Merge welded bodies, list features, build the kernel's model."""
    links, grounded, places = merge_welded(chain)
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
    model = _kernel_model(chain, links)
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


def singular_joint(chain: Chain) -> Optional[str]:
    """
    Name of a joint whose pivot vanishes at each of a few fixed irregular configurations, else None (equations.md 7).

    Pivots are analytic in q: zero at all of them is zero everywhere, and then the chain has no motion to compute.
    """
    count = chain.joint_count
    zero, joint = np.zeros(count), -1
    for trial in range(1, 5):
        position = np.sin(1.0 + 2.399963 * trial * np.arange(1, count + 1)) * (0.7 + 0.2 * trial)
        joint = plan_of(chain).model.forward_dynamics(position, zero, zero)[1]
        if joint < 0:
            return None
    return chain.joint_names[joint]


def damping_rate(chain: Chain) -> float:
    """
    Estimate of the fastest decay that joint damping gives the chain at its initial state, 1/s; 0 without damping.

    Power iteration for the largest eigenvalue of H^-1 d, six times an O(n) solution.
    """
    return _largest_rate(chain, np.array([joint.damping for joint in chain.joints]))[0]


def _largest_rate(chain: Chain, law: np.ndarray) -> tuple[float, int]:
    """Return the largest eigenvalue of H^-1 law, law (joints,) on the diagonal, and the joint that moves most in it."""
    if not law.any():
        return 0.0, 0
    position = np.array([joint.position for joint in chain.joints])
    return plan_of(chain).model.largest_rate(position, law)


def step_limit(chain: Chain, method: Method) -> Optional[tuple[float, str]]:
    """
    Return the longest step, s, that a fixed-step method can hold stable at the initial state, and the joint to blame.

    By estimates of the fastest decay of dampers and oscillation of springs, and the method's stability region on the
    negative real and on the imaginary axis. None where nothing is stiff or the method has no such limit.
    """
    real, imaginary = method.stability_limits
    limits = []
    for law, power, extent in (('damping', 1.0, real), ('stiffness', 0.5, imaginary)):
        rate, joint = _largest_rate(chain, np.array([getattr(joint, law) for joint in chain.joints]))
        if rate > 0.0 and extent < np.inf:
            limits.append((extent / rate**power, chain.joint_names[joint]))
    return min(limits, default=None)
