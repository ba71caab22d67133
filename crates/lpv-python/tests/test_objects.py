"""Results as objects of Python: they travel between processes, are copied, and show themselves in a notebook."""

from __future__ import annotations

import copy
import json
import pickle
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lpvident

WAYS: dict[str, Callable[[Any], Any]] = {
    "pickled": lambda found: pickle.loads(pickle.dumps(found)),
    "copied": copy.copy,
    "copied deeply": copy.deepcopy,
}


def contents(found: Any) -> Any:
    """All that an object tells, in lists, texts and numbers."""
    if isinstance(found, lpvident.Model):
        return found.to_json(), found.text
    if isinstance(found, lpvident.Diagnosis):
        return found.data, found.text, found.html, contents(found.model)
    if isinstance(found, lpvident.Bundle):
        return found.path, found.description, found.record_names
    if isinstance(found, BaseException):
        return type(found), found.args, contents(vars(found))
    if isinstance(found, np.ndarray):
        return found.dtype.str, found.shape, found.tolist()
    if isinstance(found, dict):
        return {name: contents(part) for name, part in found.items()}
    if isinstance(found, (list, tuple)):
        return [type(found).__name__, *map(contents, found)]
    return contents(vars(found)) if hasattr(found, "__dict__") else found


@pytest.fixture(scope="session")
def objects(bundle: lpvident.Bundle, model: lpvident.Model, diagnosis: lpvident.Diagnosis) -> dict[str, Any]:
    """One of each public class that is no exception."""
    responses, validation = bundle.frf(), model.validate(bundle)
    effect = lpvident.Effect(
        "own", force="-a*z", parameters={"a": lpvident.Parameter("N", starts=[1.0])}, states={"z": lpvident.State("v - z", 1.0)}
    )
    return {
        "Bundle": bundle, "Diagnosis": diagnosis, "Effect": effect, "Frf": responses[0], "FrozenDeviation": model.frozen_deviation,
        "Inspection": bundle.inspect(), "Model": model, "Parameter": effect.parameters["a"], "Record": bundle.record(0),
        "Responses": responses, "Run": validation.runs[0], "State": effect.states["z"], "StateSpace": model.matrices(0.1),
        "Validation": validation,
    }  # fmt: skip


def test_there_is_one_of_each_public_class(objects: dict[str, Any]) -> None:
    classes = {name for name in lpvident.__all__ if isinstance(getattr(lpvident, name), type)}
    assert classes == set(objects) | {name for name in classes if issubclass(getattr(lpvident, name), Exception)}
    for name, found in objects.items():
        assert type(found) is getattr(lpvident, name)


@pytest.mark.parametrize("way", WAYS)
def test_results_come_back_as_they_are(objects: dict[str, Any], way: str) -> None:
    for name, found in objects.items():
        again = WAYS[way](found)
        assert type(again) is type(found) and contents(again) == contents(found), name


@pytest.mark.parametrize("way", WAYS)
def test_errors_come_back_as_they_are(way: str) -> None:
    for name in lpvident.__all__:
        kind = getattr(lpvident, name)
        if isinstance(kind, type) and issubclass(kind, Exception):
            error = kind("wrong", path=Path("here"), record=3, finding='{"what": 1}')
            again = WAYS[way](error)
            assert contents(again) == contents(error) and again.finding == {"what": 1}, name


@pytest.mark.parametrize("way", WAYS)
def test_rows_come_back_as_they_are(way: str, model: lpvident.Model) -> None:
    from lpvident import distributed

    refused = distributed.Row("b", error=lpvident.BundleError("no"))
    rows = distributed.Rows([distributed.Row("a", seed=1, position=[0.1], model=model), refused])
    stopped = distributed.Interrupted("1 of 2")
    stopped.rows, stopped.outcomes = rows, {0: distributed.Outcome(1.0, None, 0.5)}
    for found in (rows, stopped, stopped.outcomes[0]):
        assert contents(WAYS[way](found)) == contents(found)


def test_a_diagnosis_that_came_from_elsewhere_writes_the_same_files(diagnosis: lpvident.Diagnosis, tmp_path: Path) -> None:
    again = pickle.loads(pickle.dumps(copy.deepcopy(diagnosis)))
    for found, folder in ((diagnosis, tmp_path / "a"), (again, tmp_path / "b")):
        found.save(folder)
    for name in ("diagnosis.json", "diagnosis.html", "model.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes(), name
    assert len(list((tmp_path / "b").iterdir())) == 3
    (tmp_path / "b/diagnosis.html").write_text("mine")
    with pytest.raises(lpvident.WriteError, match="overwrite=True"):
        again.save(tmp_path / "b")
    assert (tmp_path / "b/diagnosis.html").read_text() == "mine"
    again.save(tmp_path / "b", overwrite=True)
    assert (tmp_path / "b/diagnosis.html").read_text() == diagnosis.html
    assert json.loads((tmp_path / "b/diagnosis.json").read_text()) == diagnosis.data


class Page(HTMLParser):
    """Tags and texts, in order."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.texts: list[str] = []
        self.open: list[str] = []
        self.attributes: set[str] = set()
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.open.append(tag)
        self.attributes |= {name for name, _ in attrs}

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_what_a_notebook_shows_begins_with_the_first_fact(objects: dict[str, Any]) -> None:
    first = {
        "Bundle": f"{objects['Bundle'].name}, {len(objects['Bundle'])} records at 20 Hz",
        "Responses": "Frequency responses at 5 places",
        "Frf": "Frequency response at p = -0.3",
        "Model": objects["Model"].verdict,
        "Validation": objects["Validation"].verdict,
        "Diagnosis": objects["Diagnosis"].verdict,
    }
    for name, said in first.items():
        page = Page(objects[name]._repr_html_())
        assert page.texts[0].startswith(said), name
        assert page.open == [] and set(page.tags) <= {"div", "p", "table", "tr", "th", "td"} and page.attributes <= {"style"}, name
    text = " ".join(Page(objects["Bundle"]._repr_html_()).texts)
    assert "10 periodic for estimation" in text and str(objects["Bundle"].path) in text
    assert "153, " in " ".join(Page(objects["Responses"]._repr_html_()).texts)
    assert Page(lpvident.Responses([], 1.0)._repr_html_()).texts == ["No frequency responses"]


def test_names_are_no_markup() -> None:
    name, signal = "<script src='x.js'>&", np.sin(np.arange(100.0))
    bundle = lpvident.Bundle.from_arrays({"y": signal, "u": signal}, sample_rate=10, name=name, units={"y1": "<b>m</b>"})
    page = Page(bundle._repr_html_())
    assert page.texts[0].startswith(name) and "y1 (<b>m</b>)" in page.texts and "script" not in page.tags and "b" not in page.tags
    frf = lpvident.Frf.from_arrays([1.0], [1.0])
    page = Page(lpvident.Responses([frf], 10.0, reasons=["<i>so</i>"])._repr_html_())
    assert "<i>so</i>" in page.texts and "i" not in page.tags
