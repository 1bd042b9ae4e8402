"""Converts encoded messages to the text of their numbers, for CSV and JSON."""

import numpy as np

import ballast
from event_log import LogError, layout_of


class MessageType:
    """A message type, with the numpy layout of its bytes. `columns` names every number, in arrays NAME[0][1]."""

    def __init__(self, message_class):
        self.name = f"ballast.{message_class.__name__}"
        self.layout = layout_of(message_class)
        self.fields = [name for name in self.layout.names if name != "fingerprint"]
        self.columns = []
        for field in self.fields:
            shape = self.layout[field].shape
            self.columns += [field + "".join(f"[{i}]" for i in index) for index in np.ndindex(shape)]

    def numbers(self, payloads, where, infinity="inf", nan="nan"):
        """One tuple per message with a text per column. A float's text reads back as the same double."""
        for number, payload in enumerate(payloads):
            if len(payload) != self.layout.itemsize:
                raise LogError(f"{where}, message {number}: {len(payload)} bytes, expected {self.layout.itemsize}")
        rows = np.frombuffer(b"".join(payloads), dtype=self.layout)
        texts = []
        for field in self.fields:
            for column in rows[field].reshape(len(rows), -1).T:
                text = list(map(repr, column.tolist()))
                if column.dtype.kind == "f":
                    for i in np.flatnonzero(~np.isfinite(column)):
                        text[i] = nan if np.isnan(column[i]) else infinity if column[i] > 0 else "-" + infinity
                texts.append(text)
        return list(zip(*texts))


def types_by_fingerprint():
    classes = [value for value in vars(ballast).values() if hasattr(value, "_get_packed_fingerprint")]
    return {message_class._get_packed_fingerprint(): message_class for message_class in classes}
