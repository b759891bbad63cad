"""Every citation can be resolved: a section of docs/equations.md, or an equation on that page."""
from pathlib import Path
import re

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs/equations.md').read_text()
TEXTS = sorted(path for folder in ('planar_chain_sim', 'test', 'docs') for path in (ROOT / folder).rglob('*')
               if path.suffix in ('.py', '.hpp', '.cpp', '.md')) + [ROOT / 'README.md']
NUMBER = r'\d+(?:\.\d+)?'


def citations(pattern):
    """Return {what is cited: the files that do}."""
    found = {}
    for path in TEXTS:
        for cited in re.findall(pattern, path.read_text()):
            found.setdefault(cited, set()).add(str(path.relative_to(ROOT)))
    return found


def sections():
    """Return the sections cited, also those of a list: equations.md 6.2 and 6.3."""
    lists = citations(rf'equations\.md ({NUMBER}(?:(?:, | and ){NUMBER}(?!\d| ?%))*)')
    return {number: files for text, files in lists.items() for number in re.findall(NUMBER, text)}


@pytest.mark.parametrize('number, files', sorted(sections().items()))
def test_a_cited_section_is_there(number, files):
    assert re.search(rf'^###? {re.escape(number)}\.? ', PAGE, re.MULTILINE), f'{number}, cited by {sorted(files)}'


@pytest.mark.parametrize('number, files', sorted(citations(r'\((5\.[5-9]\d)\)').items()))
def test_a_cited_equation_is_on_the_page(number, files):
    assert f'({number})' in PAGE, f'({number}), cited by {sorted(files)}'
