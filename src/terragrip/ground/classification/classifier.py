"""GroundClassifier: learn grounds from labelled recordings, and tell them, window by window, in scikit-learn's manner."""

from __future__ import annotations

import inspect
import os
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError
from terragrip.ground.classification.channels import held_channels, signals_of, tables_of
from terragrip.ground.classification.experts import FEWEST_WINDOWS, train_experts
from terragrip.ground.classification.features import features_of
from terragrip.ground.classification.labels import UNKNOWN, classes_of, one_each
from terragrip.ground.classification.neighbours import nearby_mean, smoothed
from terragrip.ground.classification.training_set import collect, layout_of, matrix, measured_families
from terragrip.ground.classification.windows import window_starts

if TYPE_CHECKING:
    import pandas as pd

Floats = npt.NDArray[np.float64]


class GroundClassifier:
    """Tells grounds apart from windows of wheel speed, torque or current, and body motion, whichever there are.

    Parameters
    ----------
    window: length of a window [s].
    step: time from one window to the next in prediction [s]; None: one window, so that they do not overlap.
    rejection: share of windows on known grounds, from runs not trained on, that may be called ``unknown``;
        0 never says unknown where any trained set of sensors was measured.
    smooth: length of time [s] over which neighbouring windows of one recording share their evidence, novelty too; 0: each
        window is judged by itself alone.
    max_windows: windows of each ground to train on; rarer grounds are cut into windows that overlap more.
    random_state: seed of the draws in training; the same data and seed give the same classifier.

    After `fit`: ``classes_`` (the labels, sorted), ``n_features_in_``, ``feature_names_in_``, ``sensors_`` (the sets
    of sensors that it can judge from), ``notes_`` (sentences on what was left out or learnt in another way).

    Recordings are `Recording` or tables with recording columns (DESIGN 3); a motor current may stand as
    ``drive_torque_<wheel>`` in any unit or as ``motor_current_<wheel>``. Sensors may be missing in any of them:
    there is an expert for each set of sensors, and a window goes to the one that uses most of what it holds.

    Method: support vector machines (Boser, Guyon, Vapnik 1992) on features of the window (`features`), beside them
    what the sensors show given the motion (`motion_law`) where wheel speeds are, and extremely randomised trees (Geurts,
    Ernst, Wehenkel 2006) where only wheels are; probabilities after Platt (1999) from recordings held out, all grounds
    taken to be equally likely beforehand.
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
                raise InputError("is no parameter", place=name, mend=f"there are {', '.join(known)}")
            setattr(self, name, value)
        return self

    def __sklearn_tags__(self) -> Any:
        """What scikit-learn's cross-validation asks an estimator: that it is a classifier."""
        from sklearn.utils import ClassifierTags, Tags, TargetTags

        return Tags("classifier", TargetTags(required=True), classifier_tags=ClassifierTags())

    def __repr__(self) -> str:
        defaults = inspect.signature(type(self)).parameters
        told = (f"{n}={v!r}" for n, v in self.get_params().items() if v != defaults[n].default)
        return f"{type(self).__name__}({', '.join(told)})"

    def fit(self, recordings: Iterable[Any], labels: Sequence[Any]) -> Self:
        """Learn from recordings, one label each.

        Raises InputError (a ValueError) on parameters out of range, on labels that are not one for each recording,
        fewer than two grounds, recordings without a usable channel, or too short; and if scikit-learn is missing.
        """
        self.check_parameters()
        tables = tables_of(recordings)
        classes, codes = classes_of(labels, len(tables))
        held = held_channels(tables)
        signals = [signals_of(table, held) for table in tables]
        for recorded, (_, _, name) in zip(signals, tables, strict=True):
            if not recorded.families:
                mend = "give wheel_speed_*, drive_torque_*, acceleration_* or angular_velocity_* columns, or leave it out"
                raise InputError("holds no usable channel", file=name, mend=mend)
        layout, slow = layout_of(signals, self.window)
        if not layout.period:
            fastest = min(
                c.period for s in signals for family in s.families.values() for c in family.values()
            )
            problem = f"{self.window:g} s is shorter than two samples, which come every {fastest:.3g} s"
            raise InputError(problem, place="window", mend=f"take a window of {4 * fastest:.2g} s or more")
        random = np.random.default_rng(self.random_state)
        training = collect(signals, codes, layout, self.max_windows, random)
        notes = [
            f"{family}: sampled too slowly for windows of {self.window:g} s, not used." for family in slow
        ]
        notes += [f"{name}: logged with repeats, true updates every {p:.2g} s." for name, p in held.items()]
        if not training.by_recording:
            notes.append(
                "A ground has but one recording: probabilities are learnt within runs and too sure on new ones."
            )
        self._experts, said = train_experts(training, classes, int(random.integers(2**31)))
        notes += said
        self._layout, self._held = layout, held
        self._fitted(classes, training.names, tuple(notes))
        return self

    def predict(self, recordings: Iterable[Any]) -> npt.NDArray[Any]:
        """The label (windows,) of each window, ``"unknown"`` where none fits; recordings follow one another.

        `windows` tells which recording and time a row belongs to. Raises InputError as `fit` does on tables that
        cannot be read, and if not fitted.
        """
        found, novelty = self._judge(tables_of(recordings))
        labels = self.classes_[found.argmax(axis=1)]
        strange = ~(novelty >= self.rejection)  # NaN, too
        if not strange.any():
            return labels
        if labels.dtype.kind != "U":
            labels = labels.astype(object)
        return np.where(strange, np.array(UNKNOWN, dtype=object if labels.dtype == object else None), labels)

    def predict_proba(self, recordings: Iterable[Any]) -> Floats:
        """Probability (windows, classes) of each class in ``classes_``, given that it is one of them.

        A window without usable sensors has equal probabilities. Raises InputError as `predict`.
        """
        return self._judge(tables_of(recordings))[0]

    def novelty(self, recordings: Iterable[Any]) -> Floats:
        """Share (windows,) of windows on known grounds, from runs not trained on, that would look as strange.

        `predict` says unknown below ``rejection``. NaN where no usable sensor was measured. Raises InputError as `predict`.
        """
        return self._judge(tables_of(recordings))[1]

    def windows(self, recordings: Iterable[Any]) -> pd.DataFrame:
        """Which window each row of a prediction is: columns ``recording`` (its number), ``start`` and ``end`` [s]."""
        import pandas as pd

        self._check_fitted()
        starts = [self._starts(signals_of(t, self._held)) for t in tables_of(recordings)]
        numbers = np.repeat(np.arange(len(starts)), [len(s) for s in starts])
        begin = np.concatenate(starts) if starts else np.empty(0)
        return pd.DataFrame({"recording": numbers, "start": begin, "end": begin + self._layout.window})

    def score(self, recordings: Iterable[Any], labels: Sequence[Any]) -> float:
        """Share of windows whose label is that of their recording; unknown counts as wrong. Raises InputError."""
        listed = list(recordings)
        truth = one_each(labels, len(listed))
        found = self.predict(listed)
        of_window = self.windows(listed)["recording"].to_numpy()
        return float(np.mean([a == truth[k] for a, k in zip(found.tolist(), of_window, strict=True)]))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the classifier to one file that holds numbers and text only; raises InputError if it cannot."""
        from terragrip.ground.classification.storage import save

        self._check_fitted()
        save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> GroundClassifier:
        """Read a classifier that `save` wrote; raises InputError on a foreign, damaged or newer file."""
        from terragrip.ground.classification.storage import load

        return load(path)

    def _judge(self, tables: list[tuple[Floats, dict[str, Floats], str]]) -> tuple[Floats, Floats]:
        """Probabilities (windows, classes) and novelty (windows,) of all windows."""
        self._check_fitted()
        self.check_parameters()
        count = len(self.classes_)
        chances, novelties = [np.empty((0, count))], [np.empty(0)]
        for table in tables:
            signals = signals_of(table, self._held)
            starts = self._starts(signals)
            features = matrix(features_of(signals, starts, self._layout), self._names, len(starts))
            found, novelty = self._ask(features, starts)
            chances.append(smoothed(found, starts, self.smooth / 2))
            novelties.append(novelty)
        return np.concatenate(chances), np.concatenate(novelties)

    def _ask(self, features: Floats, starts: Floats) -> tuple[Floats, Floats]:
        """Send each window to the expert that uses most of what it holds."""
        measured = measured_families(self._names, features)
        chances = np.full((len(features), len(self.classes_)), 1.0 / len(self.classes_))
        novelty = np.full(len(features), np.nan)
        open_rows = np.ones(len(features), dtype=bool)
        nowhere = np.zeros(len(features), dtype=bool)
        for expert in self._experts:  # from most features to fewest
            fits = open_rows & np.all([measured.get(f, nowhere) for f in expert.families], axis=0)
            if fits.any():
                columns = [self._column[name] for name in expert.features]
                chances[fits], strange = expert.judge(features[fits][:, columns])
                if self.smooth:  # neighbours that the same expert judged
                    strange = nearby_mean(strange, starts[fits], self.smooth / 2)
                novelty[fits] = expert.strangeness.novelty(strange, self.smooth)
                open_rows &= ~fits
        return chances, novelty

    def _starts(self, signals: Any) -> Floats:
        return window_starts(signals.start, signals.end, self._layout.window, self._step)

    @property
    def _step(self) -> float:
        return self._layout.window if self.step is None else self.step

    def _fitted(self, classes: npt.NDArray[Any], names: tuple[str, ...], notes: tuple[str, ...]) -> None:
        self.classes_ = classes
        self.feature_names_in_ = np.array(names, dtype=object)
        self.n_features_in_ = len(names)
        self._names = names
        self.sensors_ = tuple(tuple(sorted(expert.families)) for expert in self._experts)
        self.notes_ = notes
        self._column = {name: k for k, name in enumerate(names)}

    def _check_fitted(self) -> None:
        if not hasattr(self, "classes_"):
            raise InputError("the classifier knows no ground yet", mend="call fit(recordings, labels) first")

    def check_parameters(self) -> None:
        """Raises InputError at the first parameter out of its range; `fit` and `predict` ask for themselves."""
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
                mend = f"give a number {'from' if closed else 'above'} {low:g}" + (
                    f" to {high:g}" if high < np.inf else ""
                )
                raise InputError(f"{value!r} is out of range", place=name, mend=mend)
