"""XML of anybody's: read without entities, by which a small file grows to gigabytes, and only so deep."""

from __future__ import annotations

from xml.etree import ElementTree as ET

MOST_DEPTH = 100  # OpenDRIVE needs ten


class _Builder(ET.TreeBuilder):
    """Builds the tree, and refuses what no map needs before it costs anything."""

    _depth = 0

    def doctype(self, *_: object) -> None:
        raise ValueError("it declares a document type, by which XML can be made to grow")

    def start(self, tag: str, attrs: dict[str, str]) -> ET.Element:
        self._depth += 1
        if self._depth > MOST_DEPTH:
            raise ValueError(f"its elements are nested more than {MOST_DEPTH} deep")
        return super().start(tag, attrs)

    def end(self, tag: str) -> ET.Element:
        self._depth -= 1
        return super().end(tag)


def parse_xml(content: bytes) -> ET.Element:
    """The root of an XML document. Raises ValueError with the reason where it is none, or a dangerous one."""
    try:
        return ET.fromstring(content, parser=ET.XMLParser(target=_Builder()))
    except (ET.ParseError, LookupError) as error:  # of an unknown encoding
        raise ValueError(f"it is no XML: {error}") from error
