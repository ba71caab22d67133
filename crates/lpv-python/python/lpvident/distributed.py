"""Bundles of a fleet, places of a bundle and seeds of a fit on many cores and machines, by Dask.

    from dask.distributed import Client
    from lpvident import distributed

    if __name__ == "__main__":                     # workers of a local cluster import this file
        client = Client("scheduler:8786")          # any cluster of Dask; without one, the cores of this machine
        rows = distributed.diagnose_many(folders, client=client)
        rows.to_frame()                            # bundle, verdict, effects, error, seconds
        rows.failed                                # the bundles that were refused, each with its exception

Each task is one bundle, one place or one seed. A path goes to the worker, which reads the records where they lie, and what comes back is
no larger than the response of a place. Results are those of one call in one process, to the last bit, whatever the workers are: they do
not talk to each other, and rows come back in the order in which they were asked for. A result is fetched as soon as it is there, so that
a worker that dies repeats only the task that it was at; one that takes down several workers (``distributed.scheduler.allowed-failures``)
is an error in its row. Ctrl-C returns within a second as `Interrupted`, which has what is done; what is left is cancelled, and what runs
ends at its next report of progress, or at once on workers that the call has started itself.

What it does not do: it keeps nothing on disk to go on from after the end of this process (``lpv fleet --shard k/N`` does), it moves no
data to workers that cannot reach them, and it starts no cluster but that of this machine.
"""

from __future__ import annotations

import asyncio
import functools
import os
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _tasks
from ._ask import Progress, listener
from ._settings import Settings, lists
from ._tasks import Outcome, heed
from .bundle import Bundle
from .commands import Source
from .effects import Effects, read_effects
from .model import Model
from .responses import Responses

if TYPE_CHECKING:
    import pandas
    from distributed import Client
    from typing_extensions import Unpack

__all__ = ["Interrupted", "Outcome", "Row", "Rows", "diagnose_many", "each", "fit_places", "frf", "heed", "identify_many"]

#: How long a worker that is ended has to do so by itself, s.
END_S = 0.2


@dataclass(frozen=True, eq=False)
class Row:
    """What one task gave.

    Attributes:
        bundle: the folder, as it was given.
        seed: of the fit; None where it was left to the settings.
        position: the constant scheduling value of a place, one number a signal; None without.
        verdict: the judgement in a sentence, and
        worth: in a word, as `Model.worth` or the verdict of a diagnosis; empty where there is none.
        effects: of a diagnosis, as `Diagnosis.effects`.
        error: why there is no result; None where there is one.
        seconds: time on the worker, s.
        model: the model; None where there is none.
    """

    bundle: str
    seed: int | None = None
    position: list[float] | None = None
    verdict: str = ""
    worth: str = ""
    effects: list[dict[str, Any]] = field(default_factory=list)
    error: Exception | None = None
    seconds: float = 0.0
    model: Model | None = field(default=None, repr=False)


class Rows(list[Row]):
    """Rows in the order in which they were asked for."""

    @property
    def failed(self) -> Rows:
        """Those with an error."""
        return Rows(row for row in self if row.error is not None)

    def to_frame(self) -> pandas.DataFrame:
        """A row for each: bundle, seed, position, verdict, worth, effects and error in words, seconds; needs pandas."""
        import pandas

        columns = ["bundle", "seed", "position", "worth", "verdict", "effects", "error", "seconds"]
        table = []
        for row in self:
            effects = "; ".join(f"{e['effect']} at {e['channel']}" for e in row.effects)
            words = {"effects": effects, "error": "" if row.error is None else str(row.error)}
            table.append({name: words.get(name, getattr(row, name)) for name in columns})
        return pandas.DataFrame(table, columns=columns)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, with what was done before it.

    Attributes:
        outcomes: of the tasks that are done, by the numbers of their items, from 0.
        rows: the same as `Rows`, of a call that gives rows; empty of another.
    """

    def __init__(self, *told: object) -> None:
        super().__init__(*told)
        self.outcomes: dict[int, Outcome] = {}
        self.rows = Rows()


def diagnose_many(
    bundles: Source | Iterable[Source],
    *,
    model: Model | str | os.PathLike[str] | None = None,
    effects: Effects | None = None,
    folder: str | os.PathLike[str] | None = None,
    client: Client | None = None,
    progress: Progress = None,
) -> Rows:
    """`lpvident.diagnose` of each bundle. A bundle that is refused has its exception in its row, and the others go on.

    Args:
        bundles: folders that the workers can read, or one.
        model: the model that effects are added to, for all of them, or a file that the workers can read; made from each bundle without.
        effects: as in `lpvident.diagnose`; a file is read here.
        folder: where the workers write diagnosis.json, diagnosis.html and model.json, one folder a bundle, named by its number and name;
            without it they write nothing.
        client: a client of Dask; without it the current one, else a cluster of the cores of this machine for this call.
        progress: called with ("bundles", bundles done, bundles in all); True for a bar of tqdm.

    Raises:
        Interrupted: on Ctrl-C, a KeyboardInterrupt with the rows that are done; what was written to ``folder`` stays.
    """
    paths = [_Place(source) for source in _several(bundles)]
    known = model if isinstance(model, Model) else _absolute(model)
    own = read_effects(effects) if isinstance(effects, (str, os.PathLike)) else effects
    task = functools.partial(_tasks.diagnose_one, model=known, effects=own)
    items = [(p.path, _results(folder, i, p.path)) for i, p in enumerate(paths)]
    return _rows(_by_place(paths), task, items, client, progress, "bundles")


@lists(Settings)
def identify_many(
    bundles: Source | Iterable[Source],
    *,
    seeds: Iterable[int] | None = None,
    folder: str | os.PathLike[str] | None = None,
    config: str | os.PathLike[str] | None = None,
    client: Client | None = None,
    progress: Progress = None,
    **settings: Unpack[Settings],
) -> Rows:
    """`lpvident.identify` of each bundle, with ``seeds`` once a seed: starts of the fit of one bundle or of several.

    Args:
        bundles: folders that the workers can read, or one.
        seeds: of every random choice; the rows of a bundle stand beside each other, in this order. Which start is the best one is for the
            caller to say, such as ``min(rows, key=lambda row: row.model.summary["error_over_noise"])``.
        folder: where the workers write model.json, one folder a row, named by its number and the name of the bundle.
        client, progress: as in `diagnose_many`.
        config, settings: those of `lpvident.identify`.
    """
    sources = _several(bundles)
    starts: Sequence[int | None] = [None] if seeds is None else list(seeds)
    paths = [_Place(source, seed=seed) for source in sources for seed in starts]
    items = [(p.path, p.seed, _results(folder, i, p.path)) for i, p in enumerate(paths)]
    task = functools.partial(_tasks.identify_one, settings={"config": _absolute(config), **settings})
    return _rows(_by_place(paths), task, items, client, progress, "models")


def _several(bundles: Source | Iterable[Source]) -> list[Any]:
    one = isinstance(bundles, (str, os.PathLike, Bundle))
    return [bundles] if one else list(bundles)  # type: ignore[arg-type]


def frf(
    bundle: Source, *, skip_periods: int | None = None, client: Client | None = None, progress: Progress = None
) -> Responses:
    """`Bundle.frf`, one task a place: the same responses, to the last bit.

    Records without periods share their length and a regressor, and measured responses are checked against each other: such a bundle is
    one task.

    Args:
        skip_periods: periods dropped as transient; without it from the decay between periods at each place.
        client, progress: as in `diagnose_many`.

    Raises:
        BundleError, IdentifyError: of the first place, in order of position, that has no response.
    """
    path = _Place(bundle).path
    with _cluster(client) as client:
        (rate, places) = _value(each(_tasks.places, [path], client=client)[0])
        task = functools.partial(_tasks.frf, path, skip_periods=skip_periods)
        found = [_value(outcome) for outcome in each(task, places, client=client, progress=progress, step="places")]
    reasons = list(dict.fromkeys(reason for _, own in found for reason in own))
    return Responses.of([place for own, _ in found for place in own], sample_rate=rate, reasons=reasons)


@lists(Settings)
def fit_places(
    bundle: Source,
    *,
    config: str | os.PathLike[str] | None = None,
    client: Client | None = None,
    progress: Progress = None,
    **settings: Unpack[Settings],
) -> Rows:
    """The response of each place and its poles: a time-invariant model a place, `lpvident.fit_frf` of its response, in order of position.

    Args:
        config, settings: skip_periods as in `frf`, and order, integrators, ...: those of `lpvident.fit_frf`. What is left out is chosen at
            each place by itself: give order and integrators where the poles of all places are to be compared.
        client, progress: as in `frf`.
    """
    place, skip_periods = _Place(bundle), settings.pop("skip_periods", None)
    given = {"config": _absolute(config), **settings}

    def rows(found: Mapping[int, Outcome]) -> Rows:
        parts = [(found[i], part) for i in sorted(found) for part in found[i].value or [{"error": found[i].error}]]
        return Rows(Row(bundle=place.given, seconds=outcome.seconds, **part) for outcome, part in parts)

    with _cluster(client) as client:
        (_, places) = _value(each(_tasks.places, [place.path], client=client)[0])
        task = functools.partial(_tasks.fit, place.path, skip_periods=skip_periods, settings=given)
        return _rows(rows, task, places, client, progress, "places")


def each(
    task: Callable[[Any], Any],
    items: Iterable[Any],
    *,
    client: Client | None = None,
    progress: Progress = None,
    step: str = "tasks",
) -> list[Outcome]:
    """Calls ``task`` with each item on the workers, and gives what came out in the order of the items.

    Args:
        task: a function that workers can import, or one that cloudpickle can carry. Give ``progress=heed`` to long calls in it, so that
            they end when the task is cancelled.
        items: what travels to the workers: names and numbers, not data.
        client, progress: as in `diagnose_many`; ``step`` names the tasks.

    Raises:
        Interrupted: on Ctrl-C, a KeyboardInterrupt with the outcomes that are there.
    """
    given = list(items)
    found: dict[int, Outcome] = {}
    with _cluster(client) as client, listener(progress) as tell:
        try:
            _gather(client, task, dict(enumerate(given)), found, step, tell)
            # Dask blames a worker's death on all that was assigned to it: by itself a task is blamed for what it does.
            lost = [i for i, outcome in found.items() if type(outcome.error).__name__ == "KilledWorker"]
            again = lost if len(lost) > 1 else []
            for i in again:
                del found[i]
            for i in again:
                _gather(client, task, {i: given[i]}, found, step, None)
        except KeyboardInterrupt:
            stopped = Interrupted(f"{len(found)} of {len(given)} {step} are done")
            stopped.outcomes = found
            raise stopped from None
    return [found[i] for i in range(len(given))]


def _gather(client: Client, task: Any, items: dict[int, Any], found: dict[int, Outcome], step: str, tell: Any) -> None:
    """Puts what the tasks give into ``found``, by the numbers of their items, as soon as it is there."""
    from distributed import as_completed

    if not items:
        return
    run = f"lpvident-{step}-{uuid.uuid4().hex}"
    numbers = {f"{run}-{i}": i for i in items}
    futures = client.map(functools.partial(_tasks.run, task), list(items.values()), key=list(numbers), pure=False)
    try:
        # With results: each is here, and forgotten there, before anything can happen to its worker.
        waiting = as_completed(futures, with_results=True, raise_errors=False, loop=client.loop)
        for done, (future, result) in enumerate(waiting, start=1):
            has_result = future.status == "finished"
            future.release()
            found[numbers[future.key]] = result if has_result else Outcome(None, _lost(result), 0.0)
            if tell is not None:
                tell(step, done, len(items))
    except BaseException:
        client.cancel(futures, force=True)
        raise


class _Place:
    """A bundle by its path, as it was given and as the workers find it."""

    def __init__(self, source: Source, *, seed: int | None = None) -> None:
        # Held, since a temporary bundle goes with its object.
        self.source = source
        self.given = os.fspath(source.path if isinstance(source, Bundle) else source)
        self.path = os.path.abspath(self.given)
        self.seed = seed


def _absolute(path: str | os.PathLike[str] | None) -> str | None:
    return None if path is None else os.path.abspath(os.fspath(path))


def _results(folder: str | os.PathLike[str] | None, number: int, path: str) -> str | None:
    """The folder of the results of a row."""
    return None if folder is None else os.path.join(os.path.abspath(os.fspath(folder)), f"{number:04}-{Path(path).name}")


def _rows(
    rows: Callable[[Mapping[int, Outcome]], Rows], task: Any, items: Sequence[Any], client: Any, progress: Progress, step: str
) -> Rows:
    try:
        return rows(dict(enumerate(each(task, items, client=client, progress=progress, step=step))))
    except Interrupted as stopped:
        stopped.rows = rows(stopped.outcomes)
        raise


def _by_place(places: Sequence[_Place]) -> Callable[[Mapping[int, Outcome]], Rows]:
    def row(place: _Place, found: Outcome) -> Row:
        return Row(bundle=place.given, seed=place.seed, error=found.error, seconds=found.seconds, **(found.value or {}))

    return lambda found: Rows(row(places[i], found[i]) for i in sorted(found))


def _value(outcome: Outcome) -> Any:
    if outcome.error is not None:
        raise outcome.error
    return outcome.value


def _lost(problem: Any) -> Exception:
    """What as_completed gives of a task that has no result: the three parts of an exception, or the exception."""
    found = problem[1] if isinstance(problem, tuple) else problem
    return found if isinstance(found, Exception) else RuntimeError(f"the task was lost: {found!r}")


async def _end(cluster: Any) -> None:
    """Ends the workers of a cluster at once: closing it waits for the calls that they are at."""
    await asyncio.gather(*(worker.close(timeout=END_S) for worker in cluster.workers.values()), return_exceptions=True)


@contextmanager
def _cluster(client: Client | None) -> Iterator[Client]:
    """The client that was given, else the current one, else one of a cluster of the cores of this machine, for as long as this lasts."""
    try:
        from distributed import Client, LocalCluster, default_client
    except ImportError as missing:
        raise ImportError(f"lpvident.distributed needs Dask ({missing}): pip install 'lpvident[distributed]'") from None
    if client is None:
        try:
            client = default_client()
        except ValueError:
            with ExitStack() as own:
                try:
                    # One thread a worker: two calls in one process would share its threads. What memory a bundle needs, it says itself.
                    cluster = own.enter_context(LocalCluster(threads_per_worker=1, memory_limit=None, dashboard_address=":0"))
                    local = own.enter_context(Client(cluster))
                except KeyboardInterrupt:
                    raise Interrupted("nothing is done: the workers were starting") from None
                try:
                    yield local
                except BaseException:
                    # Workers that do not end well are no reason to lose what is done.
                    with suppress(Exception):
                        local.sync(_end, cluster)
                    raise
            return
    yield client
