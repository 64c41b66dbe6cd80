"""Advice of one run for the drive page: as `terragrip advise` gives it, with the machine's weight."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from terragrip.advice.analysis import advise
from terragrip.advice.result import to_dict
from terragrip.estimation.driveline import machine_of
from terragrip.studio.api.drive import table_of
from terragrip.studio.api.files import Named, finite
from terragrip.studio.state import Here
from terragrip.units import STANDARD_GRAVITY

router = APIRouter(tags=["advice"])


@router.get("/advice")
def advice(studio: Here, path: Named, version: str = "") -> dict[str, Any]:
    """advice.json of estimates of the folder, by their own vehicle: ``soils``, the one with the most way first, each with its ``name``,
    and ``weight`` [N]. A run whose vehicle is not known, or that was replaced since ``version``, is refused."""
    table = table_of(studio, path, version)
    vehicle = table.vehicle
    given, way = advise([table], vehicle)
    order = sorted(given, key=lambda name: -way[name])
    soils = [{"name": name, "metres": way[name], **to_dict({name: given[name]}, way)} for name in order]
    return finite({"soils": soils, "weight": machine_of(table, vehicle).mass * STANDARD_GRAVITY})
