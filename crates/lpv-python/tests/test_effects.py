"""Effects of the user's own."""

from __future__ import annotations

import json
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lpvident
from lpvident import Effect, Parameter, State

STEP = 2e-3


def temperature(t: float, seed: int) -> float:
    return 20.0 + 4.0 * math.sin(t * (1.1 + seed))


def axis(force: Callable[[float, float, float], float], *, samples: int = 2000) -> lpvident.Bundle:
    """2 kg under a controller that nobody tells, with a force of position, speed and a measured temperature, in small steps."""
    records = []
    for seed in (1, 2):
        noise = np.random.default_rng(seed).normal(scale=1e-5, size=samples)
        warm = np.array([temperature(k * STEP, seed) for k in range(samples)])
        x = v = last = 0.0
        y, u = np.empty(samples), np.empty(samples)
        for k in range(samples):
            t, slow = k * STEP, 0.41 + 0.06 * seed
            # From rest.
            begun = 1.0 - math.exp(-((t / 0.4) ** 2))
            error = 0.09 * begun * (math.sin(math.tau * slow * t) + 0.3 * math.sin(math.tau * 1.7 * slow * t)) - x - noise[k]
            y[k], u[k] = x + noise[k], 2.0 * (900.0 * error + 42.0 * (error - last) / STEP)
            last = error
            h = STEP / 25
            for part in range(25):
                # By the rule of the middle: the error of a plain step is a time that the readings would tell.
                def rate(x: float, v: float, t: float) -> float:
                    return (u[k] + force(x, v, temperature(t, seed)) - 3.0 * v) / 2.0

                now = t + part * h
                middle = v + 0.5 * h * rate(x, v, now)
                v += h * rate(x + 0.5 * h * v, middle, now + 0.5 * h)
                x += h * middle
        records.append({"y": y, "u": u, "aux": warm, "use": "estimation" if seed == 1 else "validation"})
    return lpvident.Bundle.from_arrays(records, sample_rate=1 / STEP, units={"y1": "m", "u1": "N", "aux1": "K"})


def joint(**other: Any) -> Effect:
    given = {
        "name": "rail-joint",
        "force": "-a*exp(-((x - at)/width)^2)",
        "parameters": {
            "a": "u",
            "at": Parameter("y", starts=[-0.1, -0.05, 0.0, 0.05, 0.1]),
            "width": Parameter("y", starts=np.array([0.003, 0.01, 0.03]), positive=True),
        },
    }
    return Effect(**{**given, **other})


def test_a_force_of_the_position_is_found(tmp_path: Path) -> None:
    bundle = axis(lambda x, v, warm: -1.8 * math.exp(-(((x - 0.031) / 0.012) ** 2)))
    found = bundle.diagnose(effects=joint())
    assert [e["effect"] for e in found.effects] == ["rail-joint"], found.verdict
    # Its linear part alone is not the machine.
    u = bundle.record(0).u
    with pytest.raises(lpvident.ModelError, match="rail-joint at u1.*linear=True"):
        found.model.simulate(u)
    assert found.model.simulate(u, linear=True).shape == u.shape
    values = {name: p["value"] for name, p in found.effects[0]["parameters"].items()}
    for name, truth in {"a": 1.8, "at": 0.031, "width": 0.012}.items():
        assert values[name] == pytest.approx(truth, rel=0.05), values
    assert found.effects[0]["parameters"]["a"]["unit"] == "N"
    assert found.verdict.startswith("explained"), found.verdict
    # The model holds the definition: it is validated, and diagnosed again, by itself.
    found.model.save(tmp_path / "model.json")
    kept = json.loads((tmp_path / "model.json").read_text())
    assert "rail-joint" in json.dumps(kept) and "exp(-((x - at)/width)^2)" in json.dumps(kept)
    assert lpvident.validate(tmp_path / "model.json", bundle).verdict


def test_a_measured_signal_drives_a_force() -> None:
    bundle = axis(lambda x, v, warm: -0.7 * (warm - 20.0) - 1.5 * math.tanh(v / 1e-3))
    warm = Effect("warm-guide", force="-k*(aux1 - 20)", parameters={"k": "u/K"}, family="disturbance")
    found = bundle.diagnose(effects=[warm, joint()])
    named = {e["effect"]: e for e in found.effects}
    assert set(named) == {"warm-guide", "coulomb-friction"}, found.verdict
    assert named["warm-guide"]["parameters"]["k"]["value"] == pytest.approx(0.7, rel=0.02)


def test_definitions_travel_and_are_files(tmp_path: Path) -> None:
    dahl = Effect(
        "my-dahl",
        force="-level*z",
        parameters={"level": "u", "distance": Parameter("y", starts=[1e-4], positive=True)},
        states={"z": "(v - abs(v)*z)/distance", "w": State("-w", 1.0)},
    )
    assert pickle.loads(pickle.dumps(dahl)) == dahl
    assert len({dahl, pickle.loads(pickle.dumps(dahl)), joint()}) == 2
    file = tmp_path / "own.toml"
    file.write_text(
        '[[effect]]\nname = "my-dahl"\nforce = "-level*z"\nstates.z.rate = "(v - abs(v)*z)/distance"\n'
        'states.w = { rate = "-w", start = 1.0 }\nparameters.level.unit = "u"\n'
        'parameters.distance = { unit = "y", starts = [1e-4], positive = true }\n'
    )
    (read,) = lpvident.read_effects(file)
    assert read._plain() == dahl._plain()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"name": "cogging"}, "the catalogue has an effect of this name"),
        ({"force": "-a*(x"}, "is no formula"),
        ({"force": "-a*q*at*width"}, "has `q`"),
        ({"channel": "u7"}, "no input `u7`"),
        ({"force": None}, "either `force`"),
        ({"family": "magic"}, "magic"),
        ({"parameters": {"a": 3.0}}, "effects"),
        ({"parameters": {"a": Parameter("u", starts="no")}}, "effects"),
    ],
)
def test_what_is_wrong_is_said(wrong: dict[str, Any], said: str) -> None:
    y = np.sin(np.arange(400.0) / 7)
    bundle = lpvident.Bundle.from_arrays([{"y": y, "u": -y}, {"y": y, "u": -y, "use": "validation"}], sample_rate=100)
    with pytest.raises(lpvident.LpvError, match=said):
        bundle.diagnose(effects=joint(**wrong))
    with pytest.raises(lpvident.SettingError, match="no lpvident.Effect"):
        bundle.diagnose(effects=[wrong])
