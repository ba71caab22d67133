"""Fleets, places and seeds by Dask: the bits of one process, whatever the workers are and whatever happens to them."""

from __future__ import annotations

import importlib.util
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from conftest import SMALL

import lpvident

pytest.importorskip("distributed", reason="Dask is not installed: pip install 'lpvident[distributed]'")

from distributed import Client, LocalCluster

from lpvident import distributed

EXAMPLES = Path(__file__).parents[1] / "examples"

#: A bundle that is identified in a second.
ONE_PLACE = {
    "positions": {"values": [0.1]},
    "multisine": {"period": 256, "periods": 4, "lines": "odd"},
    "setpoints": {"samples": 400},
    "moves": {"estimation": 0, "validation": 1},
}

#: And one that is diagnosed in some seconds.
MOVES = ONE_PLACE | {"positions": {"count": 3}, "moves": {"estimation": 2, "validation": 1}, "setpoints": {"samples": 800}}


def cluster(workers: int) -> LocalCluster:
    return LocalCluster(n_workers=workers, threads_per_worker=1, memory_limit=None, dashboard_address=":0")


@pytest.fixture(scope="module")
def clients() -> Iterator[dict[int, Client]]:
    """Clients of one worker and of two, each worker a process."""
    with cluster(1) as one, cluster(2) as two, Client(one, set_as_default=False) as a, Client(two, set_as_default=False) as b:
        yield {1: a, 2: b}


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Machines with friction, and in the middle a folder that is no bundle."""
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "empty").mkdir()
    for seed in (1, 2):
        lpvident.simulate_machine(folder / f"m{seed}", MOVES, seed=seed, hide="coulomb-friction")
    return [folder / "m1", folder / "empty", folder / "m2"]


def bits(rows: distributed.Rows) -> list[tuple]:
    """All of the rows but the time."""
    models = [None if row.model is None else row.model.to_json() for row in rows]
    return [(r.bundle, r.seed, r.position, r.verdict, r.worth, r.effects, str(r.error), m) for r, m in zip(rows, models)]


def test_a_fleet_has_the_bits_of_one_process_and_loses_none(clients: dict[int, Client], fleet: list[Path], tmp_path: Path) -> None:
    heard: list[tuple[str, int, int]] = []
    found = distributed.diagnose_many(fleet, client=clients[2], progress=lambda *told: heard.append(told))
    assert heard == [("bundles", done, 3) for done in (1, 2, 3)]
    assert bits(found) == bits(distributed.diagnose_many(fleet, client=clients[1], folder=tmp_path))
    alone, row = lpvident.diagnose(fleet[2]), found[2]
    assert (row.bundle, row.verdict, row.effects) == (str(fleet[2]), alone.verdict, alone.effects)
    assert row.model.to_json() == alone.model.to_json() and row.seconds > 0
    alone.save(tmp_path / "alone")
    for name in ("diagnosis.json", "diagnosis.html", "model.json"):
        assert (tmp_path / "0002-m2" / name).read_bytes() == (tmp_path / "alone" / name).read_bytes()
    for row in (found[0], found[2]):
        assert "coulomb-friction" in [effect["effect"] for effect in row.effects]
    assert [row.bundle for row in found.failed] == [str(fleet[1])]
    assert isinstance(found[1].error, lpvident.BundleError) and found[1].error.path == str(fleet[1])
    frame = pytest.importorskip("pandas") and found.to_frame()
    assert list(frame.columns) == ["bundle", "seed", "position", "worth", "verdict", "effects", "error", "seconds"]
    assert "holds no experiment.toml" in frame.error[1]


def test_seeds_of_a_fit(clients: dict[int, Client], tmp_path: Path) -> None:
    bundle = lpvident.simulate_machine(tmp_path / "bundle", ONE_PLACE)
    settings = {"order": 4, "integrators": 2}
    found = {n: distributed.identify_many(bundle, seeds=(3, 1, 3), client=client, **settings) for n, client in clients.items()}
    assert bits(found[1]) == bits(found[2])
    assert [row.seed for row in found[2]] == [3, 1, 3]
    for row in found[2]:
        assert row.model.to_json() == bundle.identify(seed=row.seed, **settings).to_json()
    wrong = distributed.identify_many([bundle], client=clients[2], ordr=4)
    assert isinstance(wrong[0].error, lpvident.SettingError) and wrong[0].error.nearest == "order" and wrong[0].model is None


def test_places_by_themselves(clients: dict[int, Client], tmp_path: Path) -> None:
    bundle = lpvident.simulate_machine(tmp_path / "bundle", SMALL)
    whole = bundle.frf()
    for client in clients.values():
        found = distributed.frf(bundle.path, client=client)
        assert (len(found), found.sample_rate, found.reasons) == (5, whole.sample_rate, whole.reasons)
        for own, expected in zip(found.places, whole.places):
            assert own.position == expected.position and own.degrees_of_freedom == expected.degrees_of_freedom
            for name in ("frequencies", "response", "output_covariance", "input_factor"):
                assert np.array_equal(getattr(own, name), getattr(expected, name)), name
    rows = {n: distributed.fit_places(bundle, client=client, order=6, integrators=2) for n, client in clients.items()}
    assert bits(rows[1]) == bits(rows[2])
    assert [row.position for row in rows[2]] == [place.position for place in whole.places]
    for row, place in zip(rows[2], whole.places):
        alone = lpvident.fit_frf(place, sample_rate=whole.sample_rate, order=6, integrators=2)
        assert np.array_equal(row.model.poles(), alone.poles())
    with pytest.raises(lpvident.BundleError):
        distributed.frf(tmp_path, client=clients[2])


def test_little_travels(clients: dict[int, Client], tmp_path: Path) -> None:
    """Names go to the workers; no more than the response of a place, or a model, comes back."""
    bundle = lpvident.simulate_machine(tmp_path / "bundle", SMALL)
    records = sum(file.stat().st_size for file in bundle.path.glob("records/*"))
    place = max(len(pickle.dumps(p)) for p in bundle.frf().places)
    back: list[int] = []
    sent: list[int] = []

    class Watched:
        """The client, with an eye on what it sends."""

        def __getattr__(self, name: str) -> object:
            return getattr(clients[2], name)

        def map(self, task: object, items: list, **options: object) -> list:
            sent.append(len(pickle.dumps(task)) + max(len(pickle.dumps(item)) for item in items))
            futures = clients[2].map(task, items, **options)
            back.extend(len(pickle.dumps(result)) for result in clients[2].gather(futures))
            return futures

    distributed.frf(bundle, client=Watched())
    distributed.fit_places(bundle, client=Watched(), order=6, integrators=2)
    assert max(sent) < 2000 < place < records / 10
    # The arrays of a place and a few names.
    assert max(back) < place + 1000


def marked(item: tuple[str, int]) -> int:
    """Writes a line for each time that it runs, and takes a while."""
    folder, number = item
    with open(Path(folder) / f"{number}", "a") as file:
        file.write(f"{os.getpid()}\n")
    time.sleep(0.4)
    return number


def runs(folder: Path, number: int) -> list[int]:
    file = folder / f"{number}"
    return [int(line) for line in file.read_text().split()] if file.exists() else []


def test_a_killed_worker_repeats_only_its_task(tmp_path: Path) -> None:
    killed: list[int] = []

    def kill(step: str, done: int, of: int) -> None:
        """In the middle of the work, kills the worker that begins a task."""
        if done != 6 or killed:
            return
        deadline = time.monotonic() + 20
        while time.monotonic() < deadline:
            at_work = [n for n in range(16) if runs(tmp_path, n)]
            newest = max(at_work, key=lambda n: (tmp_path / f"{n}").stat().st_mtime_ns)
            if time.time() - (tmp_path / f"{newest}").stat().st_mtime < 0.1:
                os.kill(runs(tmp_path, newest)[0], signal.SIGKILL)
                killed.append(newest)
                return
            time.sleep(0.005)

    with cluster(2) as two, Client(two, set_as_default=False) as client:
        found = distributed.each(marked, [(str(tmp_path), n) for n in range(16)], client=client, progress=kill)
    assert [outcome.value for outcome in found] == list(range(16)) and all(outcome.error is None for outcome in found)
    assert len(killed) == 1
    times = [len(runs(tmp_path, n)) for n in range(16)]
    assert times == [2 if n == killed[0] else 1 for n in range(16)]
    first, second = runs(tmp_path, killed[0])
    assert first != second


def dies(item: int) -> int:
    if item == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def test_a_task_that_kills_its_workers_is_an_error_in_its_row() -> None:
    """And in no other, also where the scheduler had assigned others to the same worker."""
    import dask

    with dask.config.set({"distributed.scheduler.allowed-failures": 1}), cluster(1) as one, Client(one, set_as_default=False) as client:
        found = distributed.each(dies, range(3), client=client)
    assert [outcome.value for outcome in found] == [0, None, 2]
    assert type(found[1].error).__name__ == "KilledWorker"


class Odd(Exception):
    """An exception that does not travel."""

    def __init__(self, number: int, word: str) -> None:
        super().__init__(word)


def refuses(item: int) -> int:
    raise Odd(item, "no")


def test_an_exception_that_does_not_travel_is_told_in_words(clients: dict[int, Client]) -> None:
    (found,) = distributed.each(refuses, [1], client=clients[1])
    assert str(found.error) == "Odd: no" and distributed.each(refuses, [], client=clients[1]) == []


def long_call(folder: str) -> None:
    try:
        while True:
            distributed.heed("waiting", 0, 0)
            (Path(folder) / "at-work").touch()
            time.sleep(0.01)
    except BaseException as ended:
        (Path(folder) / "ended").write_text(type(ended).__name__)
        raise


def test_ctrl_c_ends_what_runs_on_the_workers(clients: dict[int, Client], tmp_path: Path) -> None:
    def stop() -> None:
        while not (tmp_path / "at-work").exists():
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=stop)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        distributed.each(long_call, [str(tmp_path)], client=clients[2])
    thread.join()
    deadline = time.monotonic() + 10
    while not (tmp_path / "ended").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert (tmp_path / "ended").read_text() == "Cancelled"


@pytest.mark.parametrize("whose", ["its own workers", "workers of somebody"])
def test_ctrl_c_returns_within_a_second_with_what_is_done(clients: dict[int, Client], tmp_path: Path, whose: str) -> None:
    short = lpvident.simulate_machine(tmp_path / "short", ONE_PLACE)
    long = lpvident.simulate_machine(tmp_path / "long", SMALL | {"positions": {"count": 9}, "setpoints": {"samples": 12000}})
    sent: list[float] = []

    def stop() -> None:
        sent.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    def heard(step: str, done: int, of: int) -> None:
        threading.Timer(0.3, stop).start()

    out, client = tmp_path / "out", clients[2] if whose == "workers of somebody" else None
    with pytest.raises(KeyboardInterrupt, match="1 of 4 models are done") as stopped:
        distributed.identify_many([short, long, long, long], folder=out, client=client, progress=heard)
    assert time.monotonic() - sent[0] < 1.0
    assert isinstance(stopped.value, distributed.Interrupted) and list(stopped.value.outcomes) == [0]
    (row,) = stopped.value.rows
    assert row.bundle == str(short.path) and row.model.to_json() == short.identify().to_json()
    assert lpvident.load(out / "0000-short/model.json").poles().tolist() == row.model.poles().tolist()
    # Workers of somebody are free again soon, and what they were at has left nothing.
    assert distributed.each(threads, [0], client=clients[2])[0].error is None
    assert [found.name for found in out.iterdir()] == ["0000-short"]


def test_ctrl_c_while_workers_start(monkeypatch: pytest.MonkeyPatch) -> None:
    def stops(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("distributed.LocalCluster", stops)
    with pytest.raises(distributed.Interrupted, match="workers were starting") as stopped:
        distributed.identify_many(["nowhere"])
    assert stopped.value.outcomes == {} and stopped.value.rows == []


def test_workers_that_do_not_end_lose_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    async def fails(_: object) -> None:
        raise OSError("no such worker")

    def stop(step: str, done: int, of: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(distributed, "_end", fails)
    with pytest.raises(distributed.Interrupted, match="1 of 2") as stopped:
        distributed.each(abs, [-1, -1], progress=stop)
    assert [outcome.value for outcome in stopped.value.outcomes.values()] == [1]


def threads(item: int) -> str | None:
    return os.environ.get("RAYON_NUM_THREADS")


def test_workers_beside_each_other_share_the_cores(clients: dict[int, Client]) -> None:
    found = distributed.each(threads, [0], client=clients[2])
    assert found[0].value == "1"


def test_without_dask_one_sentence_says_what_to_do() -> None:
    code = "import sys; sys.modules['distributed'] = None; from lpvident import distributed; distributed.diagnose_many(['a'])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert said.returncode == 1
    assert said.stderr.splitlines()[-1].startswith("ImportError: lpvident.distributed needs Dask") and "pip install" in said.stderr
    code = "import sys, lpvident.distributed; print([m for m in sys.modules if m.split('.')[0] in ('dask', 'distributed')])"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "[]"


def test_the_bench_of_hidden_effects_runs_on_workers() -> None:
    example = EXAMPLES / "hidden_effects.py"
    options = ["--effects", "coulomb-friction"]
    said = subprocess.run([sys.executable, example, *options], capture_output=True, text=True, check=True).stdout
    assert said.splitlines()[0].startswith("nothing (seed 1): nothing") and said.splitlines()[-1] == "2 of 2 right"


def test_the_plan_follows_every_task() -> None:
    spec = importlib.util.spec_from_file_location("scale", EXAMPLES / "scale.py")
    scale = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(scale)
    # A scheduler that takes no time: three workers, by hand, each with the next task beside it.
    assert scale.finish(3, [1.0, 2.0, 3.0, 1.0, 1.0, 1.0, 2.0], 0.0) == (4.0, 0.0)
    # One that is the limit: it takes each task in turn, and the last one when it is done.
    end, busy = scale.finish(100, [0.1] * 1000, 0.01)
    assert 10.0 <= end <= 10.0 + 100 * 0.02 + 0.1 and busy > 0.8
    # And one that is none.
    end, busy = scale.finish(10, [1.0] * 100, 1e-4)
    assert 10.0 < end < 10.1 and busy < 0.01
    # Half of its time is taken by something else; all of it.
    assert scale.finish(100, [0.1] * 1000, 0.01, taken=0.5)[0] == scale.finish(100, [0.1] * 1000, 0.02)[0]
    assert scale.finish(10, [1.0], 1e-4, taken=1.0) == (float("inf"), 1.0)
