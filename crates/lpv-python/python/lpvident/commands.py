"""The commands: inspect, identify, fit_frf, validate, diagnose, simulate_machine."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from numpy.typing import ArrayLike

from . import _lpvident
from ._ask import Progress, as_json, as_settings, listener, numbers, with_dashes
from ._settings import MachineSettings, Settings, lists
from .accounts import Diagnosis, Inspection, Validation
from .bundle import Bundle
from .effects import Effects, as_effects
from .errors import ModelError
from .model import Model
from .responses import Frf, Responses

if TYPE_CHECKING:
    import control
    import xarray
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
    frequencies: ArrayLike | Responses | Frf | Sequence[Frf] | xarray.Dataset | xarray.DataArray | control.FrequencyResponseData,
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
        frequencies: increasing, Hz, shape (n_f,). Or, without ``response``: `Responses`, one or several `Frf`, an xarray in the layout of
            `Responses.to_xarray`, or a ``control.FrequencyResponseData`` or several with ``positions``.
        response: complex, shape (n_f,), (n_f, n_y, n_u), or with ``positions`` (n_p, n_f, n_y, n_u).
        sample_rate: of the discrete model, Hz, above twice the highest frequency: that at which the input was held. Known of `Responses`,
            of an xarray with that attribute, and of a response of python-control in discrete time, of which another one is refused.
        positions: constant scheduling values of the responses, increasing, shape (n_p,).
        deviation: standard deviation of the error of an entry: a number, (n_f,), (n_f, n_y) or (n_f, n_y, n_u). Without it 0.1 % of the
            row of the output, the accuracy to which the response is described.
        config, progress: as in `identify`.
        settings: order, integrators, functions, ...: those of `identify` that concern responses.

    Raises:
        ModelError: for responses, shapes and rates that do not fit.
        SettingError, IdentifyError, KeyboardInterrupt: as in `identify`.
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
    """Responses with their sample rate, of all that `fit_frf` takes."""
    rate = None if sample_rate is None else numbers(sample_rate, "sample_rate")[0]
    alone = response is None and hasattr(frequencies, "coords")
    given = Responses.from_xarray(frequencies, sample_rate=rate) if alone else frequencies
    if isinstance(given, Responses):
        rate, given = given.sample_rate if rate is None else rate, given.places
    if response is not None:
        values = [response] if positions is None else list(response)
        make = functools.partial(Frf.from_arrays, frequencies, deviation=deviation)
    else:
        values = list(given) if isinstance(given, Iterable) and not hasattr(given, "omega") else [given]
        if all(isinstance(value, Frf) for value in values):
            if positions is not None or deviation is not None:
                raise ModelError("positions and deviation go with arrays: these responses have their own")
            return values, _known(rate)
        if not all(hasattr(value, "omega") for value in values):
            raise ModelError("give frequencies with a response, or Responses, Frf, control.FrequencyResponseData or xarray alone")
        for value in values:
            rate = _rate_of(value, rate)
        make = functools.partial(Frf.from_control, deviation=deviation)
    at = [None] * len(values) if positions is None else numbers(positions, "positions")
    if len(values) != len(at):
        raise ModelError(f"{len(values)} responses and {len(at)} positions")
    return [make(value, position=p) for value, p in zip(values, at)], _known(rate)


def _known(rate: float | None) -> float:
    if rate is None:
        raise ModelError("give sample_rate in Hz, that at which the input is held")
    return rate


def _rate_of(frd: Any, rate: float | None) -> float | None:
    """The sample rate of a response of python-control, which is that of the others."""
    step = getattr(frd, "dt", None)
    # True stands for a sample time that nobody knows, 0 for continuous time.
    if step is None or step is True or step == 0:
        return rate
    if rate is not None and abs(rate * step - 1.0) > 1e-9:
        raise ModelError(f"the response is of a sample time of {step:g} s, {1.0 / step:g} Hz, not of {rate:g} Hz")
    return 1.0 / float(step)


def validate(
    model: Model | str | os.PathLike[str], bundle: Source, *, all: bool = False, progress: Progress = None
) -> Validation:
    """Compares a model, or the file of one, with the records that a bundle holds out; with ``all`` also with those for estimation.

    Raises:
        BundleError, ModelError: for a bundle or a file that cannot be read, and channels that do not fit.
        KeyboardInterrupt: on Ctrl-C.
    """
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
        model: the model that effects are added to, or its file; without it one from the bundle: an xy-table where there is its
            [geometry], a small LFR where p is scheduled, else a servo axis.
        effects: effects of your own beside those of the catalogue, or the TOML file of some.

    Raises:
        SettingError, DiagnoseError: for an effect of your own with what is wrong with it.
        BundleError, ModelError: as in `validate`.
        KeyboardInterrupt: on Ctrl-C; nothing is written.
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
