"""Bad inputs from good ones: bytes, JSON, TOML and XML, changed at random."""

from __future__ import annotations

import json
import random
import re
from typing import Any

NASTY: tuple[Any, ...] = (
    None, True, -1, 0, 1, 2**31, 2**63, 10**30, -0.0, 1e308, -1e308, 0.1, "", "nan", "x" * 5000, "\x00", "💥", "../..",
    "/", [], {}, [[]], {"a": {}}, [None] * 3,
)  # fmt: skip
WORDS = ("", "-1", "0", "nan", "inf", "-inf", "1e309", "99999999999999999999", "x" * 3000, "💥", "../..", "/", "a b",
         "1,2,3,4", "True", "[]", "0x10", " ", "%s", "{}", "none", "1.5", "-0", "\n", "/dev/null", "10000000",
         "/proc/self/mem")  # fmt: skip


def of_bytes(content: bytes, rng: random.Random) -> bytes:
    """Bits turned over, parts cut off, doubled, wiped or strewn in."""
    if not content:
        return bytes(rng.randrange(256) for _ in range(16))
    at, size = rng.randrange(len(content)), rng.choice((1, 4, 64, 4096))
    middle = content[at : at + size]
    kind = rng.randrange(7)
    if kind == 0:
        turned = bytearray(content)
        for _ in range(rng.choice((1, 8, 200))):
            turned[rng.randrange(len(turned))] ^= 1 << rng.randrange(8)
        return bytes(turned)
    if kind == 1:
        return content[:at]
    if kind == 2:
        return content[at:]
    if kind == 3:
        return content[:at] + middle + content[at:]
    if kind == 4:
        return content[:at] + bytes(len(middle)) + content[at + len(middle) :]
    if kind == 5:
        return content[:at] + content[at + len(middle) :]
    return content[:at] + rng.randbytes(size) + content[at:]


def of_json(content: bytes, rng: random.Random) -> bytes:
    """One value of a JSON text replaced, taken out, doubled or nested deep; sometimes its bytes changed."""
    if rng.random() < 0.2:
        return of_bytes(content, rng)
    values = json.loads(content)
    for _ in range(rng.choice((1, 1, 2, 5))):
        values = _changed(values, rng)
    return json.dumps(values).encode()


def _changed(value: Any, rng: random.Random) -> Any:
    inside = (
        list(value.items()) if isinstance(value, dict) else list(enumerate(value)) if isinstance(value, list) else []
    )
    if not inside or rng.random() < 0.15:
        return rng.choice(NASTY)
    key, part = rng.choice(inside)
    kind = rng.random()
    if isinstance(value, dict):
        if kind < 0.1:
            return {name: one for name, one in value.items() if name != key}
        if kind < 0.2:
            return value | {rng.choice(WORDS): part}
        return value | {key: _changed(part, rng)}
    if kind < 0.1:
        return value[:key] + value[key + 1 :]
    if kind < 0.2:
        return [*value, part]
    return [*value[:key], _changed(part, rng), *value[key + 1 :]]


def of_text(content: bytes, rng: random.Random) -> bytes:
    """One number or word of a text (TOML, XML attributes) replaced; sometimes its bytes changed."""
    if rng.random() < 0.3:
        return of_bytes(content, rng)
    text = content.decode()
    spots = list(re.finditer(r'(?<==)"[^"]*"|-?\d+\.?\d*(?:e-?\d+)?|\b[a-z_]{3,}\b', text))
    for spot in rng.sample(spots, min(len(spots), rng.choice((1, 1, 3)))):
        quote = '"' if spot.group().startswith('"') else ""
        text = text.replace(spot.group(), f"{quote}{rng.choice(WORDS)}{quote}", 1)
    return text.encode(errors="replace")
