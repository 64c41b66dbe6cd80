"""A GeoTIFF of the user's own lies where it says; any other picture is placed by hand."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient
from PIL import Image

rasterio = pytest.importorskip("rasterio", reason="basemaps need terragrip[geo]")

pytestmark = pytest.mark.filterwarnings(
    "ignore::PendingDeprecationWarning"
)  # rasterio's own products of affine maps

# UTM zone 33N: 100 m by 50 m at 15 degrees east, where easting is 500 km and north is up.
EAST, NORTH, PIXEL = 500_000.0, 5_600_000.0, 1.0


def write(path: Path, bands: np.ndarray, crs: str | None = "EPSG:32633") -> None:
    transform = rasterio.Affine(PIXEL, 0.0, EAST, 0.0, -PIXEL, NORTH)
    with rasterio.open(
        path, "w", driver="GTiff", width=bands.shape[2], height=bands.shape[1], count=len(bands), dtype=bands.dtype, crs=crs,
        transform=transform,
    ) as file:  # fmt: skip
        file.write(bands)


def test_the_corners_are_those_of_the_file(client: TestClient, folder: Path) -> None:
    write(folder / "field.tif", np.full((3, 50, 100), 200, np.uint8))
    corners = np.array(client.get("/api/basemap", params={"path": "field.tif"}).json()["corners"])
    # Closed form at the central meridian: longitude 15, a metre of northing is 1/111.3 km of latitude, of easting cos(latitude) of that.
    metre = 1 / 111_300.0
    assert corners[0][0] == pytest.approx(15.0, abs=5 * metre)
    assert corners[1][0] - corners[0][0] == pytest.approx(
        100 * metre / np.cos(np.radians(corners[0][1])), rel=0.03
    )
    assert corners[0][1] - corners[3][1] == pytest.approx(50 * metre, rel=0.05)
    assert np.all(corners[[0, 1], 1] > corners[[2, 3], 1])


@pytest.mark.parametrize("bands", [1, 3, 4])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_it_is_shown_as_a_picture_that_browsers_read(
    client: TestClient, folder: Path, bands: int, kind: type
) -> None:
    values = np.linspace(0, 250, bands * 50 * 100).reshape(bands, 50, 100).astype(kind)
    write(folder / "field.tif", values)
    answer = client.get("/api/basemap/picture", params={"path": "field.tif"})
    assert answer.headers["content-type"] == "image/png"
    picture = np.asarray(Image.open(io.BytesIO(answer.content)))
    assert picture.shape[2] == 4
    inside = picture[:, :, 0][picture[:, :, 3] > 0]
    assert inside.max() > inside.min()


def test_a_file_that_says_no_place_or_is_none_gets_one_line(client: TestClient, folder: Path) -> None:
    (folder / "broken.tif").write_bytes(b"II*\0 and nothing")
    for name in ("broken.tif", "nothing.tif"):
        for route in ("basemap", "basemap/picture"):
            answer = client.get(f"/api/{route}", params={"path": name})
            assert answer.status_code == 422
            assert "\n" not in answer.json()["detail"]


def test_a_plain_picture_is_placed_by_hand(client: TestClient, folder: Path) -> None:
    (folder / "scan.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"\0" * 40)
    assert client.get("/api/basemap", params={"path": "scan.png"}).json() == {"corners": None}
    assert (
        client.get("/api/basemap/picture", params={"path": "scan.png"}).headers["content-type"] == "image/png"
    )
