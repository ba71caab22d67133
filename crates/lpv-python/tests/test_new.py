"""`lpv new` of arrays with frequency responses, as Python and MATLAB write them."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lpvident

MODES = ((20.0, 0.01, (1.0, 0.6)), (55.0, 0.02, (0.7, -1.1)))
HZ = 0.5 * np.arange(1, 201)


def response() -> np.ndarray:
    """Lines x outputs x inputs of a body on springs with two modes."""
    s = 2j * np.pi * HZ[:, np.newaxis, np.newaxis]
    shapes = ((hz, damping, np.outer(shape, shape)) for hz, damping, shape in MODES)
    w = 2 * np.pi
    return sum(shape / (s**2 + 2 * damping * w * hz * s + (w * hz) ** 2) for hz, damping, shape in shapes)


def write(folder: Path, ending: str, arrays: dict[str, Any]) -> None:
    folder.mkdir()
    if ending == "npz":
        np.savez(folder / "frf.npz", **arrays)
    elif ending == "mat":
        pytest.importorskip("scipy.io").savemat(folder / "frf.mat", arrays)
    else:
        with pytest.importorskip("h5py").File(folder / "frf.h5", "w") as file:
            for name, array in arrays.items():
                file[name] = array


FRD = {"Frequency": 2 * np.pi * HZ, "ResponseData": np.moveaxis(response(), 0, -1), "Units": "rad/s"}


@pytest.mark.parametrize(
    ("ending", "arrays"),
    [
        ("npz", {"frequency": HZ, "response": response()}),
        ("npz", {"f": HZ, "H": np.moveaxis(response(), 0, -1)}),
        ("npz", {"omega": 2 * np.pi * HZ, "frf": response()[:, :, :1]}),
        ("npz", {"freq": HZ, "G": response()[:, 0, 0], "fs": np.array(1000.0)}),
        ("mat", {"f": HZ, "H": np.moveaxis(response(), 0, -1)}),
        ("mat", {"f": HZ, "H": response()[:, 0, 0]}),
        ("mat", {"G": FRD}),
        ("h5", {"frequencies": HZ, "frf": response()}),
    ],
)
def test_arrays_need_no_edit(program: str, tmp_path: Path, ending: str, arrays: dict[str, Any]) -> None:
    folder = tmp_path / "lab"
    write(folder, ending, arrays)
    done = subprocess.run([program, "new", folder / f"frf.{ending}"], capture_output=True, text=True, check=True)
    assert "outputs and" in done.stdout, done.stdout
    bundle = lpvident.Bundle(folder)
    found = bundle.frf().places[0]
    outputs, inputs = found.response.shape[1:]
    assert np.allclose(found.frequencies, HZ, rtol=1e-12)
    assert np.allclose(found.response, response()[:, :outputs, :inputs], rtol=1e-9, atol=0)


def test_arrays_of_samples_are_none(program: str, tmp_path: Path) -> None:
    """A force called f beside complex numbers of another length."""
    t = np.arange(500) / 100
    write(tmp_path / "lab", "npz", {"f": np.sin(9 * t), "y": np.cos(9 * t), "spectrum": np.fft.rfft(t)})
    command = [program, "new", tmp_path / "lab/frf.npz", "--sample-rate", "100"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "output: y" in done.stdout and "input: f" in done.stdout, done.stdout


def run(samples: int, place: float) -> dict[str, Any]:
    draw = np.random.default_rng(samples)
    u = draw.normal(size=samples)
    return {"y": np.cumsum(u) * place, "u": u, "p": place}


@pytest.mark.parametrize("ending", ["mat", "h5", "tdms"])
def test_runs_of_one_file_are_records(program: str, tmp_path: Path, ending: str) -> None:
    """Runs of other lengths in a struct array; in groups that are called runs, of one length, with the place of each beside its signals."""
    runs = {f"run{k}": run(300 if ending == "h5" else 300 + 20 * k, 0.1 + 0.2 * k) for k in (1, 2, 3)}
    folder = tmp_path / "lab"
    folder.mkdir()
    if ending == "mat":
        table = np.zeros(3, dtype=[("y", object), ("u", object), ("p", object)])
        for k, one in enumerate(runs.values()):
            table[k] = (one["y"], one["u"], one["p"])
        pytest.importorskip("scipy.io").savemat(folder / "all.mat", {"data": table, "fs": 200.0})
    elif ending == "h5":
        with pytest.importorskip("h5py").File(folder / "all.h5", "w") as file:
            file["fs"] = 200.0
            for name, one in runs.items():
                for signal, values in one.items():
                    file[f"{name}/{signal}"] = values
    else:
        tdms = pytest.importorskip("nptdms")
        with tdms.TdmsWriter(folder / "all.tdms") as writer:
            for name, one in runs.items():
                group = [tdms.ChannelObject(name, signal, one[signal], {"wf_increment": 0.005}) for signal in ("y", "u")]
                writer.write_segment(group)
    done = subprocess.run([program, "new", folder / f"all.{ending}"], capture_output=True, text=True, check=True)
    assert "are runs of one machine, a record each" in done.stdout, done.stdout
    bundle = lpvident.Bundle(folder)
    assert (len(bundle), bundle.sample_rate) == (3, 200.0), done.stdout
    for k, one in enumerate(runs.values()):
        record = bundle.record(k)
        assert np.array_equal(record.y[:, 0], one["y"]) and np.array_equal(record.u[:, 0], one["u"])
        if ending != "tdms":
            assert record.position == pytest.approx([one["p"]]), done.stdout
