"""Handles of a curve: what is dragged arrives, what is held stays, and the way back is the same curve."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.soil.handles import Handle, handles, moved


def start(name: str) -> dict[str, float]:
    return {p.name: p.start for p in CURVES[name].parameters}


@pytest.mark.parametrize("name", [name for name in CURVES if name != "brixius"])
def test_a_dragged_handle_arrives_where_it_was_dragged(name: str) -> None:
    model, before = CURVES[name], start(name)
    for one in handles(model, before, ()):
        goal = Handle(one.name, one.slip * 1.3, one.value * (1.0 if one.name == "rise" else 0.9))
        if one.name in ("zero", "level"):
            goal = Handle(one.name, one.slip, goal.value)
        found = {h.name: h for h in handles(model, moved(model, before, goal), ())}[one.name]
        assert found.slip == pytest.approx(goal.slip, abs=0.005)
        if one.name != "rise":  # that one moves along the slip
            assert found.value == pytest.approx(goal.value, abs=0.005)


def test_what_is_held_and_what_is_bounded_stays() -> None:
    model, before = CURVES["burckhardt"], start("burckhardt")
    after = moved(model, before, Handle("level", 0.6, 0.5), ["c2"], {"c1": (0.7, 0.9)})
    assert after["c2"] == before["c2"]
    assert 0.7 <= after["c1"] <= 0.9
    assert float(model.value(0.6, after)) == pytest.approx(0.5, abs=0.005)
    with pytest.raises(InputError, match="held"):
        moved(model, before, Handle("level", 0.6, 0.5), list(before))
    assert handles(model, before, list(before)) == ()


def test_only_what_a_free_parameter_can_move_has_a_handle() -> None:
    """The paper's fit scales its curve: no handle says that its steepness could be dragged."""
    paper, numeric = CURVES["exponential"], CURVES["wismer_luth"]
    assert [one.name for one in handles(paper, start("exponential"), paper.fixed)] == ["level"]
    assert [one.name for one in handles(numeric, start("wismer_luth"))] == ["rise"]
    net = {**start("exponential"), "intercept": -0.05}
    assert [one.name for one in handles(paper, net, paper.fixed)] == ["zero", "level"]
    lower = moved(paper, net, Handle("zero", 0.0, -0.1), paper.fixed)
    assert lower["intercept"] == pytest.approx(-0.1, abs=0.002)


def test_a_curve_that_cannot_follow_is_the_nearest() -> None:
    model = CURVES["brixius"]
    after = moved(model, start("brixius"), Handle("level", 0.6, 2.0))
    assert float(model.value(0.6, after)) == pytest.approx(0.88 * (1 - np.exp(-4.5)), abs=0.005)


@pytest.mark.parametrize("name", [name for name in CURVES if name != "brixius"])
def test_a_rise_that_is_dragged_past_an_axis_or_the_peak_keeps_its_way_and_the_curves_height(
    name: str,
) -> None:
    model, before = CURVES[name], start(name)
    rise = next(one for one in handles(model, before) if one.name == "rise")
    height = np.max(model.value(np.linspace(0, 0.6, 301), before))
    for slip in (-0.3, 0.0, 0.4, 0.5, 1.0):
        after = moved(model, before, Handle("rise", slip, rise.value))
        found = next(one for one in handles(model, after) if one.name == "rise")
        assert (found.slip - rise.slip) * (slip - rise.slip) > 0, slip
        if name != "wismer_luth" or slip < rise.slip:  # its one parameter flattens the whole curve
            assert np.max(model.value(np.linspace(0, 0.6, 301), after)) > 0.8 * height, slip
