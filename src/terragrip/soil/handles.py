"""Points by which a curve is dragged: where they lie, and the parameters of the curve that follows one of them.

The page that drags knows no model. Whatever the model's parameters mean, a curve has a value at zero slip, a rise, a peak or none, and a
level at high slip. A moved handle states one of these; least squares find the free parameters that meet it and leave the other handles
where they were, as far as the model allows.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.physics.adhesion import CurveModel
from terragrip.soil.least_squares import INTERCEPT

FAR = 0.60
"""Slip of the handle "level", where the bins of a fit end."""
_GRID = np.linspace(0.0, FAR, 301)
_INSIDE = (0.02, 0.95)
"""Slips between which a largest value is a peak, and may be dragged."""
_RISES = (0.01, 0.45 * FAR)
"""Slips that a rise may be dragged to; at half of the level's even a straight line has risen by half."""
_FALL = 0.02
"""Share of its height that a curve falls by after its peak; one that falls less is level."""
_OTHERS, _SAME = 1e-2, 1e-3
"""Weights of the other handles' places and of unchanged parameters, beside 1 for the handle that is dragged."""
_NEAR = 0.005
"""A curve that passes a handle at most so far [-] follows it."""


@dataclass(frozen=True)
class Handle:
    """`name` ("zero", "rise", "peak", "level"), and where it lies on the curve: slip and value [-]."""

    name: str
    slip: float
    value: float


def _free(
    model: CurveModel, parameters: Mapping[str, float], held: Collection[str]
) -> dict[str, tuple[float, float]]:
    """What a drag may change, with its ends: the model's parameters that are not held, and the intercept where the curve has one."""
    free = {p.name: (p.lower, p.upper) for p in model.parameters if p.name not in held}
    return free | ({INTERCEPT: (-1.0, 1.0)} if INTERCEPT in parameters else {})


def handles(
    model: CurveModel, parameters: Mapping[str, float], held: Collection[str] = ()
) -> tuple[Handle, ...]:
    """The handles of a curve by which its free parameters can be dragged; none where all are held.

    "zero" only where the value there is free; "rise", at half the height, where a free parameter moves it along the slip; "peak" where a
    maximum lies inside and two parameters are free; "level" where "rise" is not all, and no peak lies beside it.
    `parameters` names all of the model's. Raises ValueError on one that the model does not have.
    """
    free = _free(model, parameters, held)
    if not free:
        return ()
    own = [name for name in free if name != INTERCEPT]
    zero, level = _values(model, parameters, np.array([0.0, FAR]))
    half = _half(model, parameters)
    found = [Handle("zero", 0.0, float(zero))] if INTERCEPT in free or model.native_intercept else []
    steep = any(
        abs(_half(model, {**parameters, name: 1.1 * parameters[name] + 0.01}) - half) > 1e-4 for name in own
    )
    if steep:
        found.append(Handle("rise", half, float(_values(model, parameters, np.array([half]))[0])))
    peak = _peak(model, parameters) if len(own) > 1 else None
    if peak:
        found.append(peak)
    if own and not (steep and len(own) == 1) and not (peak and abs(peak.slip - FAR) < 0.1):
        found.append(Handle("level", FAR, float(level)))
    return tuple(found)


def moved(
    model: CurveModel,
    parameters: Mapping[str, float],
    handle: Handle,
    held: Collection[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> dict[str, float]:
    """All parameters of the curve whose handle was moved to `handle`, from those before it moved; held ones stay, the others keep `bounds`.

    "zero" and "level" move in value alone, "rise" in slip alone. Where the model cannot follow, it is the nearest curve.
    Raises InputError where no parameter is free, or bounds leave no room.
    """
    free = _free(model, parameters, held)
    if not free:
        raise InputError("every parameter is held", hint="untick one to drag the curve")
    free |= {name: ends for name, ends in (bounds or {}).items() if name in free}
    if not all(lower < upper for lower, upper in free.values()):
        raise InputError("a parameter's bounds leave no room", hint="give a lower and a larger upper one")
    goal, now = _goal(handle), dict(parameters)
    here = next((one for one in handles(model, parameters, held) if one.name == handle.name), goal)
    steps = max(int(np.ceil(abs(goal.slip - here.slip) / 0.05)), 1)
    for share in np.arange(1, steps + 1) / steps:  # a long way at once can end on a curve of another kind
        slip, value = (
            here.slip + share * (goal.slip - here.slip),
            here.value + share * (goal.value - here.value),
        )
        now |= _led(model, parameters, now, Handle(goal.name, slip, value), free, held)
    return now


def _led(
    model: CurveModel,
    parameters: Mapping[str, float],
    now: Mapping[str, float],
    goal: Handle,
    free: Mapping[str, tuple[float, float]],
    held: Collection[str],
) -> dict[str, float]:
    """The free parameters that lead a handle to its goal, from those `now`; what else there is stays as `parameters` have it."""
    lower, upper = np.array(list(free.values())).T
    before, begin = (np.clip([q[name] for name in free], lower, upper) for q in (parameters, now))
    scale = np.maximum(np.abs(before), 0.1)
    others = _others(model, parameters, goal, held)

    def misses(x: Floats) -> Floats:
        trial = dict(parameters) | dict(zip(free, x.tolist(), strict=True))
        stay = [_OTHERS * _miss(model, trial, one) for one in others]
        return np.concatenate([_miss(model, trial, goal), *stay, _SAME * (x - before) / scale])

    from scipy.optimize import least_squares  # a third of a second to import: only where a curve is dragged

    # The model's own start is the second: a very high rate is not felt by the curve.
    own = {p.name: p.start for p in model.parameters} | {INTERCEPT: 0.0}
    best, cost = begin, np.inf
    for start in (begin, np.clip([own[name] for name in free], lower, upper)):
        found = least_squares(misses, start, bounds=(lower, upper), x_scale=scale, max_nfev=100)
        if found.cost < cost:
            best, cost = found.x, found.cost
        if abs(misses(best)[0]) < _NEAR:
            break
    return dict(zip(free, best.tolist(), strict=True))


def _others(
    model: CurveModel, parameters: Mapping[str, float], goal: Handle, held: Collection[str]
) -> list[Handle]:
    """What is to stay while a handle is led to its goal."""
    known = handles(model, parameters, held)
    zero, level = (float(v) for v in _values(model, parameters, np.array([0.0, FAR])))
    if goal.name == "rise":  # a peak goes where the steepness takes it
        top = Handle("height", 0.0, _height(model, parameters))
        return [Handle("zero", 0.0, zero), Handle("level", FAR, level), top]
    peak = next((one for one in known if one.name == "peak"), None)
    if goal.name == "peak" and peak:  # the curve keeps its shape: what is beyond goes with the peak
        risen = zero + (level - zero) * (goal.value - zero) / (peak.value - zero)
        return [Handle("zero", 0.0, zero), Handle("level", FAR, risen)]
    return [one for one in known if one.name != goal.name]


def _goal(handle: Handle) -> Handle:
    """Where a handle is to go, of where it was dragged."""
    if handle.name == "zero":
        return replace(handle, slip=0.0)
    if handle.name == "level":
        return replace(handle, slip=FAR)
    if handle.name == "rise":
        return replace(handle, slip=float(np.clip(handle.slip, *_RISES)))
    return replace(handle, slip=float(np.clip(handle.slip, *_INSIDE)))


def _peak(model: CurveModel, parameters: Mapping[str, float]) -> Handle | None:
    """The largest value, where it lies inside and the curve falls after it."""
    slip, value = model.peak(_own(parameters))
    value += parameters.get(INTERCEPT, 0.0)
    zero, end = _values(model, parameters, np.array([0.0, 1.0]))
    falls = _INSIDE[0] < slip < _INSIDE[1] and value - end > _FALL * (value - zero)
    return Handle("peak", slip, value) if falls else None


def _height(model: CurveModel, parameters: Mapping[str, float]) -> float:
    """The largest value up to the slip of the level."""
    return float(_values(model, parameters, _GRID).max())


def _half(model: CurveModel, parameters: Mapping[str, float]) -> float:
    """Slip at which the curve has risen by half of its height."""
    values = _values(model, parameters, _GRID)
    middle = 0.5 * (values[0] + values.max())
    after = max(int(np.argmax(values >= middle)), 1)
    share = (middle - values[after - 1]) / max(values[after] - values[after - 1], 1e-12)
    return float(_GRID[after - 1] + min(share, 1.0) * _GRID[1])


def _miss(model: CurveModel, parameters: Mapping[str, float], handle: Handle) -> Floats:
    """How far a curve passes by a handle [-], "rise" by the ratio of slips, the others in value; a peak's slope too, over the way to it."""
    if handle.name == "height":
        return np.array([_height(model, parameters) - handle.value])
    # A rise by its slip: by its value, a flat curve and one that falls through half of its height would pass too.
    if handle.name == "rise":
        return np.log([max(_half(model, parameters), 1e-4) / handle.slip])
    slip = np.array([handle.slip])
    at = _values(model, parameters, slip)
    if handle.name == "peak":
        return np.concatenate([at - handle.value, slip * model.slope(slip, _own(parameters))])
    return at - handle.value


def _own(parameters: Mapping[str, float]) -> dict[str, float]:
    return {name: value for name, value in parameters.items() if name != INTERCEPT}


def _values(model: CurveModel, parameters: Mapping[str, float], slip: Floats) -> Floats:
    return model.value(slip, _own(parameters), parameters.get(INTERCEPT, 0.0))
