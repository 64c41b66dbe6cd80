"""InputError: one line, its parts in order, and whole after a worker process."""

from __future__ import annotations

import pickle
from pathlib import Path

from terragrip.errors import InputError


def test_text_is_file_place_problem_mend() -> None:
    error = InputError("is negative", file=Path("robot.yaml"), place="mass", hint="give kilograms above zero")
    assert str(error) == "robot.yaml: mass: is negative; give kilograms above zero"


def test_missing_parts_leave_no_marks() -> None:
    assert str(InputError("no wheels")) == "no wheels"
    assert str(InputError("no wheels", hint="name one")) == "no wheels; name one"


def test_text_is_one_line_whatever_comes_in() -> None:
    error = InputError("line one\n  line two", file="a.csv", place="row\t3", hint="hint\r\nit")
    assert str(error) == "a.csv: row 3: line one line two; hint it"


def test_pickle_keeps_text_and_parts() -> None:
    error = InputError("broken", file="a.csv", place="row 3", hint="hint it")
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    assert (again.problem, again.file, again.place, again.hint) == ("broken", "a.csv", "row 3", "hint it")
