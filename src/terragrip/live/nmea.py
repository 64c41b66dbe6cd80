"""Sentences of NMEA 0183 as fields with the recording's names: RMC and VTG give the speed, RMC and GGA the position."""

from __future__ import annotations

from typing import Any

from terragrip.live.payload import Fields, Unreadable
from terragrip.units import factor_to

_KNOT = factor_to("kn", "m/s")
_KMH = factor_to("km/h", "m/s")


def fields_of(sentence: bytes) -> Fields:
    """The fields of one line; empty where it holds none of ours or says that it has no fix. Raises Unreadable."""
    import pynmea2

    line = sentence.strip()
    if not line:
        return {}
    try:
        found = pynmea2.parse(line.decode("ascii"), check=True)
    except pynmea2.SentenceTypeError:
        return {}
    except (pynmea2.ParseError, ValueError, UnicodeDecodeError) as error:
        raise Unreadable(f"no NMEA sentence ({type(error).__name__}): {line[:30]!r}") from error
    try:
        return _FIELDS.get(found.sentence_type, _nothing)(found)
    except (ValueError, TypeError, AttributeError) as error:
        raise Unreadable(f"an NMEA sentence with a field that is no number: {line[:30]!r}") from error


def _rmc(sentence: Any) -> Fields:
    if sentence.status != "A":
        return {}
    fields: Fields = {"latitude": sentence.latitude, "longitude": sentence.longitude}
    if sentence.spd_over_grnd is not None:
        fields["ground_speed"] = float(sentence.spd_over_grnd) * _KNOT
    return fields


def _vtg(sentence: Any) -> Fields:
    if getattr(sentence, "faa_mode", None) == "N":
        return {}
    if sentence.spd_over_grnd_kmph is not None:
        return {"ground_speed": float(sentence.spd_over_grnd_kmph) * _KMH}
    if sentence.spd_over_grnd_kts is not None:
        return {"ground_speed": float(sentence.spd_over_grnd_kts) * _KNOT}
    return {}


def _gga(sentence: Any) -> Fields:
    if not sentence.gps_qual:
        return {}
    fields: Fields = {"latitude": sentence.latitude, "longitude": sentence.longitude}
    if sentence.altitude is not None:
        fields["altitude"] = float(sentence.altitude)
    return fields


def _nothing(sentence: Any) -> Fields:
    return {}


_FIELDS = {"RMC": _rmc, "VTG": _vtg, "GGA": _gga}
