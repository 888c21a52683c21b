"""What mkdocs does while it builds the pages: lists of files from the code, and a look at what a page would fetch.

A line `<!-- files: world/roads -->` in a page becomes a table of that folder's files, with the first sentence of each
one's docstring.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path
from typing import Any

CODE = Path(__file__).parents[1] / "src" / "caldrive"
PLACE = re.compile(r"^<!-- files: (\S+) -->$", re.MULTILINE)
FETCHED = re.compile(r'<(?:script|img|iframe|link)\b[^>]*\b(?:src|href)="(?:https?:)?//[^"]*"')


def first_sentence(path: Path) -> str:
    """The first sentence of a module's docstring, in one line."""
    paragraph = (ast.get_docstring(ast.parse(path.read_text())) or "").partition("\n\n")[0]
    text = " ".join(paragraph.split())
    end = re.search(r"(?<!Fig)(?<!eq)\.(?= [A-Z])", text)
    return text[: end.start() + 1] if end else text


def files_table(folder: str) -> str:
    """The files of a folder of src/caldrive as a table in Markdown. Raises ValueError where there is no such folder."""
    modules = sorted(path for path in (CODE / folder).glob("*.py") if path.name != "__init__.py")
    if not modules:
        raise ValueError(f"found no Python file in {CODE / folder}, wanted a folder of the package: correct the page")
    rows = [f"| `{path.name}` | {first_sentence(path).replace('|', chr(92) + '|')} |" for path in modules]
    return "\n".join(["| file | what it holds |", "|---|---|", *rows])


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Called by mkdocs for each page."""
    return PLACE.sub(lambda place: files_table(place.group(1)), markdown)


def on_post_page(output: str, **_: Any) -> str:
    """Called by mkdocs for each finished page. Raises ValueError where it would fetch something from elsewhere."""
    if elsewhere := FETCHED.search(output):
        raise ValueError(f"found {elsewhere.group()}, wanted a page that fetches nothing: correct mkdocs.yml")
    return output
