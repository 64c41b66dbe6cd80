"""What a message of a live source holds, where it is not JSON: numbers packed in a row."""

from __future__ import annotations

import struct
from typing import Literal, Self

from pydantic import Field, model_validator

from terragrip.document import Fault, Part

_LONGEST = 1 << 16  # bytes, of a datagram
_ORDER = {"little": "<", "big": ">"}


class Payload(Part):
    """``payload: {format: doubles, fields: [time, fl, fr], byte_order: little}``, or ``format: struct`` with a ``layout``
    as Python's ``struct`` writes it (``d4f``: a double, four floats). ``json`` needs no fields: an object names its own.
    """

    format: Literal["json", "doubles", "struct"] = "json"
    fields: tuple[str, ...] = ()
    layout: str = Field("", pattern=r"^[0-9xcbBhHiIlLqQfd?]*$")
    byte_order: Literal["little", "big"] = "little"

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.format == "json":
            if self.fields or self.layout:
                raise Fault("a JSON object names its own fields", "leave out fields and layout")
            return self
        if not self.fields:
            raise Fault(
                "packed numbers need names", "write 'fields: [time, ...]' in their order", ("fields",)
            )
        if (self.format == "struct") != bool(self.layout):
            raise Fault("layout needs format struct", "write e.g. 'layout: d4f'", ("layout",))
        packer = self.packer
        if packer.size > _LONGEST:
            raise Fault(
                f"the layout takes {packer.size} bytes", f"a message has at most {_LONGEST}", ("layout",)
            )
        count = len(packer.unpack(bytes(packer.size)))
        if count != len(self.fields):
            raise Fault(f"the layout has {count} numbers, not {len(self.fields)}", "correct one", ("layout",))
        return self

    @property
    def packer(self) -> struct.Struct:
        """Packs and unpacks one message's numbers, in the order of ``fields``."""
        layout = self.layout if self.format == "struct" else f"{len(self.fields)}d"
        try:
            return struct.Struct(_ORDER[self.byte_order] + layout)
        except struct.error as error:
            raise Fault(f"is not a layout ({error})", "write e.g. 'd4f'", ("layout",)) from error
