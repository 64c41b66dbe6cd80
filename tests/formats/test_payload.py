"""Packed messages: what a profile may say of them."""

from __future__ import annotations

import struct

import pytest

from terragrip.errors import InputError
from terragrip.formats import Profile


def payload(**entries):
    return Profile.from_dict({"payload": entries, "channels": {"ground_speed": "v"}}).payload


def test_numbers_in_their_order():
    packed = payload(format="struct", layout="dxxf2h", fields=["t", "v", "a", "b"], byte_order="big")
    assert packed.packer.unpack(struct.pack(">dxxf2h", 1.5, 2.5, 3, -4)) == (1.5, 2.5, 3, -4)
    assert payload(format="doubles", fields=["t", "v"]).packer.size == 16


@pytest.mark.parametrize(
    ("entries", "expected"),
    [
        ({"format": "struct", "layout": "d5f", "fields": ["a"]}, "has 6 numbers, not 1"),
        ({"format": "doubles"}, "packed numbers need names"),
        ({"format": "doubles", "layout": "d", "fields": ["a"]}, "layout needs format struct"),
        ({"fields": ["a"]}, "names its own fields"),
        ({"format": "struct", "layout": "9999999999d", "fields": ["a"]}, "bytes; a message has at most"),
        ({"format": "struct", "layout": "5", "fields": ["a"]}, "is not a layout"),
        ({"format": "struct", "layout": "@P", "fields": ["a"]}, "layout"),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(entries, expected):
    with pytest.raises(InputError, match="payload") as refused:
        payload(**entries)
    assert expected in str(refused.value)
