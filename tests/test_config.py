"""Settings from a TOML file: laid over defaults, checked by name and type."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import pytest

from caldrive.config import from_toml


@dataclass(frozen=True)
class Wheel:
    radius: float = 0.3
    spokes: int = 5


@dataclass(frozen=True)
class Car:
    wheel: Wheel = Wheel()
    plate: Wheel = field(default=Wheel(), metadata={"flat": True})
    name: str = "car"
    file: Path | None = None
    gears: tuple[int, ...] = (1, 2)
    json: bool = field(default=False, metadata={"typed": True})

    def __post_init__(self) -> None:
        if self.wheel.radius <= 0:
            raise ValueError(f"a wheel of {self.wheel.radius} m")


PRESETS = {"usual": Car(), "large": Car(Wheel(1.0), name="lorry")}


def read(folder: Path, text: str) -> Car:
    (folder / "car.toml").write_text(text)
    return from_toml(folder / "car.toml", PRESETS, Car())


def test_what_a_file_does_not_name_stays_as_it_is(tmp_path: Path) -> None:
    assert read(tmp_path, "") == Car()
    assert read(tmp_path, "name = 'van'\n[wheel]\nradius = 0.4") == Car(Wheel(0.4), name="van")


def test_a_file_may_build_on_a_preset(tmp_path: Path) -> None:
    assert read(tmp_path, "preset = 'large'\n[wheel]\nspokes = 3") == Car(Wheel(1.0, 3), name="lorry")
    with pytest.raises(ValueError, match=r"found preset 'small' in .*, wanted one of usual, large"):
        read(tmp_path, "preset = 'small'")


def test_flat_settings_are_named_without_their_holder(tmp_path: Path) -> None:
    assert read(tmp_path, "spokes = 9").plate == Wheel(spokes=9)


def test_paths_and_lists_have_their_types(tmp_path: Path) -> None:
    car = read(tmp_path, "file = 'a/b'\ngears = [1, 2, 3]")
    assert (car.file, car.gears) == (Path("a/b"), (1, 2, 3))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("wings = 2", r"found wings in .*car\.toml, wanted one of wheel, radius, spokes, name, file, gears"),
        ("[wheel]\nwings = 2", r"found wings in .*car\.toml, wheel, wanted one of radius, spokes"),
        ("json = true", r"found json in .*car\.toml, wanted one of wheel, radius, spokes, name, file, gears:"),
        ("name = 3", r"found 3 in .*car\.toml, name .*change it"),
        ("[wheel]\nspokes = 2.5", r"found 2\.5 in .*wheel, spokes"),
        ("wheel = 3", "found 3 in .*wheel"),
        ("name = ", r"is no TOML .*correct it"),
        ("[wheel]\nradius = -1.0", r"what cannot be \(a wheel of -1\.0 m\)"),
    ],
)
def test_what_cannot_be_is_named_with_its_place(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        read(tmp_path, text)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"found no file .*gone\.toml"):
        from_toml(tmp_path / "gone.toml", PRESETS, Car())


def test_a_file_without_end_and_a_huge_one_are_refused_before_they_are_read(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="found no file /dev/zero"):
        from_toml(Path("/dev/zero"), PRESETS, Car())
    with (tmp_path / "huge.toml").open("wb") as file:
        file.truncate(20_000_000)
    with pytest.raises(ValueError, match=r"found 20 MB in .*huge\.toml"):
        from_toml(tmp_path / "huge.toml", PRESETS, Car())
