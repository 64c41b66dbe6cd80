"""A sentence on channels whose sign is the opposite of what it should be, which also holds them apart from its words."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Self


class WrongSign(str):
    """The sentence, the ``channels`` that need ``sign: -1``, in few words what shows it (``shown``), and whether it decides (``sure``)."""

    __slots__ = ("channels", "shown", "sure")
    channels: tuple[str, ...]
    shown: str
    sure: bool

    def __new__(cls, sentence: str, channels: Iterable[str], shown: str, *, sure: bool = True) -> Self:
        """Not ``sure``: another channel's sign, its unit or another motion would explain it as well."""
        result = super().__new__(cls, sentence)
        result.channels, result.shown, result.sure = tuple(channels), shown, sure
        return result

    @classmethod
    def of(cls, channels: Iterable[str], shown: str, positive: str, *, who: str | None = None) -> Self:
        """That ``channels`` are of the opposite sign, as what is ``positive`` shows; ``who``: what the sentence calls them."""
        names = list(channels)
        each = "it" if len(names) == 1 else "each"
        return cls(
            f"{who or ', '.join(names)} {shown}: {positive} positive; write 'sign: -1' for {each} in the profile.",
            names,
            shown,
        )
