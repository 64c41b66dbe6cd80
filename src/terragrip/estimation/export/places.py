"""Estimates on the map: a point of each row that has a position, as GeoJSON (RFC 7946) or GeoPackage (OGC 12-128)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from terragrip.errors import InputError
from terragrip.estimation.columns import column_named
from terragrip.estimation.export.about import about_texts
from terragrip.estimation.export.rows_as_json import json_rows
from terragrip.files import unwritable
from terragrip.recording.clock import clock_times

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates

_PLACE = ("latitude", "longitude")
_POINT = np.dtype([("order", "u1"), ("type", "<u4"), ("x", "<f8"), ("y", "<f8")])
"""A point as well-known binary, little endian (OGC 06-103r4, 8.2)."""


def placed(part: Estimates) -> Estimates:
    """The rows that have a position."""
    return part.select(np.isfinite(part["latitude"]) & np.isfinite(part["longitude"]))


class GeoJson:
    """A FeatureCollection; ``about`` is a member of it, positions are in the geometry only."""

    def __init__(self, path: Path, first: Estimates, target: Path) -> None:
        self._target = target
        self._names = [name for name in first.names if name not in _PLACE]
        about = {**about_texts(first), "notes": list(first.notes)}
        columns = {name: column_named(name)._asdict() for name in self._names}
        head = json.dumps(
            {"type": "FeatureCollection", "about": about, "columns": columns}, ensure_ascii=False
        )
        self._stream = path.open("w", encoding="utf-8")
        self._stream.write(f'{head[:-1]}, "features": [')
        self._between = "\n"

    def write(self, part: Estimates) -> None:
        """Write the rows of a part that have a position."""
        part = placed(part)
        if not len(part):
            return
        features = [
            f'{{"type":"Feature","geometry":{{"type":"Point","coordinates":[{x!r},{y!r}]}},"properties":{text}}}'
            for x, y, text in zip(
                part["longitude"].tolist(), part["latitude"].tolist(), self._properties(part), strict=True
            )
        ]
        self._stream.write(self._between + ",\n".join(features))
        self._between = ",\n"

    def _properties(self, part: Estimates) -> Any:
        rows = json_rows(part, self._names)
        if part.start is None:
            return rows
        clock = np.datetime_as_string(clock_times(part.time, part.start), timezone="UTC")
        return (f'{{"clock":"{when}",{row[1:]}' for when, row in zip(clock, rows, strict=True))

    def close(self) -> None:
        """End the collection; raises InputError where no row had a position."""
        self._stream.write("\n]}\n")
        self._stream.close()
        if self._between == "\n":
            raise _nowhere(self._target)

    def drop(self) -> None:
        """Close the stream."""
        self._stream.close()


class GeoPackage:
    """A layer ``estimates`` of points in WGS 84; its columns have comments, its metadata what the table was made from."""

    def __init__(self, path: Path, first: Estimates, target: Path) -> None:
        path.unlink()  # GDAL makes the file itself
        self._path, self._target, self._first, self._made = path, target, first, False

    def write(self, part: Estimates) -> None:
        """Write the rows of a part that have a position."""
        import pyogrio

        part = placed(part)
        if not len(part):
            return
        about = {} if self._made else {**about_texts(self._first), "notes": " ".join(self._first.notes)}
        try:
            pyogrio.write_arrow(
                _layer(part), self._path, layer="estimates", driver="GPKG", geometry_name="geometry",
                geometry_type="Point", crs="EPSG:4326", append=self._made, layer_metadata=about or None,
            )  # fmt: skip
        except pyogrio.errors.DataSourceError as error:
            raise unwritable(self._target, error, "free space or choose another folder") from error
        self._made = True

    def close(self) -> None:
        """Raise InputError where no row had a position."""
        if not self._made:
            raise _nowhere(self._target)

    def drop(self) -> None:
        """Each block is already in the file."""


def _layer(part: Estimates) -> Any:
    """The rows as Arrow with their points as well-known binary, and their clock where it is known."""
    import pyarrow as pa

    table = part.to_arrow().drop_columns(list(_PLACE)).replace_schema_metadata(None)
    points = np.zeros(len(part), dtype=_POINT)
    points["order"], points["type"], points["x"], points["y"] = 1, 1, part["longitude"], part["latitude"]
    arrays = list(table.columns)
    fields = [f.with_metadata({"GDAL:OGR:comment": column_named(f.name).label}) for f in table.schema]
    if part.start is not None:
        ticks = clock_times(part.time, part.start).astype("datetime64[ms]").view(np.int64)
        clock = pa.Array.from_buffers(pa.int64(), len(ticks), [None, pa.py_buffer(ticks)])
        arrays.append(clock.view(pa.timestamp("ms", "UTC")))
        fields.append(pa.field("clock", arrays[-1].type))
    binary = pa.Array.from_buffers(
        pa.binary(_POINT.itemsize), len(part), [None, pa.py_buffer(points.tobytes())]
    )
    arrays.append(binary.cast(pa.binary()))
    fields.append(pa.field("geometry", pa.binary(), metadata={"ARROW:extension:name": "geoarrow.wkb"}))
    return pa.table(arrays, schema=pa.schema(fields))


def _nowhere(path: Path) -> InputError:
    return InputError("no row has a position", file=path, hint="write .parquet")
