"""Robot files: finds the format of a text and its reader; refuses other formats by name."""
from __future__ import annotations

from typing import Union

from .xml_elements import root_tag
from ..chain.chain import Chain
from ..errors import ChainError

WANTED = 'must be a URDF, an MJCF or a chain file in YAML'
OTHERS = {  # the root element's tag -> format, other than URDF and MJCF
    'sdf': 'an SDF', 'gazebo': 'an SDF (an old one, with the root gazebo)', 'world': 'a world of Gazebo',
    'mujocoinclude': 'a part of an MJCF, to be included by another file', 'OpenSimDocument': 'a model of OpenSim',
    'COLLADA': 'a COLLADA mesh', 'Robot': 'a robot of OpenRAVE', 'KinBody': 'a body of OpenRAVE',
    'Environment': 'an environment of OpenRAVE', 'X3D': 'an X3D scene', 'VTKFile': 'a VTK file', 'amf': 'an AMF mesh',
    'launch': 'a launch file', 'package': 'a package manifest', 'svg': 'an SVG picture',
    'project': 'a project file', 'simulation': 'a scene of another simulator', 'scene': 'a scene of another simulator',
}
BEGINNINGS = {  # of texts that are no XML
    '#usda': 'a USD scene', 'PXR-USDC': 'a USD scene', '#VRML': 'a VRML scene (for example of Webots)',
    '#X3D': 'an X3D scene', '\x89MCAP': 'an MCAP log (resimulate and replay read it)', 'glTF': 'a glTF scene',
    'PK\x03\x04': 'a ZIP archive (or a USDZ scene)', 'solid ': 'an STL mesh', 'ply\n': 'a PLY mesh', '%PDF': 'a PDF',
}


def refuse_other_formats(start: Union[str, bytes], name: str) -> None:
    """Raise ChainError with the format of a file that is neither YAML nor XML, by its first characters."""
    if isinstance(start, bytes):
        start = start.decode('latin-1')
    for beginning, what in BEGINNINGS.items():
        if start.startswith(beginning):
            raise ChainError(f'{name}: is {what}, {WANTED}')


def chain_from_robot_file(text: str, name: str, hold: dict) -> Chain:
    """Return the chain of an XML text: URDF or MJCF; ChainError, one sentence, for another format."""
    tag = root_tag(text)
    if tag == 'mujoco':
        from .mjcf_reader import chain_from_mjcf
        return chain_from_mjcf(text, name, hold)
    if tag in OTHERS:
        raise ChainError(f'{name}: is {OTHERS[tag]}, {WANTED}')
    from .urdf_reader import chain_from_urdf
    return chain_from_urdf(text, name, hold)
