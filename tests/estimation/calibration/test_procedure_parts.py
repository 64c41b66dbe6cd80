"""What a calibration keeps, leaves unknown and hands back."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from terragrip.estimation.calibration import procedure, radii
from terragrip.estimation.calibration.gains import RelativeGains
from terragrip.estimation.calibration.plausible import gains_by_axle, plausible, turned_unseen
from terragrip.estimation.calibration.result import Calibration, Evidence, Quantity, Unknown
from terragrip.estimation.calibration.speeds import _scaled
from terragrip.estimation.zero_slip import Zero
from terragrip.physics.loads import GRAVITY
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle
from window_table import stating

WHEELS = ("fl", "fr", "rl", "rr")


def quantity(key: str, value: float, std: float, wheel: str | None = None, **more: Any) -> Quantity:
    return Quantity(key, value, std, "1", (Evidence("log", 0.0, 10.0, 5),), "so", wheel=wheel, **more)


def test_quantities_that_the_file_knows_better_are_left_out(vehicle: Vehicle) -> None:
    for key, stated, std, kept in (
        ("drive_torque_gain", 0.02, 0.0399, True),  # of a value of 2: relative
        ("drive_torque_gain", 0.02, 0.0401, False),
        ("drive_torque_gain", None, 0.199, True),  # where nothing is stated: a tenth
        ("drive_torque_gain", None, 0.201, False),
        ("wheel_radius", None, 0.0399, True),  # and a fiftieth
        ("wheel_radius", None, 0.0401, False),
        ("drive_torque_offset", 0.3, 0.29, True),
        ("drive_torque_offset", 0.3, 0.31, False),
        ("drive_torque_offset", None, 9.0, True),
        ("pitch_offset", None, 9.0, True),
    ):
        unknown: list[Unknown] = []
        machine = stating(vehicle) if stated is None else stating(vehicle, **{key: stated})
        two = [quantity(key, 2.0, 0.001, "fl"), quantity(key, 2.0, std, "fr")]
        assert procedure._useful(two, machine, unknown) == (two if kept else [])
        assert len(unknown) == (not kept)
    relative = procedure._useful(
        [quantity("wheel_radius", 2.0, 0.05)], stating(vehicle, wheel_radius=0.01), unknown
    )
    assert relative == []
    assert unknown[-1].why == "determined only to 2.5 %, but the vehicle file states 1 %: record more"
    procedure._useful([quantity("drive_torque_gain", 1.0, 1.12)], stating(vehicle), unknown)
    assert unknown[-1].why.startswith("determined only to 110 %, ")  # not 1.1e+02
    procedure._useful([quantity("drawbar_offset", 2.0, 0.05)], stating(vehicle, drawbar_offset=0.01), unknown)
    assert "determined only to 0.05 1, but the vehicle file states 0.01 1" in unknown[-1].why


def test_what_is_left_unknown_of_each_constant(vehicle: Vehicle) -> None:
    found = [
        quantity("drive_torque_offset", 0.0, 0.03, "fl"), quantity("drive_torque_offset", 0.0, 0.04, "fr"),
        quantity("wheel_radius", 0.5, 0.01), quantity("wheel_radius", 0.25, 0.01), quantity("acceleration_bias_x", 0.0, 0.7),
    ]  # fmt: skip
    left = procedure._left(found, stating(vehicle, drive_torque_gain=0.02))
    assert left == {
        "drive_torque_offset": pytest.approx(np.sqrt((0.03**2 + 0.04**2) / 2)),
        "acceleration_bias": pytest.approx(0.7),
        "wheel_radius": pytest.approx(np.sqrt((0.02**2 + 0.04**2) / 2)),
    }
    of_gains = [quantity("drive_torque_gain", 1.0, 0.003, w) for w in WHEELS]
    left = procedure._left(of_gains, stating(vehicle, drive_torque_gain=0.02, drive_torque_gain_common=0.01))
    assert left == {
        "drive_torque_gain": pytest.approx(0.003),
        "drive_torque_gain_common": pytest.approx(np.hypot(0.01, 0.01)),
    }
    alone = procedure._left(
        of_gains, stating(vehicle, drive_torque_gain=0.02)
    )  # nothing else is common to all
    assert alone["drive_torque_gain_common"] == pytest.approx(0.01)
    assert procedure._left(of_gains, stating(vehicle)) == {}


def test_errors_that_channels_keep(vehicle: Vehicle) -> None:
    one = np.ones(3)
    bare, full = (
        Recording(one, {}),
        Recording(one, {"acceleration_x": one, "acceleration_y": one, "pitch": one}),
    )
    ground = GRAVITY * np.radians(0.5)

    def errors(logs: list[Recording], found: list[Quantity] = [], **stated: float) -> tuple[float, ...]:  # noqa: B006
        result = procedure._channel_errors(found, stating(vehicle, **stated), logs)
        return result.push, result.lateral, result.drawbar

    assert errors([bare]) == pytest.approx((ground, ground, 0.0))
    assert errors([bare] * 4, slope=0.02, drawbar_offset=3.0) == pytest.approx(
        (GRAVITY * 0.01, GRAVITY * 0.01, 3.0)
    )
    assert errors([full]) == pytest.approx((0.03, 0.03, 0.0))
    assert errors([full, bare]) == pytest.approx((ground / np.sqrt(2), ground / np.sqrt(2), 0.0))
    assert errors([full], acceleration_bias=0.05) == pytest.approx((0.05, 0.05, 0.0))
    assert errors([Recording(one, {"pitch": one})])[0] == pytest.approx(GRAVITY * np.radians(0.2))
    known = [quantity("acceleration_bias_x", 0.0, 0.001), quantity("drawbar_offset", 0.0, 0.5)]
    assert errors([full], known, drawbar_offset=3.0) == pytest.approx((0.001, 0.03, 0.5))


def test_zeros_are_taken_off_and_gains_divided_out(vehicle: Vehicle) -> None:
    zeros = {
        "drive_torque_offset": {"fl": 0.5},
        "drawbar_offset": 3.0,
        "acceleration_bias_x": 0.1,
        "pitch_offset": 0.02,
    }
    machine = Vehicle.from_dict({**vehicle.to_dict(), "calibration": zeros})
    names = (
        "drive_torque_fl",
        "drive_torque_fr",
        "drawbar_force",
        "acceleration_x",
        "pitch",
        "angular_velocity_z",
    )
    log = procedure._corrected(Recording(np.zeros(1), {n: np.ones(1) for n in names}), machine, 0.25)
    assert [log[n][0] for n in names] == pytest.approx([0.5, 1.0, -2.0, 0.9, 0.98, 0.75])
    (divided,) = procedure._with_gains([log], [quantity("drive_torque_gain", 0.5, 0.1, "fr")])
    assert [divided[n][0] for n in names[:2]] == [0.5, 2.0]
    errors = procedure._offset_errors(
        [quantity("drive_torque_offset", 0.0, 0.02, "fr")], stating(vehicle, drive_torque_offset=0.3)
    )
    assert errors.tolist() == [0.3, 0.02, 0.3, 0.3]
    assert procedure._offset_errors([], stating(vehicle)).tolist() == [0.0] * 4


def test_radii_of_passes_and_of_each_wheel(vehicle: Vehicle) -> None:
    rolling = radii.Rolling(np.array([0.2, 0.2, 0.21, 0.21]), np.full(4, 0.003), 2.1, 0.0123, ())
    apart = RelativeGains([], [], np.array([1.0, 1.01, 0.99, 1.0]), np.array([0.0, 0.004, 0.004, 0.0]))
    together, own = (procedure._radii(rolling, g, vehicle) for g in (None, apart))
    assert [q.value for q in together] == pytest.approx([0.2, 0.2, 0.21, 0.21])
    assert [q.std for q in together] == pytest.approx([0.0006, 0.0006, 0.00063, 0.00063])
    assert [q.value for q in own] == pytest.approx([0.2, 0.202, 0.2079, 0.21])
    assert [q.std for q in own] == pytest.approx([0.0006, 0.001, 0.00105, 0.00063])
    assert "slip of 1.23 %" in together[0].sentence
    assert "over slip" not in together[0].sentence
    assert "over slip" in own[0].sentence
    # Gains that were not told apart from radii: how far the wheels may differ is in the interval, in no value.
    vague = procedure._radii(rolling, apart, vehicle, determined=False)
    assert [q.value for q in vague] == pytest.approx([0.2, 0.2, 0.21, 0.21])
    spread = np.hypot(0.003, np.hypot([0.0, 0.01, 0.01, 0.0], [0.0, 0.004, 0.004, 0.0]))
    assert [q.std for q in vague] == pytest.approx((rolling.radius * spread).tolist())
    assert "over slip" not in vague[0].sentence


@pytest.mark.parametrize(
    ("key", "value", "fits"),
    [
        ("drive_torque_gain", 1.34, True), ("drive_torque_gain", 1.36, False), ("drive_torque_gain", 0.75, True),
        ("drive_torque_gain", 0.73, False), ("drive_torque_gain", 0.0, False), ("wheel_radius", 0.219, True),
        ("wheel_radius", 0.221, False), ("wheel_radius", 0.181, True), ("wheel_radius", 0.179, False),
    ],
)  # fmt: skip
def test_no_sensor_is_a_third_off_and_no_wheel_a_tenth(
    vehicle: Vehicle, key: str, value: float, fits: bool
) -> None:
    unknown: list[Unknown] = []
    both = [quantity(key, 1.0 if "gain" in key else 0.2, 0.01, "fl"), quantity(key, value, 0.01, "rr")]
    assert plausible(both, vehicle, unknown) == (both if fits else [])
    assert [u.name for u in unknown] == ([] if fits else [key])
    assert all("that of rr would be" in u.why for u in unknown)


@pytest.mark.parametrize(("share", "said"), [(0.19, False), (0.21, True)])
def test_much_turning_that_nothing_tells_asks_for_a_yaw_rate(
    vehicle: Vehicle, share: float, said: bool
) -> None:
    time = np.arange(0.0, 400.0, 0.5)
    side = np.where(time < 400 * share, 0.1, 0.0)
    channels = {"ground_speed": np.where(time < 396, 1.0, 0.0)}
    for wheel in WHEELS:
        channels[f"wheel_speed_{wheel}"] = 5.0 * (1 + (side if wheel[1] == "r" else -side))
        channels[f"drive_torque_{wheel}"] = np.ones(800)
    log = Recording(time, channels)
    lines = turned_unseen([log], vehicle, [])
    assert bool(lines) is said
    if said:
        assert "turned in 21% of its driving" in lines[0].why
    assert turned_unseen([log], vehicle, ["wheel_radius fl"]) == []
    assert turned_unseen([log], vehicle, ["drive_torque_gain fl"]) == []
    assert turned_unseen([log.with_channels(ground_speed=np.full(800, 0.19))], vehicle, []) == []


@pytest.mark.parametrize(
    ("value", "std", "rounded"),
    [
        (0.123456789, 0.0123, 0.1235),
        (123.456789, 4.5, 123.46),
        (1.23456789, 0.001, 1.23457),
        (0.5, 0.0, 0.5),
        (0.5, np.inf, 0.5),
    ],
)
def test_a_file_holds_a_value_to_a_hundredth_of_its_error(value: float, std: float, rounded: float) -> None:
    assert quantity("wheel_radius", value, std).rounded == rounded


def test_intervals_and_spreads_of_few_degrees_of_freedom() -> None:
    one = quantity("drive_torque_gain", 2.0, 0.1, "fl", factor=2 * 1.959963984540054)
    assert one.interval == pytest.approx((2.0 - 0.3919927969, 2.0 + 0.3919927969))
    assert one.spread == pytest.approx(0.2)
    assert replace(one, own_std=0.03).spread == pytest.approx(0.06)
    assert (one.name, replace(one, wheel=None).name) == ("drive_torque_gain fl", "drive_torque_gain")
    assert one.applies
    assert not replace(one, key="drive_torque_scale").applies
    assert replace(one, evidence=one.evidence * 3).samples == 15


def test_a_calibration_as_plain_text() -> None:
    logs = (Evidence("a.csv", 1.0, 11.0, 5), Evidence("b.csv", 0.0, 20.0, 6))
    metres = replace(quantity("wheel_radius", 0.80123, 0.0021, "fl"), unit="m", evidence=logs)
    plain = quantity("drive_torque_scale", 12.3, 4.0)
    lines = (
        Calibration((metres, plain), (Unknown("pitch_offset", "no pitch"),), notes=("Look.",))
        .table()
        .split("\n")
    )
    assert lines[1].split("  ")[0] == "wheel_radius fl"
    assert [cell.strip() for cell in lines[1].split("  ") if cell.strip()] == [
        "wheel_radius fl", "0.80123", "0.79711 to 0.80535", "m", "11 samples in 30 s of 2 logs",
    ]  # fmt: skip
    assert [cell.strip() for cell in lines[2].split("  ") if cell.strip()] == [
        "drive_torque_scale", "12.3", "4.5 to 20.1", "5 samples in 10 s of log",
    ]  # fmt: skip
    assert lines[3:] == [
        "", "wheel_radius: so", "drive_torque_scale: so", "", "Not determined by the data:", "  pitch_offset: no pitch", "", "Note: Look.",
    ]  # fmt: skip
    wide = Calibration((quantity("drive_torque_scale", 600.0, 1000.0),), ()).table()
    assert "  600    -1360 to 2560  " in wide  # no digits to cut off before the point
    assert Calibration((), ()).table() == "quantity  value  95 % interval  unit  from"


@pytest.mark.parametrize(
    ("key", "value", "std"),
    [("wheel_radius", 0.98, 0.01), ("wheel_based_speed_gain", 1 / 0.98, 0.01 / 0.98**2)],
)
def test_a_zero_of_slip_scales_a_radius_and_divides_a_gain(key: str, value: float, std: float) -> None:
    stated = quantity(key, 2.0, 0.0)
    scaled = _scaled(stated, Zero(0.98, 0.01, 9))
    assert isinstance(scaled, Quantity)
    assert (scaled.value, scaled.std) == (pytest.approx(2 * value), pytest.approx(2 * std))
    assert "in 9 windows of the lightest work" in scaled.sentence
    assert "doubt" not in scaled.sentence
    assert isinstance(_scaled(stated, None), Unknown)
    assert _scaled(stated, Zero(1.0, 0.03, 9, "why")) == Unknown(key, "why")
    doubted = _scaled(stated, Zero(0.99, 0.03, 9, "why"))
    assert isinstance(doubted, Quantity)
    assert "(the interval covers the doubt: why)" in doubted.sentence
    assert isinstance(_scaled(stated, Zero(1.0, 0.02, 9)), Quantity)


def test_noise_of_a_sensor_is_the_files_or_the_median_of_the_logs(vehicle: Vehicle) -> None:
    known = SimpleNamespace(drive_torque=None, drawbar_force=7.0, acceleration=None)
    logs = [
        Recording(
            np.arange(5.0),
            {f"drive_torque_{w}": np.ones(5) for w in WHEELS},
            noise={f"drive_torque_{w}": k + 1.0 for k, w in enumerate(WHEELS)},
        )
    ]
    noise = procedure._sensor_noise(logs, SimpleNamespace(sensors=known))  # type: ignore[arg-type]
    assert noise == {"drive_torque": 2.5, "drawbar_force": 7.0, "acceleration": 0.0}


@pytest.mark.parametrize(
    ("gains", "words"),
    [
        ((1.287, 1.310, 0.772, 0.768), "The torque gains go by axle, 1.69 times apart"),
        ((1.1, 1.12, 0.9, 0.89), ""),
        ((1.3, 0.77, 1.3, 0.77), ""),
    ],
    ids=["of two axles", "of sensors", "of two sides"],
)
def test_gains_that_go_by_axle_are_named(gains: tuple[float, ...], words: str) -> None:
    """The first are what an exchange of the torques of a machine of 191 and 229 kg an axle left."""
    axles = {"front": {"mass": 191, "wheels": ["fl", "fr"]}, "rear": {"mass": 229, "wheels": ["rl", "rr"]}}
    wheel = {"radius": 0.31, "inertia": 1.6}
    vehicle = Vehicle.from_dict(
        {"mass": 420, "wheelbase": 1.1, "center_of_gravity_height": 0.48, "axles": axles, "wheel": wheel}
    )
    found = [
        Quantity("drive_torque_gain", g, 0.02, "", (), "", w)
        for g, w in zip(gains, vehicle.wheels, strict=True)
    ]
    notes = gains_by_axle(found, vehicle)
    assert [note.startswith(words) for note in notes] == [True] * bool(words)
