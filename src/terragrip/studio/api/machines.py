"""The vehicle maker: what is asked of a machine, what is typical of its class, what each missing number costs, the file."""

from __future__ import annotations

import shlex
from typing import Any

from fastapi import APIRouter
from pydantic import BaseModel, Field

from terragrip.studio.api.files import Named, finite
from terragrip.studio.state import Here
from terragrip.vehicle_maker import SIGNALS, Made, classes, fields, interval_costs, make

router = APIRouter(tags=["machines"])


class Machine(BaseModel):
    """A machine by its class, what its log measures, and what is known of it: numbers or texts with a unit by field."""

    machine: str
    signals: str = "torque"
    known: dict[str, str | float] = {}
    name: str = Field("", max_length=200)

    def make(self) -> Made:
        """The vehicle; InputError on what is impossible. An empty answer is not known."""
        known = {name: value for name, value in self.known.items() if str(value).strip()}
        return make(self.machine, self.signals, known, name=self.name.strip())  # type: ignore[arg-type]  # make checks it


class MachineFile(Machine):
    """A machine, and the vehicle file to write."""

    output: str
    replace: bool = False


@router.get("/machines")
def list_machines() -> dict[str, Any]:
    """The classes of machine, and what a log may measure."""
    return {"classes": [{"name": one.name, "title": one.title} for one in classes()], "signals": SIGNALS}


@router.get("/machines/parts")
def parts_of_machine(studio: Here, path: Named) -> dict[str, list[str]]:
    """The names of a vehicle file's wheels and axles."""
    from terragrip.vehicle import Vehicle

    vehicle = Vehicle.load(studio.folder.file(path))
    return {"wheels": list(vehicle.wheels), "axles": list(vehicle.axles)}


@router.post("/machines/made")
def make_machine(wanted: Machine) -> dict[str, Any]:
    """What is asked for, with what is typical and from where (null: nothing is assumed); the vehicle for its sketch; the file as text."""
    made = wanted.make()
    asked = fields(made.machine, made.signals, made.known)
    return finite(
        {
            "fields": [
                {
                    "name": field.name,
                    "title": field.title,
                    "unit": field.unit,
                    "value": field.typical and field.typical.value,
                    "spread": field.typical and field.typical.spread,
                    "source": field.typical and field.typical.source,
                    "needed": field.needed,
                    "is_spread": field.is_spread,
                    "known": made.known.get(field.name),
                    "is_far": field.is_far(made.known),
                }
                for field in asked
            ],
            "vehicle": made.vehicle.to_dict(),
            "text": made.to_yaml(),
        }
    )


@router.post("/machines/costs")
def costs_of_machine(wanted: Machine) -> list[dict[str, Any]]:
    """Half the width of the 95 % intervals where all is known, without each number that is not known, and as the file stands."""
    return finite(
        [
            {"what": cost.what, "field": cost.field, "half_width": cost.half_width}
            for cost in interval_costs(wanted.make())
        ]
    )


@router.post("/machines/file", status_code=201)
def save_machine(studio: Here, wanted: MachineFile) -> dict[str, str]:
    """Write the vehicle file; with the command line that makes it again."""
    target = studio.folder.new_file(wanted.output, (".yaml", ".yml"), replace=wanted.replace)
    wanted.make().save(target)
    words = ["terragrip", "new", "vehicle", "--class", wanted.machine, "--signals", wanted.signals]
    words += [f"--name={wanted.name.strip()}"] if wanted.name.strip() else []
    words += [f"--{k.replace('_', '-')}={v}" for k, v in wanted.known.items() if str(v).strip()]
    return {"path": wanted.output, "command": shlex.join([*words, "-o", wanted.output])}
