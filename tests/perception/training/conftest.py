"""What the tests of training share: one thread, and a tiny recording."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from tests.perception.data import record


@pytest.fixture(scope="module", autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(autouse=True)
def _no_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of a tiny training's time would go into its curves, which test_folder.py draws."""
    monkeypatch.setattr(
        "caldrive.perception.training.folder.draw_curves", lambda rows, figures, path: path.write_bytes(b"curves")
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three tiny episodes of a bright column."""
    return record(tmp_path_factory.mktemp("episodes"))
