"""~/markers: the bodies as lines, without TF, in the frame of `frame_id`, where the URDF has them."""
from __future__ import annotations

from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from ..chain.visual import body_color
from ..mechanics.body_lines import body_lines

PERIOD = 1.0 / 30.0  # s
WIDTH = 0.03         # m, of a line


def marker_array(chain, frames, stamp: int, position, frame_id: str) -> MarkerArray:
    """
    Return a line list for each body at joint positions (joints,) of a time, ns, and one marker of joint points.

    `frame_id`: a link of `frames` (LinkFrames), in whose frame they are drawn; any other is taken as the root's.
    """
    by_name = dict(zip(chain.joint_names, position))
    lines = []   # number and body; ends of its lines; how far it lies from the plane
    for number, body in enumerate(body_lines(chain, position)):
        beside = frames.beside(chain.bodies[number].name, by_name)
        if beside is not None:   # what a slide along the normal carries, on its own, is drawn as the links it carries
            lines.append((number, [end for line in body for end in line], beside))
    places = iter(frames.seen_from(frame_id, [end for _, line, _ in lines for end in line],
                                   [beside for _, line, beside in lines for _ in line], by_name))
    markers, points = [], []
    for number, line, _ in lines:
        drawn = [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in (next(places) for _ in line)]
        marker = _marker(Marker.LINE_LIST, chain.bodies[number].name, drawn, body_color(chain, number))
        marker.scale.x = WIDTH
        markers.append(marker)
        points.append(drawn[0])
    marker = _marker(Marker.SPHERE_LIST, 'joint points', points, (0.2, 0.2, 0.2, 1.0))
    marker.scale.x = marker.scale.y = marker.scale.z = 1.5 * WIDTH
    markers.append(marker)
    for number, marker in enumerate(markers):
        marker.id, marker.header.frame_id = number, frame_id
        marker.header.stamp.sec, marker.header.stamp.nanosec = divmod(stamp, 10**9)
    return MarkerArray(markers=markers)


def _marker(kind: int, name: str, points: list, color: tuple) -> Marker:
    marker = Marker(type=kind, ns=name, points=points, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = map(float, color)
    return marker
