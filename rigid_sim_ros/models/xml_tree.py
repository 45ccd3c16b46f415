# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
XML as a tree of elements that know their lines.

A model is a stranger's file: entities and document types are refused by defusedxml, size, depth
and number of elements are bounded, and nothing that a file names is opened here.
"""

from collections.abc import Iterator
from pathlib import Path
import re
from xml.sax import ContentHandler, SAXParseException
from xml.sax.xmlreader import AttributesImpl, Locator

from defusedxml import DefusedXmlException
from defusedxml.sax import parseString

from rigid_sim_ros.models.findings import ModelError
from rigid_sim_ros.problems import Problem
from rigid_sim_ros.reading import bytes_of

# [bytes] The largest robots have 0.3 MB; a file beyond this is no description of a model.
MAX_BYTES = 32_000_000
# A model needs some 10 levels, and 1e4 elements; more would take memory and stack without end.
MAX_DEPTH = 100
MAX_ELEMENTS = 1_000_000


class Element:
    """An element: its attributes, children and text, and where it stands."""

    __slots__ = ('attributes', 'children', 'file', 'line', 'parent', 'tag', 'text')

    def __init__(self, tag: str, attributes: dict[str, str], parent: 'Element | None', file: str,
                 line: int) -> None:
        """Make an element without children."""
        self.tag, self.attributes, self.parent = tag, attributes, parent
        self.file, self.line = file, line
        self.children: list[Element] = []
        self.text = ''

    @property
    def name(self) -> str:
        """Return its attribute `name`, '' without one."""
        return self.attributes.get('name', '')

    @property
    def path(self) -> str:
        """Return where it stands below the root, with the names of what has one."""
        own = f"{self.tag} '{self.name[:60]}'" if self.name else self.tag
        if self.parent is None or self.parent.parent is None:
            return own
        return f'{self.parent.path}/{own}'

    def find(self, tag: str) -> 'Element | None':
        """Return the first child of a tag."""
        return next(self.each(tag), None)

    def each(self, tag: str) -> Iterator['Element']:
        """Return the children of a tag."""
        return (child for child in self.children if child.tag == tag)

    def every(self) -> Iterator['Element']:
        """Return the element and all below it."""
        yield self
        for child in self.children:
            yield from child.every()


def read(path: Path) -> Element:
    """Return the root of a file; raises ModelError where it is no XML, or goes beyond bounds."""
    return parse(contents(path), str(path))


def contents(path: Path) -> bytes:
    """Return the bytes of a regular file of bounded size; ModelError where it is none."""
    try:
        return bytes_of(path, MAX_BYTES)
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        raise ModelError([Problem(f'cannot be read: {reason}', '', str(path))]) from None


def parse(data: bytes, file: str) -> Element:
    """Return the root of some text; `file` is named in errors."""
    handler = _Builder(file)
    try:
        parseString(_strict(data), handler, forbid_dtd=True)
    except ModelError:
        raise
    except SAXParseException as error:
        raise ModelError([Problem(f'not XML: {error.getMessage()}', '', file,
                                  error.getLineNumber() or 1)]) from None
    except DefusedXmlException:
        raise ModelError([Problem('has a document type or entities, must have none', '', file,
                                  handler.line)]) from None
    except (ValueError, LookupError) as error:   # an encoding that nobody knows, a bad byte
        raise ModelError([Problem(f'not XML: {" ".join(str(error).split())}', '', file,
                                  handler.line)]) from None
    if handler.root is None:
        raise ModelError([Problem('is empty, must be a model', '', file, 1)])
    return handler.root


# What begins a part of a file in which < is no tag, and what ends it.
_PARTS = {b'<!--': b'-->', b'<?': b'?>', b'<![CDATA[': b']]>'}
_BEGINS = re.compile(b'|'.join(map(re.escape, _PARTS)))


def _strict(data: bytes) -> bytes:
    """
    Return a file as XML wants it, line by line: TinyXML, with which others read it, wants less.

    XML forbids -- in comments, which Gazebo's own worlds have, and blanks before <?xml ... ?>.
    Nothing else is changed, so nothing that another reader sees is hidden.
    """
    blank = data[:len(data) - len(data.lstrip())]
    if blank and data.startswith(b'<?xml', len(blank)):
        declaration, end, rest = data[len(blank):].partition(b'?>')
        data = declaration + end + blank + rest
    mended, at = bytearray(data), 0
    while begin := _BEGINS.search(data, at):
        end = _PARTS[begin[0]]
        stop = data.find(end, begin.end())
        if stop < 0:
            break
        if begin[0] == b'<!--':
            inside = data[begin.end():stop].replace(b'--', b'  ')
            # As long as it was: millions of comments take no room beside the file.
            mended[begin.end():stop] = inside[:-1] + b' ' if inside.endswith(b'-') else inside
        at = stop + len(end)
    return bytes(mended)


class _Builder(ContentHandler):
    """Builds the tree."""

    def __init__(self, file: str) -> None:
        super().__init__()
        self._file = file
        self._open: list[Element] = []
        # What an open element holds comes in pieces, which are joined once: a file may have 1e7.
        self._texts: list[list[str]] = []
        self._count = 0
        self._locator: Locator | None = None
        self.root: Element | None = None

    @property
    def line(self) -> int:
        line = None if self._locator is None else self._locator.getLineNumber()
        return int(line or 1)

    def setDocumentLocator(self, locator: Locator) -> None:
        """Keep what knows the line."""
        self._locator = locator

    def startElement(self, name: str, attrs: AttributesImpl) -> None:
        """Open an element."""
        self._count += 1
        for number, most, what in ((self._count, MAX_ELEMENTS, 'elements'),
                                   (len(self._open), MAX_DEPTH, 'levels')):
            if number > most:
                raise ModelError([Problem(f'has more than {most} {what}, must be a description '
                                          'of a model', '', self._file, self.line)])
        parent = self._open[-1] if self._open else None
        element = Element(name, dict(attrs.items()), parent, self._file, self.line)
        if parent is None:
            self.root = element
        else:
            parent.children.append(element)
        self._open.append(element)
        self._texts.append([])

    def endElement(self, name: str) -> None:
        """Close the element."""
        self._open.pop().text = ''.join(self._texts.pop())

    def characters(self, content: str) -> None:
        """Keep text."""
        self._texts[-1].append(content)
