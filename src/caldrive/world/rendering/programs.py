"""The process's GL programs: compiled from `shaders/*.glsl`, with the blocks, textures and samplers that all share.

The GLSL is whole but for two things. `#include "blocks.glsl"` stands for the text of that file, and numbers that Python
knows too (semantic classes, texture layers, parts of cars and people, heights) go by their names: `defines` has them.
"""

from __future__ import annotations

import re
from enum import IntEnum
from functools import lru_cache
from pathlib import Path

import moderngl
import numpy as np

from caldrive.datatypes import Semantic
from caldrive.world.rendering.gl import gl_context, mipmapped_layers, rain_texture
from caldrive.world.scene.cars import GLOWING, CarPart
from caldrive.world.scene.furniture import LAMP_RADIUS
from caldrive.world.scene.ground import JUNCTION_HALF_WIDTH, KERB_HEIGHT, UNITS_PER_METRE
from caldrive.world.scene.people import HIP_HEIGHT, SHOULDER_HEIGHT, Limb
from caldrive.world.scene.shadows import TALLEST_SHADOW
from caldrive.world.scene.streets import Border
from caldrive.world.scene.textures import Tex, texture_layers

SHADERS = Path(__file__).with_name("shaders")
VERSION = "#version 330 core\n"
BLOCKS = {"Frame": 0, "Lighting": 1}  # uniform blocks and where they are bound
SAMPLERS = ("layers", "shadows", "panorama", "drops")  # in the order of their texture units
_ENUMS: dict[str, type[IntEnum]] = {"CLASS": Semantic, "TEX": Tex, "BORDER": Border, "CAR": CarPart, "LIMB": Limb}
_INCLUDE = re.compile(r'^#include "(\w+\.glsl)"\n', flags=re.MULTILINE)


def defines() -> dict[str, float]:
    """The numbers that the shaders call by name, such as CLASS_SIGN for Semantic.SIGN; heights and radii in m."""
    members = {f"{prefix}_{member.name}": int(member) for prefix, enum in _ENUMS.items() for member in enum}
    return members | {
        "GLOWING": GLOWING,
        "METRES_PER_COLOR": 255 / UNITS_PER_METRE,
        "JUNCTION_HALF_WIDTH": JUNCTION_HALF_WIDTH,
        "HIP_HEIGHT": HIP_HEIGHT,
        "SHOULDER_HEIGHT": SHOULDER_HEIGHT,
        "KERB_HEIGHT": KERB_HEIGHT,
        "LAMP_RADIUS": LAMP_RADIUS,
        "TALLEST_SHADOW": TALLEST_SHADOW,
    }


def shader_source(name: str) -> str:
    """The GLSL of `shaders/NAME.glsl`, ready to compile: version, defines, and every included file in its place."""
    numbers = "".join(f"#define {key} {value}\n" for key, value in defines().items())
    return VERSION + numbers + _expanded(f"{name}.glsl")


def _expanded(file: str) -> str:
    return _INCLUDE.sub(lambda include: _expanded(include[1]), (SHADERS / file).read_text(encoding="utf-8"))


def compiled(vertex: str, fragment: str | None = None) -> moderngl.Program:
    """A program from `shaders/VERTEX.vert.glsl` and `shaders/FRAGMENT.frag.glsl`, by default of the same name.

    Its blocks and samplers are where all pictures expect them.
    """
    program = gl_context().program(
        vertex_shader=shader_source(f"{vertex}.vert"), fragment_shader=shader_source(f"{fragment or vertex}.frag")
    )
    for block, binding in BLOCKS.items():
        member = program.get(block, None)
        if isinstance(member, moderngl.UniformBlock):
            member.binding = binding
    for unit, sampler in enumerate(SAMPLERS):
        if sampler in program:
            program[sampler] = unit
    return program


class Programs:
    """The programs that draw pictures, and what all towns share on the graphics side."""

    def __init__(self) -> None:
        gl = gl_context()
        self.current: object = None  # whose lighting and textures are in place
        self.frame, self.lighting = gl.buffer(reserve=96, dynamic=True), gl.buffer(reserve=128, dynamic=True)
        self.static, self.road, self.actor = compiled("static"), compiled("road"), compiled("actor")
        self.shadow, self.glow = compiled("shadow"), compiled("glow")
        self.sky, self.rain = compiled("sky"), compiled("rain")
        self.corners = gl.buffer(np.array([(-1, -1), (1, -1), (-1, 1), (1, 1)], "f4").tobytes())
        self.layers = mipmapped_layers(texture_layers())
        self.drops = rain_texture()


class SemanticPrograms:
    """The programs that draw classes instead of colours, from the same triangles."""

    def __init__(self) -> None:
        self.static = compiled("static_class")
        self.road = compiled("road", "road_class")
        self.actor = compiled("actor", "actor_class")


@lru_cache(maxsize=1)
def programs() -> Programs:
    """Those of the process, compiled at the first call."""
    return Programs()


@lru_cache(maxsize=1)
def semantic_programs() -> SemanticPrograms:
    """Those of the process, compiled at the first call."""
    return SemanticPrograms()
