"""The bench of hidden effects on a cluster: machines with something wrong with them, and what a diagnosis says of each.

    python hidden_effects.py --seeds 3                       # on the cores of this machine
    python hidden_effects.py --scheduler node1:8786    # on a cluster of Dask, whose workers have lpvident

As `cargo xtask blind` does, each task simulates a machine in a scratch folder of its worker, diagnoses the bundle, which does not tell
what was hidden in it, and gives back a line; the machines here differ in noise and moves only. Numbers and names travel.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import lpvident
from lpvident import distributed

EFFECTS = ["coulomb-friction", "viscous-friction", "cogging", "cable-stiffness", "payload", "delay", "actuator-lag", "sensor-gain"]

MACHINE = {
    "positions": {"count": 3},
    "multisine": {"period": 512, "periods": 4, "lines": "odd"},
    "setpoints": {"samples": 800},
    "moves": {"estimation": 2, "validation": 1},
}


def named(case: tuple[str, int]) -> list[str]:
    """The effects that are found in a machine with this one; none where nothing was hidden."""
    effect, seed = case
    with tempfile.TemporaryDirectory(prefix="lpvident-") as folder:
        hide = [effect] if effect else []
        bundle = lpvident.simulate_machine(Path(folder) / "bundle", MACHINE, seed=seed, hide=hide, progress=distributed.heed)
        return [found["effect"] for found in bundle.diagnose(progress=distributed.heed).effects]


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--seeds", type=int, default=1, help="machines with each effect")
    arguments.add_argument("--effects", default=",".join(EFFECTS), help="names, by commas")
    arguments.add_argument("--scheduler", help="address of a scheduler; a cluster of this machine without")
    asked = arguments.parse_args()
    cases = [(effect, seed) for effect in ["", *asked.effects.split(",")] for seed in range(1, asked.seeds + 1)]
    if asked.scheduler:
        from distributed import Client

        Client(asked.scheduler)
    found = distributed.each(named, cases, step="machines", progress=True)
    right = 0
    for (effect, seed), outcome in zip(cases, found):
        answer = f"not simulated: {outcome.error}" if outcome.error else ", ".join(outcome.value) or "nothing"
        right += outcome.error is None and outcome.value == ([effect] if effect else [])
        print(f"{effect or 'nothing'} (seed {seed}): {answer}, {outcome.seconds:.1f} s")
    print(f"{right} of {len(cases)} right")


if __name__ == "__main__":
    main()
