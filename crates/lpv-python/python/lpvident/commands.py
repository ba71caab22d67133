"""The commands: inspect, identify, fit_frf, validate, diagnose, simulate_machine."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _lpvident
from ._ask import Progress, as_json, as_settings, listener, with_dashes
from ._settings import MachineSettings, Settings, lists
from .accounts import Diagnosis, Inspection, Validation
from .bundle import Bundle
from .effects import Effects, as_effects
from .errors import ModelError
from .model import Model
from .responses import Frf, Responses

if TYPE_CHECKING:
    from typing_extensions import Unpack

#: A bundle, or its folder.
Source = Bundle | str | os.PathLike[str]


def _open(bundle: Source) -> Bundle:
    return bundle if isinstance(bundle, Bundle) else Bundle(bundle)


def _model(model: Model | str | os.PathLike[str]) -> Model:
    return model if isinstance(model, Model) else Model.load(model)


def inspect(bundle: Source, *, progress: Progress = None) -> Inspection:
    """What is in a bundle, checked: sampling, periods, noise, distortion, coverage, warnings."""
    with listener(progress) as tell:
        return Inspection(*_lpvident.inspect(_open(bundle)._native, tell))


@lists(Settings)
def identify(
    bundle: Source,
    *,
    config: str | os.PathLike[str] | None = None,
    progress: Progress = None,
    **settings: Unpack[Settings],
) -> Model:
    """A model of the machine behind a bundle. What is left out is chosen from the data, and `Model.reasons` says why.

    Args:
        structure: "lpv" (several positions), "lti", "rigid-body" (servo axes) or "xy-table" (first principles, with [geometry]).
        skip_periods: periods dropped as transient.
        order: order of the common denominator, integrators included; number of states of a fit in the time domain.
        integrators: poles held at z = 1.
        rigid_body: "decoupled" (two integrators an axis, a gain that no position changes) or "coupled" (full, a function of the position).
        functions: number of basis functions.
        fuzziness: of Fuzzy-Kolmogorov c-Max, above 1 (35).
        polish: "minimax" or "none".
        weighting: "covariance" or "relative".
        model_error: relative error of the truncated basis, added to the covariance.
        lfr: "small" or "exact".
        interpolation: "spline", "linear", or ``{"kind": "polynomial", "order": 4}``, "chebyshev" with order, "gaussian-process" with
            "length-scale".
        focus: "simulation" or "prediction", of a fit in the time domain.
        direct: "zero" or "estimated", its direct term.
        hold_out: last part of each transient record that is not fitted but judged, 0 to 0.95.
        seed: of every random choice.
        config: a settings file of the program; what is given here goes before it.
        progress: called with (step, parts done, parts in all) from the calling thread; True for a bar of tqdm.

    Raises:
        SettingError: with ``name``, and ``nearest`` for a name that is not known.
        BundleError, IdentifyError: with ``path``, ``record`` or ``place``.
        KeyboardInterrupt: on Ctrl-C; nothing is written.
    """
    file = None if config is None else os.fspath(config)
    opened = _open(bundle)
    with listener(progress) as tell:
        return Model(_lpvident.identify(opened._native, as_settings(settings), file, tell))


@lists(Settings)
def fit_frf(
    frequencies: ArrayLike | Responses | Frf | Sequence[Frf],
    response: ArrayLike | Sequence[ArrayLike] | None = None,
    *,
    sample_rate: float | None = None,
    positions: Iterable[float] | None = None,
    deviation: ArrayLike | None = None,
    config: str | os.PathLike[str] | None = None,
    progress: Progress = None,
    **settings: Unpack[Settings],
) -> Model:
    """A state space, or with several positions an LFR, from frequency responses.

    Args:
        frequencies: increasing, Hz, shape (n_f,); or `Responses`, or one or several `Frf`, and no ``response``.
        response: complex, shape (n_f,), (n_f, n_y, n_u), or with ``positions`` (n_p, n_f, n_y, n_u).
        sample_rate: of the discrete model, Hz, above twice the highest frequency: that at which the input was held.
        positions: constant scheduling values of the responses, increasing, shape (n_p,).
        deviation: standard deviation of the error of an entry: a number, (n_f,), (n_f, n_y) or (n_f, n_y, n_u). Without it 0.1 % of the row of the
            output, the accuracy to which the response is described.
        settings: order, integrators, functions, ...: those of `identify` that concern responses.
    """
    places, rate = _places(frequencies, response, positions, deviation, sample_rate)
    highest = max((p.frequencies[-1] for p in places if len(p.frequencies)), default=0.0)
    if not rate > 2.0 * highest:
        raise ModelError(f"sample_rate is {rate:g} Hz; it must be above twice the highest frequency, {highest:g} Hz")
    file = None if config is None else os.fspath(config)
    native = [place._native() for place in places]
    with listener(progress) as tell:
        return Model(_lpvident.fit_frf(native, 1.0 / rate, as_settings(settings), file, tell))


def _places(
    frequencies: Any, response: Any, positions: Any, deviation: Any, sample_rate: float | None
) -> tuple[list[Frf], float]:
    if isinstance(frequencies, Responses):
        return frequencies.places, float(frequencies.sample_rate if sample_rate is None else sample_rate)
    if sample_rate is None:
        raise ModelError("give sample_rate in Hz, that at which the input is held")
    if isinstance(frequencies, Frf):
        return [frequencies], float(sample_rate)
    if response is None:
        return list(frequencies), float(sample_rate)
    if positions is None:
        return [Frf.from_arrays(frequencies, response, deviation=deviation)], float(sample_rate)
    values, at = list(response), np.atleast_1d(np.asarray(positions, dtype=np.float64))
    if len(values) != len(at):
        raise ModelError(f"{len(values)} responses and {len(at)} positions")
    pairs = zip(values, at)
    return [Frf.from_arrays(frequencies, r, deviation=deviation, position=p) for r, p in pairs], float(sample_rate)


def validate(
    model: Model | str | os.PathLike[str], bundle: Source, *, all: bool = False, progress: Progress = None
) -> Validation:
    """Compares a model, or the file of one, with the records that a bundle holds out; with ``all`` also with those for estimation."""
    known, opened = _model(model), _open(bundle)
    with listener(progress) as tell:
        (json_text, text), runs = _lpvident.validate(known._native, opened._native, all, tell)
    return Validation(json_text, text, runs)


def diagnose(
    bundle: Source,
    model: Model | str | os.PathLike[str] | None = None,
    *,
    effects: Effects | None = None,
    progress: Progress = None,
) -> Diagnosis:
    """Finds the effects that a model lacks on the moves of a bundle, fits them and judges them on held-out moves.

    Args:
        model: the model that effects are added to, or its file; without it one from the bundle: an xy-table where there is its [geometry], a
            small LFR where p is scheduled, else a servo axis.
        effects: effects of your own beside those of the catalogue, or the TOML file of some.

    Raises:
        SettingError, DiagnoseError: for an effect of your own with what is wrong with it.
    """
    opened, known = _open(bundle), None if model is None else _model(model)
    with listener(progress) as tell:
        return Diagnosis(_lpvident.diagnose(opened._native, None if known is None else known._native, as_effects(effects), tell))


@lists(MachineSettings)
def simulate_machine(
    folder: str | os.PathLike[str],
    machine: Mapping[str, Any] | str | os.PathLike[str] | None = None,
    *,
    hide: str | Iterable[str] = (),
    format: Literal["npz", "csv", "parquet", "mat"] = "npz",
    progress: Progress = None,
    **settings: Unpack[MachineSettings],
) -> Bundle:
    """Writes the bundle of a simulated xy-table, and opens it: data with a known truth.

    Args:
        folder: where the bundle goes; it has no bundle yet.
        machine: settings by name, such as ``{"positions": {"count": 5}}``, or a machine file. `machine_template()` lists them; names
            may have ``_`` in place of ``-``.
        hide: effects that the machine has and the bundle does not tell, such as "coulomb-friction" or "coulomb-friction=2.5".
        format: of the record files: npz, csv, parquet or mat.
        settings: settings by name beside ``machine``, such as ``seed=3``.
    """
    file = None if machine is None or isinstance(machine, Mapping) else os.fspath(machine)
    given = with_dashes({**(machine if isinstance(machine, Mapping) else {}), **settings})
    hidden = [hide] if isinstance(hide, str) else list(hide)
    with listener(progress) as tell:
        _lpvident.simulate_machine(os.fspath(folder), as_json(given), file, hidden, format, tell)
    return Bundle(folder)
