"""A map as a file: GeoPackage, GeoParquet, GeoJSON, GeoTIFF, or a picture. Each appears whole or not at all."""

from __future__ import annotations

import io
import os
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from terragrip.errors import InputError, missing_package
from terragrip.files import replacing
from terragrip.maps.about import ABOUT, About
from terragrip.maps.field_map import MOST_CELLS, FieldMap

KINDS: dict[str, tuple[str, str]] = {
    ".gpkg": ("a GeoPackage with all layers", "pyogrio"),
    ".parquet": ("a GeoParquet file of one layer", "geopandas"),
    ".geojson": ("a GeoJSON file of one layer", "pyogrio"),
    ".tif": ("a GeoTIFF, a band for each quantity and one for its SD, count and passes", "rasterio"),
    ".tiff": ("a GeoTIFF, a band for each quantity and one for its SD, count and passes", "rasterio"),
    ".png": ("a picture", "matplotlib"),
    ".svg": ("a picture", "matplotlib"),
    ".pdf": ("a picture", "matplotlib"),
}
"""What a suffix stands for, and the package that writes it."""


def require_suffix(path: str | os.PathLike[str]) -> None:
    """Raise InputError if a map cannot be written under this name, or a package for it is not installed."""
    suffix = Path(path).suffix.lower()
    if suffix not in KINDS:
        problem = f"a map cannot be written as {suffix!r}" if suffix else "the name has no suffix"
        raise InputError(
            problem,
            file=path,
            place="--output",
            hint=f"name it {Path(path).stem}.gpkg, or any of {', '.join(KINDS)}",
        )
    for package in ("pyproj", KINDS[suffix][1]):
        if find_spec(package) is None:
            extra = "report" if package == "matplotlib" else "geo"
            raise missing_package(package, extra, file=path)


def write_map(made: FieldMap, path: str | os.PathLike[str], layer: str = "cells") -> None:
    """Write a map by the suffix of its name; `layer` is the one of GeoParquet and GeoJSON. Raises InputError as `require_suffix`."""
    require_suffix(path)
    suffix = Path(path).suffix.lower()
    with replacing(path) as temporary:
        if suffix == ".gpkg":
            _geopackage(made, temporary)
        elif suffix in (".parquet", ".geojson"):
            from terragrip.maps.layers import layer as table

            frame = table(made, layer)
            if suffix == ".parquet":
                frame.to_parquet(temporary, index=False)
            else:
                written = io.BytesIO()  # GDAL does not report a full disk
                frame.to_crs(4326).to_file(written, driver="GeoJSON", engine="pyogrio", RFC7946="YES")
                temporary.write_bytes(written.getvalue())
        elif suffix in (".tif", ".tiff"):
            _geotiff(made, temporary)
        else:
            from terragrip.maps.picture import picture

            picture(made).savefig(
                temporary, format=suffix[1:], dpi=150, bbox_inches="tight", facecolor="white"
            )


def _metadata(made: FieldMap) -> dict[str, str]:
    """How the map was made, as a file's metadata."""
    from terragrip.maps.layers import changes_between

    about = About(
        made.epsg, made.cell, made.datum, made.reference_slip, list(made.runs), list(made.notes), changes_between(made)
    )  # fmt: skip
    return {ABOUT: about.to_text()}


def _geopackage(made: FieldMap, path: Path) -> None:
    from terragrip.maps.layers import LAYERS
    from terragrip.maps.layers import layer as table

    path.unlink()
    metadata = _metadata(made)
    for name in LAYERS:
        frame = table(made, name)
        if name == "changes" and not len(frame):
            continue  # nothing was driven twice; an empty layer would say that nothing changed
        try:
            frame.to_file(path, layer=name, driver="GPKG", engine="pyogrio", dataset_metadata=metadata)
        except RuntimeError as error:  # pyogrio's own, the disk's among them
            raise OSError(str(error).rpartition("failed: ")[2]) from error


def _geotiff(made: FieldMap, path: Path) -> None:
    """Cloud-optimised, north up, NaN where nothing is known; bands ``count`` and ``passes`` distinguish driven cells from kriged ones."""
    import rasterio
    from rasterio.transform import from_origin

    from terragrip.maps.layers import cell_table

    table = cell_table(made)
    column, row = table["column"], table["row"]
    west, top = int(column.min()), int(row.max())
    width, height = int(column.max()) - west + 1, top - int(row.min()) + 1
    if width * height > MOST_CELLS:
        raise InputError(
            f"a raster of {width} by {height} cells is too large",
            file=path,
            place="--cell",
            hint="map the runs one by one, or coarser",
        )
    names = [name for quantity in made.cells for name in (quantity, f"{quantity}_std")] + ["count", "passes"]
    profile: dict[str, Any] = {
        "driver": "COG", "width": width, "height": height, "count": len(names), "dtype": "float32", "nodata": float("nan"),
        "crs": made.epsg, "transform": from_origin(west * made.cell, (top + 1) * made.cell, made.cell, made.cell), "compress": "deflate",
    }  # fmt: skip
    with rasterio.MemoryFile() as memory:
        with memory.open(**profile) as file:
            file.update_tags(**_metadata(made))
            for band, name in enumerate(names, 1):
                values = np.full((height, width), np.nan, dtype=np.float32)
                values[top - row, column - west] = table[name]
                file.write(values, band)
                file.set_band_description(band, name)
        path.write_bytes(memory.getbuffer())  # GDAL says nothing of a disk that is full
