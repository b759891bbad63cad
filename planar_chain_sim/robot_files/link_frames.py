"""
Frames of a URDF's links in space at joint positions, for TF and for markers.

The robot's plane may have any orientation in the root's frame.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Optional

import numpy as np

from .planar_robot import body_names, planar_data
from .spatial_robot import child_place
from .urdf_reader import Reader
from .xml_elements import read_xml


class Frames:
    """
    The frames of some links in those of their parents, for all joints at once.

    pairs: names of parent and child. `joints`: SpatialJoints that carry the links; `joint_names`: of the positions that
    poses() takes.
    """

    def __init__(self, joints: Sequence, joint_names: Sequence[str] = ()):
        index = {name: k for k, name in enumerate(joint_names)}
        self.pairs = [(joint.parent, joint.child) for joint in joints]
        places = [child_place(joint, np.eye(3), np.zeros(3)) for joint in joints]
        self._still = np.array([[*shift, *quaternion(turn)] for turn, shift in places]).reshape(-1, 7)
        turning, sliding = ([row for row, joint in enumerate(joints) if joint.moves and joint.kind == kind]
                            for kind in ('rotation', 'slide'))
        self._turning, self._sliding = np.array(turning, int), np.array(sliding, int)
        self._turns, self._slides = (np.array([index[joints[row].name] for row in rows], int)
                                     for rows in (turning, sliding))
        # A turn by q about the axis a is the quaternion (a sin q/2, cos q/2), to the right of that of the joint at 0.
        still = self._still[self._turning, 3:]
        self._quarter = np.array([_product(still[k], [*joints[row].axis, 0.0]) for k, row in enumerate(turning)])
        self._along = np.array([places[row][0] @ joints[row].axis for row in sliding])

    def poses(self, position) -> np.ndarray:
        """Return (frames, 7): x, y, z, m, and the unit quaternion x, y, z, w, at joint positions (joints,)."""
        poses = self._still.copy()
        if len(self._turning):
            half = 0.5 * position[self._turns, None]
            poses[self._turning, 3:] = np.cos(half) * poses[self._turning, 3:] + np.sin(half) * self._quarter
        if len(self._sliding):
            poses[self._sliding, :3] += position[self._slides, None] * self._along
        return poses


class LinkFrames:
    """
    Frames of the links of a URDF that the reader takes; `hold` as there.

    `plane` (2, 3): the chain's x and y in the root's frame, if known, as for a URDF that this package wrote.
    """

    def __init__(self, urdf: str, hold: Mapping = {}, plane=None):
        self._robot = Reader(read_xml(urdf, 'the URDF'), 'the URDF').robot(dict(hold))
        self._joints = {joint.child: joint for joint in self._robot.joints}
        self._flat = plane is not None
        self._plane = np.array(plane) if self._flat else planar_data(self._robot, 'the URDF')[1].basis[:2]
        self._sides = {} if self._flat else self._sides_of_bodies()

    @property
    def root(self) -> str:
        """Name of the link that no joint carries."""
        return self._robot.root

    @property
    def links(self) -> tuple:
        """Names of all links, the root first."""
        return self.root, *self._joints

    def fixed(self) -> Frames:
        """Return the frames that never change: links behind fixed and welded joints."""
        return Frames([joint for joint in self._robot.joints if not joint.moves])

    def moving(self, joint_names: Sequence[str]) -> Frames:
        """Return the frames of links behind joints that move; `joint_names`: the chain's, in order."""
        return Frames([joint for joint in self._robot.joints if joint.moves], joint_names)

    def pose(self, link: str, position: Mapping) -> tuple[np.ndarray, np.ndarray]:
        """Return rotation (3, 3) and position (3,), m, of a link in the root's frame."""
        way = []
        while link != self.root:
            way.append(self._joints[link])
            link = way[-1].parent
        turn, shift = np.eye(3), np.zeros(3)
        for joint in reversed(way):
            if joint.moves:
                joint = replace(joint, welded_at=position[joint.name])
            turn, shift = child_place(joint, turn, shift)
        return turn, shift

    def _sides_of_bodies(self) -> dict:
        """Return body -> how far its link lies along the normal, m, and {slide along it: m per m}."""
        robot, normal = self._robot, np.cross(*self._plane)
        places, sides = {robot.root: (np.eye(3), np.zeros(3))}, {robot.root: (0.0, {})}
        for joint in robot.joints:
            turn, shift = places[joint.child] = child_place(joint, *places[joint.parent])
            slides = sides[joint.parent][1]
            if joint.moves and joint.kind == 'slide' and abs(along := float(normal @ turn @ joint.axis)) > 0.5:
                slides = {**slides, joint.name: along}
            sides[joint.child] = float(normal @ shift), slides
        return {body: sides[link] for link, body in body_names(robot).items() if link != robot.root}

    def beside(self, body: str, position: Mapping) -> Optional[float]:
        """Return how far from the chain's plane a body lies along its normal, m; None for a body that is no link."""
        if self._flat:
            return 0.0
        if body not in self._sides:
            return None
        start, slides = self._sides[body]
        return start + sum(along * position[slide] for slide, along in slides.items())

    def seen_from(self, link: str, points, beside, position: Mapping) -> np.ndarray:
        """
        Return points in a link's frame (n, 3), m, or in the root's for no such link.

        `points`: complex (n,), m, in the plane; `beside`: (n,), m, how far from it each lies along its normal.
        """
        points = np.asarray(points)
        places = (np.stack([points.real, points.imag], axis=1) @ self._plane
                  + np.asarray(beside)[:, None] * np.cross(*self._plane))
        turn, shift = self.pose(link, position) if link in self._joints else (np.eye(3), np.zeros(3))
        return (places - shift) @ turn


def quaternion(turn: np.ndarray) -> np.ndarray:
    """Return x, y, z, w of a rotation matrix, w >= 0: the eigenvector of the largest eigenvalue, exact for any turn."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = turn
    matrix = np.array([[xx - yy - zz, yx + xy, zx + xz, zy - yz], [yx + xy, yy - xx - zz, zy + yz, xz - zx],
                       [zx + xz, zy + yz, zz - xx - yy, yx - xy], [zy - yz, xz - zx, yx - xy, xx + yy + zz]])
    vector = np.linalg.eigh(matrix)[1][:, -1]
    return vector if vector[3] >= 0.0 else -vector


def _product(first: Sequence[float], second: Sequence[float]) -> np.ndarray:
    """Return the product of two quaternions x, y, z, w."""
    a, b = np.array(first[:3]), np.array(second[:3])
    return np.array([*(first[3] * b + second[3] * a + np.cross(a, b)), first[3] * second[3] - a @ b])
