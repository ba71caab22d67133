"""What commands find: accounts with the verdict first."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._ask import verdict_html
from ._write import write_texts
from .errors import WriteError

if TYPE_CHECKING:
    import pandas

    from . import _lpvident
    from .model import Model


class Inspection:
    """What is in a bundle. ``data`` is what `lpv inspect --json` prints, ``text`` what it says in words."""

    def __init__(self, json_text: str, text: str, lines_csv: str) -> None:
        self.data: dict[str, Any] = json.loads(json_text)
        self.text = text
        self._lines = lines_csv

    @property
    def warnings(self) -> list[str]:
        """What was found, in words, the gravest first."""
        return list(self.data["warnings"])

    @property
    def findings(self) -> list[dict[str, Any]]:
        """The same as facts."""
        return list(self.data["findings"])

    @property
    def noise(self) -> NDArray[np.float64]:
        """Standard deviation of the noise of one sample, in the units of the outputs, shape (n_y,); empty without periodic records."""
        return np.array(self.data["noise"], dtype=np.float64)

    def lines(self) -> pandas.DataFrame:
        """A row for each line of the spectra; needs pandas."""
        import io

        import pandas

        return pandas.read_csv(io.StringIO(self._lines))

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        first = self.warnings[0] if self.warnings else "nothing is wrong with these data"
        worth = "unjudged" if self.warnings else "good"
        rows = {
            "bundle": self.data["name"],
            "rate": f"{self.data['sample_rate_hz']:g} Hz",
            "records": len(self.data["records"]),
            "experiments": len(self.data["experiments"]),
            "warnings": len(self.warnings),
        }
        return verdict_html(first, worth, rows)


class Run(NamedTuple):
    """A record and the model along it: ``measured``, ``open_loop`` and ``closed_loop`` (None without a controller), N x n_y each."""

    name: str
    measured: NDArray[np.float64]
    open_loop: NDArray[np.float64]
    closed_loop: NDArray[np.float64] | None


class Validation:
    """A model against a bundle. ``data`` is what `lpv validate --json` prints, ``text`` what it says, ``runs`` one `Run` a record."""

    def __init__(self, json_text: str, text: str, runs: list[tuple[Any, ...]]) -> None:
        self.data: dict[str, Any] = json.loads(json_text)
        self.text = text
        self.runs = [Run(*run) for run in runs]

    @property
    def verdict(self) -> str:
        """What the model is worth on these records, in a sentence."""
        return str(self.data["verdict"]["sentence"])

    @property
    def worth(self) -> str:
        """The judgement in a word, as `Model.worth`."""
        return str(self.data["verdict"]["worth"])

    def to_frame(self) -> pandas.DataFrame:
        """A row for each record and output: errors in its unit, over noise, and fit in percent; needs pandas."""
        import pandas

        rows = []
        for record in self.data["records"]:
            for output in record["outputs"]:
                row = {"record": record["name"], "output": output["name"], "unit": output["unit"]}
                for run in ("one_step", "open_loop", "closed_loop"):
                    row |= {f"{run}_{k}": v for k, v in (output[run] or {}).items()}
                rows.append(row)
        return pandas.DataFrame(rows)

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        frozen = self.data["frozen"] or {}
        rows = {
            "model": self.data["model"],
            "frozen error, largest and median": f"{frozen['error']['strict_max_db']:.1f} dB, {frozen['error']['median_db']:.1f} dB"
            if frozen
            else "",
            "records": ", ".join(run.name for run in self.runs),
            "notes": "; ".join(self.data["notes"]),
        }
        return verdict_html(self.verdict, self.worth, rows)


class Diagnosis:
    """What a model lacks. ``data`` is the content of diagnosis.json, ``text`` what `lpv diagnose` says, ``html`` its page.

    A copy, and one that comes from another process, saves to a folder that has no such files, unless ``overwrite``; its model first, then the rest.
    """

    def __init__(self, native: _lpvident.Diagnosis | _Kept) -> None:
        self._native = native
        json_text, text = native.account()
        self.data: dict[str, Any] = json.loads(json_text)
        self.text = text

    @property
    def verdict(self) -> str:
        """What was found and what is left, in a sentence."""
        return str(self.data["verdict_in_words"])

    @property
    def worth(self) -> str:
        """The same in a word: explained, partly-explained, unexplained, nothing-missing, contradictory-data."""
        return "contradictory-data" if self.data.get("contradictions") else str(self.data["verdict"])

    @property
    def effects(self) -> list[dict[str, Any]]:
        """The effects that were added, in order: name, family, channel, parameters with value, std and unit, evidence."""
        return list(self.data["effects"])

    @property
    def candidates(self) -> list[dict[str, Any]]:
        """Every effect that was tried."""
        return list(self.data["candidates"])

    @property
    def model(self) -> Model:
        """The model with the effects."""
        from .model import Model

        return Model(self._native.model())

    @property
    def html(self) -> str:
        """The page with errors before and after, and the force that would explain them."""
        return self._native.html()

    def to_frame(self) -> pandas.DataFrame:
        """A row for each parameter of each effect; needs pandas."""
        import pandas

        columns = ["effect", "family", "channel", "parameter", "value", "std", "unit", "held_out_gain_db", "p_value", "runner_up"]
        rows = []
        for effect in self.effects:
            known = {k: effect[k] for k in ("effect", "family", "channel")}
            why = {k: effect["evidence"].get(k) for k in ("held_out_gain_db", "p_value", "runner_up")}
            for name, value in effect["parameters"].items():
                rows.append({**known, "parameter": name, "std": None, **value, **why})
        return pandas.DataFrame(rows, columns=columns)

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Writes diagnosis.json, diagnosis.html and model.json, as the program does; all three take their places, or none."""
        self._native.save(os.fspath(folder), overwrite)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_again, (type(self), self._native.account(), self.html, self.model))

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        rows = {f"{e['effect']} at {e['channel']}": _parameters(e) for e in self.effects}
        return verdict_html(self.verdict, self.worth, {"base": self.data["base_model"], **rows})


class _Kept:
    """What a diagnosis asks its native half for, of a copy: the texts of its files and its model."""

    def __init__(self, account: tuple[str, str], html: str, model: Model) -> None:
        self._account, self._html, self._model = account, html, model

    def account(self) -> tuple[str, str]:
        return self._account

    def html(self) -> str:
        return self._html

    def model(self) -> _lpvident.Model:
        return self._model._native

    def save(self, folder: str, overwrite: bool) -> None:
        place = Path(folder)
        for name in ("diagnosis.json", "diagnosis.html", "model.json"):
            if not overwrite and (place / name).exists():
                raise WriteError(f"{place / name} exists: give another folder, or overwrite=True", path=place / name)
        self._model.save(place / "model.json", overwrite=overwrite)
        write_texts({place / "diagnosis.json": self._account[0], place / "diagnosis.html": self._html})


def _again(kind: type[Diagnosis], account: tuple[str, str], html: str, model: Model) -> Diagnosis:
    return kind(_Kept(account, html, model))


def _parameters(effect: dict[str, Any]) -> str:
    def one(name: str, value: dict[str, Any]) -> str:
        std = value.get("std")
        return f"{name} {value['value']:.4g}" + (f" ± {std:.2g}" if std is not None else "") + f" {value['unit']}"

    return ", ".join(one(name, value) for name, value in effect["parameters"].items())
