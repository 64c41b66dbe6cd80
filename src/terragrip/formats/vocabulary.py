"""What the words in a column's name mean: the general words of the trade, their abbreviations, and the units behind them.

Not a list of loggers: a word stands here for what it means everywhere. `Vocabulary.without` takes words away, by which
``benchmarks/bench_inspect.py`` judges each logger without the words that it alone has shown.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

from terragrip.formats.words import CHINESE, CORNERS, FRENCH, FRENCH_CORNERS, MEANINGS, UNIT_WORDS
from terragrip.units import is_common

_ALWAYS = ("rpm", "rps", "kmh", "kph", "kmph", "mph", "mps")  # mean a unit wherever they stand
_MOMENTS = {"n m": "N m", "kn m": "kN m"} | {
    text: f"{force} {lever}"
    for force in ("lb", "lbs", "lbf")
    for lever in ("ft", "in")
    for text in (f"{force} {lever}", f"{lever} {force}")
}
_HOURS = {"hour": "h", "hr": "h", "h": "h"}
_PER = re.compile(r"(?!mph)(km|m|mm|cm|mi|rad|deg|rev|ft)p(s|h|hr|min)(2?)$")  # mph are miles
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")
_SYMBOL_OF_AXIS = re.compile(r"(acc|accel|accl|gyro|gyr|vel|omega|a|g|w|v|f)([xyz])$")
_SYMBOLS = {
    "t": "torque",
    "m": "torque",
    "v": "speed",
    "w": "rotation",
    "n": "rotation",
    "i": "current",
    "a": "acceleration",
}
_AXIS_SYMBOLS = {"a": "acceleration", "g": "gyro", "w": "gyro", "v": "speed", "f": "force"}
_COMPASS = {"n": "north", "e": "east", "d": "vertical", "u": "vertical"}
_ELISION = re.compile(r"\b[dl]['\u2019](?=\w)", re.IGNORECASE)
"""vitesse d'avancement"""
_PLURAL = re.compile(r"(\w{4,}?)(?:s|en?|n)")
"""Groups of columns: torques, roues, Drehmomente, Raddrehzahlen."""
_ORDINAL = re.compile(r"(\d)(st|nd|rd|th)$", re.IGNORECASE)
_VOWELS = re.compile(r"(?<!^)[aeiou]")
_CHINESE = re.compile("|".join(sorted(CHINESE, key=len, reverse=True)))
_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue", "ß": "ss"})
_OF_MESSAGES = frozenset({"fix", "status", "state", "raw", "exp"})
"""Words that name messages, topics and experiments too, and then say nothing of each field in them."""
_PREFIX = "(?:da|[GMkhdcmµμun])"
_BEHIND = (
    re.compile(
        r"(?<=\w)(?:[\s_|{<,:]+|\s+[-/]\s*)(?:in\s+)?(?P<unit>[^\s_|{<>},:]*(?:[/°²·^]|\w-[12])[^\s_|{<>},:]*)[>}]?$"
    ),
    re.compile(
        rf"(?<=\w)[\s_|{{<,:./-]+(?:in\s+)?(?P<unit>{_PREFIX}(?:[ANVW]|Pa|rad|deg)"
        rf"|(?:{_PREFIX}N|kgf?|kp|ozf?|lbf)[ .*·-]?(?:mm?|cm|ft|in))[>}}]?$"
    ),
)
"""A unit without brackets that is no word: n in 1/min, yaw rate <°/s>; or that comes apart as words do: force_daN, M_rl/cNm."""
_GLUED = re.compile(r"(?<=[a-z])(?P<unit>(?:k|da)Nm?)$")
_SOURCE = re.compile(r"(\([^()]*\)|\[[^\[\]]*\])\s*\*(\w+)$")
"""Vehicle Speed (km/h) *OBD: the source behind the unit."""
_BRACKET = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]?\s*$")


@dataclass(frozen=True)
class Name:
    """What a column's name says: concepts of `MEANINGS`, the wheel ("" if none), the axis, and the unit at its end.

    ``strange`` are words that mean nothing here, and so may mean anything.
    """

    concepts: frozenset[str]
    wheel: str = ""
    axis: str = ""
    unit: str | None = None
    words: tuple[str, ...] = ()
    strange: tuple[str, ...] = ()

    def has(self, *concepts: str) -> bool:
        """Whether one of the concepts is in the name."""
        return bool(self.concepts.intersection(concepts))


@dataclass(frozen=True)
class Vocabulary:
    """Words and what they mean; ``left_out`` are not known."""

    left_out: frozenset[str] = field(default_factory=frozenset)

    def without(self, words: Iterable[str]) -> Vocabulary:
        """The same vocabulary that does not know ``words``."""
        return Vocabulary(self.left_out | frozenset(words))

    @cached_property
    def _known(self) -> dict[str, str]:
        return {
            word: concept
            for concept, words in MEANINGS.items()
            for word in words.split()
            if word not in self.left_out
        }

    def concepts_of(self, word: str) -> frozenset[str]:
        """What a lower-case word means: as it stands, put together of two words, or cut short."""
        added = {"rate"} if self._is_derivative(word) else set()
        symbol = {_SYMBOLS[word[0]]} if self._has_symbol(word) else set()
        return frozenset({self._known[known] for known in self.known_in(word)} | added | symbol)

    def known_in(self, word: str) -> frozenset[str]:
        """The vocabulary's words that a lower-case word is read by."""
        known = self._known
        if word in known:
            return frozenset([word])
        if len(word) < 3 or not word.isalpha():
            return frozenset()
        plural = None if word in UNIT_WORDS else _PLURAL.fullmatch(word)
        for one in (word, plural[1]) if plural else (word,):
            parts = {one} if one in known else self._two_in(one)
            if parts and (one == word or "statistic" not in map(known.get, parts)):  # joint_states: a message
                return frozenset(parts)
        if self._has_symbol(word) or self._is_derivative(word):
            return frozenset([word[1:]])
        tail = next((w for w in known if len(w) >= 5 and word.endswith(w)), None)
        if tail is not None:  # of a word that is not known and one that is
            return frozenset([tail])
        # Cut short: its first letters (veloc), or its consonants (whl, lngtd); of two meanings the name's other words tell.
        if word in UNIT_WORDS:
            return frozenset()
        bare = word == _VOWELS.sub("", word)
        return frozenset(full for full, concept in known.items() if _is_cut(word, bare, full, concept))

    def _two_in(self, word: str) -> set[str]:
        """The two known words that a word is put together of, if any."""
        cuts = range(3, len(word) - 2)
        parts = ({word[:cut], word[cut:]} for cut in cuts)
        return next((two for two in parts if two <= self._known.keys()), set())

    def _has_symbol(self, word: str) -> bool:
        """vWheel, TMotor: a physicist's letter before what it is of."""
        return (
            word not in self._known
            and word[:1] in _SYMBOLS
            and self._known.get(word[1:]) in ("wheel", "motor")
        )

    def _is_derivative(self, word: str) -> bool:
        """dpsi: the time derivative of an angle."""
        return (
            word not in self._known
            and word[:1] == "d"
            and self._known.get(word[1:]) in ("yaw", "pitch", "roll")
        )

    def unit_word(self, word: str) -> str | None:
        """The unit that a word at a name's end stands for (``kmh``, ``mps2``, ``radps``), None if it is none."""
        if (match := _PER.match(word)) is not None:
            time = {"hr": "h"}.get(match[2], match[2])
            return f"{match[1]}/{time}" + ("^2" if match[3] else "")
        return None if word in self.left_out else UNIT_WORDS.get(word)

    def read(self, name: str) -> Name:
        """Read a column's name."""
        body, stated = self._parted(name)
        words = words_of(body)
        unit, used = self._unit_at_end(words)
        unit = unit or stated or next((u for w in words if w in _ALWAYS and (u := self.unit_word(w))), None)
        last = words_of(re.split(r"[./]|::", body)[-1])  # of a struct's field, less the structs it is in
        text = words[: len(words) - used] or words
        text = [word for word in text if word not in _OF_MESSAGES or word in last]
        text, concepts = _symbol_at_end(text) if len(last) - used == 2 else (text, set())
        axis, meant = self._meant(text)
        concepts |= meant
        if "sp" in text and meant & {"speed", "rotation", "torque", "pull"}:
            concepts.add("command")  # rpm_sp: a set-point; in WheelSpFL it is the speed
        if text == ["t"]:
            concepts.add("time")
        if len(words) > 1 and unit in ("rpm", "rev/s"):
            concepts.add("rotation")
        if text and text[0] in _SYMBOLS and concepts & {"wheel", "motor"}:
            concepts.add(_SYMBOLS[text[0]])  # nRadVL
        if "speed" in concepts and words and words[-1] in _COMPASS:
            concepts.add(_COMPASS[words[-1]])  # VelN, vel_d
            unit = None if unit == "N" else unit
        if "speed" in concepts and unit == "kN":
            unit = "kn"  # speed_kn: knots, no force
        strange = tuple(w for w in text if not self.concepts_of(w) and w.isalpha() and w not in "xyz")
        if "speed" in concepts and "time" not in concepts and unit == "ms" and text[-1] not in strange:
            unit = "m/s"  # v_gps_ms: no milliseconds, which speed_age_ms is in
        return Name(_settled(concepts), _wheel_of(words, last, concepts), axis, unit, tuple(words), strange)

    def _meant(self, text: list[str]) -> tuple[str, set[str]]:
        """The axis that a name's words state, and what the others mean."""
        axis, concepts = "", set()
        for word in text:
            short = None if word in self._known else _SYMBOL_OF_AXIS.match(word)
            if short is not None:
                concepts.add(_AXIS_SYMBOLS[short[1][0]])
                axis = short[2]
            elif word in ("x", "y", "z"):
                axis = word
            else:
                concepts |= self.concepts_of(word)
        return axis, concepts

    def _parted(self, name: str) -> tuple[str, str | None]:
        """A name without the unit or remark at its end, and that unit; a word in brackets is the name's (``Speed (GPS)``)."""
        name = _SOURCE.sub(r"\2 \1", name)
        if behind := self._unit_behind(name):
            name = f"{name[: behind.start()]} [{behind['unit']}]"
        bracket = _BRACKET.search(name)
        if bracket is None or not name[: bracket.start()].strip():
            return name, None
        text, plain = bracket[1], bracket[1].lower()
        unit = text if is_common(text) or text == "G" else self.unit_word(plain)
        unit = None if text.isdigit() else unit  # speed[1]
        is_word = unit is None and len(plain) > 2 and plain in self._known
        if is_word or not 0 < len(text) <= 10 or re.search(r"\s\w{3,}", text):
            return name, None
        return name[: bracket.start()], None if plain == "ms^2" else unit  # m/s^2 misspelt, or not

    def _unit_behind(self, name: str) -> re.Match[str] | None:
        """A name's end that is written as a unit, in capitals no mega (DRAFT_MN, CURRENT_MA)."""
        glued = _GLUED.search(name)
        if glued is not None and self.concepts_of(words_of(name[: glued.start()])[-1]):  # no hookN, PeakN
            return glued
        ends = (pattern.search(name) for pattern in _BEHIND)
        return next(
            (m for m in ends if m and is_common(m["unit"]) and not (name.isupper() and m["unit"][0] == "M")),
            None,
        )

    def _unit_at_end(self, words: list[str]) -> tuple[str | None, int]:
        """The unit that a name ends in, and how many of its words say so; a name is not all unit."""
        for count in (3, 2):
            tail = words[-count:]
            if len(words) > count and tail[-1] in ("s", "h", "s2", "min", "2"):
                top, bottom = tail[0], "".join(tail[1:])
                if top in ("m", "km", "mm", "cm", "mi", "ft", "rad", "deg", "rev") and bottom in (
                    "s",
                    "h",
                    "s2",
                    "min",
                ):
                    return f"{top}/{bottom.replace('s2', 's^2')}", count
        if len(words) > 3 and words[-2] == "per":  # RadPerSec
            parts = self.unit_word(words[-3]), _HOURS.get(words[-1]) or self.unit_word(words[-1])
            if None not in parts:
                return f"{parts[0]}/{parts[1]}", 3
        lever = _MOMENTS.get(" ".join(words[-2:]))
        if lever is not None and any("torque" in self.concepts_of(word) for word in words[:-2]):
            return lever, 2
        if (
            words
            and (unit := self.unit_word(words[-1])) is not None
            and (len(words) > 1 or len(words[-1]) > 2)
        ):
            return unit, 1 if len(words) > 1 else 0
        return None, 0


def _is_cut(word: str, bare: bool, full: str, concept: str) -> bool:
    """Whether ``word`` is ``full`` cut short; sides only by all their consonants (lft), for their first letters mean much else."""
    if len(full) <= len(word) or len(full) < 4:
        return False
    skeleton = _VOWELS.sub("", full)
    if bare and skeleton == word:
        return True
    if len(full) < 5 or concept in ("left", "right", "front", "rear", "middle"):
        return False
    return full.startswith(word) or (bare and skeleton.startswith(word))


GENERAL = Vocabulary()


def _symbol_at_end(text: list[str]) -> tuple[list[str], set[str]]:
    """A name that ends in a letter and its index: one word with its axis (a_z), else without the letter; and what that means."""
    letter, index = text[-2:]
    if letter in _AXIS_SYMBOLS and index in ("x", "y", "z"):
        return [*text[:-2], letter + index], set()
    if letter in _SYMBOLS and (index in CORNERS or index in "lr12345678"):
        return [*text[:-2], index], {_SYMBOLS[letter]}  # M1, w_rl, log.n_fl
    return text, set()


def words_of(name: str) -> list[str]:
    """The words of a name in their order, in lower case: parts of camel case and between other characters, numbers apart."""
    result: list[str] = []
    plain = _ELISION.sub("", _without_accents(name))
    for part in re.split(r"[^A-Za-z0-9]+", _ordinals(plain)):
        if part.lower() in (*_ALWAYS, "nm", "kn", "knm", "knots", "ms2", "mps2"):
            result.append(part.lower())
            continue
        # A plural abbreviation in capitals beside a word (WheelSpFL) comes apart by case alone.
        result += [word.lower() for word in _WORD.findall(part)]
    return _rejoined(result)


def _rejoined(words: list[str]) -> list[str]:
    """Words with a power put back behind its unit (``mps``, ``2``)."""
    joined: list[str] = []
    for word in words:
        if joined and word == "2" and re.fullmatch(r"(m|rad|deg)ps|ms|s", joined[-1]):
            joined[-1] += word
        else:
            joined.append(word)
    return joined


def _without_accents(name: str) -> str:
    if name.isascii():
        return name
    name = _CHINESE.sub(lambda word: f" {CHINESE[word[0]]} ", name)
    parted = unicodedata.normalize("NFKD", unicodedata.normalize("NFC", name).translate(_UMLAUTS))
    return "".join(c for c in parted if not unicodedata.combining(c))


def _ordinals(name: str) -> str:
    return " ".join(_ORDINAL.sub(r"\1", word) for word in name.split(" "))


def _settled(concepts: set[str]) -> frozenset[str]:
    """Of two meanings of one abbreviation the one that the name's other words ask for."""
    along = {"acceleration", "force", "speed"} & concepts
    if {"latitude", "lateral"} <= concepts:
        concepts = concepts - ({"latitude"} if along else {"lateral"})
    if {"longitude", "longitudinal"} <= concepts:
        concepts = concepts - ({"longitude"} if along else {"longitudinal"})
    return frozenset(concepts)


def _wheel_of(words: list[str], last: list[str], concepts: set[str]) -> str:
    """The wheel that a name speaks of: a corner, a side with its end or its axle's number or neither, or a number; empty if none."""
    corners = CORNERS | FRENCH_CORNERS if not set(FRENCH).isdisjoint(words) else CORNERS
    for word in words:
        if word in corners:
            return corners[word]
    side = "l" if "left" in concepts else "r" if "right" in concepts else ""
    end = next((end[0] for end in ("front", "rear", "middle") if end in concepts), "")
    number = next((word for word in last if word.isdigit() and 1 <= int(word) <= 8), "")
    return (end or number) + side if side else number
