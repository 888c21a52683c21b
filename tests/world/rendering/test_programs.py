"""The shaders: GLSL files with includes, and numbers that go by the names that Python has for them."""

from __future__ import annotations

import re

from caldrive.datatypes import Semantic
from caldrive.world.rendering.programs import SHADERS, VERSION, defines, shader_source
from caldrive.world.scene.textures import Tex


def test_a_source_begins_with_its_version_and_holds_what_it_includes() -> None:
    source = shader_source("road.frag")
    assert source.startswith(VERSION)
    assert "#include" not in source
    for file in ("blocks", "light", "stripes"):
        assert source.count((SHADERS / f"{file}.glsl").read_text()) == 1


def test_classes_and_layers_have_their_numbers_by_name() -> None:
    source = shader_source("static.vert")
    assert f"#define CLASS_SIGN {Semantic.SIGN.value}\n" in source
    assert f"#define TEX_ASPHALT {Tex.ASPHALT.value}\n" in source


def test_every_shader_file_is_drawn_with_and_every_name_in_it_has_a_number() -> None:
    names = ("static", "road", "actor", "shadow", "glow", "sky", "rain", "static_class", "road_class", "actor_class")
    files = {path.name.removesuffix(".glsl") for path in SHADERS.iterdir()}
    stages = {file for file in files if file.partition(".")[0] in names}
    assert files - stages == {"blocks", "light", "stripes"}
    for stage in stages:
        code = re.sub(r"//.*|#define.*", "", shader_source(stage))
        assert set(re.findall(r"\b[A-Z]+_[A-Z_0-9]+\b", code)) <= set(defines())
