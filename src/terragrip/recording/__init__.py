"""Measurements: the schema, the checks, and the sensors' properties estimated from the log."""

from terragrip.recording.held import fresh_samples, held_periods, without_held
from terragrip.recording.noise import rounding_noise, sensor_noise
from terragrip.recording.plausibility import unit_warnings
from terragrip.recording.schema import is_channel, unit_of, wheel_names_in
from terragrip.recording.survey import LogBlocks, survey_of
from terragrip.recording.table import Recording

__all__ = [
    "LogBlocks",
    "Recording",
    "fresh_samples",
    "held_periods",
    "is_channel",
    "rounding_noise",
    "sensor_noise",
    "survey_of",
    "unit_of",
    "unit_warnings",
    "wheel_names_in",
    "without_held",
]
