"""
Reads XML text leniently where that changes no meaning, and safely: no DTD, no entities, no other files, limited size.

Accepted: blank lines before the XML declaration, any version in it, `--` in a comment, undeclared prefixes. Prefixes
stay in the tags as written; a default namespace adds none.
"""
from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NoReturn, Optional
from xml.parsers import expat

from ..chain.section import clipped
from ..errors import ChainError

MAX_DEPTH = 64            # of nested elements
MAX_ELEMENTS = 400_000    # half a second's work; public robots have up to some 10,000


class Element:
    """One element: `tag`, `attributes`, `children`, `text` right under it, and the `line` on which it begins."""

    __slots__ = ('tag', 'attributes', 'children', 'text', 'line')

    def __init__(self, tag: str, attributes: dict, line: int):
        self.tag, self.attributes, self.line = tag, attributes, line
        self.children, self.text = [], ''

    def get(self, key: str) -> Optional[str]:
        """Return an attribute, None where it is missing."""
        return self.attributes.get(key)

    def find(self, tag: str) -> Optional[Element]:
        """Return the first child of this tag, None where there is none."""
        return next((child for child in self.children if child.tag == tag), None)

    def all(self, tag: str) -> list[Element]:
        """Return the children of this tag."""
        return [child for child in self.children if child.tag == tag]

    def walk(self) -> Iterator[Element]:
        """Yield the element and all within it, in the order of the text."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))


def read_xml(text: str, name: str, wanted: str = 'URDF', depth: int = MAX_DEPTH,
             elements: int = MAX_ELEMENTS) -> Element:
    """
    Return the root element of a text; `name` is the file's in ChainError sentences, `wanted` what it should be.

    `depth`, `elements`: how deep it may be nested, and how many it may have.
    """
    root: Any = None
    stack, count = [], 0

    def fail(problem) -> NoReturn:
        raise ChainError(f'{name} line {parser.CurrentLineNumber}: {problem}')

    def start(tag, attributes):
        nonlocal root, count
        count += 1
        if len(stack) == depth:
            fail(f'is nested deeper than {depth} elements, must be {wanted}')
        if count > elements:
            fail(f'has more than {elements} elements, must be {wanted} of fewer')
        element = Element(tag, attributes, parser.CurrentLineNumber)
        if stack:
            stack[-1][0].children.append(element)
        else:
            root = element
        stack.append((element, []))

    def end(tag):
        element, parts = stack.pop()
        element.text = ''.join(parts)

    def doctype(*_):
        fail(f'has a DOCTYPE, must be {wanted} without one')

    parser = expat.ParserCreate('utf-8')   # without namespaces: an undeclared prefix is part of the name
    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = lambda part: stack[-1][1].append(part)
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(_without_comments(text), True)
    except expat.ExpatError as error:
        reason = clipped(expat.ErrorString(error.code), 80)
        raise ChainError(f'{name} line {error.lineno}: is not well-formed XML ({reason}), must be {wanted}') from None
    return root


def root_tag(text: str) -> str:
    """Return the tag of the first element of a text, '' where none begins."""
    text = _without_comments(text).lstrip()
    end = 1
    while end < len(text) and end < 200 and not text[end].isspace() and text[end] not in '/>':
        end += 1
    return text[1:end] if text.startswith('<') else ''


def _without_comments(text: str) -> str:
    """Return the text with blanks for comments and for the XML declaration; lines stay where they are."""
    parts, place = [], 0
    while (begin := text.find('<', place)) >= 0:
        for mark, end_mark, kept in (('<!--', '-->', False), ('<![CDATA[', ']]>', True), ('<?', '?>', False)):
            if text.startswith(mark, begin):
                end = text.find(end_mark, begin + len(mark))
                end = len(text) if end < 0 else end + len(end_mark)
                parts.append(text[place:begin])
                parts.append(text[begin:end] if kept else '\n' * text.count('\n', begin, end))
                break
        else:
            end = begin + 1
            parts.append(text[place:end])
        place = end
    parts.append(text[place:])
    return ''.join(parts)
