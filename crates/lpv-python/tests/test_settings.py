"""Settings by keyword: their types say what the program takes, no more and no less."""

from __future__ import annotations

import inspect
import json
import re
import sys
from typing import Any, Literal, get_args, get_origin

import numpy as np
import pytest

import lpvident
from lpvident import _lpvident, distributed
from lpvident._settings import Interpolation, MachineSettings, Settings

LINES = np.linspace(1.0, 10.0, 20)


def refused(**settings: Any) -> str:
    with pytest.raises(lpvident.SettingError) as wrong:
        lpvident.fit_frf(LINES, np.ones(20), sample_rate=50.0, **settings)
    return wrong.value.message


def test_the_typed_settings_are_those_of_the_program() -> None:
    names = {name.replace("-", "_") for name in json.loads(_lpvident.settings())}
    assert set(Settings.__annotations__) == names
    told = refused(zzzzzz=1).split("there are ")[1]
    assert set(told.split(", ")) == names


def test_the_typed_choices_are_those_of_the_program() -> None:
    words = {name: re.findall(r'["\']([a-z-]+)["\']', kind.__forward_arg__) for name, kind in Settings.__annotations__.items()}
    chosen = {name: set(found) for name, found in words.items() if found}
    assert set(chosen) == {"structure", "rigid_body", "polish", "weighting", "lfr", "focus", "direct"}
    for name, found in chosen.items():
        assert set(re.findall(r"`([a-z-]+)`", refused(**{name: "nothing"}).split("expected")[1])) == found, name
    (plain,) = (set(get_args(kind)) for kind in get_args(Interpolation) if get_origin(kind) is Literal)
    kinds = set(re.findall(r"`([a-z-]+)`", refused(interpolation="nothing").split("expected")[1]))
    assert plain < kinds
    for kind in kinds - plain:
        assert "missing field" in refused(interpolation=kind)
    for kind in plain:
        assert lpvident.fit_frf(LINES, np.ones(20), sample_rate=50.0, order=1, integrators=0, interpolation=kind).outputs == 1


def test_the_typed_tables_of_a_machine_are_those_of_its_file() -> None:
    tomllib = pytest.importorskip("tomllib") if sys.version_info >= (3, 11) else pytest.skip("no reader of TOML")
    # The table `machine` stands in the dictionary of that name.
    assert {*MachineSettings.__annotations__, "machine"} == {k.replace("-", "_") for k in tomllib.loads(lpvident.machine_template())}


def test_a_setting_that_is_no_number_is_named() -> None:
    for value in (float("nan"), np.float64("inf")):
        assert "`fuzziness`" in refused(fuzziness=value)
    assert "not finite" in refused(interpolation={"kind": "gaussian-process", "length-scale": float("nan")})


def test_every_call_with_settings_lists_them() -> None:
    identify = (lpvident.identify, lpvident.fit_frf, lpvident.Bundle.identify, lpvident.Responses.fit)
    for call in (*identify, distributed.identify_many, distributed.fit_places):
        assert set(Settings.__annotations__) < set(inspect.signature(call).parameters), call
    assert set(MachineSettings.__annotations__) < set(inspect.signature(lpvident.simulate_machine).parameters)
