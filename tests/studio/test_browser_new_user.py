"""A new user's way in a real browser: a log with foreign names, a machine without a vehicle file, no terminal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from served import NEEDS, Served, axe_violations
from terragrip.estimation import Estimates

pytest.importorskip("playwright.sync_api", reason="SKIPPED LOUDLY: the browser tests need playwright")

pytestmark = NEEDS

WHEELS = {"fl": "Front Left", "fr": "Front Right", "rl": "Rear Left", "rr": "Rear Right"}
WIDTHS = (390, 768, 1280)


@pytest.fixture
def foreign(made: Path, tmp_path: Path) -> Path:
    """A CSV of the simulated drive with another logger's names and units, and without the soil's label."""
    table = pd.read_parquet(made / "recording.parquet")
    other = pd.DataFrame({"Stamp [ms]": np.round(1000 * table["time"]).astype(int)})
    for wheel, words in WHEELS.items():
        other[f"Wheel Speed {words} [rpm]"] = table[f"wheel_speed_{wheel}"] * 30 / np.pi
        other[f"Wheel Torque {words} [Nm]"] = table[f"drive_torque_{wheel}"]
    other["Radar Speed [km/h]"] = 3.6 * table["ground_speed"]
    other["Drawbar Pull [kN]"] = table["drawbar_force"] / 1000
    other["Pitch [deg]"] = np.degrees(table["pitch"])
    other.to_csv(tmp_path / "day1.csv", index=False, float_format="%.8g")
    return tmp_path / "day1.csv"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An empty folder."""
    target = tmp_path / "work"
    target.mkdir()
    return target


class Hand:
    """A user's hand: what it clicks is counted; a choice from a list or of a file is two clicks, a field to type in is one."""

    def __init__(self, page: Any) -> None:
        self.page, self.clicks = page, 0

    def click(self, what: str) -> None:
        self.clicks += 1
        self.page.click(what)

    def choose(self, what: str, value: str) -> None:
        self.clicks += 2
        self.page.select_option(what, value)

    def write(self, what: str, text: str) -> None:
        self.clicks += 1
        self.page.fill(what, text)

    def give(self, what: str, file: Path) -> None:
        self.clicks += 2
        with self.page.expect_file_chooser() as chooser:
            self.page.click(what)
        chooser.value.set_files(file)


def choose_columns(hand: Hand, log: Path) -> None:
    hand.give("text=choose files", log)
    hand.page.wait_for_selector("#column-ground_speed")


def make_robot(hand: Hand) -> None:
    hand.choose("#machine-class", "field-robot")
    hand.write("#machine-mass", "139 kg")
    hand.write("#machine-wheel_radius", "20 cm")
    hand.page.wait_for_selector("text=not known: mass on the front axle")


@pytest.mark.long  # a tractor's log to its estimates: below
def test_from_a_strangers_log_to_a_report_in_25_clicks(
    page: Any, served: Served, folder: Path, foreign: Path, made: Path
) -> None:
    import terragrip as tg
    from terragrip.soil.library import SoilLibrary

    hand = Hand(page)
    page.goto(served.url)
    choose_columns(hand, foreign)
    hand.click("#use-columns")
    make_robot(hand)
    hand.click("#save-machine")
    page.wait_for_selector("text=ready to estimate")
    assert page.evaluate("() => document.activeElement.id") == "step-estimate"
    hand.click("#wizard-go")
    page.wait_for_selector("#next-soils")
    page.click("#jobs >> text=Command line")  # what does the same without a browser
    assert page.inner_text("#jobs code") == (
        "terragrip estimate day1.csv --vehicle day1-vehicle.yaml --profile day1-profile.yaml --output day1-estimates.parquet"
    )
    hand.click("#next-soils")
    page.wait_for_selector("#see-soils")
    hand.click("#next-report")
    page.wait_for_selector("#see-report")
    with page.context.expect_page() as opened:
        hand.click("#see-report")
    opened.value.wait_for_load_state()
    assert "Traction report" in opened.value.inner_text("h1")
    opened.value.close()
    hand.click("#see-soils")
    page.wait_for_selector("#slider-a")
    assert hand.clicks <= 25
    names = {path.name for path in folder.iterdir()}
    assert names >= {
        "day1.csv",
        "day1-profile.yaml",
        "day1-vehicle.yaml",
        "day1-estimates.parquet",
        "day1-soils.json",
        "day1-report.html",
    }
    # the log became what it was made from, and the estimates are those of that log and that vehicle
    truth = tg.read(made / "recording.parquet")
    log = tg.read(folder / "day1.csv", folder / "day1-profile.yaml")
    for channel in ("wheel_speed_rr", "drive_torque_fl", "ground_speed", "drawbar_force", "pitch"):
        np.testing.assert_allclose(log[channel], truth[channel], rtol=1e-6, atol=1e-5)
    estimates = tg.estimate(log, tg.Vehicle.load(folder / "day1-vehicle.yaml"))
    np.testing.assert_array_equal(
        tg.Estimates.read(folder / "day1-estimates.parquet")["slip_rr"], estimates["slip_rr"]
    )
    assert list(SoilLibrary.load(folder / "day1-soils.json")) == ["field"]
    who_comes_back_finds_what_follows(page, served, folder)


def who_comes_back_finds_what_follows(page: Any, served: Served, folder: Path) -> None:
    """Of the log day1.csv, estimated and with soils; not the jobs of other logs, nor what its estimates cannot give."""
    for name in ("day1-soils.json", "day1-report.html", "day1-report.pdf"):
        (folder / name).unlink(missing_ok=True)
    (folder / "other.csv").write_bytes((folder / "day1.csv").read_bytes())
    page.goto(f"{served.url}/#/start?log=other.csv")  # it listed the jobs of other logs
    page.wait_for_selector("#wizard-go")
    page.wait_for_function("() => document.getElementById('wizard-found').textContent")
    assert page.is_hidden("#jobs")
    page.goto(f"{served.url}/#/start?log=day1.csv")
    page.wait_for_selector("#next-soils")
    page.wait_for_selector("#jobs .job")
    assert page.inner_text("#see-estimate") == "See the drive: day1-estimates.parquet"
    table = Estimates.read(folder / "day1-estimates.parquet")
    kept = {name: rows for name, rows in table.columns.items() if not name.startswith("adhesion")}
    replace(table, columns=kept).write(folder / "day1-estimates.parquet")
    page.reload()  # of slip alone: two buttons led to jobs that must fail
    page.wait_for_selector("#no-adhesion")
    page.wait_for_function("() => !document.querySelector('#next-soils, #next-ground')")
    (folder / "day1-estimates.parquet").unlink()
    page.reload()
    page.wait_for_selector("text=ready to estimate")
    page.wait_for_function("() => !document.querySelector('#next-soils')")


def test_a_columns_choice_unit_and_sign_reach_the_profile(
    page: Any, served: Served, folder: Path, foreign: Path
) -> None:
    import yaml

    hand = Hand(page)
    page.goto(served.url)
    choose_columns(hand, foreign)
    row = page.locator('[data-channel="ground_speed"]')
    assert "a speed over ground" in row.inner_text()
    assert row.locator(".outline path").get_attribute("d")
    page.click("button[aria-label='Change the sign of ground_speed']")
    assert (
        page.evaluate("() => document.activeElement.getAttribute('aria-label')")
        == "Change the sign of ground_speed"
    )
    page.fill("input[aria-label='Unit of ground_speed']", "m/s")
    page.select_option("#column-pitch", "")
    page.select_option("#column-drawbar_force", "Pitch")
    page.fill("input[aria-label='Unit of drawbar_force']", "N")
    page.fill("#profile-output", "mine.yaml")
    page.click("#use-columns")
    page.wait_for_function("() => document.getElementById('wizard-profile').value === 'mine.yaml'")
    channels = yaml.safe_load((folder / "mine.yaml").read_text())["channels"]
    assert channels["ground_speed"] == {"from": "Radar Speed", "unit": "m/s", "sign": -1}
    assert channels["drawbar_force"] == {"from": "Pitch", "unit": "N"}
    assert "pitch" not in channels


def test_a_scale_that_only_the_user_knows_is_asked_for_and_the_choice_is_that_of_the_profile(
    page: Any, served: Served, folder: Path, foreign: Path
) -> None:
    """A motor current was taken for N m, times 1, and "2,5" in a field for numbers for 25."""
    import yaml

    log = pd.read_csv(foreign, nrows=2000).rename(columns=lambda name: name.replace("Torque", "Current"))
    log.rename(columns=lambda name: name.replace("[Nm]", "[A]")).to_csv(folder / "day2.csv", index=False)
    page.goto(f"{served.url}/#/start?log=day2.csv")
    page.wait_for_selector("#column-ground_speed")
    page.click("#use-columns")
    assert page.evaluate("() => document.activeElement.ariaLabel") == "Scale of drive_torque_fl"
    for wheel in WHEELS:
        page.fill(f"[aria-label='Scale of drive_torque_{wheel}']", "2,5")
    unit = page.input_value("[aria-label='Unit of ground_speed']")
    page.fill("[aria-label='Unit of ground_speed']", "deg")
    page.click("#use-columns")
    page.wait_for_selector(".note.error")
    page.fill("[aria-label='Unit of ground_speed']", unit)
    page.click("#use-columns")
    page.wait_for_selector(".note.error", state="detached")  # what was repaired went on to be said
    page.wait_for_selector("#wizard-profile option[value='day2-profile.yaml']", state="attached")
    (kept,) = folder.glob("*-profile.yaml")
    profile = yaml.safe_load(kept.read_text())
    assert profile["channels"]["drive_torque_rr"]["scale"] == 2.5
    profile["channels"]["drive_torque_rr"]["scale"] = 3
    (folder / "other.yaml").write_text(yaml.safe_dump(profile))
    page.wait_for_selector("#wizard-profile option[value='other.yaml']", state="attached")
    page.select_option("#wizard-profile", "other.yaml")
    page.wait_for_selector("[aria-label='Scale of drive_torque_rr'][value='3']", state="attached")


def test_a_column_chosen_by_hand_comes_with_its_own_unit_and_is_nothing_else_besides(
    page: Any, served: Served, folder: Path
) -> None:
    """200 mm/s of a test rig were 200 m/s, seconds were read as the ms of the time before, and the turning wheel stayed the yaw rate."""
    import yaml

    n = np.arange(400)
    log = {"Uptime [ms]": 50 * n, "Clock [s]": 100 + n / 20, "omega_rad_s": 1.5 + n / 1000}
    log |= {"carriage_mm_s": 200 + n % 3, "speed of something": 0.2 + n / 1e5}
    pd.DataFrame(log).to_csv(folder / "rig.csv", index=False)
    page.goto(f"{served.url}/#/start?log=rig.csv")
    page.wait_for_selector("#column-ground_speed")
    assert (page.input_value("#time-column"), page.input_value("#time-unit")) == ("Uptime", "ms")
    assert page.input_value("#column-angular_velocity_z") == "omega_rad_s"  # what turns, of an unknown part
    page.select_option("#time-column", "Clock")
    page.select_option("#column-wheel_speed_fl", "omega_rad_s")
    page.select_option("#column-ground_speed", "carriage_mm_s")
    page.select_option("#column-wheel_speed_fr", "speed of something")
    assert page.input_value("#column-angular_velocity_z") == ""
    assert "no unit is stated" in page.inner_text("[data-channel=wheel_speed_fr] .why")
    page.select_option("#column-wheel_speed_fr", "")
    page.click("#use-columns")
    page.wait_for_selector("#wizard-profile option[value='rig-profile.yaml']", state="attached")
    profile = yaml.safe_load((folder / "rig-profile.yaml").read_text())
    assert profile["time"] == {"from": "Clock"}
    assert profile["channels"] == {
        "wheel_speed_fl": {"from": "omega_rad_s", "unit": "rad/s"},
        "ground_speed": {"from": "carriage_mm_s", "unit": "mm/s"},
    }


def test_a_tractor_without_sensors_at_its_free_wheels_is_estimated_without_a_text_editor(
    page: Any, served: Served, folder: Path, foreign: Path
) -> None:
    """They roll with the ground: the page asked to 'map the ground speed over the radius', and had no field where that could be done."""
    log = pd.read_csv(foreign, nrows=2000)
    log.drop(columns=[name for name in log if "Front" in name]).to_csv(folder / "day2.csv", index=False)
    page.goto(f"{served.url}/#/start?log=day2.csv")
    page.wait_for_selector("#column-ground_speed")
    page.click("#use-columns")
    page.wait_for_selector("#wizard-profile option[value='day2-profile.yaml']", state="attached")
    page.select_option("#machine-class", "tractor-2wd")
    for name, text in (("mass", "139 kg"), ("wheel_radius", "20 cm"), ("front_wheel_radius", "15 cm")):
        page.fill(f"#machine-{name}", text)
    page.click("#save-machine")
    page.wait_for_selector("text=ready to estimate")
    page.click("#wizard-go")
    page.wait_for_selector("#see-estimate")


def test_a_log_is_tried_again_when_the_studio_is_back(
    page: Any, served: Served, folder: Path, made: Path
) -> None:
    """The page went on to say that the studio does not respond, with no way to estimate but a reload."""
    for name in ("recording.parquet", "vehicle.yaml"):
        (folder / name).write_bytes((made / name).read_bytes())
    page.goto(f"{served.url}/#/start?log=recording.parquet")
    page.wait_for_selector("#wizard-go:enabled")
    served.stop()
    page.click("text=Method and file")
    page.select_option("#wizard-method", "kalman")
    page.wait_for_selector("#wizard-found:has-text('does not respond')")
    served.start()
    page.wait_for_selector("#wizard-found:has-text('ready to estimate')")
    assert page.is_enabled("#wizard-go")


def test_a_log_whose_reading_was_cut_off_is_read_when_the_studio_is_back(
    page: Any, served: Served, folder: Path, made: Path
) -> None:
    for name in ("recording.parquet", "vehicle.yaml"):
        (folder / name).write_bytes((made / name).read_bytes())
    page.route("**/api/columns?*", lambda route: route.abort("connectionrefused"))
    page.goto(f"{served.url}/#/start?log=recording.parquet")
    page.wait_for_selector("#wizard-found:has-text('cannot be read')")
    page.unroute("**/api/columns?*")
    served.stop()
    page.wait_for_selector("text=does not respond; trying again")
    served.start()
    page.wait_for_selector("#wizard-found:has-text('ready to estimate')")


def test_what_was_chosen_and_typed_outlasts_a_reload_and_another_class(
    page: Any, served: Served, folder: Path, foreign: Path, made: Path
) -> None:
    """A look at another page lost the columns chosen by hand, a second choice of the class every number of the machine."""
    pd.read_csv(foreign, nrows=2000).to_csv(folder / "day2.csv", index=False)
    page.goto(f"{served.url}/#/start?log=day2.csv")
    page.wait_for_selector("#column-ground_speed")
    page.select_option("#column-pitch", "")
    page.select_option("#machine-class", "tractor-2wd")
    page.fill("#machine-mass", "6.200 kg")  # of a German: it was a tractor of 6.2 kg, without a word
    page.wait_for_selector("#typical-mass.bad:has-text('6.2 kg: far from what is typical')")
    page.fill("#machine-mass", "139 kg")
    page.wait_for_selector("#typical-mass:has-text('139 kg')")
    page.select_option("#machine-class", "field-robot")
    page.wait_for_selector("#typical-wheel_radius:has-text('Innok Heros')")
    page.wait_for_selector("#typical-mass:text-is('139 kg')")
    page.reload()
    page.wait_for_selector("#choose-columns >> text=not saved yet")
    assert page.input_value("#column-pitch") == ""
    page.wait_for_selector("#typical-mass:text-is('139 kg')")
    assert page.input_value("#machine-class") == "field-robot"
    page.click("#use-columns")
    page.wait_for_selector("#wizard-profile option[value='day2-profile.yaml']", state="attached")
    page.reload()
    page.wait_for_selector("#choose-columns >> text=The choice saved in", state="attached")
    page.click("#choose-columns summary")
    page.select_option("#column-ground_speed", "")
    (folder / "vehicle.yaml").write_bytes((made / "vehicle.yaml").read_bytes())
    page.select_option("#wizard-vehicle", "vehicle.yaml")
    page.wait_for_selector("#wizard-go:enabled")
    asked: list[str] = []
    page.once("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
    page.click("#wizard-go")  # it estimated by the profile as saved, under a form that showed another choice
    assert asked == [
        "The columns were changed, and the change is not used yet. Estimate by day2-profile.yaml as it is?"
    ]


def test_a_command_over_ticked_files_and_the_focus_stays_at_its_button(
    page: Any, served: Served, folder: Path, made: Path
) -> None:
    for name in ("a.parquet", "b.parquet", "c.parquet"):
        (folder / name).write_bytes((made / "recording.parquet").read_bytes())
    (folder / "vehicle.yaml").write_bytes((made / "vehicle.yaml").read_bytes())
    page.goto(served.url)
    page.check("[aria-label='choose a.parquet']")
    page.check("[aria-label='choose c.parquet']")
    page.click("[data-key='do batch']")
    page.click("#job-go")
    page.wait_for_selector(".state.done")
    page.wait_for_selector("text=estimates/c.parquet")
    assert sorted(path.name for path in (folder / "estimates").iterdir()) == ["a.parquet", "c.parquet"]
    assert page.evaluate("() => document.activeElement.dataset.key") == "do batch"


def test_of_several_vehicles_none_is_taken_for_the_logs(
    page: Any, served: Served, folder: Path, made: Path
) -> None:
    """The first by its name would estimate the robot's log with a tractor's mass, and look as well as the right one."""
    for name in ("a.parquet", "b.parquet"):
        (folder / name).write_bytes((made / "recording.parquet").read_bytes())
    (folder / "big.yaml").write_bytes((made / "vehicle.yaml").read_bytes())
    page.goto(f"{served.url}/#/start?log=a.parquet")
    page.wait_for_selector("#only-vehicle:has-text('no other vehicle file')")
    assert page.input_value("#wizard-vehicle") == "big.yaml"
    (folder / "robot.yaml").write_bytes((made / "vehicle.yaml").read_bytes())
    page.reload()
    page.wait_for_selector("#wizard-found:has-text('choose the vehicle')")
    assert page.is_hidden("#only-vehicle")
    assert page.is_disabled("#wizard-go")
    page.select_option("#wizard-vehicle", "big.yaml")
    page.wait_for_selector("text=ready to estimate")
    page.click("#wizard-go")
    page.wait_for_selector("#next-soils")
    page.click("#next-soils")
    page.wait_for_selector("#see-soils")
    page.select_option("#wizard-vehicle", "robot.yaml")
    page.wait_for_selector("#wizard-go:enabled")
    page.click("#wizard-go")
    page.wait_for_selector("#see-estimate:has-text('a-estimates-2.parquet')")
    assert not page.query_selector("#see-soils")  # a report would have shown the curve of the wrong vehicle
    page.reload()  # the last choice is known by the work that was done
    page.wait_for_selector("#see-estimate:has-text('a-estimates-2.parquet')")
    assert page.input_value("#wizard-vehicle") == "robot.yaml"
    rows = page.inner_text("#wizard-found .good")
    (folder / "third.yaml").write_bytes((made / "vehicle.yaml").read_bytes())
    pd.read_parquet(folder / "a.parquet").iloc[:3000].to_parquet(folder / "a.parquet")
    page.click("#read-again")  # the page went on with the rows of the log before
    page.wait_for_selector("#wizard-found:has-text('3,000 rows, ready to estimate')")
    assert not rows.startswith("3,000")
    assert page.locator("#wizard-vehicle option[value='third.yaml']").count() == 1
    page.goto(f"{served.url}/#/start")
    page.click("[data-key='do batch']")
    assert page.is_disabled("#job-go")
    page.select_option("#job-vehicle", "big.yaml")
    assert page.is_enabled("#job-go")


def test_what_a_long_log_waits_for_is_said(page: Any, served: Served, folder: Path, made: Path) -> None:
    """Ten hours at 50 Hz: twenty seconds of four empty headings, then as many of a button that could not be pressed."""
    for name in ("recording.parquet", "vehicle.yaml"):
        (folder / name).write_bytes((made / name).read_bytes())
    held: list[Any] = []
    for name in ("columns", "inspect"):
        page.route(f"**/api/{name}?*", lambda route: held.append(route))
    page.goto(f"{served.url}/#/start?log=recording.parquet")
    page.wait_for_selector("#step-columns ~ * >> text=Reading the log")
    held.pop().continue_()
    page.wait_for_selector("#wizard-found >> text=Trying an estimate")
    held.pop().continue_()
    page.wait_for_selector("text=ready to estimate")


def test_a_click_on_save_counts_while_the_page_asks_the_server(
    page: Any, served: Served, folder: Path
) -> None:
    """The page asks a little after the last key: a press that begins before that and ends after it is one click."""
    page.goto(f"{served.url}/#/start?machine")
    page.wait_for_selector("#machine-class option[value='rover']", state="attached")
    page.select_option("#machine-class", "rover")
    page.wait_for_selector("#save-machine:enabled")
    page.wait_for_selector(".costs table")
    held: list[Any] = []
    page.route("**/machines/made", lambda route: held.append(route))
    with page.expect_request("**/machines/made"):
        page.fill("#machine-mass", "50 kg")
        page.hover("#save-machine")
        page.mouse.down()
    with page.expect_response("**/machines/file"):
        page.mouse.up()
    for route in held:
        route.continue_()
    (made,) = folder.glob("*.yaml")
    assert "50" in made.read_text()


def test_an_impossible_number_is_said_and_nothing_is_saved(
    page: Any, served: Served, folder: Path, foreign: Path
) -> None:
    page.goto(f"{served.url}/#/start?machine")
    page.wait_for_selector("#machine-class option[value='rover']", state="attached")
    page.select_option("#machine-class", "rover")
    page.fill("#machine-mass", "50 kg")
    page.wait_for_selector(".sketch")
    page.fill("#machine-wheel_radius", "-3 cm")
    page.wait_for_selector(
        "#machine-wheel_radius[aria-invalid=true] + #machine-problem:has-text('impossible')"
    )
    assert page.query_selector(".maker-picture.of-before")  # what is drawn is of the numbers before
    assert page.is_disabled("#save-machine")
    assert list(folder.glob("*.yaml")) == []
    page.fill("#machine-wheel_radius", "3 cm")
    page.wait_for_selector(".maker-picture:not(.of-before)")


def test_a_matlab_logs_own_times_are_not_asked_for(
    page: Any, served: Served, folder: Path, tmp_path: Path
) -> None:
    time = np.arange(0.0, 30.0, 0.1)
    speed = 1 + 0.2 * np.sin(time)
    savemat(tmp_path / "run.mat", {"data": {"time": time, "omega_fl": 5 * speed, "v_gps": speed}})
    page.goto(served.url)
    choose_columns(Hand(page), tmp_path / "run.mat")
    assert page.inner_text("#time-column option:checked") == "the log's own times"
    page.click("#use-columns")
    page.wait_for_selector("#wizard-profile option[value='run-profile.yaml']", state="attached")
    assert "time: {from: time}" in (folder / "run-profile.yaml").read_text()


def test_the_pages_fit_every_width_and_axe_finds_nothing_serious(
    page: Any, served: Served, folder: Path, foreign: Path
) -> None:
    (folder / "day1.csv").write_bytes(foreign.read_bytes())
    faults = []
    for where, ready in (
        ("start", "text=day1.csv"),
        ("start?log=day1.csv", "#use-columns"),
        ("start?machine", "#machine-class"),
    ):
        page.set_viewport_size({"width": WIDTHS[0], "height": 800})
        page.goto(f"{served.url}/icon.svg")
        page.goto(f"{served.url}/#/{where}")
        page.wait_for_selector(ready)
        if "start?" in where:
            page.wait_for_selector("#machine-class option[value='tractor-4wd']", state="attached")
            page.select_option("#machine-class", "tractor-4wd")
            page.wait_for_selector(".costs table")
        for theme in ("light", "dark"):
            faults += [
                f"{where}, {theme}: {fault}" for fault in axe_violations(page, theme, ("serious", "critical"))
            ]
        for width in WIDTHS:
            page.set_viewport_size({"width": width, "height": 800})
            wide = page.evaluate(
                "() => { const m = document.querySelector('main'); return m.scrollWidth - m.clientWidth; }"
            )
            faults += [f"{where} at {width}: {wide} px too wide"] if wide > 0 else []
    assert faults == []


def test_matrices_of_simulink_are_assigned_to_the_wheels(
    page: Any, served: Served, folder: Path, made: Path
) -> None:
    """Nothing names the wheels of omega (n, 4): it was proposed as the machine's rate of turn, and the page went on to say that
    the log has no wheel speed when four had been chosen."""
    table = pd.read_parquet(made / "recording.parquet").dropna(subset=["wheel_speed_fl", "ground_speed"])
    omega = table[[f"wheel_speed_{wheel}" for wheel in WHEELS]].to_numpy()
    series = {"Time": table["time"].to_numpy(), "Units": "rad/s", "Data": omega}
    savemat(
        folder / "run.mat",
        {"logs": {"omega": series, "v": series | {"Units": "m/s", "Data": table["ground_speed"].to_numpy()}}},
    )
    page.goto(f"{served.url}/#/start?log=run.mat")
    page.wait_for_selector(".bad:has-text('This log has no wheel speed')")
    assert page.input_value("#column-ground_speed") == "logs.v"
    assert page.input_value("#column-angular_velocity_z") == ""
    page.select_option("#column-wheel_speed_fl", "logs.omega[0]")
    page.wait_for_selector(".bad:has-text('This log has no wheel speed')", state="detached")
    page.fill("#profile-output", "profile.txt")
    page.click("#use-columns")
    page.wait_for_selector(".note.error")
    page.click("nav >> text=Fit")  # an error stays, but not for another page's user
    page.wait_for_selector(".note.error", state="detached")


def test_a_log_that_is_opened_again_is_as_it_was_left(
    page: Any, served: Served, folder: Path, foreign: Path, made: Path
) -> None:
    """The proposals came again in place of the saved choice, and of several vehicles none, until an estimate had been made."""
    for name in ("big.yaml", "robot.yaml"):
        (folder / name).write_bytes((made / "vehicle.yaml").read_bytes())
    page.goto(served.url)
    choose_columns(Hand(page), foreign)
    page.click("button[aria-label='Change the sign of ground_speed']")
    page.select_option("#column-pitch", "")
    page.select_option("#column-drawbar_force", "Pitch")
    page.fill("input[aria-label='Unit of drawbar_force']", "N")
    page.fill("#profile-output", "mine.yaml")
    page.click("#use-columns")
    page.wait_for_selector("#wizard-profile option[value='mine.yaml']", state="attached")
    page.select_option("#wizard-vehicle", "robot.yaml")
    page.wait_for_selector("#wizard-go:enabled")
    saved = (folder / "mine.yaml").read_text()
    page.reload()
    page.wait_for_selector("#as-left:has-text('read by mine.yaml, vehicle robot.yaml')")
    page.wait_for_selector("#wizard-go:enabled")
    page.click("#choose-columns > summary")
    assert page.input_value("#column-pitch") == ""
    assert page.input_value("#column-drawbar_force") == "Pitch"
    assert page.inner_text("button[aria-label='Change the sign of ground_speed']") == "\u2212"
    assert page.input_value("#profile-output") == "mine.yaml"
    page.once("dialog", lambda dialog: dialog.accept())
    with page.expect_response("**/api/profile"):
        page.click("#use-columns")
    assert (folder / "mine.yaml").read_text() == saved
    page.reload()
    page.click("#propose")
    page.wait_for_function("() => document.getElementById('column-pitch')?.value === 'Pitch'")
    assert page.query_selector("#as-left") is None
    assert page.input_value("#profile-output") == "day1-profile.yaml"
    assert (folder / "mine.yaml").read_text() == saved
