"""Basemaps of the user's own: a GeoTIFF says where it lies, any other picture is placed by hand."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from fastapi import APIRouter, Response
from fastapi.responses import FileResponse

from terragrip.errors import InputError, missing_package
from terragrip.studio.api.files import PICTURE_TYPES, Named
from terragrip.studio.state import Here

router = APIRouter(tags=["map"])

LARGEST = 4096
"""Pixels of a side that a page gets."""


@router.get("/basemap")
def placed(studio: Here, path: Named) -> dict[str, Any]:
    """Corners of a basemap (longitude and latitude, north-west first, clockwise); null where the picture does not say."""
    target = studio.folder.file(path)
    if target.suffix.lower() in PICTURE_TYPES:
        return {"corners": None}
    with _mercator(target, path) as raster:
        west, south, east, north = raster.bounds
        from rasterio.warp import transform

        lon, lat = transform(raster.crs, "EPSG:4326", [west, east, east, west], [north, north, south, south])
    return {"corners": [[float(x), float(y)] for x, y in zip(lon, lat, strict=True)]}


@router.get("/basemap/picture")
def picture(studio: Here, path: Named) -> Response:
    """The basemap as a picture that a browser shows."""
    target = studio.folder.file(path)
    plain = PICTURE_TYPES.get(target.suffix.lower())
    if plain is not None:
        return FileResponse(target, media_type=plain)
    with _mercator(target, path) as raster:
        scale = min(1.0, LARGEST / max(raster.width, raster.height))
        shape = max(int(raster.height * scale), 1), max(int(raster.width * scale), 1)
        colors = 3 if raster.src_dataset.count >= 3 else 1  # the map's own transparency comes after them
        bands = raster.read(list(range(1, colors + 1)), out_shape=(colors, *shape))
        mask = raster.dataset_mask(out_shape=shape)
    return Response(_png(_eight_bits(bands), mask), media_type="image/png")


def _mercator(target: Path, path: str) -> Any:
    """The raster in the map's own projection; InputError where it is none, or rasterio is missing."""
    try:
        import rasterio
        from rasterio.errors import RasterioError
        from rasterio.vrt import WarpedVRT
    except ModuleNotFoundError as error:
        raise missing_package("rasterio", "geo", "read a GeoTIFF", file=path) from error
    try:
        raster = rasterio.open(target)
        if raster.crs is None:
            raster.close()
            raise InputError("has no georeference", file=path, hint="save it as PNG and place it by hand")
        return WarpedVRT(raster, crs="EPSG:3857", add_alpha=raster.count in (1, 3))
    except RasterioError as error:
        raise InputError("is not a readable GeoTIFF", file=path, hint="export it anew") from error


def _eight_bits(bands: Any) -> Any:
    """Bands as 8 bits: those with more are stretched from their 2 % to their 98 % point."""
    if bands.dtype == np.uint8:
        return bands
    low, high = np.nanpercentile(bands, [2, 98])
    return (np.clip((bands - low) / max(float(high - low), 1e-12), 0, 1) * 255).astype(np.uint8)


def _png(bands: Any, mask: Any) -> bytes:
    from PIL import Image

    colors = bands if len(bands) == 3 else np.repeat(bands[:1], 3, axis=0)
    picture = np.moveaxis(np.concatenate((colors, mask[None].astype(np.uint8))), 0, -1)
    out = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture), "RGBA").save(out, "PNG")
    return out.getvalue()
