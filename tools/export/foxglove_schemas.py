"""Foxglove's schemas of frames and scenes as JSON Schema, word for word but for the descriptions.

Foxglove knows a message by the name of its schema: https://docs.foxglove.dev/docs/sdk/schemas. Every field is required.
"""

import json

_NUMBER, _STRING, _BOOLEAN = ({"type": kind} for kind in ("number", "string", "boolean"))


def _record(title, fields):
    return {"title": title, "type": "object", "properties": fields, "required": list(fields)}


def _list(items):
    return {"type": "array", "items": items}


def _choice(title, *names):
    return {"title": title, "oneOf": [{"title": name, "const": number} for number, name in enumerate(names)]}


def _clock(title, seconds):
    """A time or duration. Its parts are not marked as required."""
    return {"type": "object", "title": title,
            "properties": {"sec": seconds, "nsec": {"type": "integer", "minimum": 0, "maximum": 999999999}}}


_TIME = _clock("time", {"type": "integer", "minimum": 0})
_DURATION = _clock("duration", {"type": "integer"})
_VECTOR = _record("foxglove.Vector3", {"x": _NUMBER, "y": _NUMBER, "z": _NUMBER})
_POINTS = _list({**_VECTOR, "title": "foxglove.Point3"})
_QUATERNION = _record("foxglove.Quaternion", {"x": _NUMBER, "y": _NUMBER, "z": _NUMBER, "w": _NUMBER})
_POSE = _record("foxglove.Pose", {"position": _VECTOR, "orientation": _QUATERNION})
_COLOR = _record("foxglove.Color", {"r": _NUMBER, "g": _NUMBER, "b": _NUMBER, "a": _NUMBER})
_INDICES = _list({"type": "integer", "minimum": 0})

_PRIMITIVES = {
    "arrows": _record("foxglove.ArrowPrimitive", {
        "pose": _POSE, "shaft_length": _NUMBER, "shaft_diameter": _NUMBER, "head_length": _NUMBER,
        "head_diameter": _NUMBER, "color": _COLOR}),
    "cubes": _record("foxglove.CubePrimitive", {"pose": _POSE, "size": _VECTOR, "color": _COLOR}),
    "spheres": _record("foxglove.SpherePrimitive", {"pose": _POSE, "size": _VECTOR, "color": _COLOR}),
    "cylinders": _record("foxglove.CylinderPrimitive", {
        "pose": _POSE, "size": _VECTOR, "bottom_scale": _NUMBER, "top_scale": _NUMBER, "color": _COLOR}),
    "lines": _record("foxglove.LinePrimitive", {
        "type": _choice("foxglove.LineType", "LINE_STRIP", "LINE_LOOP", "LINE_LIST"), "pose": _POSE,
        "thickness": _NUMBER, "scale_invariant": _BOOLEAN, "points": _POINTS, "color": _COLOR,
        "colors": _list(_COLOR), "indices": _INDICES}),
    "triangles": _record("foxglove.TriangleListPrimitive", {
        "pose": _POSE, "points": _POINTS, "color": _COLOR, "colors": _list(_COLOR), "indices": _INDICES}),
    "texts": _record("foxglove.TextPrimitive", {
        "pose": _POSE, "billboard": _BOOLEAN, "font_size": _NUMBER, "scale_invariant": _BOOLEAN, "color": _COLOR,
        "text": _STRING}),
    "models": _record("foxglove.ModelPrimitive", {
        "pose": _POSE, "scale": _VECTOR, "color": _COLOR, "override_color": _BOOLEAN, "url": _STRING,
        "media_type": _STRING, "data": {"type": "string", "contentEncoding": "base64"}}),
}
PRIMITIVES = tuple(_PRIMITIVES)

_DELETION = _record("foxglove.SceneEntityDeletion", {
    "timestamp": _TIME, "type": _choice("foxglove.SceneEntityDeletionType", "MATCHING_ID", "ALL"), "id": _STRING})
_ENTITY = _record("foxglove.SceneEntity", {
    "timestamp": _TIME, "frame_id": _STRING, "id": _STRING, "lifetime": _DURATION, "frame_locked": _BOOLEAN,
    "metadata": _list(_record("foxglove.KeyValuePair", {"key": _STRING, "value": _STRING})),
    **{name: _list(primitive) for name, primitive in _PRIMITIVES.items()}})

FRAME, SCENE = "foxglove.FrameTransform", "foxglove.SceneUpdate"
# The text of each schema by its name.
SCHEMAS = {schema["title"]: json.dumps(schema, separators=(",", ":")) for schema in (
    _record(FRAME, {"timestamp": _TIME, "parent_frame_id": _STRING, "child_frame_id": _STRING, "translation": _VECTOR,
                    "rotation": _QUATERNION}),
    _record(SCENE, {"deletions": _list(_DELETION), "entities": _list(_ENTITY)}))}
