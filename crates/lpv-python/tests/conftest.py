"""What the tests share: a small simulated machine with its model, the program, the measured bundles."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

import lpvident

ROOT = Path(__file__).resolve().parents[3]

#: Enough for an LPV model in seconds.
SMALL = {
    "positions": {"count": 5},
    "multisine": {"period": 512, "periods": 5, "lines": {"band": {"first": 1, "last": 153}}},
    "setpoints": {"samples": 1200},
    "moves": {"estimation": 3, "validation": 2},
}


@pytest.fixture(scope="session")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> lpvident.Bundle:
    return lpvident.simulate_machine(tmp_path_factory.mktemp("small") / "bundle", SMALL, seed=5)


@pytest.fixture(scope="session")
def model(bundle: lpvident.Bundle) -> lpvident.Model:
    return bundle.identify()


@pytest.fixture(scope="session")
def hidden(tmp_path_factory: pytest.TempPathFactory) -> lpvident.Bundle:
    """The machine with a friction that nobody tells."""
    return lpvident.simulate_machine(tmp_path_factory.mktemp("hidden") / "bundle", SMALL, seed=5, hide="coulomb-friction")


@pytest.fixture(scope="session")
def diagnosis(hidden: lpvident.Bundle) -> lpvident.Diagnosis:
    return hidden.diagnose()


@pytest.fixture(scope="session")
def program() -> str:
    """The program `lpv`: LPV_PROGRAM, else that of the target folder or the path."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    for found in (os.environ.get("LPV_PROGRAM"), target / "release/lpv", target / "debug/lpv", shutil.which("lpv")):
        if found and Path(found).is_file():
            return str(found)
    pytest.skip("the program lpv is not built: cargo build --release --bin lpv")


def measured() -> list[str]:
    """Names of the measured and simulated bundles beside the repository, or those of them that LPV_BUNDLES names, by commas."""
    folder = ROOT.parent / "shared/data"
    named = os.environ.get("LPV_BUNDLES")
    names = sorted(p.parent.name for p in folder.glob("*/experiment.toml"))
    return [n for n in names if named is None or n in named.split(",")]


@pytest.fixture
def measured_bundle(request: pytest.FixtureRequest) -> Path:
    if request.param is None:
        pytest.skip("../shared/data is missing: no measured bundles")
    return ROOT.parent / "shared/data" / request.param
