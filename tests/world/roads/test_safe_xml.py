"""XML that could hurt is refused before it does."""

from __future__ import annotations

import pytest

from caldrive.world.roads.safe_xml import MOST_DEPTH, parse_xml

LAUGHS = "".join(f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(12))


def test_a_document_becomes_a_tree() -> None:
    assert [child.get("a") for child in parse_xml(b'<root><x a="1"/><x a="2"/></root>')] == ["1", "2"]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "latin-1"])
def test_encodings_that_name_themselves_are_read(encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?><root name="Stra\u00dfe"/>'
    assert parse_xml(text.encode(encoding)).get("name") == "Stra\u00dfe"


DANGERS = {
    "entities": (f'<!DOCTYPE r [<!ENTITY a0 "ha">{LAUGHS}]><r>&a12;</r>'.encode(), "document type"),
    "a file of this machine": (b'<!DOCTYPE r [<!ENTITY f SYSTEM "file:///etc/passwd">]><r>&f;</r>', "document type"),
    "depth": (b"<a>" * (MOST_DEPTH + 1), f"nested more than {MOST_DEPTH} deep"),
    "an unknown encoding": (b'<?xml version="1.0" encoding="klingon"?><r/>', "no XML: unknown encoding"),
    "another encoding than it says": (b"\xff\xfe<r/>", "no XML"),
    "null bytes": (b"<r>\0</r>", "no XML"),
    "nothing": (b"", "no XML"),
    "two roots": (b"<a/><b/>", "no XML"),
}


@pytest.mark.parametrize("danger", DANGERS)
def test_a_dangerous_document_is_refused(danger: str) -> None:
    content, message = DANGERS[danger]
    with pytest.raises(ValueError, match=message):
        parse_xml(content)
