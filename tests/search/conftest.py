"""A tiny recording and a network, made once, and a finished search on them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from caldrive.progress import silent
from caldrive.search.examples import Source, checked_parts, make_features
from caldrive.search.run import SearchResult, Workers, search
from tests.search.data import TINY_SEARCH, make_source


@pytest.fixture(scope="session")
def source(tmp_path_factory: pytest.TempPathFactory) -> Source:
    """With its features."""
    source = make_source(tmp_path_factory.mktemp("search"))
    make_features(source, checked_parts(source, TINY_SEARCH), silent)
    return source


@pytest.fixture(scope="session")
def searched(tmp_path_factory: pytest.TempPathFactory, source: Source) -> tuple[Source, SearchResult]:
    """A whole search that nothing interrupted, and what it found."""
    own = replace(source, out=tmp_path_factory.mktemp("searched"))
    return own, search(replace(TINY_SEARCH, conditioning=True), own, Workers())
