"""The cache of converted maps: what is in it is whole and the user's own, and where there is none all works without."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest

from caldrive.files import write_whole
from caldrive.world.roads import map_cache
from caldrive.world.roads.map_cache import digest, kept_network

NETWORK = b"<net/>"


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the user's cache is; its last resort lies beside it."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path / "home"


@pytest.fixture
def last_resort(tmp_path: Path) -> Path:
    return tmp_path / "temporary" / f"caldrive-{os.getuid()}"


def made_again() -> bytes:
    return pytest.fail("was made again")


def test_a_network_is_made_once(home: Path) -> None:
    path = kept_network("key", lambda: NETWORK)
    assert path.parent == home / "caldrive"
    assert path.read_bytes() == NETWORK
    assert kept_network("key", made_again) == path
    assert list(path.parent.iterdir()) == [path]


def test_another_key_is_another_network() -> None:
    assert kept_network("key", lambda: NETWORK) != kept_network("other", lambda: NETWORK)


@pytest.mark.parametrize("damage", [b"", b"<net", b"<Net/>"], ids=["empty", "cut off", "changed"])
def test_a_damaged_network_is_made_again(damage: bytes) -> None:
    path = kept_network("key", lambda: NETWORK)
    path.write_bytes(damage)
    assert kept_network("key", lambda: NETWORK).read_bytes() == NETWORK


def test_two_that_make_the_same_network_at_once_both_get_it() -> None:
    path = kept_network("key", lambda: kept_network("key", lambda: NETWORK).read_bytes())
    assert path.read_bytes() == NETWORK


def test_a_file_in_the_way_of_the_cache_is_no_obstacle(home: Path, last_resort: Path) -> None:
    home.write_text("in the way")
    assert kept_network("key", lambda: NETWORK).parent == last_resort
    assert last_resort.stat().st_mode & 0o777 == 0o700


def test_a_full_disk_under_the_cache_is_no_obstacle(
    home: Path, last_resort: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, content: bytes) -> None:
        if home in path.parents:
            raise OSError(28, "No space left on device", str(path))
        write_whole(path, content)

    monkeypatch.setattr(map_cache, "write_whole", full)
    assert kept_network("key", lambda: NETWORK).parent == last_resort
    assert kept_network("key", made_again).parent == last_resort


def test_without_any_folder_the_network_stays_in_memory(home: Path, last_resort: Path) -> None:
    home.touch()
    last_resort.touch()
    paths = [kept_network(key, lambda: NETWORK + key.encode()) for key in ("a", "b")]  # noqa: B023
    assert [path.read_bytes() for path in paths] == [b"<net/>a", b"<net/>b"]


@pytest.mark.parametrize("planted", ["open to all", "a link of somebody else's"])
def test_a_folder_that_others_can_write_to_is_not_used(
    planted: str, home: Path, last_resort: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home.touch()
    if planted == "open to all":
        last_resort.mkdir()
        last_resort.chmod(0o777)
    else:
        (last_resort.parent / "theirs").mkdir(mode=0o700)
        last_resort.symlink_to("theirs")
        monkeypatch.setattr(
            Path, "lstat", lambda _: os.stat_result((0o120777, 1, 1, 1, os.getuid() + 1, 0, 0, 0, 0, 0))
        )
    before = sorted(last_resort.iterdir())
    assert kept_network("key", lambda: NETWORK).read_bytes() == NETWORK
    assert sorted(last_resort.iterdir()) == before


def test_without_a_home_the_last_resort_is_used(
    last_resort: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)  # as for a user number without a name
    monkeypatch.chdir(tmp_path)
    assert kept_network("key", lambda: NETWORK).parent == last_resort
    assert not (tmp_path / "~").exists()


def test_digests_tell_where_one_part_ends() -> None:
    assert digest(b"ab", b"c") != digest(b"a", b"bc")
