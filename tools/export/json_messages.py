"""The messages of this project as JSON for Foxglove."""

import json


def shaped(shape, number, array, record):
    """Builds a field of this shape. The first dimension becomes an array, further ones objects.

    Foxglove refuses a channel that has an array of arrays.
    """
    if not shape:
        return number
    return array(shape[0], shaped_entry(shape[1:], number, record))


def shaped_entry(shape, number, record):
    if not shape:
        return number
    keys = "xyz" if shape[0] == 3 else [f"e{i}" for i in range(shape[0])]
    return record({key: shaped_entry(shape[1:], number, record) for key in keys})


def json_schema(message_type):
    """The JSON Schema of a message, limited to what Foxglove reads."""

    def array(_, items):
        return {"type": "array", "items": items}

    def record(properties):
        return {"type": "object", "properties": properties}

    fields = {}
    for field in message_type.fields:
        layout = message_type.layout[field]
        number = {"type": "number" if layout.base.kind == "f" else "integer"}
        fields[field] = shaped(layout.shape, number, array, record)
    return json.dumps({"title": message_type.name, **record(fields)})


def json_pattern(message_type):
    """The format string that makes a message's JSON from its numbers."""

    def array(size, item):
        return "[" + ",".join([item] * size) + "]"

    def record(entries):
        return "{" + ",".join(f'"{key}":{entry}' for key, entry in entries.items()) + "}"

    return record({field: shaped(message_type.layout[field].shape, "%s", array, record)
                   for field in message_type.fields})
