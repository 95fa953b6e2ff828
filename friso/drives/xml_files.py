"""Read parameter files that are XML, without document types or entities."""

from __future__ import annotations

from xml.etree import ElementTree

from friso.errors import InputError


def root_of(text: str, expected: str) -> ElementTree.Element:
    """Return the root element of an XML text.

    `expected` says what files of this kind are like. Raises InputError for a text that is no XML, and for one with a
    document type.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError("", "a document type", f"an XML file without one, {expected}")
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError("", f"no XML: {error}", f"a file {expected}") from None
