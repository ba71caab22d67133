"""What one worker and two give, what a task costs the scheduler, and what that means for 1,000 workers.

    python scale.py                  # all of it, some minutes: the tables of docs/scale.md
    python scale.py --only plan      # what the scheduler costs, and the plan: a minute

Every figure is measured here. Times with one worker and with two are taken in turns, so that a load that comes and goes meets both; the
ratio is that of each turn. For the plan a simulation takes the measured time of the scheduler for a task, for a heartbeat and for the
bytes that it relays, and the measured times of diagnoses, and follows every task through it.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import heapq
import logging
import multiprocessing
import os
import pickle
import statistics
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import dask
from distributed import Client, LocalCluster, Worker
from distributed.deploy.subprocess import SubprocessCluster
from distributed.scheduler import heartbeat_interval

import lpvident
from lpvident import distributed

MACHINE = {
    "positions": {"count": 3},
    "multisine": {"period": 512, "periods": 4, "lines": "odd"},
    "setpoints": {"samples": 1000},
    "moves": {"estimation": 2, "validation": 1},
}

HIDDEN = ["coulomb-friction", "cogging", "viscous-friction", "payload"]

#: Workers and bundles of the plan.
WORKERS, BUNDLES = (1, 2, 10, 100, 1000, 3000), 100_000

#: Tasks that a worker of one thread has at a time, the one that runs included: `worker-saturation` is 1.1.
AHEAD = 2


def machines(folder: Path, count: int) -> list[Path]:
    """Bundles of simulated machines, each with an effect in it."""
    places = [folder / f"m{i:02}" for i in range(count)]
    for i, place in enumerate(places):
        lpvident.simulate_machine(place, MACHINE, seed=i + 1, hide=HIDDEN[i % len(HIDDEN)])
    return places


def local(workers: int) -> LocalCluster:
    return LocalCluster(n_workers=workers, threads_per_worker=1, memory_limit=None, dashboard_address=":0")


def bare(path: str) -> None:
    """The same work without Dask."""
    lpvident.diagnose(path)


def speedup(bundles: Sequence[Path], rounds: int) -> distributed.Rows:
    """One worker and two in turns, and beside them one process and two of a plain pool: what the machine gives at that time."""
    print(f"{len(bundles)} diagnoses, one thread a worker, {os.cpu_count()} cores; times in s:\n")
    print("| turn | load before | 1 worker | 2 workers | ratio | ratio of plain processes | both workers at work |")
    print("|---|---|---|---|---|---|---|")
    ratios, plain, busy, rows = [], [], [], distributed.Rows()
    os.environ["RAYON_NUM_THREADS"] = "1"
    pools = multiprocessing.get_context("spawn").Pool
    paths = [str(path) for path in bundles]
    with local(1) as one, local(2) as two, Client(one, set_as_default=False) as a, Client(two, set_as_default=False) as b:
        with pools(1) as single, pools(2) as double:
            # Imports and the first call are not counted.
            for client, pool in ((a, single), (b, double)):
                distributed.diagnose_many(bundles[:2], client=client)
                pool.map(bare, paths[:2], chunksize=1)
            for turn in range(rounds):
                took: dict[object, float] = {}
                before = os.getloadavg()[0]
                for which in (a, b, single, double) if turn % 2 == 0 else (double, single, b, a):
                    start = time.perf_counter()
                    if which in (single, double):
                        which.map(bare, paths, chunksize=1)
                    else:
                        rows = distributed.diagnose_many(bundles, client=which)
                        assert not rows.failed, rows.failed[0].error
                    took[which] = time.perf_counter() - start
                    if which is b:
                        busy.append(sum(row.seconds for row in rows) / (2 * took[b]))
                ratios.append(took[a] / took[b])
                plain.append(took[single] / took[double])
                cells = f"{took[a]:.1f} | {took[b]:.1f} | {ratios[-1]:.2f} | {plain[-1]:.2f} | {100 * busy[-1]:.1f} %"
                print(f"| {turn + 1} | {before:.1f} | {cells} |", flush=True)
    found = [f"{what} {statistics.median(all_):.2f}, from {min(all_):.2f} to {max(all_):.2f}" for what, all_ in
             (("ratio", ratios), ("of plain processes", plain), ("part of the time at work", busy))]
    print(f"\nMedians: {'; '.join(found)}.\n")
    return rows


def sizes(bundle: Path, row: distributed.Row) -> tuple[int, int]:
    """What travels for a task, and what stays; the bytes of the records and of a result."""
    records = sum(file.stat().st_size for file in bundle.glob("records/*"))
    place = max(len(pickle.dumps(place)) for place in lpvident.Bundle(bundle).frf().places)
    result = len(pickle.dumps({**vars(row), "error": None}))
    sent = len(pickle.dumps((str(bundle), None)))
    print("| bytes of one bundle | |\n|---|---|")
    print(f"| its records, which stay where they are | {records} |")
    print(f"| to the worker: a path | {sent} |")
    print(f"| back: verdict, effects, model | {result} |")
    print(f"| the response of one place, as `frf` sends it back | {place} |\n")
    return records, result


def crowd(address: str, count: int) -> None:
    """Many workers in one process: to the scheduler each is one of its own."""
    logging.getLogger("distributed").setLevel(logging.WARNING)
    # What workers do for themselves.
    dask.config.set({"distributed.worker.profile.enabled": False, "distributed.admin.system-monitor.interval": "1h"})

    async def work() -> None:
        async with contextlib.AsyncExitStack() as stack:
            for _ in range(count):
                await stack.enter_async_context(Worker(address, nthreads=1, memory_limit=None, dashboard=False))
            await asyncio.Event().wait()

    asyncio.run(work())


@contextlib.contextmanager
def crowded(count: int) -> Iterator[Client]:
    """A client of a scheduler in a process of its own, and of so many workers in another."""
    with SubprocessCluster(n_workers=0, dashboard_address=":0") as cluster, Client(cluster, set_as_default=False) as client:
        workers = multiprocessing.get_context("spawn").Process(target=crowd, args=(cluster.scheduler_address, count))
        workers.start()
        try:
            client.wait_for_workers(count, timeout=120)
            yield client
        finally:
            workers.kill()
            workers.join()


def idle(client: Client, seconds: float) -> float:
    """Part of the time that the scheduler works when nothing is to be done."""
    # Workers that have just come have more to say.
    time.sleep(3.0)
    before, start = client.run_on_scheduler(time.process_time), time.perf_counter()
    time.sleep(seconds)
    return (client.run_on_scheduler(time.process_time) - before) / (time.perf_counter() - start)


def a_task(client: Client, size: int, count: int) -> float:
    """Scheduler's processor time for a task with a result of so many bytes, s."""
    before = client.run_on_scheduler(time.process_time)
    distributed.each(bytes, [size] * count, client=client)
    return (client.run_on_scheduler(time.process_time) - before) / count


class Costs(NamedTuple):
    """Scheduler's time, s: for a task, for a byte of its result, for a heartbeat; and the part of its time that it needs for itself."""

    task: float
    byte: float
    beat: float
    itself: float

    def taken(self, workers: int) -> float:
        """Part of its time that it has for no task."""
        return self.itself + self.beat * workers / heartbeat_interval(workers)


def costs(result: int, tasks: int, few: int, many: int) -> Costs:
    """Measured with few workers and with many."""
    large = 20 * result
    print("| the scheduler's processor | |\n|---|---|")
    found, still = {}, {}
    for workers in (few, many):
        with crowded(workers) as client:
            distributed.each(bytes, [0] * tasks, client=client)
            found[workers] = statistics.median(a_task(client, 0, tasks) for _ in range(3))
            relayed = statistics.median(a_task(client, large, tasks // 4) for _ in range(3))
            still[workers] = idle(client, 20.0)
        print(f"| a task, with {workers} workers | {1e3 * found[workers]:.2f} ms |", flush=True)
    byte = max(relayed - found[many], 0.0) / large
    beats = [workers / heartbeat_interval(workers) for workers in (few, many)]
    beat = max(still[many] - still[few], 0.0) / (beats[1] - beats[0])
    costs = Costs(found[many], byte, beat, max(still[few] - beat * beats[0], 0.0))
    print(f"| so at most, of such tasks | {1 / costs.task:.0f} a second |")
    print(f"| a result that it relays | {1e9 * byte:.2f} ns a byte, {1e3 * byte * result:.2f} ms for one of {result} bytes |")
    print(f"| a heartbeat of a worker | {1e3 * beat:.2f} ms |")
    print(f"| what it needs for itself | {100 * costs.itself:.1f} % of the time |\n")
    return costs


def finish(workers: int, durations: Sequence[float], service: float, taken: float = 0.0) -> tuple[float, float]:
    """When the last task is done, and for how much of the time the scheduler works.

    The scheduler is one server: it takes ``service`` for each task, from its end to the start of the next one on that worker, and for
    the first ones; ``taken`` is the part of its time that it has for no task. A worker has the next task beside it while it works on one.
    """
    if taken >= 1.0:
        return float("inf"), 1.0
    service /= 1.0 - taken
    free, next_task = 0.0, 0
    until = [0.0] * workers
    ends: list[tuple[float, int]] = []

    def assign(worker: int, now: float) -> None:
        nonlocal next_task
        until[worker] = max(now, until[worker]) + durations[next_task]
        heapq.heappush(ends, (until[worker], worker))
        next_task += 1

    for worker in list(range(workers)) * AHEAD:
        if next_task < len(durations):
            free += service
            assign(worker, free)
    while ends:
        end, worker = heapq.heappop(ends)
        free = max(free, end) + service
        if next_task < len(durations):
            assign(worker, free)
    return free, min(1.0, len(durations) * service * (1.0 - taken) / free + taken)


def check(costs: Costs, workers: int, seconds: float, count: int) -> None:
    """The simulation beside a real scheduler, whose workers sleep: that needs no processors."""
    with crowded(workers) as client:
        distributed.each(time.sleep, [0.0] * 4 * workers, client=client)
        start = time.perf_counter()
        distributed.each(time.sleep, [seconds] * count, client=client)
        real = time.perf_counter() - start
    simulated, busy = finish(workers, [seconds] * count, costs.task, costs.taken(workers))
    print(
        f"{count} tasks that sleep for {seconds} s on {workers} workers took {real:.1f} s, one after the other on each worker "
        f"{count * seconds / workers:.1f} s; the simulation says {simulated:.1f} s, and that the scheduler works for {100 * busy:.0f} % of it.\n"
    )


def plan(seconds: Sequence[float], records: int, result: int, costs: Costs) -> None:
    """Times for many workers, of diagnoses and of tasks as short as one place."""
    service = costs.task + costs.byte * result
    for name, scale in (("diagnoses", 1.0), ("tasks of a tenth of that", 0.1), ("tasks of a hundredth", 0.01)):
        durations = [scale * seconds[i % len(seconds)] for i in range(BUNDLES)]
        print(f"{BUNDLES} {name}, {sum(durations) / BUNDLES:.2f} s each in the mean:\n")
        print("| workers | time to finish | of what they could | scheduler works | tasks a second | relayed, MB/s |")
        print("|---|---|---|---|---|---|")
        for workers in WORKERS:
            end, busy = finish(workers, durations, service, costs.taken(workers))
            part, rate = sum(durations) / workers / end, BUNDLES / end
            print(f"| {workers} | {clock(end)} | {100 * part:.1f} % | {100 * busy:.1f} % | {rate:.3g} | {rate * result / 1e6:.3g} |")
        print()
    rate = BUNDLES / finish(1000, [seconds[i % len(seconds)] for i in range(BUNDLES)], service, costs.taken(1000))[0]
    print(f"1,000 workers read {rate * records / 1e6:.0f} MB/s of records for the diagnoses.")
    shortest = 1000 * service / (1.0 - costs.taken(1000))
    print(f"One scheduler keeps 1,000 workers busy with tasks of {shortest:.1f} s or more in the mean.")


def clock(seconds: float) -> str:
    if seconds >= 3600:
        return f"{seconds / 3600:.1f} h"
    return f"{seconds / 60:.1f} min" if seconds >= 60 else f"{seconds:.1f} s"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--bundles", type=int, default=16, help="diagnoses a turn")
    arguments.add_argument("--rounds", type=int, default=5, help="turns of one worker and two")
    arguments.add_argument("--tasks", type=int, default=2000, help="empty tasks that tell what the scheduler takes")
    arguments.add_argument("--crowd", type=int, default=100, help="workers that make heartbeats and sleep")
    arguments.add_argument("--only", choices=["speedup", "plan"], help="one of the two parts")
    asked = arguments.parse_args()
    with tempfile.TemporaryDirectory(prefix="lpvident-") as folder:
        bundles = machines(Path(folder), asked.bundles)
        if asked.only == "plan":
            with local(1) as cluster, Client(cluster, set_as_default=False) as client:
                rows = distributed.diagnose_many(bundles[: len(HIDDEN)], client=client)
        else:
            rows = speedup(bundles, asked.rounds)
        records, result = sizes(bundles[0], rows[0])
    if asked.only == "speedup":
        return
    measured = costs(result, asked.tasks, few=2, many=asked.crowd)
    check(measured, asked.crowd, seconds=1.0, count=20 * asked.crowd)
    plan([row.seconds for row in rows], records, result, measured)


if __name__ == "__main__":
    main()
