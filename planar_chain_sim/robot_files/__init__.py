"""Robots of other formats, URDF and MJCF, read as chains and written from them."""
