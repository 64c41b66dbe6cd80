"""GroundClassifier: learn grounds from labelled recordings, and classify others window by window, in scikit-learn's manner."""

from __future__ import annotations

import inspect
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.ground.classification.channels import (
    held_channels,
    shortest_period,
    signals_of,
    tables_of,
    wheels_of,
)
from terragrip.ground.classification.comparable import not_comparable, rates_apart, without
from terragrip.ground.classification.experts import FEWEST_WINDOWS, train_experts
from terragrip.ground.classification.labels import UNKNOWN, classes_of, one_each
from terragrip.ground.classification.learnt import Judgement, Learnt
from terragrip.ground.classification.training_set import collect, layout_of

if TYPE_CHECKING:
    import pandas as pd


class GroundClassifier:
    """Classifies grounds by windows of wheel speed, torque or current, and body motion, with any of these.

    Parameters
    ----------
    window: length of a window [s].
    step: time from one window to the next in prediction [s]; None: one window, so that they do not overlap.
    rejection: share of windows on known grounds, from runs not trained on, that may be called ``unknown``;
        0 always names a ground where any trained set of sensors was measured.
    smooth: length of time [s] over which neighbouring windows of one recording share their evidence, novelty too; 0: each
        window is classified by itself alone.
    max_windows: windows of each ground to train on; rarer grounds are cut into windows that overlap more.
    random_state: seed of the draws in training; the same data and seed give the same classifier.

    After `fit`: ``classes_`` (the labels, sorted), ``n_features_in_``, ``feature_names_in_``, ``sensors_`` (the sets
    of sensors that it can classify from), ``notes_`` (sentences on data left out or learned in another way).

    Recordings are `Recording` or tables with recording columns (architecture.md, contracts); a motor current may be
    ``drive_torque_<wheel>`` in any unit or ``motor_current_<wheel>``. Sensors may be missing in any of them:
    there is an expert for each set of sensors, and a window goes to the one that uses most of its sensors.

    Method: support vector machines (Boser, Guyon, Vapnik 1992) on features of the window (`features`). Where wheel speeds
    are measured, a law of the other sensors given the motion (`motion_law`) is added; where only wheels are measured, extremely
    randomised trees (Geurts, Ernst, Wehenkel 2006). Probabilities after Platt (1999) from recordings held out, all grounds
    assumed equally likely beforehand.
    """

    def __init__(
        self,
        window: float = 1.7,
        *,
        step: float | None = None,
        rejection: float = 0.02,
        smooth: float = 0.0,
        max_windows: int = 1500,
        random_state: int = 0,
    ) -> None:
        self.window = window
        self.step = step
        self.rejection = rejection
        self.smooth = smooth
        self.max_windows = max_windows
        self.random_state = random_state

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The constructor's parameters by name."""
        return {name: getattr(self, name) for name in inspect.signature(type(self)).parameters}

    def set_params(self, **parameters: Any) -> Self:
        """Change parameters; raises InputError on an unknown name."""
        known = self.get_params()
        for name, value in parameters.items():
            if name not in known:
                raise InputError("is no parameter", place=name, hint=f"there are {', '.join(known)}")
            setattr(self, name, value)
        return self

    def __sklearn_tags__(self) -> Any:
        """Marks this estimator as a classifier for scikit-learn's cross-validation."""
        from sklearn.utils import ClassifierTags, Tags, TargetTags

        return Tags("classifier", TargetTags(required=True), classifier_tags=ClassifierTags())

    def __repr__(self) -> str:
        defaults = inspect.signature(type(self)).parameters
        changed = (f"{n}={v!r}" for n, v in self.get_params().items() if v != defaults[n].default)
        return f"{type(self).__name__}({', '.join(changed)})"

    def fit(self, recordings: Iterable[Any], labels: Sequence[Any]) -> Self:
        """Learn from recordings, one label each.

        Raises InputError (a ValueError) on parameters out of range, on labels that are not one for each recording,
        fewer than two grounds, recordings without a usable channel, or too short; and if scikit-learn is missing.
        """
        self.check_parameters()
        tables = tables_of(recordings)
        classes, codes = classes_of(labels, len(tables))
        left_out, notes = not_comparable(tables, codes)
        tables = [without(table, left_out) for table in tables]
        held = held_channels(tables)
        signals = [signals_of(table, held) for table in tables]
        for recorded, (_, _, name) in zip(signals, tables, strict=True):
            if not recorded.families:
                hint = "give wheel_speed_*, drive_torque_*, acceleration_* or angular_velocity_* columns, or leave it out"
                raise InputError("has no usable channel", file=name, hint=hint)
        notes += rates_apart(signals, codes)
        layout, slow = layout_of(signals, self.window)
        if not layout.period:
            fastest = min(shortest_period(family) for one in signals for family in one.families.values())
            problem = f"{self.window:g} s is shorter than two samples, which come every {fastest:.3g} s"
            raise InputError(problem, place="window", hint=f"use a window of {4 * fastest:.2g} s or more")
        random = np.random.default_rng(self.random_state)
        training = collect(signals, codes, layout, self.max_windows, random)
        notes += [
            f"{family}: sampled too slowly for windows of {self.window:g} s, not used." for family in slow
        ]
        notes += [f"{name}: logged with repeats, true updates every {p:.2g} s." for name, p in held.items()]
        experts, remarks = train_experts(training, classes, int(random.integers(2**31)))
        used = {name for expert in experts for name in expert.features}
        names = tuple(name for name in training.names if name in used)
        return self._know(
            Learnt(
                classes, names, tuple(experts), layout, held, (*notes, *remarks), left_out, wheels_of(signals)
            )
        )

    def predict(self, recordings: Iterable[Any]) -> npt.NDArray[Any]:
        """The label (windows,) of each window, ``"unknown"`` where none fits; recordings follow one another.

        `windows` gives the recording and time of each row. Raises InputError as `fit` does on tables that
        cannot be read, and if not fitted.
        """
        return self._grounds(self._judge(recordings)[0])

    def predict_proba(self, recordings: Iterable[Any]) -> Floats:
        """Probability (windows, classes) of each class in ``classes_``, given that the ground is one of them.

        A window without usable sensors has equal probabilities. Raises InputError as `predict`.
        """
        return self._judge(recordings)[0].probabilities

    def novelty(self, recordings: Iterable[Any]) -> Floats:
        """Share (windows,) of windows on known grounds, from runs not trained on, that are at least as atypical.

        `predict` gives unknown below ``rejection``. NaN where no usable sensor was measured. Raises InputError as `predict`.
        """
        return self._judge(recordings)[0].novelty

    def windows(self, recordings: Iterable[Any]) -> pd.DataFrame:
        """The window of each row of a prediction: columns ``recording`` (its number), ``start`` and ``end`` [s]."""
        learnt = self._known()
        starts = [learnt.windows(table, self.step) for table in tables_of(recordings)]
        return _windows(np.concatenate([np.empty(0), *starts]), [*map(len, starts)], learnt)

    def judge(self, recordings: Iterable[Any]) -> pd.DataFrame:
        """All results for every window, classified once: the columns of `windows`, ``ground`` (`predict`), ``novelty`` and
        ``probability_<class>`` (`predict_proba`). Raises InputError as `predict`.
        """
        every, counts = self._judge(recordings)
        table = _windows(every.starts, counts, self._known())
        table["ground"] = self._grounds(every)
        table["novelty"] = every.novelty
        for k, name in enumerate(self.classes_):
            table[f"probability_{name}"] = every.probabilities[:, k]
        return table

    def too_slow(self, recording: Any) -> list[str]:
        """A sentence on each kind of sensor that is sampled too slowly in a recording to be judged. Raises InputError as `predict`."""
        (table,) = tables_of([recording])
        return self._known().too_slow(table)

    def score(self, recordings: Iterable[Any], labels: Sequence[Any]) -> float:
        """Share of windows whose label is that of their recording; unknown counts as wrong. Raises InputError."""
        listed = list(recordings)
        truth = one_each(labels, len(listed))
        result = self.predict(listed)
        of_window = self.windows(listed)["recording"].to_numpy()
        return float(np.mean([a == truth[k] for a, k in zip(result.tolist(), of_window, strict=True)]))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the classifier to one file of numbers and text only; raises InputError if it cannot."""
        from terragrip.ground.classification.storage import save

        save(self.get_params(), self._known(), path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> GroundClassifier:
        """Read a classifier that `save` wrote; raises InputError on a foreign, damaged or newer file."""
        from terragrip.ground.classification.storage import load

        return load(path, cls.restored)

    @classmethod
    def restored(cls, parameters: Mapping[str, Any], learnt: Learnt) -> Self:
        """A fitted classifier from its parameters and learned values; raises InputError on parameters out of range."""
        classifier = cls(**parameters)
        classifier.check_parameters()
        return classifier._know(learnt)

    def _judge(self, recordings: Iterable[Any]) -> tuple[Judgement, list[int]]:
        """Classify the windows of all recordings, one recording after another; and how many each has."""
        learnt = self._known()
        self.check_parameters()
        judged = [learnt.judge(table, self.step, self.smooth) for table in tables_of(recordings)]
        nothing = Judgement(np.empty(0), np.empty((0, len(self.classes_))), np.empty(0))
        every = Judgement(*(np.concatenate(parts) for parts in zip(nothing, *judged, strict=True)))
        return every, [len(one.starts) for one in judged]

    def _grounds(self, judged: Judgement) -> npt.NDArray[Any]:
        """The likeliest class of each window, or unknown."""
        labels = self.classes_[judged.probabilities.argmax(axis=1)]
        strange = ~(judged.novelty >= self.rejection)  # NaN, too
        if not strange.any():
            return labels
        if labels.dtype.kind != "U":
            labels = labels.astype(object)
        return np.where(strange, np.array(UNKNOWN, dtype=object if labels.dtype == object else None), labels)

    def _know(self, learnt: Learnt) -> Self:
        self._learnt = learnt
        self.classes_ = learnt.classes
        self.feature_names_in_ = np.array(learnt.features, dtype=object)
        self.n_features_in_ = len(learnt.features)
        self.sensors_ = tuple(tuple(sorted(expert.families)) for expert in learnt.experts)
        self.notes_ = learnt.notes
        return self

    def _known(self) -> Learnt:
        """The learned values; raises InputError if the classifier is not fitted."""
        if not hasattr(self, "_learnt"):
            raise InputError("the classifier knows no ground yet", hint="call fit(recordings, labels) first")
        return self._learnt

    def check_parameters(self) -> None:
        """Raises InputError at the first parameter out of its range; `fit` and `predict` call it themselves."""
        ranges = {
            "window": (0.0, np.inf, False),
            "step": (0.0, np.inf, False),
            "rejection": (0.0, 1.0, True),
            "smooth": (0.0, np.inf, True),
            "max_windows": (FEWEST_WINDOWS - 1, np.inf, False),
        }
        for name, (low, high, closed) in ranges.items():
            value = getattr(self, name)
            if name == "step" and value is None:
                continue
            number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            if not number or not (low <= value < high) or (value == low and not closed):
                hint = f"give a number {'from' if closed else 'above'} {low:g}" + (
                    f" to {high:g}" if high < np.inf else ""
                )
                raise InputError(f"{value!r} is out of range", place=name, hint=hint)


def _windows(starts: Floats, counts: list[int], learnt: Learnt) -> pd.DataFrame:
    import pandas as pd

    numbers = np.repeat(np.arange(len(counts)), counts)
    return pd.DataFrame({"recording": numbers, "start": starts, "end": starts + learnt.layout.window})
