"""Write the page of the Python API, as `make docs` does: python docs/api.py FOLDER. A warning of pdoc is an error."""
from pathlib import Path
import sys
from typing import get_type_hints
import warnings

import numpy.typing
import pdoc

import planar_chain_sim


class ArrayLike:
    """Stands for numpy.typing.ArrayLike, which pdoc would write out as a union of ten types."""

    __module__ = 'numpy.typing'


def write(folder: Path) -> None:
    """Write planar_chain_sim.html, and index.html that leads to it, into a folder."""
    numpy.typing.ArrayLike = ArrayLike
    for value in map(planar_chain_sim.__getattr__, planar_chain_sim.__all__[1:]):
        if isinstance(value, type):     # what dataclasses and named tuples generate has types that pdoc cannot look up
            for constructor in (value.__init__, value.__new__):
                if hasattr(constructor, '__annotations__'):
                    constructor.__annotations__ = get_type_hints(value)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        pdoc.pdoc('planar_chain_sim', '!planar_chain_sim.', output_directory=folder)


if __name__ == '__main__':
    write(Path(sys.argv[1]))
