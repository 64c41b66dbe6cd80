"""A snapshot is bytes; what goes on from it is the same to the last bit."""

from __future__ import annotations

import copy
import pickle

import pytest

from drives import drive, robot
from terragrip.errors import InputError
from terragrip.estimation import METHODS, TractionEstimator
from terragrip.estimation.engine_estimator import _MAGIC, restored
from terragrip.estimation.estimator import _SNAPSHOT_MAGIC
from terragrip.estimation.sealed import seal


@pytest.fixture(scope="module")
def rows():
    return drive(6.0, imu=True).recording.to_pandas().to_dict("records")


@pytest.mark.parametrize("method", METHODS)
def test_going_on_from_a_snapshot_is_bit_identical(rows, method):
    through = TractionEstimator(robot(), method, held={"ground_speed": 0.02}, gap=3.0)
    for row in rows[:333]:
        through.update(row)
    data = through.snapshot()
    again = TractionEstimator.restore(data)
    assert again.method == method
    for row in rows[333:]:
        assert again.update(row).to_dict() == through.update(row).to_dict()
    assert again.snapshot() == through.snapshot()


def test_a_snapshot_does_not_disturb(rows):
    taken, plain = TractionEstimator(robot()), TractionEstimator(robot())
    for row in rows[:100]:
        taken.snapshot()
        assert taken.update(row).to_dict() == plain.update(row).to_dict()


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_goes_on_by_itself(rows, copied):
    one, plain = TractionEstimator(robot()), TractionEstimator(robot())
    other = copied(one)
    for row in rows[:50]:
        other.update(row)
    assert one.update(rows[0]).to_dict() == plain.update(rows[0]).to_dict()


def test_the_vehicle_and_settings_come_back(rows):
    vehicle = robot(calibration={"drive_torque_gain": {"rr": 1.02}})
    there = TractionEstimator(vehicle, "kalman", sensors={"ground_speed": 0.05}, standstill_speed=0.1)
    back = TractionEstimator.restore(there.snapshot())
    assert back.vehicle.to_dict() == vehicle.to_dict()
    assert back.noise == there.noise
    assert back.thresholds == there.thresholds


@pytest.mark.parametrize("place", [0, 9, 40, 3000, -1])
def test_a_changed_byte_is_noticed(place):
    data = bytearray(TractionEstimator(robot()).snapshot())
    data[place] ^= 0x40
    with pytest.raises(InputError, match="snapshot is damaged"):
        TractionEstimator.restore(bytes(data))


@pytest.mark.parametrize("size", [0, 5, 100, -1])
def test_a_short_snapshot_is_refused(size):
    data = TractionEstimator(robot()).snapshot()
    with pytest.raises(InputError, match="snapshot is damaged"):
        TractionEstimator.restore(data[:size])


@pytest.mark.parametrize("mark", [_SNAPSHOT_MAGIC, _MAGIC])
@pytest.mark.parametrize("body", [b"ab", b"\2\0\0\0no", b"\2\0\0\0{}", b"\2\0\0\0[]", b"[]", b'{"inner": 1}'])
def test_bytes_with_a_right_checksum_and_another_content_are_refused(mark, body):
    with pytest.raises(InputError, match="snapshot is damaged"):
        restored(seal(mark, body))
