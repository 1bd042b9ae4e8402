"""Python values as TOML text."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def value_text(value: Any, where: str) -> str:
    """The value as TOML on one line. Raises TypeError for what TOML has no type for; `where` names the value then."""
    if hasattr(value, "tolist"):  # NumPy's arrays and scalars
        value = value.tolist()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)  # a float's digits give back the same bits; inf and nan are TOML's words too
    if isinstance(value, str):
        value.encode()  # raises UnicodeEncodeError for a lone surrogate, which no file can hold
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_entries(value, where)) + " }" if value else "{}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(value_text(item, f"{where}.{i}") for i, item in enumerate(value)) + "]"
    raise TypeError(f"{where}: {type(value).__name__} is not allowed; "
                    "allowed: bool, int, float, str, lists and dicts of these, NumPy arrays")


def document(table: Mapping[str, Any]) -> str:
    """The dict as a TOML document."""
    return "".join(entry + "\n" for entry in _entries(table, ""))


def override_text(value: Any, key: str) -> str:
    """The value as after `--set KEY=`, where a word that is no TOML value stands for itself."""
    if isinstance(value, str) and value == value.strip() and value.isprintable():  # no surrogate is printable
        try:
            tomllib.loads("x = " + value)
        except tomllib.TOMLDecodeError:
            return value
    return value_text(value, key)


def _entries(table, where):
    for key, value in table.items():
        if not isinstance(key, str):
            raise TypeError(f"{where or 'dict'}: the key {key!r} is not allowed; allowed: str")
        name = key if _BARE_KEY.fullmatch(key) else json.dumps(key, ensure_ascii=False).replace("\x7f", "\\u007f")
        yield f"{name} = {value_text(value, f'{where}.{key}' if where else key)}"
