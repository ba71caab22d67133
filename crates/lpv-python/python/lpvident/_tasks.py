"""What runs on the workers of `lpvident.distributed`: functions that they import, of paths and numbers."""

from __future__ import annotations

import os
import pickle
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from ._ask import count
from .bundle import Bundle
from .commands import diagnose, fit_frf, identify
from .effects import Effects
from .errors import LpvError
from .model import Model
from .responses import Frf, Responses


class Outcome(NamedTuple):
    """What a task of `each` gave: its value, or the exception that ended it, and the time on the worker, s."""

    value: Any
    error: Exception | None
    seconds: float


class Cancelled(Exception):
    """Ends a task that nobody waits for any more."""


def heed(step: str, done: int, of: int) -> None:
    """``progress=heed`` ends a long call in a task of `each` when the task is cancelled."""
    del step, done, of
    from distributed import get_worker

    try:
        worker = get_worker()
    except ValueError:
        return
    state = worker.state.tasks.get(worker.get_current_task())
    if state is None or state.state == "cancelled":
        raise Cancelled("nobody waits for this task any more")


def run(task: Callable[[Any], Any], item: Any) -> Outcome:
    _share_cores()
    start = time.perf_counter()
    try:
        value, error = task(item), None
    except Exception as problem:
        value, error = None, _portable(problem)
    return Outcome(value, error, time.perf_counter() - start)


def _share_cores() -> None:
    """As many threads behind lpvident as the worker has, unless it was told or has begun: workers beside each other share the cores."""
    from distributed import get_worker

    worker = get_worker()
    if not worker.address.startswith("inproc"):
        os.environ.setdefault("RAYON_NUM_THREADS", str(worker.state.nthreads))


def _portable(problem: Exception) -> Exception:
    try:
        pickle.loads(pickle.dumps(problem))
    except Exception:
        return RuntimeError(f"{type(problem).__name__}: {problem}")
    return problem.with_traceback(None)


def diagnose_one(item: tuple[str, str | None], *, model: Model | str | None, effects: Effects | None) -> dict[str, Any]:
    path, results = item
    known = Model.load(model) if isinstance(model, str) else model
    found = diagnose(path, known, effects=effects, progress=heed)
    if results is not None:
        found.save(results)
    return {"verdict": found.verdict, "worth": found.worth, "effects": found.effects, "model": found.model}


def identify_one(item: tuple[str, int | None, str | None], *, settings: dict[str, Any]) -> dict[str, Any]:
    path, seed, results = item
    model = identify(path, **(settings if seed is None else {**settings, "seed": seed}), progress=heed)
    if results is not None:
        model.save(Path(results) / "model.json")
    return {"verdict": model.verdict, "worth": model.worth, "model": model}


def places(path: str) -> tuple[float, list[list[int]]]:
    bundle = Bundle(path)
    return bundle.sample_rate, bundle._native.places()


def frf(path: str, records: list[int], *, skip_periods: int | None) -> tuple[list[tuple[Any, ...]], list[str]]:
    return Bundle(path)._native.frf(set(records), count(skip_periods, "skip_periods"), heed)


def fit(path: str, records: list[int], *, skip_periods: int | None, settings: dict[str, Any]) -> list[dict[str, Any]]:
    own, reasons = frf(path, records, skip_periods=skip_periods)
    places = Responses.of(own, sample_rate=Bundle(path).sample_rate, reasons=reasons)
    return [_fit_place(place, places.sample_rate, settings) for place in places.places]


def _fit_place(place: Frf, rate: float, settings: dict[str, Any]) -> dict[str, Any]:
    try:
        model = fit_frf(place, sample_rate=rate, **settings, progress=heed)
    except LpvError as refused:
        return {"position": place.position, "error": refused}
    return {"position": place.position, "verdict": model.verdict, "worth": model.worth, "model": model}
