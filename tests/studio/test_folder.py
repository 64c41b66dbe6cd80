"""No request reads or writes outside the folder; files are known by what they hold."""

from __future__ import annotations

from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from terragrip.errors import InputError
from terragrip.formats.registry import suffixes
from terragrip.studio.folder import Folder

PARTS = st.sampled_from(
    ["..", ".", "a", "vehicle.yaml", "", "/", "\\", "\0", "~", "%2e%2e", "x" * 300, ".hidden", "out"]
)


@pytest.fixture
def outside(folder: Path) -> Path:
    """A secret beside the folder, and symbolic links in the folder that lead to it."""
    secret = folder.parent / "secret.yaml"
    secret.write_text("axles: secret")
    (folder / "link.yaml").symlink_to(secret)
    (folder / "out").symlink_to(folder.parent)
    (folder / "loop").symlink_to(folder / "loop")
    return secret


@pytest.mark.parametrize(
    "path",
    ["../secret.yaml", "a/../../secret.yaml", "/etc/passwd", "link.yaml", "out/secret.yaml", "..\\secret.yaml", "loop", "",
     ".", "..", ".env", "a/.ssh/id", "vehicle.yaml\0.png", "//etc/passwd"],
)  # fmt: skip
def test_paths_that_leave_the_folder_are_refused(client: TestClient, outside: Path, path: str) -> None:
    assert client.get("/api/file", params={"path": path}).status_code == 422
    assert (
        client.put("/api/file", params={"path": path, "replace": True}, content=b"axles: x").status_code
        == 422
    )
    assert client.delete("/api/file", params={"path": path}).status_code == 422
    assert client.get("/api/inspect", params={"path": path}).status_code == 422
    assert outside.read_text() == "axles: secret"


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(parts=st.lists(PARTS | st.text(max_size=8), min_size=1, max_size=5))
def test_whatever_a_path_is_made_of_it_stays_inside(folder: Path, parts: list[str]) -> None:
    try:
        target = Folder(folder).resolve("/".join(parts))
    except InputError:
        return
    assert target.is_relative_to(folder.resolve())


@pytest.mark.parametrize("suffix", suffixes())
def test_a_log_of_every_format_is_listed(folder: Path, suffix: str) -> None:
    (folder / f"drive{suffix}").write_bytes(b"")
    assert ("recording", f"drive{suffix}") in {(one.kind, one.path) for one in Folder(folder).items()}


def test_files_are_listed_by_what_they_hold(client: TestClient, folder: Path, outside: Path) -> None:
    (folder / "notes.json").write_text("[]")
    (folder / ".secret.yaml").write_text("axles: {}")
    items = {item["path"]: item["kind"] for item in client.get("/api/folder").json()["items"]}
    assert items == {
        "recording.parquet": "recording",
        "truth.parquet": "recording",
        "estimates.parquet": "estimates",
        "vehicle.yaml": "vehicle",
        "soils.json": "library",
    }


def test_a_folder_that_is_none_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is no folder"):
        Folder(tmp_path / "nothing")
