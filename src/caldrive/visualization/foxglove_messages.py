"""Channels' messages in protobuf, with the schemas that Foxglove, Lichtblick and Rerun know; needs the extra `record`.

Protobuf and not JSON: Rerun reads Foxglove's schemas in protobuf only, and a picture in JSON takes a third more room.
Values have schemas of their own, such as `caldrive.Affordances`, that are made from `channels.FIELDS`: viewers plot any
number of any schema.
"""

from __future__ import annotations

import math
from functools import lru_cache, singledispatch
from typing import Any

from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.Color_pb2 import Color
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CubePrimitive_pb2 import CubePrimitive
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.Point3_pb2 import Point3
from foxglove_schemas_protobuf.Pose_pb2 import Pose
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from google.protobuf.timestamp_pb2 import Timestamp

from caldrive.visualization.channels import FIELDS, TEXT, Content, Lens, Picture, Remark, Values
from caldrive.visualization.scenes import CAMERA, Box, Line, Part, Place, Scene, turned

LEVELS = {"info": Log.INFO, "warning": Log.WARNING, "error": Log.ERROR}


def nanoseconds(time: float) -> int:
    """A time (s) as MCAP counts it."""
    return round(time * 1e9)


@singledispatch
def message(content: Content, time: float) -> Any:
    """The protobuf message of a content at a time (s)."""
    raise TypeError(f"{type(content).__name__} is no content of a channel")


@message.register
def _(content: Picture, time: float) -> Any:
    return CompressedImage(timestamp=_stamp(time), frame_id=CAMERA, format="jpeg", data=content.jpeg)


@message.register
def _(content: Values, time: float) -> Any:
    return value_class(content.kind)(**content.fields)


@message.register
def _(content: Remark, time: float) -> Any:
    return Log(timestamp=_stamp(time), level=LEVELS[content.level], message=content.text, name="caldrive")


@message.register
def _(content: Place, time: float) -> Any:
    return FrameTransform(
        timestamp=_stamp(time), parent_frame_id=content.parent, child_frame_id=content.frame,
        translation=_vector(*content.origin), rotation=_quaternion(*content.rotation),
    )  # fmt: skip


@message.register
def _(content: Lens, time: float) -> Any:
    width, height = content.camera.width, content.camera.height
    focal = width / 2 / math.tan(math.radians(content.camera.fov) / 2)  # pixels
    return CameraCalibration(
        timestamp=_stamp(time), frame_id=CAMERA, width=width, height=height,
        K=[focal, 0, width / 2, 0, focal, height / 2, 0, 0, 1],
        R=[1, 0, 0, 0, 1, 0, 0, 0, 1],
        P=[focal, 0, width / 2, 0, 0, focal, height / 2, 0, 0, 0, 1, 0],
    )  # fmt: skip


@message.register
def _(content: Scene, time: float) -> Any:
    return SceneUpdate(entities=[_entity(part, content.frame, time) for part in content.parts])


def _entity(part: Part, frame: str, time: float) -> SceneEntity:
    """One entity of a part, which takes the place of the last one of its name, moves with its frame and stays."""
    return SceneEntity(
        timestamp=_stamp(time), frame_id=frame, id=part.name, frame_locked=True,
        cubes=[_cube(box) for box in part.boxes], lines=[_line(line) for line in part.lines],
    )  # fmt: skip


def _cube(box: Box) -> CubePrimitive:
    middle = _vector(box.pose.x, box.pose.y, box.up)
    pose = Pose(position=middle, orientation=_quaternion(*turned(box.pose.heading)))
    return CubePrimitive(pose=pose, size=_vector(*box.size), color=_color(box.color))


def _line(line: Line) -> LinePrimitive:
    points = [Point3(x=x, y=y) for x, y in line.points.tolist()]
    here = Pose(position=_vector(0, 0, 0), orientation=_quaternion(0, 0, 0, 1))
    return LinePrimitive(pose=here, thickness=line.width, points=points, color=_color(line.color))


def _stamp(time: float) -> Timestamp:
    stamp = Timestamp()
    stamp.FromNanoseconds(nanoseconds(time))
    return stamp


def _vector(x: float, y: float, z: float) -> Vector3:
    return Vector3(x=x, y=y, z=z)


def _quaternion(x: float, y: float, z: float, w: float) -> Quaternion:
    return Quaternion(x=x, y=y, z=z, w=w)


def _color(color: tuple[float, float, float, float]) -> Color:
    r, g, b, a = color
    return Color(r=r, g=g, b=b, a=a)


@lru_cache
def value_class(kind: str) -> Any:
    """The message class of a kind of values: a number (double) or a word (string) by each name."""
    file = FileDescriptorProto(name=f"caldrive/{kind}.proto", package="caldrive", syntax="proto3")
    schema = file.message_type.add(name=kind)
    for number, (name, unit) in enumerate(FIELDS[kind].items(), start=1):
        of_type = FieldDescriptorProto.TYPE_STRING if unit == TEXT else FieldDescriptorProto.TYPE_DOUBLE
        schema.field.add(name=name, number=number, type=of_type, label=FieldDescriptorProto.LABEL_OPTIONAL)
    pool = DescriptorPool()
    pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(f"caldrive.{kind}"))
