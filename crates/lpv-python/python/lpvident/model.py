"""Models: frozen, sampled, along signals, and as files."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _lpvident
from ._ask import Progress, columns, numbers, position, verdict_html
from .accounts import Validation
from .errors import ModelError, SettingError
from .systems import FrozenDeviation, StateSpace, system

if TYPE_CHECKING:
    from .bundle import Bundle


class Model:
    """A model of a machine, time-invariant or depending on a scheduling value p.

    Made by `identify`, `fit_frf`, `Diagnosis.model` or `load`. A p is a number or one number a scheduling signal, in their unit;
    leave it out for a time-invariant model. No model is evaluated outside its `range`.
    """

    def __init__(self, native: _lpvident.Model) -> None:
        self._native = native

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Model:
        """Reads model.json, or a .mat or .csv file that holds the whole model.

        Raises:
            ModelError: with ``path``, and what is wrong in it.
        """
        return cls(_lpvident.Model.load(os.fspath(path)))

    @classmethod
    def from_json(cls, text: str) -> Model:
        """The model of a text that `to_json` gave."""
        with tempfile.TemporaryDirectory(prefix="lpvident-") as folder:
            file = Path(folder) / "model.json"
            file.write_text(text, encoding="utf-8")
            return cls.load(file)

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self).from_json, (self.to_json(),))

    # What it is.

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return self._native.channels()[0]

    @property
    def outputs(self) -> int:
        """Number of outputs."""
        return self._native.channels()[1]

    @property
    def states(self) -> int:
        """Number of states."""
        return len(self._native.frozen(self._middle())[0][0])

    @property
    def range(self) -> NDArray[np.float64] | None:
        """Lowest and highest value of each scheduling signal, shape (n_p, 2); None of a time-invariant model."""
        bounds = self._native.range()
        return None if bounds is None else np.array(bounds)

    @property
    def sample_time(self) -> float | None:
        """Of the model, else of the records behind it, s."""
        return self._native.sample_time()

    @property
    def is_continuous(self) -> bool:
        """Whether it is written in continuous time."""
        return self._native.is_continuous()

    @property
    def identification(self) -> dict[str, Any] | None:
        """How it was made: bundle, settings, summary; None of a model from elsewhere."""
        text = self._native.identification()
        return None if text is None else dict(json.loads(text))

    @property
    def summary(self) -> dict[str, Any]:
        """Figures of the identification; empty of a model from elsewhere."""
        found = self.identification
        return {} if found is None else dict(found["summary"])

    @property
    def verdict(self) -> str:
        """What the model is worth, in a sentence: of a diagnosed model that of its diagnosis; empty where nobody judged it."""
        judged = self.summary.get("verdict")
        if judged:
            return str(judged["sentence"])
        # The file of a diagnosed model has the sentence first among its reasons, and no word for it.
        diagnosed = (self.identification or {}).get("written_by") == "lpv diagnose"
        return self.reasons[0] if diagnosed and self.reasons else ""

    @property
    def worth(self) -> str:
        """The judgement in a word: good, good-up-to, good-at-rest, approximate, unjudged, contradictory-data, not-a-model.

        Empty where nobody judged the model, and of a diagnosed one, whose word is `Diagnosis.worth`.
        """
        return str((self.summary.get("verdict") or {}).get("worth", ""))

    @property
    def reasons(self) -> list[str]:
        """The choices that were made from the data, in words."""
        return list(self.summary.get("reasons", []))

    @property
    def effects(self) -> list[str]:
        """The machine behind a diagnosed model and its effects, a line each."""
        return list(self._native.explanation())

    @property
    def text(self) -> str:
        """What the program `lpv identify` prints."""
        return self._native.text() or self._native.describe()

    # At a constant p.

    def frozen(self, p: ArrayLike | None = None) -> Any:
        """The system at a constant p, in the time in which the model is written.

        Returns a ``control.StateSpace`` where python-control is installed, else a `StateSpace` with the same A, B, C, D and dt. That of
        control has the names of the channels as inputs and outputs and that of the bundle as its name, with ``_`` in place of ``.``, which
        control refuses.
        """
        return system(*self._native.frozen(position(p)), self.identification)

    def sampled(self, p: ArrayLike | None = None, sample_time: float | None = None) -> Any:
        """The same in discrete time, the input held over a sample; ``sample_time`` in s is that of the records unless given."""
        return system(*self._native.sampled(position(p), sample_time), self.identification)

    def matrices(self, p: ArrayLike | None = None) -> StateSpace:
        """A, B, C, D at a constant p as arrays, with or without python-control."""
        (a, b, c, d), dt = self._native.frozen(position(p))
        return StateSpace(a, b, c, d, dt)

    def lfr(self) -> dict[str, Any] | None:
        """The blocks A, B1, B2, C1, D11, D12, C2, D21, D22 of a linear fractional representation, with ``deltas``, pairs of the number
        of a scheduling signal and its repetitions, and ``dt``; None of another model. Deltas run from -1 to 1 over the range."""
        return self._native.lfr()

    def poles(self, p: ArrayLike | None = None) -> NDArray[np.complex128]:
        """Eigenvalues of A at a constant p: rad/s in continuous time, in the z plane in discrete time."""
        return self._native.poles(position(p))

    def frequency_response(
        self,
        p: ArrayLike | None,
        frequencies: ArrayLike,
        *,
        sampled: bool = True,
        sample_time: float | None = None,
    ) -> NDArray[np.complex128]:
        """The response at a constant p, shape (n_f, n_y, n_u).

        Args:
            frequencies: Hz, shape (n_f,).
            sampled: as records show it, the input held over a sample; False for the response of `frozen`.
            sample_time: in s; that of the records unless given.
        """
        lines = np.array(numbers(frequencies, "frequencies"))
        return self._native.frequency_response(position(p), lines, sampled, sample_time)

    @property
    def frozen_deviation(self) -> FrozenDeviation | None:
        """How well the frozen response is known; of a small LFR from responses of known noise, else None."""
        found = self._native.frozen_deviation()
        return None if found is None else FrozenDeviation(found[0], found[1], *found[2])

    # Along signals.

    def simulate(
        self,
        u: ArrayLike,
        p: ArrayLike | None = None,
        *,
        x0: ArrayLike | None = None,
        sample_time: float | None = None,
        linear: bool = False,
    ) -> NDArray[np.float64]:
        """Outputs for the inputs u along p, shape (N, n_y).

        Args:
            u: N x n_u, held between samples; a vector for one input.
            p: N x n_p, the scheduling at the samples, or one constant value; a model in continuous time follows it also between them.
            x0: state at the first sample, shape (n,); zero unless given. `first_state` finds that of a record.
            sample_time: in s, of a model in continuous time; that of the records unless given.
            linear: the linear part of a diagnosed model, without its effects, which `validate` simulates.

        Raises:
            ModelError: for signals that the model cannot have, and for a model with effects unless ``linear``.
        """
        self._refuse_effects(linear)
        inputs = columns(u, "u")
        return self._native.simulate(inputs, self._along(p, len(inputs)), self._state(x0), sample_time)

    def predict(
        self,
        u: ArrayLike,
        y: ArrayLike,
        p: ArrayLike | None = None,
        *,
        x0: ArrayLike | None = None,
        noise: ArrayLike | None = None,
        sample_time: float | None = None,
        linear: bool = False,
    ) -> NDArray[np.float64]:
        """One-step predictions of the outputs from inputs and outputs before, shape (N, n_y).

        With the gain of a model in innovation form, else with a Kalman filter for disturbed inputs, whose level is the most likely one
        of seven decades on the first 600 samples.

        Args:
            u, y: N x n_u and N x n_y.
            p, x0, sample_time: as in `simulate`.
            noise: standard deviation of the noise of a sample, by output; without it a thousandth of the motion.
            linear: as in `simulate`.
        """
        self._refuse_effects(linear)
        inputs, outputs = _record(u, y)
        known = None if noise is None else numbers(noise, "noise")
        if known is not None and len(known) != self.outputs:
            raise ModelError(f"noise has {len(known)} numbers, the model {self.outputs} outputs")
        if known is not None and min(known) <= 0.0:
            raise ModelError(f"noise = {min(known):g}: a standard deviation is above zero")
        along = self._along(p, len(inputs))
        return self._native.predict((inputs, outputs, along), self._state(x0), known, sample_time)

    def first_state(
        self,
        u: ArrayLike,
        y: ArrayLike,
        p: ArrayLike | None = None,
        *,
        sample_time: float | None = None,
        linear: bool = False,
    ) -> NDArray[np.float64]:
        """The state in which a record begins, shape (n,), as `validate` finds it where a record does not begin at rest.

        Outputs are linear in it, ``y = y_0(u, p) + O(p) x0``: y_0 from rest, column i of O the free response from the unit state i. The
        least squares solution of least size over the first max(50, 5 n) samples; singular values of O below 1e-4 of the largest count as
        zero. All of it is zero where the model leaves the range of numbers within these samples.

        Args:
            u, y: N x n_u and N x n_y, from the first sample on.
            p, sample_time, linear: as in `simulate`.

        Raises:
            ModelError: as in `simulate`.
        """
        self._refuse_effects(linear)
        inputs, outputs = _record(u, y)
        if outputs.shape[1] != self.outputs:
            raise ModelError(f"y has {outputs.shape[1]} channels, the model {self.outputs} outputs")
        if not np.isfinite(outputs).all():
            raise ModelError("y has a number that is not finite")
        return self._native.first_state((inputs, outputs, self._along(p, len(inputs))), sample_time)

    def validate(self, bundle: Bundle, *, all: bool = False, progress: Progress = None) -> Validation:
        """Compares it with a bundle: `lpvident.validate`."""
        from .commands import validate

        return validate(self, bundle, all=all, progress=progress)

    # As files.

    def to_json(self) -> str:
        """The text of model.json, with the folder of the bundle absolute; `save` writes it relative to the file."""
        return self._native.to_json()

    def to_mat(self, path: str | os.PathLike[str], *, points: int = 11, overwrite: bool = False) -> None:
        """Writes a MATLAB file with the blocks and ``points`` frozen systems a scheduling signal; its name ends in .mat."""
        if not os.fspath(path).lower().endswith(".mat"):
            raise ModelError(f"{os.fspath(path)}: the name of a MATLAB file ends in .mat", path=path)
        self.save(path, points=points, overwrite=overwrite)

    def save(self, path: str | os.PathLike[str], *, points: int = 11, overwrite: bool = False) -> None:
        """Writes a file of the kind of its ending: .json, .mat, .csv, or .py for python-control.

        A file takes its place in one step. A result of the same kind is replaced, any other file only with ``overwrite``.

        Raises:
            WriteError: with ``path``, and what stands in the way.
        """
        if not isinstance(points, (int, np.integer)) or not 2 <= points <= 1000:
            raise SettingError(f"points = {points!r}: give a number from 2 to 1000", name="points", allowed="2 to 1000")
        self._native.save(os.fspath(path), int(points), overwrite)

    def plot_bode(self, p: ArrayLike | None = None, frequencies: ArrayLike | None = None, *, axes: Any = None) -> Any:
        """Sizes of the sampled response over frequency, an axis an entry, in matplotlib.

        Args:
            p: one position or several; the ends and the middle of the range unless given.
            frequencies: Hz; 400 up to the Nyquist frequency unless given.
            axes: n_y x n_u axes to draw on. Returns them.
        """
        from .plots import bode

        return bode(self, p, frequencies, axes)

    def _middle(self) -> list[float]:
        bounds = self.range
        return [] if bounds is None else bounds.mean(axis=1).tolist()

    def _state(self, x0: ArrayLike | None) -> list[float] | None:
        if x0 is None:
            return None
        state = numbers(x0, "x0")
        if len(state) != self.states:
            raise ModelError(f"x0 has {len(state)} numbers, the model {self.states} states")
        return state

    def _refuse_effects(self, linear: bool) -> None:
        effects = self._native.effects()
        if effects and not linear:
            raise ModelError(
                f"the model has effects ({', '.join(effects)}), and this would be its linear part alone: give linear=True for that, or "
                "compare the whole model with records by validate()"
            )

    def _along(self, p: ArrayLike | None, samples: int) -> NDArray[np.float64] | None:
        if p is None or self.range is None:
            return None
        signals = len(self.range)
        along = columns(np.atleast_1d(p), "p")
        if np.ndim(p) < 2:
            along = along[:, 0].reshape(np.shape(p))
        if along.ndim == 0 or (along.shape == (signals,) and (signals > 1 or samples > 1)):
            along = np.broadcast_to(np.atleast_1d(along), (samples, signals))
        along = columns(along, "p")
        if along.shape != (samples, signals):
            raise ModelError(f"p has the shape {along.shape}; for u of {samples} samples give {samples} x {signals}")
        return along

    def __repr__(self) -> str:
        return self._native.describe() + (f"; {self.verdict}" if self.verdict else "")

    def _repr_html_(self) -> str:
        bounds = self.range
        found = self.identification or {}
        rows = {
            "model": self._native.describe(),
            "range": "" if bounds is None else ", ".join(f"{low:g} to {high:g}" for low, high in bounds),
            "sample time": f"{self.sample_time:g} s" if self.sample_time else "",
            "bundle": found.get("bundle", ""),
            "effects": "; ".join(self.effects),
        }
        return verdict_html(self.verdict or self._native.describe(), self.worth, rows)



def _record(u: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Inputs and outputs of as many samples."""
    inputs, outputs = columns(u, "u"), columns(y, "y")
    if len(outputs) != len(inputs):
        raise ModelError(f"u has {len(inputs)} samples and y {len(outputs)}")
    return inputs, outputs
