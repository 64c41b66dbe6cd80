"""The ground in the report: shares that can be counted by hand, and a sentence where nothing is known."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from terragrip.figures import PART_COLORS, SOIL_COLORS, soil_color
from terragrip.ground.changes import Change
from terragrip.ground.events import Event
from terragrip.ground.result import Ground, Timeline
from terragrip.ground.sections import Section as Stay
from terragrip.report import ground_sections
from terragrip.report.page import Page, Picture, Section, Table, render
from terragrip.report.style import CSS_VARIABLES, text_color

NAMES = ("fine", "wet", "unknown")


def ground(labels: list[str], taken: list[str], events: tuple[dict[str, object], ...] = ()) -> Ground:
    """A drive of blocks of half a second; the soil taken for has probability .8."""
    time = 0.5 * np.arange(len(labels))
    probabilities = np.full((len(labels), 3), 0.1)
    probabilities[np.arange(len(labels)), [NAMES.index(name) for name in taken]] = 0.8
    timeline = Timeline(
        time, NAMES, probabilities, np.ones(len(labels), dtype=bool), np.array(labels, dtype=object)
    )
    stay = Stay(
        0.0, 2.0, 0.0, "fine", {"fine": 0.8, "wet": 0.1}, 200, 0.12, 0.02, 0.33, 0.04, 0.1, 0.01, label="wet"
    )
    change = Change(2.0, 0.2, 0.9, {})
    return Ground(
        "run 1", 0.0, float(time[-1]), NAMES[:2], (change,), (stay,), events, timeline, ("A note.",)
    )


def only(section: Section, kind: type) -> list:
    return [item for item in section.content if isinstance(item, kind)]


def test_confusion_counts_labelled_blocks_only() -> None:
    labels = ["fine"] * 8 + ["wet"] * 4 + [""] * 20
    taken = ["fine"] * 6 + ["wet"] + ["unknown"] + ["fine"] * 3 + ["wet"] + ["wet"] * 20
    section = ground_sections.recognised([ground(labels, taken)])
    (table,) = only(section, Table)
    assert table.header == ("label", "fine", "wet", "unknown", "blocks of 0.5 s")
    assert table.rows == (("fine", "75 %", "12 %", "12 %", "8"), ("wet", "75 %", "25 %", "0 %", "4"))
    # 7 of 12 right; 11 of 12 with fine and wet as one
    assert "right in 58.3 %" in section.prose[0]
    assert "in 91.7 % with fine and wet taken as one" in section.prose[0]
    assert "A note." in section.prose


def test_the_figure_marks_changes_and_names_soils() -> None:
    section = ground_sections.recognised([ground(["fine"] * 9, ["fine"] * 9)], simulated=True)
    (picture,) = only(section, Picture)
    assert "Simulated run run 1" in picture.caption
    for name in NAMES:
        assert name in picture.svg


def test_without_labels_there_is_no_confusion_but_a_sentence() -> None:
    section = ground_sections.recognised([ground([""] * 9, ["fine"] * 9)])
    assert not only(section, Table)
    assert any("no confusion matrix" in text for text in section.prose)


def test_without_a_library_no_share_of_right_soils_is_told() -> None:
    """All is unknown there, and "right in 0.0 % of the time" was said of it."""
    drive = ground(["fine"] * 9, ["unknown"] * 9)
    unnamed = replace(drive.timeline, names=("unknown",), probabilities=np.ones((9, 1)))
    section = ground_sections.recognised([replace(drive, soils=(), timeline=unnamed)])
    assert not only(section, Table)
    assert any("No soil is named" in text for text in section.prose)
    assert not any("right in" in text for text in section.prose)


def test_sections_carry_their_means_and_what_they_were_taken_for() -> None:
    section = ground_sections.section_points([ground(["fine"] * 9, ["fine"] * 9)])
    (table,) = only(section, Table)
    assert table.rows == (("run 1, 0 to 2 s", "fine", "80 %", "wet", "12.0 ± 2.0 %", "0.330 ± 0.040", "–"),)
    assert len(only(section, Picture)) == 1


def test_events_are_listed_with_their_reasons_and_short_ones_counted() -> None:
    happened = (
        Event("stuck", 1.0, 3.5, "wheels turn at 0.9 m/s, the vehicle stands"),
        Event("outlier", 4.0, 4.1, ""),
    )
    section = ground_sections.events([ground(["fine"] * 9, ["fine"] * 9, happened)])
    (table,) = only(section, Table)
    assert table.rows == (("run 1, 1.0 s", "stuck", "2.5", "wheels turn at 0.9 m/s, the vehicle stands"),)
    assert section.prose[0].startswith("1 outlier, 1 stuck")


@pytest.mark.parametrize(
    "section", [ground_sections.recognised, ground_sections.section_points, ground_sections.events]
)
def test_without_a_ground_each_section_says_so(section) -> None:
    result = section([])
    assert result.omitted
    assert "ground.json" in result.omitted


def test_a_warning_is_listed_however_short_and_its_reason_is_read_from_the_left() -> None:
    why = "The wheels begin to dig: mean slip of the wheels is 41 %, at 0.31 m/s"
    happened = tuple(
        [Event("outlier", float(i), i + 0.9, "a row that fits nothing") for i in range(60)]
        + [Event("immobilization", 70.0, 70.2, why)]
    )
    section = ground_sections.events([ground(["fine"] * 9, ["fine"] * 9, happened)])
    (table,) = only(section, Table)
    assert table.rows[0] == ("run 1, 70.0 s", "immobilization", "0.2", why)
    # sixty alike are not listed one by one
    assert [row[0] for row in table.rows[1:]] == [
        "run 1, 0.0 s",
        "run 1, 1.0 s",
        "run 1, 2.0 s",
        "run 1, 57 more",
    ]
    assert float(table.rows[-1][2]) == pytest.approx(57 * 0.9, abs=0.1)
    assert table.prose == {3}
    html = render(Page("t", "l", (section,)))
    assert f'<td class="prose">{why}</td>' in html
    assert re.search(r"td\.prose [^}]*text-align: left", html)


def test_events_of_the_estimates_are_told_of_runs_without_a_ground() -> None:
    mine = Event("stuck", 1.0, 3.5, "it stands")
    section = ground_sections.events([ground(["fine"] * 9, ["fine"] * 9)], {"run 1": [mine], "run 2": [mine]})
    (table,) = only(section, Table)
    assert [row[0] for row in table.rows] == ["run 2, 1.0 s"]  # of run 1 the ground tells


SEEN = {
    "all cones": np.eye(3),
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.01182, 0.04294, 0.968881],
    ],
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.3039],
    ],
}  # Machado, Oliveira and Fernandes (2009), severity 1
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def seen(color: str, eye: str) -> np.ndarray:
    """CIE L*a*b* of a colour as an eye sees it."""
    coded = np.array([int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    white = TO_XYZ @ np.ones(3)
    parts = TO_XYZ @ np.clip(np.array(SEEN[eye]) @ linear, 0, 1) / white
    f = np.where(parts > 0.008856, np.cbrt(parts), 7.787 * parts + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("eye", SEEN)
@pytest.mark.parametrize(
    "labels",
    [
        ["hard", "fine", "wet", "coarse", "grass"],
        ["work", "headland", "road", "standing"],
        [f"field {i}" for i in range(8)],
    ],
)
def test_colour_blind_readers_tell_labels_apart(labels: list[str], eye: str) -> None:
    """Two colours side by side differ from about 10 on (CIE 1976); two and a half is the least that can be seen."""
    colors = [seen(soil_color(name, labels), eye) for name in labels]
    apart = min(float(np.linalg.norm(a - b)) for i, a in enumerate(colors) for b in colors[:i])
    assert apart > 12


def schemes() -> list[dict[str, str]]:
    """Colours of the page's variables by name, in the light and the dark scheme."""
    css = (files("terragrip.report") / "templates/page.css").read_text(encoding="utf-8")
    return [
        dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", part)) for part in css.split("prefers-color-scheme: dark")
    ]


@pytest.mark.parametrize("scheme", [0, 1], ids=["light", "dark"])
def test_names_on_the_strip_can_be_read(scheme: int) -> None:
    """4.5 is the least contrast of a text (WCAG 2.2, 1.4.3)."""
    names = [*SOIL_COLORS, *PART_COLORS, *(f"field {i}" for i in range(30))]

    def luminance(color: str) -> float:
        color = schemes()[scheme][CSS_VARIABLES[color]] if color in CSS_VARIABLES else color
        coded = np.array([int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)])
        linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    for name in names:
        patch = soil_color(name, names)
        low, high = sorted((luminance(patch), luminance(text_color(patch))))
        assert (high + 0.05) / (low + 0.05) >= 4.5, (name, patch)


def test_labels_have_colours_of_their_own() -> None:
    names = ["hard", "fine", "wet", "coarse", "grass", *(f"field {i}" for i in range(20))]
    assert len({soil_color(name, names) for name in names}) == len(names)
