"""A machine without graphics says what to install."""

from __future__ import annotations

import pytest

from caldrive.world.rendering import gl


@pytest.mark.parametrize("library", ["EGL", "GL"])
def test_a_machine_without_a_library_says_what_to_install(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(f"GLCONTEXT_LINUX_LIB{library}", "nowhere.so")
    with pytest.raises(RuntimeError, match=r"found no EGL .*nowhere\.so.* type apt-get install libegl1"):
        gl.gl_context.__wrapped__()
