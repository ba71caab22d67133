"""Bundles from arrays and frames, and what is said of wrong ones."""

from __future__ import annotations

import copy
import math
import pickle
from pathlib import Path

import numpy as np
import pytest

import lpvident

N = 400


def signals(seed: int) -> dict[str, np.ndarray]:
    draw = np.random.default_rng(seed)
    # Over decades, with numbers that few digits do not hold.
    scale = 10.0 ** draw.integers(-12, 9, size=(N, 1))
    return {"y": draw.normal(size=(N, 2)) * scale, "u": draw.normal(size=N) / 3.0, "p": np.linspace(-1.0, math.pi, N)}


def test_arrays_keep_every_digit(tmp_path: Path) -> None:
    given = [signals(1), {**signals(2), "use": "validation", "name": "held-out"}]
    controller = {"reference_numerator": [0.1, 1 / 3], "feedback_numerator": [0.1, 1 / 3], "denominator": [1.0, -0.5]}
    bundle = lpvident.Bundle.from_arrays(
        given, sample_rate=1000 / 3, name='a "name" with ü', units={"y1": "m", "y2": "rad"}, controller=controller
    )
    assert (bundle.name, bundle.sample_rate, len(bundle)) == ('a "name" with ü', 1000 / 3, 2)
    assert bundle.record_names == ["record000", "held-out"]
    assert bundle.description["channels"]["output"]["units"] == ["m", "rad"]
    assert bundle.description["controller"]["denominator"] == [[1.0, -0.5]]
    for index, expected in enumerate(given):
        record = bundle.record(index)
        assert np.array_equal(record.y, expected["y"])
        assert np.array_equal(record.u[:, 0], expected["u"])
        assert np.array_equal(record.p[:, 0], expected["p"])
        assert record.r.shape == (N, 0) or record.r.size == 0
        assert record.names["y"] == ["y1", "y2"]
    place = bundle.path
    del bundle, record
    assert not place.exists(), "a temporary bundle goes with its object"


def test_arrays_stay_in_a_folder_that_is_given(tmp_path: Path) -> None:
    lpvident.Bundle.from_arrays(signals(1), sample_rate=10, folder=tmp_path / "kept")
    assert len(lpvident.Bundle(tmp_path / "kept")) == 1
    with pytest.raises(lpvident.BundleError, match="never overwritten"):
        lpvident.Bundle.from_arrays(signals(1), sample_rate=10, folder=tmp_path / "kept")


def test_bundles_travel_between_processes(tmp_path: Path) -> None:
    signal = np.sin(np.arange(300.0) / 9)
    kept = lpvident.Bundle.from_arrays([{"y": signal, "u": -signal}], sample_rate=100, folder=tmp_path / "kept")
    again = pickle.loads(pickle.dumps(kept))
    assert again.path == kept.path and (again.record(0).y == kept.record(0).y).all()
    with pytest.raises(TypeError, match="give from_arrays or from_frames a folder"):
        pickle.dumps(lpvident.Bundle.from_arrays([{"y": signal, "u": -signal}], sample_rate=100))


def test_a_temporary_folder_goes_with_the_last_copy() -> None:
    bundle = lpvident.Bundle.from_arrays(signals(1), sample_rate=10)
    place, again = bundle.path, copy.deepcopy(bundle)
    assert again is not bundle and again.description == bundle.description
    del bundle
    assert again.record(0).y.shape == (N, 2)
    with pytest.raises(TypeError, match="does not travel"):
        pickle.dumps(again)
    del again
    assert not place.exists()


def test_a_folder_that_cannot_be_written_is_an_error_of_the_tree(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(lpvident.WriteError) as refused:
        lpvident.Bundle.from_arrays(signals(1), sample_rate=10, folder=tmp_path / "file/bundle")
    assert refused.value.path == str(tmp_path / "file/bundle")


def test_frames(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    s = signals(3)
    # The name of an input is one that numpy.savez has an argument of.
    frame = pandas.DataFrame({"file": s["u"], "encoder": s["y"][:, 0]}, index=np.arange(N) * 0.004)
    bundle = lpvident.Bundle.from_frames(
        [frame, (frame[::-1].set_index(frame.index), {"use": "validation"})], outputs=["encoder"], inputs="file", units={"file": "N"}
    )
    assert bundle.sample_rate == pytest.approx(250.0, rel=1e-12)
    assert np.array_equal(bundle.record(0).y[:, 0], s["y"][:, 0])
    assert np.array_equal(bundle.record(1).u[:, 0], s["u"][::-1])
    stamped = frame.set_index(pandas.date_range("2024-01-01", periods=N, freq="4ms"))
    by_stamp = lpvident.Bundle.from_frames(stamped, outputs=["encoder"], inputs=["file"])
    assert by_stamp.sample_rate == pytest.approx(250.0, rel=1e-9)
    with pytest.raises(lpvident.BundleError, match="tells no time"):
        lpvident.Bundle.from_frames(frame.reset_index(), outputs=["encoder"], inputs=["file"])
    with pytest.raises(lpvident.BundleError, match="no column `speed`") as missing:
        lpvident.Bundle.from_frames(frame, outputs=["speed"], inputs=["file"])
    assert missing.value.column == "speed"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"u": np.zeros((2, 2, 2))}, "3 dimensions"),
        ({"u": np.array(["a", "b"])}, "no array of real numbers"),
        ({"u": np.ones(N) * 1j}, "complex"),
        ({"u": np.ones(N - 1)}, "samples|rows|length"),
        ({"u": np.ma.masked_greater(np.arange(N, dtype=float), 3.0)}, "masked"),
        ({"u": np.arange(N).astype("datetime64[s]")}, "times or dates"),
        ({"periods": 7}, "unknown option `periods`"),
        ({"name": "../out"}, "use letters"),
        ({"period": 12.5}, "period = 12.5"),
        ({"period": True}, "period = True"),
        ({"use": 1}, "use = 1"),
    ],
)
def test_wrong_arrays_are_refused(change: dict, message: str) -> None:
    with pytest.raises(lpvident.BundleError, match=message):
        bundle = lpvident.Bundle.from_arrays({**signals(1), **change}, sample_rate=10)
        bundle.record(0)


def test_every_frame_tells_its_time() -> None:
    pandas = pytest.importorskip("pandas")

    def frame(index: object) -> object:
        return pandas.DataFrame({"force": np.ones(N), "x": np.arange(N, dtype=float)}, index=index)

    def bundle(*frames: object) -> lpvident.Bundle:
        return lpvident.Bundle.from_frames(frames, outputs=["x"], inputs=["force"])

    time = np.arange(N) * 0.004
    with_zone = pandas.date_range("2024-01-01", periods=N, freq="4ms", tz="Europe/Berlin")
    assert bundle(frame(time), frame(with_zone)).sample_rate == pytest.approx(250.0, rel=1e-9)
    gap = np.where(np.arange(N) < N // 2, time, time + 0.4)
    for wrong, message in [
        ((frame(time), frame(time / 2)), "record 1: the index tells 500 Hz"),
        ((frame(time), frame(gap)), "record 1: .* equally spaced"),
        ((frame(4 * np.arange(N)),), "whole steps of 4"),
        ((frame([f"row {k}" for k in range(N)]),), "holds no times"),
        ((frame(pandas.MultiIndex.from_product([["a"], range(N)])),), "holds no times"),
    ]:
        with pytest.raises(lpvident.BundleError, match=message):
            bundle(*wrong)
    twice = frame(time)
    twice.columns = ["x", "x"]
    with pytest.raises(lpvident.BundleError, match="several columns are called `x`"):
        lpvident.Bundle.from_frames(twice, outputs=["x"], inputs=[], sample_rate=250.0)
    with pytest.raises(lpvident.BundleError, match="no ndarray"):
        lpvident.Bundle.from_arrays((np.ones(N), np.ones(N)), sample_rate=10.0)  # type: ignore[arg-type]


def test_a_record_by_name_and_number() -> None:
    bundle = lpvident.Bundle.from_arrays([{**signals(k), "name": name} for k, name in ((1, "there"), (2, "back"))], sample_rate=10)
    assert np.array_equal(bundle.record(-1).y, bundle.record("back").y)
    for wrong, message in [("bakc", "nearest: `back`"), (2, "no record 2"), (-3, "no record -3"), (0.5, "no record 0.5")]:
        with pytest.raises(lpvident.BundleError, match=message):
            bundle.record(wrong)


def test_wrong_settings_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"force": np.ones(N), "x": np.ones(N)}, index=np.arange(N) * 0.1)
    folder = tmp_path / "made"
    for call, message in [
        (lambda: lpvident.Bundle.from_arrays(signals(1), sample_rate=10, folder=folder, units={"y3": "m"}), "no column `y3`; there are y1"),
        (lambda: lpvident.Bundle.from_arrays(signals(1), sample_rate=10, folder=folder, units={"y1": 1}), "no text: 1"),
        (lambda: lpvident.Bundle.from_arrays(signals(1), sample_rate=-10, folder=folder), "samples a second"),
        (lambda: lpvident.Bundle.from_arrays(signals(1), sample_rate="fast", folder=folder), "is no number"),
        (lambda: lpvident.Bundle.from_arrays(signals(1), sample_rate=math.nan, folder=folder), "samples a second"),
        (lambda: lpvident.Bundle.from_arrays([{**signals(2), "period": "5"}], sample_rate=10, folder=folder), "record 0: period"),
        (lambda: lpvident.Bundle.from_frames(frame, outputs=["x"], inputs="x", folder=folder), "`x` is given twice"),
    ]:
        with pytest.raises(lpvident.BundleError, match=message):
            call()
        assert not folder.exists()
    assert lpvident.Bundle.from_arrays(signals(1), sample_rate="10").sample_rate == 10.0  # type: ignore[arg-type]
    for periods in (-1, 1.5, "two", True):
        with pytest.raises(lpvident.SettingError, match="skip_periods") as wrong:
            lpvident.Bundle.from_arrays(signals(1), sample_rate=10).frf(skip_periods=periods)
        assert wrong.value.name == "skip_periods"
    with pytest.raises(lpvident.SettingError, match="progress = 'yes'"):
        lpvident.Bundle.from_arrays(signals(1), sample_rate=10).inspect(progress="yes")  # type: ignore[arg-type]


def test_errors_have_fields(tmp_path: Path) -> None:
    with pytest.raises(lpvident.BundleError) as missing:
        lpvident.Bundle(tmp_path)
    assert missing.value.path == str(tmp_path) and missing.value.exit_code == 2
    (tmp_path / "move.csv").write_text("u,y\n0,0\n1,x\n")
    text = "format = 1\nname = 'one'\nsample_rate = 20.0\n[channels.output]\ncolumns = ['y']\n[channels.input]\ncolumns = ['u']\n"
    text += "[[records]]\nfile = 'move.csv'\nkind = 'transient'\nuse = 'estimation'\n"
    (tmp_path / "experiment.toml").write_text(text)
    with pytest.raises(lpvident.BundleError) as number:
        lpvident.Bundle(tmp_path).record(0)
    found = number.value
    assert (found.record, found.line, found.column) == (0, 3, "y") and found.path.endswith("move.csv")
    again = pickle.loads(pickle.dumps(found))
    assert type(again) is lpvident.BundleError and again.line == 3 and again.message == found.message
    (tmp_path / "experiment.toml").write_text(text.replace("sample_rate = 20.0", "sample_rate = 20.0\nnmae = 3"))
    with pytest.raises(lpvident.BundleError) as key:
        lpvident.Bundle(tmp_path)
    assert key.value.line == 4
    for kind in (lpvident.BundleError, lpvident.IdentifyError, lpvident.SettingError, lpvident.WriteError):
        assert issubclass(kind, lpvident.LpvError)
