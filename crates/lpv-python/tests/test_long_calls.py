"""Long calls: progress, other threads, Ctrl-C, and what they leave."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from conftest import SMALL

import lpvident


def test_progress_comes_from_the_calling_thread(bundle: lpvident.Bundle) -> None:
    heard: list[tuple[str, int, int, int]] = []
    bundle.identify(progress=lambda step, done, of: heard.append((step, done, of, threading.get_ident())))
    assert {thread for *_, thread in heard} == {threading.get_ident()}
    steps = [step for step, *_ in heard]
    assert len(set(steps)) > 2 and all(done <= of or of == 0 for _, done, of, _ in heard)


def test_an_exception_of_the_callback_ends_the_call(bundle: lpvident.Bundle) -> None:
    class Enough(Exception):
        pass

    def stop(step: str, done: int, of: int) -> None:
        raise Enough

    with pytest.raises(Enough):
        bundle.identify(progress=stop)
    assert bundle.inspect(), "the next call works"


def test_bar(bundle: lpvident.Bundle, capfd: pytest.CaptureFixture[str]) -> None:
    bundle.inspect(progress=True)
    assert "reading records" in capfd.readouterr().err


def test_other_threads_go_on(bundle: lpvident.Bundle) -> None:
    ticks, done = [0], threading.Event()

    def tick() -> None:
        while not done.is_set():
            ticks[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.monotonic()
    bundle.identify()
    seconds = time.monotonic() - start
    done.set()
    thread.join()
    # Python was free for most of that time; a sleep of 1 ms takes longer where cores are few.
    assert ticks[0] > 20 * seconds


CALLS = {
    "identify": "lpvident.Bundle(place).identify(progress=ready).save(out / 'model.json')",
    "diagnose": "lpvident.Bundle(place).diagnose(progress=ready).save(out / 'diagnosis')",
    "simulate": "lpvident.simulate_machine(out / 'bundle', positions={'count': 2000}, progress=ready)",
}

SCRIPT = """
import sys, time, lpvident
from pathlib import Path
place, out = sys.argv[1], Path(sys.argv[2])
def ready(step, done, of):
    print("ready", flush=True)
try:
    {call}
    print("done", flush=True)
except KeyboardInterrupt:
    print("stopped", flush=True)
    # What was left behind ends by itself; it writes nothing.
    time.sleep(float(sys.argv[3]))
"""


@pytest.mark.skipif(os.name == "nt", reason="signals of Unix")
@pytest.mark.parametrize("call", CALLS)
def test_ctrl_c_stops_within_a_second_and_leaves_nothing(call: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp(call)
    place, out = folder / "place", folder / "out"
    out.mkdir()
    lpvident.simulate_machine(place, SMALL | {"setpoints": {"samples": 6000}}, seed=1, hide="coulomb-friction")
    script = SCRIPT.format(call=CALLS[call])
    wait = "3" if call == "simulate" else "0"
    child = subprocess.Popen([sys.executable, "-c", script, place, out, wait], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert child.stdout is not None and child.stderr is not None
    assert child.stdout.readline() == "ready\n"
    time.sleep(0.3)
    start = time.monotonic()
    child.send_signal(signal.SIGINT)
    line = next(l for l in child.stdout if l != "ready\n")
    seconds = time.monotonic() - start
    assert line == "stopped\n", child.stderr.read()
    assert seconds < 1.0, f"{seconds:.2f} s"
    child.wait(60)
    assert child.stderr.read() == ""
    left: list[Path] = list(out.rglob("*"))
    assert left == []
