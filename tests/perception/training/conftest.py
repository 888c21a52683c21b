"""What the tests of training share: one thread, and a tiny recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

from tests.perception.data import record


@pytest.fixture(scope="module", autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(scope="module", autouse=True)
def _no_drawing() -> Iterator[None]:
    """Half of a tiny training's time would go into its curves, which test_folder.py draws."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "caldrive.perception.training.folder.draw_curves", lambda rows, figures, path: path.write_bytes(b"curves")
        )
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three tiny episodes of a bright column."""
    return record(tmp_path_factory.mktemp("episodes"))
