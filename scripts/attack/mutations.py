"""Bytes, texts and JSON, changed at random. All changes are drawn from the generator that is given."""

from __future__ import annotations

import json
import random
import re
from typing import Any

NUMBERS = ("0", "-1", "nan", "inf", "-inf", "1e308", "1e309", "-0.0", "0.1", "1e-320", "2147483648", "-2147483649",
           "9223372036854775808", "99999999999999999999999999999999", "0x10", "1_000", "1,5", "٣")  # fmt: skip
NASTY: tuple[Any, ...] = (
    None, True, -1, 0, 1, 2**31, 2**63, 10**30, -0.0, 1e308, -1e308, 1e-320, 0.1, "", "x" * 5000, "\x00",
    "\x1b[31m", "💥", "../..", "/", "%s", [], {}, [[]], {"a": {}}, [None] * 3,
)  # fmt: skip
TEXTS = ("", "x" * 3000, "💥", "\x00", "../..", "/", "a b", "[]", "{}", "%s", "none", "true", "\n", '"', "'", "<",
         "]]>", "&lt;", "\ufeff", "\x1b[31m")  # fmt: skip


def of_bytes(content: bytes, rng: random.Random) -> bytes:
    """Bits turned over, or a part cut off, doubled, wiped, taken out or strewn in."""
    if not content:
        return rng.randbytes(16)
    at, size = rng.randrange(len(content)), rng.choice((1, 4, 64, 4096))
    before, middle, after = content[:at], content[at : at + size], content[at + size :]
    changes = (
        lambda: _bits_turned(content, rng.choice((1, 8, 200)), rng),
        lambda: before,
        lambda: middle + after,
        lambda: before + middle + middle + after,
        lambda: before + bytes(len(middle)) + after,
        lambda: before + after,
        lambda: before + rng.randbytes(size) + middle + after,
        lambda: b"",
        lambda: b"\xff\xfe" + content,
    )
    return rng.choices(changes, (3, 3, 1, 2, 2, 2, 2, 0.3, 0.3))[0]()


def _bits_turned(content: bytes, n: int, rng: random.Random) -> bytes:
    turned = bytearray(content)
    for _ in range(n):
        turned[rng.randrange(len(turned))] ^= 1 << rng.randrange(8)
    return bytes(turned)


def of_text(content: bytes, rng: random.Random) -> bytes:
    """Some numbers or words of a text (TOML, XML) replaced, some of its lines gone or there twice."""
    text = content.decode(errors="replace")
    if rng.random() < 0.2:
        lines = text.splitlines(keepends=True)
        at = rng.randrange(len(lines)) if lines else 0
        return "".join(lines[:at] + rng.choice(([], 2 * lines[at : at + 1])) + lines[at + 1 :]).encode()
    spots = list(re.finditer(r'"[^"\n]*"|-?\d+\.?\d*(?:e-?\d+)?|\b[a-zA-Z_]{3,}\b', text))
    chosen = rng.sample(spots, min(len(spots), rng.choice((1, 1, 1, 3))))
    for spot in sorted(chosen, key=lambda spot: -spot.start()):
        text = text[: spot.start()] + _other_word(spot.group(), rng) + text[spot.end() :]
    return text.encode(errors="replace")


def _other_word(word: str, rng: random.Random) -> str:
    """Something that stands where a number stood where that was one; quotes stay."""
    if word.startswith('"'):
        return f'"{_other_word(word[1:-1], rng)}"'
    numeric = re.fullmatch(r"-?\d+\.?\d*(?:e-?\d+)?", word)
    return rng.choice(NUMBERS if numeric and rng.random() < 0.8 else TEXTS)


def of_json(content: bytes, rng: random.Random) -> bytes:
    """Some values of a JSON text replaced, taken out, doubled or renamed; now and then nested deep, or NaN."""
    try:
        values = json.loads(content)
    except ValueError:
        return of_bytes(content, rng)
    if rng.random() < 0.03:
        return b"[" * 100_000 + b"]" * 100_000
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        values = _changed(values, rng)
    text = json.dumps(values)
    if rng.random() < 0.1:  # what Python writes and JSON does not know
        text = re.sub(r"\d+\.\d+", lambda found: rng.choice(("NaN", "Infinity", found.group())), text)
    return text.encode()


def _changed(value: Any, rng: random.Random) -> Any:
    """A value with one change somewhere inside."""
    if not isinstance(value, dict | list) or not value or rng.random() < 0.05:
        return _other_value(value, rng)
    kind = rng.random()
    if isinstance(value, list):
        at = rng.randrange(len(value))
        if kind < 0.1:
            return value[:at] + value[at + 1 :]
        return [*value, value[at]] if kind < 0.2 else [*value[:at], _changed(value[at], rng), *value[at + 1 :]]
    key = rng.choice(list(value))
    if kind < 0.07:
        return {name: one for name, one in value.items() if name != key}
    if kind < 0.14:
        return value | {rng.choice(TEXTS): value[key]}
    return value | {key: _changed(value[key], rng)}


def _other_value(value: Any, rng: random.Random) -> Any:
    """Mostly of the same type, as others are refused at the door."""
    alike = [other for other in NASTY if type(other) is type(value)]
    numbers = [other for other in NASTY if isinstance(other, int | float) and not isinstance(other, bool)]
    if isinstance(value, int | float) and not isinstance(value, bool):
        alike = [*numbers, -value, value + 1, value * 10]
    return rng.choice(alike) if alike and rng.random() < 0.7 else rng.choice(NASTY)
