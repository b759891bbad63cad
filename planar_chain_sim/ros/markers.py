"""~/markers: the bodies as lines in the upright plane, for those who want no TF."""
from __future__ import annotations

from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from ..pictures import body_lines
from ..visual import body_color

PERIOD = 1.0 / 30.0  # s
WIDTH = 0.03         # m, of a line


def marker_array(chain, stamp: int, position, frame_id: str) -> MarkerArray:
    """Return a line list for each body at joint positions (joints,) of a time, ns, and one marker of joint points."""
    markers, points = [], []
    for number, (body, lines) in enumerate(zip(chain.bodies, body_lines(chain, position))):
        ends = [_point(end) for line in lines for end in line]
        marker = _marker(Marker.LINE_LIST, body.name, ends, body_color(body, COLORS[number % len(COLORS)]))
        marker.scale.x = WIDTH
        markers.append(marker)
        points.append(ends[0])
    marker = _marker(Marker.SPHERE_LIST, 'joint points', points, (0.2, 0.2, 0.2))
    marker.scale.x = marker.scale.y = marker.scale.z = 1.5 * WIDTH
    markers.append(marker)
    for number, marker in enumerate(markers):
        marker.id, marker.header.frame_id = number, frame_id
        marker.header.stamp.sec, marker.header.stamp.nanosec = divmod(stamp, 10**9)
    return MarkerArray(markers=markers)


def _marker(kind: int, name: str, points: list, color: tuple) -> Marker:
    marker = Marker(type=kind, ns=name, points=points, action=Marker.ADD)
    marker.pose.orientation.w = 1.0
    marker.color.r, marker.color.g, marker.color.b = map(float, color)
    marker.color.a = 1.0
    return marker


def _point(place: complex) -> Point:
    return Point(x=float(place.real), y=0.0, z=float(place.imag))   # the plane stands upright, as in the URDF
