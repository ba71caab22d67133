"""Models: frozen, sampled, along a moving p, as files."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import lpvident

POSITIONS = (-0.3, -0.11, 0.0, 0.27)


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return float((np.linalg.norm(found - expected, axis=(1, 2)) / np.linalg.norm(expected, axis=(1, 2))).max())


def test_frozen_responses_agree_with_python_control(bundle: lpvident.Bundle, model: lpvident.Model) -> None:
    control = pytest.importorskip("control")
    lines = bundle.frf().frequencies[::5]
    for p in POSITIONS:
        for system, sampled in ((model.frozen(p), False), (model.sampled(p), True)):
            assert isinstance(system, control.StateSpace)
            assert system.dt == (model.sample_time if sampled or not model.is_continuous else 0.0)
            points = 2j * np.pi * lines
            points = points if system.dt == 0 else np.exp(points * system.dt)
            theirs = np.array([system.horner(s, warn_infinite=False)[:, :, 0] for s in points])
            assert relative(model.frequency_response(p, lines, sampled=sampled), theirs) < 1e-12


def test_simulation_follows_the_moving_position(bundle: lpvident.Bundle, model: lpvident.Model) -> None:
    found = model.validate(bundle)
    assert found.runs
    for run in found.runs:
        record = bundle.record(run.name)
        y = model.simulate(record.u, record.p)
        assert np.array_equal(run.measured, record.y)
        # The records begin at rest, as the simulation does.
        scale = np.abs(run.open_loop).max(axis=0)
        assert (np.abs(y - run.open_loop) / scale).max() < 1e-10


def test_simulation_at_rest_is_that_of_the_sampled_matrices(model: lpvident.Model) -> None:
    draw = np.random.default_rng(2)
    u, x0 = draw.normal(size=(60, 2)), draw.normal(size=model.states)
    matrices = model._native.sampled([0.1], None)[0]
    a, b, c, d = matrices
    x, expected = x0, []
    for k in range(60):
        expected.append(c @ x + d @ u[k])
        x = a @ x + b @ u[k]
    for p in (0.1, [0.1], np.full((60, 1), 0.1), np.full(60, 0.1)):
        assert np.allclose(model.simulate(u, p, x0=x0), expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


def test_predictions_are_better_than_simulations(bundle: lpvident.Bundle, model: lpvident.Model) -> None:
    record = bundle.record("move0")
    predicted = model.predict(record.u, record.y, record.p)
    one, open_loop = (np.std(record.y - y, axis=0) for y in (predicted, model.simulate(record.u, record.p)))
    assert predicted.shape == record.y.shape
    assert (one < open_loop).all()


def test_wrong_arguments_are_refused(model: lpvident.Model) -> None:
    u = np.zeros((10, 2))
    for call in (
        lambda: model.frozen(0.5),
        lambda: model.frozen([0.1, 0.2]),
        lambda: model.simulate(u, np.zeros(9)),
        lambda: model.simulate(np.zeros((10, 3)), 0.0),
        lambda: model.simulate(u, 0.0, x0=np.zeros(3)),
        lambda: model.simulate(u),
        lambda: model.predict(u, np.zeros((9, 2)), 0.0),
        lambda: model.predict(u, u, 0.0, noise=[1.0]),
        lambda: model.frequency_response(0.0, [-1.0]),
    ):
        with pytest.raises(lpvident.ModelError):
            call()
    masked = np.ma.masked_greater(np.linspace(0.0, 0.1, 10), 0.05)
    for call in (
        lambda: model.frozen("a"),
        lambda: model.frozen(1j),
        lambda: model.frozen(np.ma.masked_array([0.1], [True])),
        lambda: model.simulate(u, 0.0, x0=np.full(model.states, np.nan)),
        lambda: model.simulate(u, 0.0, x0="a"),
        lambda: model.predict(u, u, 0.0, noise=[-1.0, 1.0]),
        lambda: model.predict(u, u, 0.0, noise=[np.nan, 1.0]),
    ):
        with pytest.raises(lpvident.ModelError):
            call()
    with pytest.raises(lpvident.LpvError, match="masked"):
        model.simulate(u, masked)
    for points in (0, 1, 10**12, -1, 2.5):
        with pytest.raises(lpvident.SettingError, match="2 to 1000"):
            model.save("model.mat", points=points)
    with pytest.raises(lpvident.LpvError):
        model.simulate(np.full((10, 2), np.nan), 0.0)
    with pytest.raises(lpvident.BundleError, match="empty"):
        model.simulate(np.zeros((0, 2)), 0.0)


def test_models_travel_between_processes(model: lpvident.Model) -> None:
    assert pickle.loads(pickle.dumps(model)).to_json() == model.to_json()
    lines = np.linspace(1.0, 40.0, 40)
    # Of no bundle, and so of no folder.
    other = lpvident.fit_frf(lines, 1.0 / (1.0 + 0.1j * lines), sample_rate=100.0, order=1, integrators=0)
    assert pickle.loads(pickle.dumps(other)).to_json() == other.to_json()


def test_settings(bundle: lpvident.Bundle) -> None:
    with pytest.raises(lpvident.SettingError) as unknown:
        bundle.identify(functons=8)
    assert (unknown.value.name, unknown.value.nearest) == ("functons", "functions")
    with pytest.raises(lpvident.SettingError) as kind:
        bundle.identify(order="eight")
    assert kind.value.name == "order"
    with pytest.raises(lpvident.SettingError) as range_:
        bundle.identify(hold_out=2.0)
    assert (range_.value.name, range_.value.value, range_.value.allowed) == ("hold-out", 2.0, "0 to 0.95")
    assert "functions" in lpvident.settings_template()


def test_machines_are_checked_before_there_is_a_folder(tmp_path: Path) -> None:
    place = tmp_path / "bundle"
    with pytest.raises(lpvident.MachineError, match="nearest: `coulomb-friction`"):
        lpvident.simulate_machine(place, hide="coulomb-frction")
    with pytest.raises(lpvident.SettingError) as unknown:
        lpvident.simulate_machine(place, multisine={"perod": 512})
    assert unknown.value.nearest == "period"
    with pytest.raises(lpvident.SettingError, match="there are .*multisine"):
        lpvident.simulate_machine(place, zzzzzz=1)
    with pytest.raises(lpvident.MachineError, match="above zero"):
        lpvident.simulate_machine(place, machine={"machine": {"beam_mass_kg": -1.0}})
    assert not place.exists()
    assert "beam-mass-kg" in lpvident.machine_template()


def test_files(model: lpvident.Model, bundle: lpvident.Bundle, tmp_path: Path) -> None:
    model.save(tmp_path / "model.json")
    again = lpvident.load(tmp_path / "model.json")
    assert again.to_json() == model.to_json()
    again.save(tmp_path / "deeper/model.json")
    assert json.loads((tmp_path / "deeper/model.json").read_text())["identification"]["folder"].startswith("..")
    assert np.array_equal(again.poles(0.1), model.poles(0.1))
    scipy = pytest.importorskip("scipy.io")
    model.to_mat(tmp_path / "model.mat")
    assert np.array_equal(scipy.loadmat(tmp_path / "model.mat")["lpv"]["A"][0, 0], model.lfr()["A"])
    (tmp_path / "notes.json").write_text("mine")
    with pytest.raises(lpvident.WriteError) as foreign:
        model.save(tmp_path / "notes.json")
    assert foreign.value.path == str(tmp_path / "notes.json") and (tmp_path / "notes.json").read_text() == "mine"
    model.save(tmp_path / "notes.json", overwrite=True)
    with pytest.raises(lpvident.ModelError):
        model.save(tmp_path / "model.xls")
    with pytest.raises(lpvident.ModelError) as missing:
        lpvident.load(tmp_path / "none.json")
    assert missing.value.path.endswith("none.json")


def test_accounts_show_the_verdict_first(bundle: lpvident.Bundle, model: lpvident.Model) -> None:
    assert model.worth == "good" and model.verdict and model.verdict in model._repr_html_().split("</p>")[0].replace("&#x27;", "'")
    assert model.text.startswith(model.verdict[:10]) and model.verdict in repr(model)
    found = model.validate(bundle, all=True)
    assert len(found.runs) == 5 and found._repr_html_().index("<p") < found._repr_html_().index("<table")
    inspection = bundle.inspect()
    assert len(inspection.data["records"]) == len(bundle) and inspection.noise.shape == (2,)
    deviation = model.frozen_deviation
    if deviation is not None:
        assert deviation.total.shape == (5, len(deviation.frequencies), 2, 2)
    pytest.importorskip("pandas")
    assert len(found.to_frame()) == 10
    assert len(inspection.lines()) > 0


def test_a_diagnosis_names_the_effect(hidden: lpvident.Bundle, diagnosis: lpvident.Diagnosis, tmp_path: Path) -> None:
    found = diagnosis
    assert "coulomb-friction" in [effect["effect"] for effect in found.effects]
    assert found.verdict in found.text
    found.save(tmp_path / "diagnosis")
    assert json.loads((tmp_path / "diagnosis/diagnosis.json").read_text()) == found.data
    assert (tmp_path / "diagnosis/diagnosis.html").read_text() == found.html
    assert found.model.effects
    # In the loop the model with its effects errs by the noise; its frozen response is that of the linear part.
    errors = [o["closed_loop"]["over_noise"] for r in found.model.validate(hidden).data["records"] for o in r["outputs"]]
    assert max(errors) < 1.5, errors
    pytest.importorskip("pandas")
    frame = found.to_frame()
    assert {"effect", "parameter", "value", "std", "unit"} <= set(frame.columns) and len(frame) >= 1


def test_a_diagnosed_model_says_what_its_diagnosis_said(diagnosis: lpvident.Diagnosis, tmp_path: Path) -> None:
    model = diagnosis.model
    model.save(tmp_path / "model.json")
    for found in (model, lpvident.load(tmp_path / "model.json")):
        assert found.verdict == diagnosis.verdict and found.verdict in repr(found)
        assert found._repr_html_().index(found.verdict[:9]) < found._repr_html_().index("<table")
    assert diagnosis.worth in ("explained", "partly-explained")


def test_a_state_that_was_known_comes_back(model: lpvident.Model) -> None:
    draw, along = np.random.default_rng(4), 0.1 + 0.15 * np.sin(np.arange(400) / 30)
    u, x0 = draw.normal(size=(400, 2)), draw.normal(size=model.states)
    y = model.simulate(u, along, x0=x0)
    found = model.first_state(u, y, along)
    assert found.shape == (model.states,)
    assert np.abs(model.simulate(u, along, x0=found) - y).max() < 1e-3 * np.abs(y - model.simulate(u, along)).max()
    for wrong in (y[:-1], y[:, :1], np.full_like(y, np.nan)):
        with pytest.raises(lpvident.LpvError):
            model.first_state(u, wrong, along)


def test_a_record_begins_where_validate_begins_it(bundle: lpvident.Bundle, model: lpvident.Model) -> None:
    record = bundle.record("move0")
    options = {"r": record.r[700:], "p": record.p[700:], "use": "validation"}
    cut = lpvident.Bundle.from_arrays({"y": record.y[700:], "u": record.u[700:], **options}, sample_rate=bundle.sample_rate)
    record, (run,) = cut.record(0), model.validate(cut).runs
    x0 = model.first_state(record.u, record.y, record.p)
    scale = np.abs(run.open_loop).max(axis=0)
    assert (np.abs(model.simulate(record.u, record.p, x0=x0) - run.open_loop) / scale).max() < 1e-6
    # From rest it is another run.
    assert (np.abs(model.simulate(record.u, record.p) - run.open_loop) / scale).max() > 1e-2


def test_a_start_of_a_model_with_offsets_or_without_bounds() -> None:
    # With a working point: the start is that of what is left of it.
    draw = np.random.default_rng(1)
    u = draw.normal(size=3000) + 5.0
    y = np.zeros(3000)
    for k in range(1, 3000):
        y[k] = 0.95 * y[k - 1] + 0.1 * u[k - 1]
    y += 7.0 + 1e-4 * draw.normal(size=3000)
    bundle = lpvident.Bundle.from_arrays([{"y": y, "u": u}, {"y": y, "u": u, "use": "validation"}], sample_rate=100.0)
    model = bundle.identify(order=1)
    x0 = model.first_state(u[1000:], y[1000:])
    assert np.abs(model.simulate(u[1000:], x0=x0)[:, 0] - y[1000:]).max() < 0.05
    lines = np.linspace(0.5, 40.0, 200)
    grows = lpvident.fit_frf(lines, 0.1 / (np.exp(2j * np.pi * lines / 100.0) - 1e9), sample_rate=100.0, order=1, integrators=0)
    assert grows.first_state(np.ones(60), np.ones(60)).tolist() == [0.0]


def test_a_system_of_python_control_has_the_names_of_its_machine(bundle: lpvident.Bundle, model: lpvident.Model) -> None:
    pytest.importorskip("control")
    channels = bundle.description["channels"]
    for system in (model.frozen(0.1), model.sampled(0.1)):
        assert system.output_labels == channels["output"]["columns"] and system.input_labels == channels["input"]["columns"]
        assert system.name == bundle.name.replace(".", "_")


def test_names_that_python_control_refuses_are_changed() -> None:
    control = pytest.importorskip("control")
    pandas = pytest.importorskip("pandas")
    draw = np.random.default_rng(0)
    u = draw.normal(size=1500)
    frame = pandas.DataFrame({"drive.force": u, "axis.x": np.convolve(u, 0.8 ** np.arange(40))[:1500] + 0.01 * draw.normal(size=1500)})
    bundle = lpvident.Bundle.from_frames(frame, outputs=["axis.x"], inputs=["drive.force"], sample_rate=100.0, name="axis 1.5 kg")
    system = bundle.identify(order=1).frozen()
    assert isinstance(system, control.StateSpace)
    assert (system.input_labels, system.output_labels, system.name) == (["drive_force"], ["axis_x"], "axis 1_5 kg")


def test_bode_plot(model: lpvident.Model) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axes = model.plot_bode()
    assert axes.shape == (2, 2) and len(axes[0, 0].lines) == 3
    assert len(model.plot_bode(0.1, [0.1, 1.0])[0, 0].lines) == 1


def test_a_discrete_model_has_one_sample_time() -> None:
    lines = np.linspace(1.0, 40.0, 40)
    model = lpvident.fit_frf(lines, 1.0 / (1.0 + 0.1j * lines), sample_rate=100.0, order=1, integrators=0)
    assert not model.is_continuous
    assert model.sampled(sample_time=0.01).dt == pytest.approx(0.01)
    for call in (
        lambda: model.sampled(sample_time=0.02),
        lambda: model.frequency_response(None, [1.0], sample_time=0.02),
        lambda: model.simulate(np.ones(5), sample_time=0.02),
    ):
        with pytest.raises(lpvident.LpvError):
            call()


def test_a_fit_that_grows_by_half_in_a_sample_is_not_good() -> None:
    lines = np.linspace(0.5, 40.0, 200)
    z = np.exp(2j * np.pi * lines / 100.0)
    for pole, bad in ((0.9, False), (1.8, True)):
        model = lpvident.fit_frf(lines, 0.1 / (z - pole), sample_rate=100.0, order=1, integrators=0)
        assert np.abs(model.poles()).max() == pytest.approx(pole, abs=1e-6)
        assert (model.worth == "approximate" and "unstable" in model.verdict) == bad
