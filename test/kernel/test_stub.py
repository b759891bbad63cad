"""_kernel.pyi names all that the compiled kernel has, and nothing else; codes are named as the enums count them."""
import ast
from pathlib import Path

import pytest

import planar_chain_sim
from planar_chain_sim import _kernel


def names_in(body):
    """Return the public names that a part of the stub declares, __init__ included."""
    for each in body:
        if isinstance(each, (ast.FunctionDef, ast.ClassDef)):
            yield each.name
        elif isinstance(each, ast.AnnAssign):
            yield each.target.id


def public(names):
    return {name for name in names if not name.startswith('_')}


STUB = ast.parse(Path(planar_chain_sim.__file__).with_name('_kernel.pyi').read_text())
CLASSES = {each.name: each for each in STUB.body if isinstance(each, ast.ClassDef)}


def test_the_stub_has_every_name_of_the_module():
    assert public(names_in(STUB.body)) == public(vars(_kernel))


@pytest.mark.parametrize('name', CLASSES)
def test_the_stub_has_every_name_of_a_class(name):
    assert public(names_in(CLASSES[name].body)) == public(vars(getattr(_kernel, name)))


def test_every_code_has_a_name():
    for names in (_kernel.FAMILIES, _kernel.OUTCOMES, _kernel.EVENT_KINDS, _kernel.REFUSALS):
        assert len(set(names)) == len(names) > 1 and all(names)
    assert _kernel.OUTCOMES[0] == 'good' and _kernel.REFUSALS[0] == 'none'
    with pytest.raises(ValueError, match="^family 'nonsense' is none of FAMILIES$"):
        _kernel.MethodData('nonsense', 4, False, 0.0)
