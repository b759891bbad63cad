"""Types for those who use the package: the stub of the public names, which are loaded late, has the same names."""
import ast
from pathlib import Path

import planar_chain_sim

PACKAGE = Path(planar_chain_sim.__file__).parent


def test_the_stub_has_every_public_name_from_its_own_module():
    tree = ast.parse((PACKAGE / '__init__.pyi').read_text())
    imported = {alias.asname: node.module for node in tree.body if isinstance(node, ast.ImportFrom)
                for alias in node.names if alias.asname == alias.name and node.level == 1}
    declared = {node.target.id for node in tree.body if isinstance(node, ast.AnnAssign)}
    assert imported == planar_chain_sim._HOME
    assert {*imported, *declared} == {*planar_chain_sim.__all__}
    assert (PACKAGE / 'py.typed').is_file()


def test_types_are_wanted_of_every_module_with_public_names():
    settings = (Path(__file__).parents[2] / 'pyproject.toml').read_text()
    assert [name for name in planar_chain_sim._HOME.values() if f'"planar_chain_sim.{name}",' not in settings] == []
