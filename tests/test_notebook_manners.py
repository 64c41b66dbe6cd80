"""What results show in a notebook: tables as HTML, figures, summaries by label, frames with a clock."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pandas as pd
import pytest

import terragrip as tg
from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.ground.analysis import analyse
from terragrip.ground.events import Event
from terragrip.ground.sections import Section
from terragrip.ground.span import Span
from terragrip.ground.views import table_of
from terragrip.simulation import Scenario, simulate
from terragrip.soil.estimates import GatheredRuns

pytestmark = pytest.mark.usefixtures("one_form")

pytest.importorskip("matplotlib", reason="figures need terragrip[report]")


@pytest.fixture(scope="module")
def run() -> Any:
    return simulate(Scenario.load("multi2").model_copy(update={"duration": 250.0}), 1000)


@pytest.fixture(scope="module")
def estimates(run: Any) -> Estimates:
    time = run.recording.time
    log = run.recording.with_channels(latitude=51 + 1e-9 * time, longitude=13 + 7e-6 * time)
    return tg.estimate(replace(log, start=1.7e9), run.vehicle)


class Cells(HTMLParser):
    """The cells of all tables, and whether every tag was closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.cells: list[str] = []
        self.open: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.open.append(tag)
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("td", "th"):
            self.cells[-1] += data


def is_drawn(figure: Any) -> bool:
    """Whether the figure shows itself as a picture with something on it."""
    import io

    from matplotlib.image import imread

    picture = imread(io.BytesIO(figure._repr_png_()))
    return bool(np.ptp(picture[..., :3]) > 0.5) and all(axes.has_data() for axes in figure.axes)


def test_estimates_as_a_table(estimates: Estimates) -> None:
    noted = replace(estimates, notes=("a <script> & more",))
    text = noted._repr_html_()
    cells = Cells(text).cells
    calm = estimates.event_codes == 0
    shown = (
        f"{np.nanmedian(estimates['slip_fl'][calm]):.3f} ± {np.nanmedian(estimates['slip_fl_std'][calm]):.3f}"
    )
    assert shown in cells
    assert "a &lt;script&gt; &amp; more" in text
    assert "2023-11-14 22:13:20 UTC" in text


@pytest.mark.parametrize("kind", ["time", "plane", "map"])
def test_estimates_are_drawn(estimates: Estimates, kind: Any) -> None:
    assert is_drawn(estimates.plot(kind))


def test_each_soil_of_the_plane_has_its_own_points(estimates: Estimates) -> None:
    axes = estimates.plot("plane").axes[0]
    calm = (estimates.event_codes == 0) & np.isfinite(estimates["slip_fl"])
    soils = sorted(set(estimates["soil"][calm]))
    lines = {line.get_label(): line.get_xydata() for line in axes.get_lines() if line.get_label() in soils}
    assert len(soils) > 1
    assert list(lines) == soils
    for soil, points in lines.items():
        rows = calm & (estimates["soil"] == soil)
        own = {
            pair
            for w in estimates.wheels
            for pair in zip(estimates[f"slip_{w}"][rows], estimates[f"adhesion_{w}"][rows], strict=True)
        }
        assert {tuple(point) for point in points} <= own


def test_what_cannot_be_drawn_is_refused(estimates: Estimates) -> None:
    with pytest.raises(InputError, match="take one of time, plane, map"):
        estimates.plot("pie")  # type: ignore[arg-type]
    nowhere = replace(estimates, columns={k: v for k, v in estimates.columns.items() if k != "latitude"})
    with pytest.raises(InputError, match="no positions"):
        nowhere.plot("map")
    with pytest.raises(InputError, match=r"'torque'.*slip"):
        estimates.plot("map", "torque")


def test_the_summary_by_soil_is_what_pandas_groups(estimates: Estimates) -> None:
    found = estimates.summary(by="soil")
    table = estimates.to_pandas()
    assert set(found.index) == set(table["soil"])
    assert found["rows"].sum() == len(estimates)
    calm = table[table["event"] == ""].groupby("soil")
    for column in ("slip_fl", "slip_fl_std", "adhesion_rr", "soil_resistance"):
        pd.testing.assert_series_equal(found[column], calm[column].median(), check_index_type=False)
    assert found["seconds"].sum() == pytest.approx(estimates.time[-1] - estimates.time[0])
    assert found["metres"].sum() == pytest.approx(estimates["distance"][-1] - estimates["distance"][0])
    assert estimates.summary(by="event").loc["standstill", "rows"] == (table["event"] == "standstill").sum()
    with pytest.raises(InputError, match=r"no label 'field'.*event, soil"):
        estimates.summary(by="field")


def test_sections_and_events_are_spans(estimates: Estimates) -> None:
    ground, _ = analyse(estimates, None, "multi2")
    assert {type(one) for one in ground.events} == {Event}
    assert {type(one) for one in ground.sections} == {Section}
    every: list[Span] = [*ground.sections, *ground.events]
    for span in every:
        assert span.seconds == span.end - span.start
        assert span.rows(estimates.time).sum() >= 1
    assert len(table_of(ground.events)) == len(ground.events)
    assert list(ground.to_pandas()["start"]) == [one.start for one in ground.sections]
    assert ground.events[0].kind in Cells(ground._repr_html_()).cells
    assert is_drawn(ground.plot())


def test_soils(estimates: Estimates) -> None:
    gathered = GatheredRuns()
    gathered.add(estimates, "multi2")
    campaign = gathered.learn(tg.AdhesionCurve(bootstrap=20))
    assert campaign.soils
    table = campaign.to_pandas()
    assert list(table.index) == list(campaign.soils)
    name = table.index[0]
    twice = replace(gathered, makers={"ukf", estimates.method}).learn(tg.AdhesionCurve(bootstrap=0))
    for made, by in ((campaign, estimates.method), (twice, " and ".join(sorted({"ukf", estimates.method})))):
        assert made.soils[name].soil.fit["signature"]["made_by"] == by
    assert table.loc[name, "a"] == campaign.soils[name].soil.parameters["a"]
    for shown in (campaign, campaign.library(), campaign.soils[name].curve):
        assert is_drawn(shown.plot())
        assert Cells(shown._repr_html_()).cells
    assert "not fitted" in tg.AdhesionCurve()._repr_html_()
    with pytest.raises(InputError, match="not fitted"):
        tg.AdhesionCurve().plot()


def test_a_calibration() -> None:
    from terragrip.estimation.calibration.result import Calibration, Evidence, Quantity, Unknown

    evidence = (Evidence("log", 0.0, 10.0, 50),)
    gains = [
        Quantity("drive_torque_gain", 1.02 + 0.01 * k, 0.01, "1", evidence, "by tow", wheel=w)
        for k, w in enumerate(("fl", "fr"))
    ]
    found = Calibration(
        (*gains, Quantity("drawbar_offset", 3.0, 1.0, "N", evidence, "at rest")),
        (Unknown("pitch", "flat <1 deg>"),),
    )
    assert list(found.to_pandas().index) == ["drive_torque_gain fl", "drive_torque_gain fr", "drawbar_offset"]
    assert found.to_pandas().loc["drawbar_offset", "low"] == pytest.approx(3 - 1.96, abs=1e-3)
    assert "flat &lt;1 deg&gt;" in found._repr_html_()
    assert is_drawn(found.plot())
    with pytest.raises(InputError, match="no quantity"):
        Calibration((), ()).plot()


def test_a_recording_as_a_table(run: Any) -> None:
    cells = Cells(run.recording._repr_html_()).cells
    assert {"ground_speed", "m/s", "wheel_speed_fl", "rad/s"} <= set(cells)


def test_what_a_terminal_shows_is_one_line_and_a_mistyped_column_is_suggested(
    run: Any, estimates: tg.Estimates
) -> None:
    curve = tg.AdhesionCurve(bootstrap=0).fit(estimates["slip_rr"], estimates["adhesion_rr"])
    assert f"{len(estimates)} rows" in repr(estimates)
    assert "ground_speed" in repr(run.recording)
    assert f"a={curve.parameters_['a']:.4g}" in repr(curve)
    assert max(len(repr(one)) for one in (estimates, run.recording, curve)) < 600
    for table in (estimates, run.recording):
        with pytest.raises(KeyError, match="no column ground_sped; did you mean ground_speed"):
            table["ground_sped"]


def test_tables_are_read_by_name_and_say_so(run: Any, estimates: Estimates) -> None:
    """`list(recording)` was an AttributeError of an int, `pd.DataFrame(estimates)` a column of names."""
    for table in (run.recording, estimates):
        assert list(table) == list(table.names) == list(table.to_pandas())
        assert "time" in table
        assert list(pd.DataFrame(dict(table))) == list(table.names)
        assert 0 not in table
        uses: list[Callable[[], Any]] = [
            lambda one=table: one[:5],
            lambda one=table: one[0],
            lambda one=table: one[["time", "ground_speed"]],
            lambda one=table: one[one["ground_speed"] > 0.1],
            lambda one=table: np.array(one),
            lambda one=table: pd.DataFrame(one),
        ]
        for use in uses:
            with pytest.raises(
                TypeError, match=r"rows are \w+\.select\(rows\), a DataFrame is \w+\.to_pandas\(\)"
            ):
                use()
        with pytest.raises(AttributeError, match=r"no 'head': a column is \w+\['time'\]"):
            table.head()
        assert not hasattr(table, "items")


def test_what_is_no_vehicle_is_refused_by_the_way_to_one(run: Any) -> None:
    """A page of pydantic's, or `'str' object has no attribute 'wheels'`."""
    data = run.vehicle.to_dict()
    way = r"is no vehicle; give what Vehicle\.load\(path\) returns, or Vehicle\.from_dict\(data\)"
    for wrong in (data, "robot.yaml", None):
        for call in (
            lambda it: tg.estimate(run.recording, it),
            lambda it: tg.calibrate(run.recording, it),
            tg.TractionEstimator,
        ):
            with pytest.raises(InputError, match=way):
                call(wrong)
    assert tg.Vehicle(**data) == run.vehicle
    for make, match in (
        (lambda: tg.Vehicle("robot.yaml"), r"Vehicle\.load\(path\) reads a file"),
        (lambda: tg.Vehicle(mass=100), "axles: is missing; add it"),
        (lambda: tg.Vehicle(**data | {"mas": 100}), "mas: unknown key; did you mean mass"),
        (lambda: tg.Vehicle(**data | {"mass": "heavy"}), "mass: 'heavy' is not a number with a unit"),
        (lambda: setattr(run.vehicle, "mass", 300), "mass: cannot be changed; change the file"),
        (lambda: tg.Profile({}), r"Profile\.from_dict\(data\) a dict"),
    ):
        with pytest.raises(InputError, match=match):
            make()


def test_a_file_of_estimates_needs_a_name(run: Any, estimates: Estimates) -> None:
    for call in (estimates.write, lambda it: tg.estimate_file(run.recording, run.vehicle, it)):
        with pytest.raises(InputError, match="NoneType is no path; give the path of a file"):
            call(None)


def test_slips_in_per_cent_are_refused(estimates: tg.Estimates) -> None:
    curve = tg.AdhesionCurve(bootstrap=0).fit(estimates["slip_rr"], estimates["adhesion_rr"])
    for call in (
        lambda: curve.predict(20),
        lambda: curve.fit(100 * estimates["slip_rr"], estimates["adhesion_rr"]),
    ):
        with pytest.raises(InputError, match="divide per cents by 100"):
            call()


@pytest.mark.parametrize("name", [n for n in tg.__all__ if n not in ("__version__", "InputError")])
def test_public_signatures_are_typed(name: str) -> None:
    """Every public function and method says what it takes and what it gives."""
    public = getattr(tg, name)
    made = [public] if not isinstance(public, type) else [v for k, v in vars(public).items() if k[0] != "_"]
    for one in made:
        function = getattr(one, "__func__", getattr(one, "fget", one))
        if callable(function) and hasattr(function, "__code__"):
            code = function.__code__
            named = set(code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]) - {"self", "cls"}
            assert named | {"return"} <= set(function.__annotations__), function


def test_estimates_and_views_load_no_drawing_library_until_they_draw() -> None:
    code = (
        "import sys, numpy as np\nimport terragrip.estimation.estimates, terragrip.ground.result, terragrip.soil.library\n"
        "print([m for m in ('matplotlib', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_time_axis_says_which_clock_its_0_is(estimates: Estimates) -> None:
    labels = [axes.get_xlabel() for axes in estimates.plot().axes]
    assert labels[-1] == "time [s], from 0 at 2023-11-14 22:13:20 UTC"
    assert set(labels[:-1]) == {""}
