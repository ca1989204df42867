"""CDR, the form in which ROS 2 sends messages: numbers in their order, each aligned to its size.

OMG, DDS Interoperability Wire Protocol (RTPS) 2.5, section 10, and CORBA 3.3 part 2, section 9.3:
plain CDR, version 1, little-endian.
"""

from __future__ import annotations

import struct

import numpy as np

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
"""Representation identifier and options, which go before every message."""


class CdrEncoder:
    """Content of one message, field by field in the order of its definition.

    Examples
    --------
    A byte, and a number of four bytes, which is moved to a multiple of four:

    >>> encoder = CdrEncoder()
    >>> encoder.number("B", 7)
    >>> encoder.number("I", 1)
    >>> encoder.message().hex(" ")
    '00 01 00 00 07 00 00 00 01 00 00 00'
    """

    def __init__(self) -> None:
        self._content = bytearray()

    def number(self, kind: str, value: float) -> None:
        """A number in a format of `struct`: `B` uint8, `?` bool, `I` uint32, `i` int32, ..."""
        self._align(struct.calcsize(kind))
        self._content += struct.pack(f"<{kind}", value)

    def text(self, value: str) -> None:
        """A string: its bytes and a closing 0, after their number."""
        content = value.encode("utf-8") + b"\0"
        self.number("I", len(content))
        self._content += content

    def array(self, values: np.ndarray) -> None:
        """A sequence of numbers: all values in their order, after their number."""
        self.number("I", values.size)
        if values.size:  # Where no value follows, nothing is aligned.
            self._align(values.dtype.itemsize)
        little = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
        self._content += little.reshape(-1).view(np.uint8).data

    def message(self) -> bytes:
        """What was encoded, after its header."""
        return LITTLE_ENDIAN + bytes(self._content)

    def _align(self, size: int) -> None:
        # From the first byte after the header.
        self._content += bytes(-len(self._content) % size)
