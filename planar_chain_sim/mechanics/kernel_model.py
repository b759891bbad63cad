"""The kernel's model of a chain: the merged links as arrays, and the laws of their joints."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .joint_forces import add_laws_to_kernel
from .path_matrix import Link, merge_welded, Place
from .. import _kernel
from ..chain.chain import Chain


class KernelModel(NamedTuple):
    """
    The kernel's const `model` of a chain, its merged links, and the places of the bodies in them.

    `grounded`: first moment, kg m, of bodies welded to the base, which the kernel's model does not have.
    """

    model: _kernel.Model
    links: list[Link]
    grounded: complex
    places: list[Place]


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


def kernel_model_of(chain: Chain) -> KernelModel:
    """Return the chain's model, which is made at its first use and then kept with the chain."""
    kept = chain.__dict__   # a frozen dataclass lets its cache be written here, and pickles without it
    if '_model' not in kept:
        links, grounded, places = merge_welded(chain)
        topology, constants = kernel_arrays(chain, links)
        model = _kernel.Model(topology, constants, (chain.gravity.real, chain.gravity.imag), chain.joint_count)
        add_laws_to_kernel(model, chain)
        model.place_bodies([body.name for body in chain.bodies], places)
        kept['_model'] = KernelModel(model, links, grounded, places)
    return kept['_model']
