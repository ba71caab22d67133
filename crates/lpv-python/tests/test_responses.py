"""Frequency responses, and models of those that were measured elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

import lpvident


def two_modes(p: float, rate: float) -> tuple[list[np.ndarray], np.ndarray]:
    """A discrete system of two modes, 2 x 2, whose first frequency falls with p; and its poles."""
    blocks, poles = [], []
    for frequency, damping in ((12.0 * (1.0 - 0.3 * p), 0.02), (31.0, 0.05)):
        pole = np.exp(2 * np.pi * frequency / rate * (-damping + 1j * np.sqrt(1 - damping**2)))
        blocks.append(np.array([[pole.real, pole.imag], [-pole.imag, pole.real]]))
        poles += [pole, pole.conjugate()]
    a = np.block([[blocks[0], np.zeros((2, 2))], [np.zeros((2, 2)), blocks[1]]])
    b = np.array([[1.0, 0.3], [0.2, -0.5], [0.4, 1.0], [-0.3, 0.1]])
    c = np.array([[0.5, 1.0, -0.2, 0.3], [1.0, -0.1, 0.6, 0.8]])
    return [a, b, c], np.array(poles)


def response(system: list[np.ndarray], lines: np.ndarray, rate: float) -> np.ndarray:
    a, b, c = system
    z = np.exp(2j * np.pi * lines / rate)
    return np.array([c @ np.linalg.solve(zk * np.eye(len(a)) - a, b) for zk in z])


def sorted_poles(poles: np.ndarray) -> np.ndarray:
    return poles[np.lexsort((poles.imag, poles.real.round(6)))]


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e6])
def test_poles_of_a_response_come_back(scale: float) -> None:
    rate, lines = 200.0, np.linspace(0.5, 95.0, 190)
    system, poles = two_modes(0.0, rate)
    f = scale * response(system, lines, rate)
    model = lpvident.fit_frf(lines, f, sample_rate=rate, integrators=0, order=4)
    assert np.abs(sorted_poles(model.poles()) - sorted_poles(poles)).max() < 1e-6
    g = model.frequency_response(None, lines)
    assert np.abs(g - f).max() < 1e-6 * np.abs(f).max()
    assert (model.inputs, model.outputs, model.sample_time) == (2, 2, 1 / rate)


def test_order_is_chosen_from_a_noisy_response() -> None:
    rate, lines = 200.0, np.linspace(0.5, 95.0, 190)
    system, poles = two_modes(0.0, rate)
    f = response(system, lines, rate)
    draw = np.random.default_rng(1)
    noise = 1e-3 * (draw.normal(size=f.shape) + 1j * draw.normal(size=f.shape))
    model = lpvident.fit_frf(lines, f + noise, sample_rate=rate, deviation=1.5e-3)
    near = np.abs(model.poles()[:, None] - poles).min(axis=0)
    assert near.max() < 1e-2, model.poles()
    assert model.reasons and "order" in " ".join(model.reasons)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_fit_says_what_it_is_worth(scale: float) -> None:
    rate, lines = 200.0, np.linspace(0.5, 95.0, 190)
    f = scale * response(two_modes(0.0, rate)[0], lines, rate)
    draw = np.random.default_rng(2)
    size = 1e-3 * scale
    noisy = f + size * (draw.normal(size=f.shape) + 1j * draw.normal(size=f.shape)) / np.sqrt(2)
    fitted = {order: lpvident.fit_frf(lines, noisy, sample_rate=rate, integrators=0, order=order, deviation=size) for order in (1, 2, 4)}
    assert fitted[4].worth == "good", fitted[4].verdict
    # One of two modes is missing, then both.
    assert fitted[2].worth in ("approximate", "not-a-model") and "noise" in fitted[2].verdict, fitted[2].verdict
    assert fitted[1].worth == "not-a-model", fitted[1].verdict
    chosen = lpvident.fit_frf(lines, noisy, sample_rate=rate, integrators=0, deviation=size)
    assert chosen.worth == "good" and chosen.states == 4, chosen.verdict


def test_samples_of_a_continuous_response_are_fitted_as_well_as_a_given_order_does() -> None:
    rate, lines = 100.0, np.linspace(1.0, 40.0, 60)
    s = 2j * np.pi * lines
    f = 100.0 / (s * s + 2.0 * s + 900.0)
    draw = np.random.default_rng(1)
    size = 1e-3 * np.abs(f)
    noisy = f + size * (draw.normal(size=60) + 1j * draw.normal(size=60))
    found = lpvident.fit_frf(lines, noisy, sample_rate=rate, integrators=0, deviation=np.sqrt(2) * size)
    off = np.linalg.norm(found.frequency_response(None, lines)[:, 0, 0] - f) / np.linalg.norm(f)
    assert off < 0.01, (off, found.verdict)


def test_responses_at_several_positions_give_an_lpv_model() -> None:
    rate, lines = 200.0, np.linspace(0.5, 95.0, 120)
    positions = np.linspace(0.0, 1.0, 6)
    f = np.array([response(two_modes(p, rate)[0], lines, rate) for p in positions])
    model = lpvident.fit_frf(lines, f, positions=positions, sample_rate=rate, lfr="exact", integrators=0)
    assert model.range.tolist() == [[0.0, 1.0]]
    g = np.array([model.frequency_response(p, lines) for p in positions])
    assert np.median(np.abs(g - f)) < 0.02 * np.median(np.abs(f))


def test_deviations_come_back() -> None:
    lines, draw = np.linspace(1.0, 10.0, 20), np.random.default_rng(3)
    variance = draw.uniform(1.0, 9.0, (20, 3, 1)) * draw.uniform(1e-6, 1e-2, (20, 1, 2))
    place = lpvident.Frf.from_arrays(lines, np.ones((20, 3, 2)), deviation=np.sqrt(variance))
    assert np.allclose(place.deviation, np.sqrt(variance), rtol=1e-12)
    for wrong in (-1.0, np.full(20, np.nan), np.ones((20, 2)), np.ones(19)):
        with pytest.raises(lpvident.ModelError, match="deviation of shape"):
            lpvident.Frf.from_arrays(lines, np.ones((20, 3, 2)), deviation=wrong)


def test_wrong_responses_are_refused() -> None:
    lines = np.linspace(1.0, 10.0, 20)
    with pytest.raises(lpvident.ModelError, match="twice the highest"):
        lpvident.fit_frf(lines, np.ones(20), sample_rate=15.0)
    with pytest.raises(lpvident.ModelError, match="shape"):
        lpvident.fit_frf(lines, np.ones(19), sample_rate=50.0)
    with pytest.raises(lpvident.ModelError, match="sort"):
        lpvident.fit_frf(lines[::-1], np.ones(20), sample_rate=50.0)
    with pytest.raises(lpvident.SettingError) as wrong:
        lpvident.fit_frf(lines, np.ones(20), sample_rate=50.0, ordr=2)
    assert wrong.value.nearest == "order"


def test_responses_of_a_bundle(bundle: lpvident.Bundle) -> None:
    found = bundle.frf()
    assert found.response.shape == (5, 153, 2, 2) and found.response.dtype == np.complex128
    assert np.allclose(found.positions[:, 0], np.linspace(-0.3, 0.3, 5))
    assert found.frequencies[0] == pytest.approx(bundle.sample_rate / 512)
    place = found[2]
    variance = place.output_covariance[7, 1, 1].real * place.input_factor[7, 0, 0].real
    assert place.deviation[7, 1, 0] == pytest.approx(np.sqrt(variance))
    # The same responses by way of arrays give the same model.
    ways = [found.fit(lfr="exact", seed=1), lpvident.fit_frf(found.places, sample_rate=found.sample_rate, lfr="exact", seed=1)]
    assert ways[0].to_json() == ways[1].to_json()


def test_xarray(bundle: lpvident.Bundle) -> None:
    pytest.importorskip("xarray")
    found = bundle.frf()
    dataset = found.to_xarray()
    assert dataset.response.sizes == {"place": 5, "frequency": 153, "output": 2, "input": 2}
    assert np.array_equal(dataset.position, found.positions[:, 0])
    again = lpvident.Responses.from_xarray(dataset.transpose("input", "output", "place", "frequency"))
    assert again.sample_rate == found.sample_rate and np.array_equal(again.positions, found.positions)
    assert np.array_equal(again.response, found.response) and np.array_equal(again.frequencies, found.frequencies)
    # Variances of entries are written, and make a product of outputs and inputs again.
    assert np.allclose(again.deviation, found.deviation, rtol=1e-12)


def test_fits_of_xarrays() -> None:
    xarray = pytest.importorskip("xarray")
    rate, lines = 200.0, np.linspace(0.5, 95.0, 190)
    f = response(two_modes(0.0, rate)[0], lines, rate)
    given = {"integrators": 0, "order": 4}
    known = lpvident.fit_frf(lines, f, sample_rate=rate, deviation=1e-3, **given).to_json()
    place = lpvident.Responses([lpvident.Frf.from_arrays(lines, f, deviation=1e-3)], rate)
    dataset = place.to_xarray()
    # Axes in any order; a place and a channel that are selected; an array of its own.
    for layout in (dataset, dataset.transpose("output", "frequency", "input", "place"), dataset.isel(place=0)):
        assert lpvident.fit_frf(layout, **given).to_json() == known
    one = lpvident.fit_frf(dataset.isel(place=0, output=1, input=0), **given)
    assert one.to_json() == lpvident.fit_frf(lines, f[:, 1, 0], sample_rate=rate, deviation=1e-3, **given).to_json()
    plain = lpvident.fit_frf(lines, f, sample_rate=rate, **given).to_json()
    assert lpvident.fit_frf(dataset.response, sample_rate=rate, **given).to_json() == plain
    arrays = lpvident.fit_frf(dataset.frequency, dataset.response[0], sample_rate=rate, deviation=1e-3, **given)
    assert arrays.to_json() == known
    angular = dataset.assign_coords(frequency=("frequency", lines, {"units": "rad/s"}))
    for wrong, message in [
        (angular, "frequencies in rad/s"),
        (dataset.rename(frequency="f"), "over frequency|over place, f"),
        (dataset.drop_vars("frequency"), "response over"),
        (dataset.drop_vars("response"), "over nothing"),
        (dataset.drop_attrs() if hasattr(dataset, "drop_attrs") else xarray.Dataset(dataset, attrs={}), "give sample_rate"),
        (dataset.assign(deviation=(("frequency", "signal"), np.ones((190, 3)))), "a deviation over frequency, signal"),
        (dataset.assign_coords(position=("frequency", lines)), "a position over frequency"),
        (xarray.concat([dataset, dataset], "place").assign_coords(position=3.0), "a position over nothing"),
    ]:
        with pytest.raises(lpvident.ModelError, match=message):
            lpvident.fit_frf(wrong, **given)
    with pytest.raises(lpvident.ModelError, match="no xarray"):
        lpvident.Responses.from_xarray(f)  # type: ignore[arg-type]


def test_fits_of_responses_of_python_control() -> None:
    control = pytest.importorskip("control")
    rate, lines = 200.0, np.linspace(0.5, 95.0, 190)
    # Other numbers of outputs and inputs, so that no axis stands for another one.
    f = response(two_modes(0.0, rate)[0], lines, rate)[:, :, :1]
    given = {"integrators": 0, "order": 4}
    omega, data = 2 * np.pi * lines, np.moveaxis(f, 0, -1)
    for frd, more in (
        (control.FRD(data, omega, dt=1 / rate), {}),
        (control.FRD(data, omega, dt=1 / rate), {"sample_rate": rate, "deviation": 1e-3}),
        (control.FRD(data, omega), {"sample_rate": rate}),
        (control.FRD(data, omega, dt=True), {"sample_rate": rate}),
    ):
        model = lpvident.fit_frf(frd, **given, **more)
        assert (model.outputs, model.inputs, model.sample_time) == (2, 1, 1 / rate)
        assert np.abs(model.frequency_response(None, lines) - f).max() < 1e-6 * np.abs(f).max()
    positions = np.linspace(0.0, 1.0, 6)
    several = [control.FRD(np.moveaxis(response(two_modes(p, rate)[0], lines, rate), 0, -1), omega, dt=1 / rate) for p in positions]
    model = lpvident.fit_frf(several, positions=positions, lfr="exact", integrators=0)
    assert model.range.tolist() == [[0.0, 1.0]]
    for call, message in [
        (lambda: lpvident.fit_frf(control.FRD(data, omega)), "give sample_rate"),
        (lambda: lpvident.fit_frf(control.FRD(data, omega, dt=True)), "give sample_rate"),
        (lambda: lpvident.fit_frf(control.FRD(data, omega, dt=0.01), sample_rate=rate), "0.01 s, 100 Hz, not of 200 Hz"),
        (lambda: lpvident.fit_frf([several[0], control.FRD(data, omega, dt=0.01)], positions=[0, 1]), "0.01 s"),
        (lambda: lpvident.fit_frf(several, positions=[0.0]), "6 responses and 1 positions"),
        (lambda: lpvident.fit_frf(control.FRD(data, omega, dt=0.01)), "twice the highest"),
    ]:
        with pytest.raises(lpvident.ModelError, match=message):
            call()


def test_what_is_no_response_is_refused_in_the_tree_of_errors() -> None:
    frf = lpvident.Frf.from_arrays([1.0, 2.0], [1.0, 2.0])
    for call in (
        lambda: lpvident.fit_frf(3.0, sample_rate=50.0),
        lambda: lpvident.fit_frf([1.0, 2.0], sample_rate=50.0),
        lambda: lpvident.fit_frf(["a"], ["b"], sample_rate=50.0),
        lambda: lpvident.fit_frf([1.0], ["b"], sample_rate=50.0),
        lambda: lpvident.fit_frf([1.0], [1.0], sample_rate="fast"),
        lambda: lpvident.fit_frf([1.0], [1.0], sample_rate=50.0, deviation="small"),
        lambda: lpvident.fit_frf([1.0], [[1.0]], sample_rate=50.0, positions="here"),
        lambda: lpvident.fit_frf(frf),
        lambda: lpvident.Responses([], 50.0).response,
        lambda: lpvident.fit_frf(lpvident.Frf(frf.frequencies, frf.response[0], frf.response, frf.response), sample_rate=50.0),
        lambda: lpvident.Responses([], 50.0).deviation,
        # That of the array is not for responses that have their own.
        lambda: lpvident.fit_frf(frf, sample_rate=50.0, deviation=1.0),
    ):
        with pytest.raises(lpvident.ModelError):
            call()
