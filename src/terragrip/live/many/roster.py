"""Which vehicle file and profile belong to a vehicle's name: by an index table, else one for all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError
from terragrip.listing import listed, profile_in
from terragrip.live.topics import is_name

if TYPE_CHECKING:
    from terragrip.formats import Profile
    from terragrip.vehicle import Vehicle

COLUMNS = ("name", "vehicle", "profile")


class Roster:
    """``vehicle`` and ``profile`` hold for all that ``index`` gives none: a CSV with the columns `name` (as in the topic), `vehicle` and
    `profile`, paths from the table's folder. Without ``vehicle``, vehicles that are not listed are refused.

    Raises InputError where neither is given, or the table is none, lists a vehicle twice, or lists no vehicle at all.
    """

    def __init__(self, vehicle: Path | None, profile: Path | None = None, index: Path | None = None) -> None:
        if vehicle is None and index is None:
            raise InputError(
                "no vehicle is named", place="--vehicle", hint="name a vehicle file, or an --index"
            )
        self._vehicle, self._profile, self._index = vehicle, profile, index
        self._files: dict[
            tuple[str, Path, int], Vehicle | Profile
        ] = {}  # by kind, file and when it was changed
        self._changed: int | None = None
        self._rows: dict[str, tuple[Path | None, Path | None]] = {}
        self.refresh()

    @property
    def names(self) -> tuple[str, ...]:
        """Those listed, in the table's order."""
        return tuple(self._rows)

    def refresh(self) -> None:
        """Read the table anew where it has changed; raises InputError where it is none any more, and then keeps what it said."""
        if self._index is None:
            return
        changed = _changed(self._index)
        if changed == self._changed:
            return
        self._changed = changed
        self._rows = _rows(self._index)

    def of(self, name: str) -> tuple[Vehicle, Profile | None]:
        """The vehicle of a name and its profile; files are read anew where they have changed. Raises InputError where it has none."""
        vehicle, profile = self._rows.get(name, (None, None))
        vehicle, profile = vehicle or self._vehicle, profile or self._profile
        if vehicle is None:
            hint = "write one in its row, or give --vehicle for all others"
            raise InputError(f"names no vehicle file for {name}", file=self._index, hint=hint)
        return self._loaded("vehicle", vehicle), self._loaded("profile", profile) if profile else None

    def _loaded(self, kind: str, path: Path) -> Any:
        """The vehicle or the profile in a file, read once for each change of it."""
        from terragrip.formats import Profile
        from terragrip.vehicle import Vehicle

        key = kind, path, _changed(path)
        if key not in self._files:
            self._files[key] = (Vehicle if kind == "vehicle" else Profile).load(path)
        return self._files[key]


def _rows(index: Path) -> dict[str, tuple[Path | None, Path | None]]:
    result: dict[str, tuple[Path | None, Path | None]] = {}
    for number, row in listed(index, ("name",), COLUMNS):
        name, place = row["name"], f"row {number}"
        if not is_name(name):
            raise InputError(
                f"{name[:40]!r} is not a vehicle's name", file=index, place=place,
                hint="use letters, digits and _ - . only, as in its topic",
            )  # fmt: skip
        if name in result:
            raise InputError(f"{name} occurs here twice", file=index, place=place, hint="keep one row")
        vehicle = index.parent / row["vehicle"] if row.get("vehicle") else None
        result[name] = vehicle, profile_in(index, row.get("profile", ""))
    if not result:
        raise InputError("names no vehicle", file=index, hint="write one in each line: name,vehicle,profile")
    return result


def _changed(path: Path) -> int:
    """When a file was changed last [ns]; -1 where that cannot be known: it is missing, or a profile that comes with Terragrip."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return -1
