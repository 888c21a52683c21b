"""Changes that know a file's format: they get past the first look at it, which any flipped byte would not."""

from __future__ import annotations

import gzip
import io
import random
import re
import struct
from collections.abc import Callable

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from PIL import Image

from scripts.attack.mutations import NASTY, of_bytes, of_json, of_text

Change = Callable[[bytes, random.Random], bytes]
BYTES_SHARE = 0.25  # of the changes that know nothing of the format


def of_file(name: str, content: bytes, rng: random.Random) -> bytes:
    """A file changed as its ending allows, or byte by byte."""
    change = BY_ENDING.get(name.rpartition(".")[2], of_bytes)
    return of_bytes(content, rng) if rng.random() < BYTES_SHARE else change(content, rng)


def of_lines(content: bytes, rng: random.Random) -> bytes:
    """One line of JSON lines changed, gone, doubled, or moved."""
    lines = content.splitlines()
    at = rng.randrange(len(lines))
    choice = rng.random()
    if choice < 0.7:
        lines[at] = of_json(lines[at], rng)
    elif choice < 0.8:
        del lines[at]
    elif choice < 0.9:
        lines.append(lines[at])
    else:
        lines.reverse()
    return b"\n".join(lines) + rng.choice((b"\n", b"\n", b"\n\n", b""))


def of_gzip(content: bytes, rng: random.Random) -> bytes:
    """What is packed, changed; rarely as large as a bomb."""
    if rng.random() < 0.05:
        return 50 * gzip.compress(b" " * 10_000_000, 1) + content  # members one after the other are one text
    return gzip.compress(of_json(gzip.decompress(content), rng), mtime=0)


def of_safetensors(content: bytes, rng: random.Random) -> bytes:
    """The header changed, or the numbers behind it; the length of the header as it is, or not."""
    size = int.from_bytes(content[:8], "little")
    header, numbers = content[8 : 8 + size], content[8 + size :]
    choice = rng.random()
    if choice < 0.25:
        header = of_json(header.rstrip(), rng)
    elif choice < 0.5:  # the JSON within the JSON, which caldrive reads
        header = of_text(header, rng)
    elif choice < 0.6:
        return struct.pack("<Q", rng.choice((0, 1, size - 1, size + 1, 2**31, 2**63, 2**64 - 1))) + content[8:]
    else:
        numbers = _other_numbers(numbers, rng)
    return struct.pack("<Q", len(header)) + header + numbers


def _other_numbers(numbers: bytes, rng: random.Random) -> bytes:
    """Zeros, NaN, huge or random numbers in all places or in some."""
    pattern = rng.choice(
        (b"\x00\x00\x00\x00", b"\xff\xff\xff\x7f", b"\x00\x00\x80\x7f", b"\xff\xff\x7f\x7f", b"\xff\x7b\xff\x7b")
    )
    if rng.random() < 0.3:
        return (pattern * (len(numbers) // 4 + 1))[: len(numbers)]
    at = rng.randrange(len(numbers) // 4) * 4
    size = min(rng.choice((4, 400, 40_000)), len(numbers) - at) // 4 * 4
    return numbers[:at] + (pattern * (size // 4)) + numbers[at + size :]


def of_parquet(content: bytes, rng: random.Random) -> bytes:
    """A column of another type, gone, or with values that cannot be; rows gone or doubled; other metadata."""
    table = pq.read_table(io.BytesIO(content))
    choice, at = rng.random(), rng.randrange(table.num_columns)
    if choice < 0.1:
        table = table.remove_column(at)
    elif choice < 0.2:
        table = pa.concat_tables([table, table.slice(rng.randrange(len(table)))])
    elif choice < 0.25:
        table = table.slice(rng.randrange(len(table) + 1))
    elif choice < 0.45:
        metadata = {key: of_json(value, rng) for key, value in (table.schema.metadata or {}).items()}
        table = table.replace_schema_metadata(metadata)
    else:
        table = _other_column(table, at, rng)
    buffer = io.BytesIO()
    pq.write_table(table, buffer, write_page_checksum=True)
    return buffer.getvalue()


def _other_column(table: pa.Table, at: int, rng: random.Random) -> pa.Table:
    """One value of a column replaced by one of its type, of another type, or by none."""
    field, values = table.schema.field(at), table.column(at).to_pylist()
    row = rng.randrange(len(values))
    alike: dict[pa.DataType, tuple[object, ...]] = {
        pa.float64(): (float("nan"), float("inf"), -1e308, 1e308, -1.0, 2.0, 1e-320, -0.0),
        pa.int64(): (-1, 2**62, 0, 7, 99),
        pa.string(): ("", "x" * 5000, "\x00", "left", "💥"),
        pa.binary(): (b"", b"\xff\xd8\xff", of_bytes(values[row], rng) if isinstance(values[row], bytes) else b""),
        pa.bool_(): (True, False),
    }
    values[row] = rng.choice((*alike[field.type], None))
    try:
        column = pa.array(values, rng.choice((field.type, field.type, field.type, pa.string(), pa.float32())))
    except (pa.ArrowException, TypeError, ValueError):
        column = pa.array(values, field.type)
    return table.set_column(at, field.name, column)


def of_xml(content: bytes, rng: random.Random) -> bytes:
    """Attributes as in any text; or a whole element gone, there twice, or nested in itself."""
    if rng.random() < 0.6:
        return of_text(content, rng)
    text = content.decode(errors="replace")
    elements = list(re.finditer(r"<(\w+)[^<>]*/>|<(\w+)[^<>]*>(?:(?!<\2\b).)*?</\2>", text, re.DOTALL))
    if not elements:
        return of_text(content, rng)
    one = rng.choice(elements)
    instead = rng.choice(("", 2 * one.group(), 50 * one.group(), f"<a>{one.group()}</a>", "<!-- -->"))
    if rng.random() < 0.05:
        text = text.replace(
            "?>",
            '?><!DOCTYPE l [<!ENTITY a "'
            + "x" * 1000
            + '">'
            + "".join(f'<!ENTITY {b} "{f"&{a};" * 20}">' for a, b in zip("abcdefg", "bcdefgh", strict=True))
            + "]>",
            1,
        )
        instead = "&h;"
    return (text[: one.start()] + instead + text[one.end() :]).encode()


def of_picture(content: bytes, rng: random.Random) -> bytes:
    """Another size, another kind of pixels, or a header that says so and is not true."""
    if rng.random() < 0.5 and content[:4] == b"\x89PNG":
        width, height = rng.choice(((0, 0), (2**31 - 1, 1), (60_000, 60_000), (1, 2**31 - 1), (5, 5)))
        header = b"IHDR" + struct.pack(">II", width, height) + content[24:29]
        import zlib

        return content[:12] + header + struct.pack(">I", zlib.crc32(header)) + content[33:]
    if rng.random() < 0.5 and content[:2] == b"\xff\xd8" and (at := content.find(b"\xff\xc0")) > 0:
        return (
            content[: at + 5]
            + struct.pack(">HH", *rng.choice(((0, 0), (65500, 65500), (1, 65500))))
            + content[at + 9 :]
        )
    size = rng.choice(((1, 1), (3000, 2), (2, 3000), (33, 17), (1, 44), (100, 44)))
    pixels = np.zeros((size[1], size[0], 4), np.uint8) + rng.choice((0, 128, 255))
    buffer = io.BytesIO()
    mode = rng.choice(("L", "RGBA", "1", "RGB", "P", "LA", "I;16"))
    Image.fromarray(pixels.astype(np.uint8), "RGBA").convert("L" if mode == "I;16" else mode).save(buffer, "PNG")
    return buffer.getvalue()


BY_ENDING: dict[str, Change] = {
    "json": of_json, "jsonl": of_lines, "gz": of_gzip, "toml": of_text, "xodr": of_xml, "parquet": of_parquet,
    "safetensors": of_safetensors, "png": of_picture, "jpg": of_picture,
}  # fmt: skip
__all__ = ["BY_ENDING", "NASTY", "of_file"]
