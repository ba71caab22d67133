"""What Python writes is what the program writes, to the last byte."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from conftest import measured

import lpvident

BUNDLES = measured() or [None]


def run(*arguments: object) -> tuple[int, str]:
    done = subprocess.run([str(a) for a in arguments], check=False, capture_output=True, text=True, timeout=3000)
    return done.returncode, done.stderr


def compare(by_program: tuple[int, str], call, files: list[tuple[Path, Path]]) -> None:
    code, said = by_program
    try:
        call()
    except lpvident.LpvError as refused:
        assert code == refused.exit_code
        assert said.strip() == f"error: {refused.message}"
        return
    assert code in (0, 3), said
    for theirs, ours in files:
        assert theirs.read_bytes() == ours.read_bytes(), ours.name


def both(program: str, bundle: Path, folder: Path, command: str) -> None:
    # Both side by side, since a model file names the folder of its bundle as seen from itself.
    theirs, ours = folder / "a", folder / "b"
    theirs.mkdir()
    ours.mkdir()
    if command == "identify":
        told = run(program, "identify", bundle, "-o", theirs / "model.json")
        compare(told, lambda: lpvident.identify(bundle).save(ours / "model.json"), [(theirs / "model.json", ours / "model.json")])
    else:
        told = run(program, "diagnose", bundle, "-o", theirs)
        names = ("diagnosis.json", "diagnosis.html", "model.json")
        compare(told, lambda: lpvident.diagnose(bundle).save(ours), [(theirs / n, ours / n) for n in names])


@pytest.mark.parametrize("command", ["identify", "diagnose"])
@pytest.mark.parametrize("measured_bundle", BUNDLES, indirect=True)
def test_measured_bundles(program: str, measured_bundle: Path, tmp_path: Path, command: str) -> None:
    both(program, measured_bundle, tmp_path, command)


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_simulated_bundle(program: str, bundle: lpvident.Bundle, tmp_path: Path, command: str) -> None:
    both(program, bundle.path, tmp_path, command)


def test_settings_are_those_of_the_program(program: str, bundle: lpvident.Bundle, tmp_path: Path) -> None:
    settings = tmp_path / "identify.toml"
    settings.write_text('lfr = "exact"\nfunctions = 8\ninterpolation = { kind = "polynomial", order = 2 }\n')
    code, said = run(program, "identify", bundle.path, "-c", settings, "--seed", 3, "-o", tmp_path / "a.json")
    assert code in (0, 3), said
    by_name = bundle.identify(lfr="exact", functions=8, interpolation={"kind": "polynomial", "order": 2}, seed=3)
    by_name.save(tmp_path / "b.json")
    bundle.identify(config=settings, seed=3).save(tmp_path / "c.json")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes() == (tmp_path / "c.json").read_bytes()


def test_simulated_machine(program: str, tmp_path: Path) -> None:
    machine = tmp_path / "machine.toml"
    machine.write_text("seed = 9\n[positions]\ncount = 2\n[multisine]\nperiod = 256\nlines = \"odd\"\n[setpoints]\nsamples = 400\n")
    code, said = run(program, "simulate", "--machine", machine, "--hide", "coulomb-friction", "-o", tmp_path / "a")
    assert code == 0, said
    lpvident.simulate_machine(
        tmp_path / "b",
        {"positions": {"count": 2}, "multisine": {"period": 256, "lines": "odd"}, "setpoints": {"samples": 400}},
        seed=9,
        hide="coulomb-friction",
    )
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert len(files) > 10
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file
