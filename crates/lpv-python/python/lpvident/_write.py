"""Arrays as a bundle on disk: an experiment.toml and NPZ files, which keep every digit."""

from __future__ import annotations

import contextlib
import json
import os
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import BundleError, WriteError

#: Options of a record beside its signals.
OPTIONS = ("period", "use", "position", "injection", "name")

#: Types of options, and what they are.
_KINDS: dict[str, tuple[tuple[type, ...], str]] = {
    "period": ((int, np.integer), "the samples a period, a whole number"),
    "use": ((str,), '"estimation" or "validation"'),
}


def toml(value: Any) -> str:
    """A value in TOML; tables are inline."""
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{toml(str(k))} = {toml(v)}" for k, v in value.items() if v is not None) + " }"
    if isinstance(value, (Sequence, np.ndarray)):
        return "[" + ", ".join(map(toml, value)) + "]"
    raise BundleError(f"{type(value).__name__} cannot be written to a description: give numbers, texts, lists or dictionaries")


def write_bundle(
    folder: Path,
    head: Mapping[str, Any],
    channels: Mapping[str, Mapping[str, Sequence[Any]]],
    records: Sequence[tuple[Mapping[str, NDArray[np.float64]], Mapping[str, Any]]],
) -> None:
    """Writes records, each its columns and its options, and then the description, which makes the folder a bundle."""
    description = folder / "experiment.toml"
    if description.exists():
        raise BundleError(f"`{description}` exists; bundles are never overwritten: choose another folder", path=description)
    lines = [f"{key} = {toml(value)}" for key, value in {"format": 2, **head}.items() if value is not None]
    for role, group in channels.items():
        lines += ["", f"[channels.{role}]", *(f"{key} = {toml(value)}" for key, value in group.items())]
    files: list[Path] = []
    # Before anything is written.
    for number, (_, options) in enumerate(records):
        unknown = [name for name in options if name not in OPTIONS]
        if unknown:
            raise BundleError(f"record {number}: unknown option `{unknown[0]}`; known: {', '.join(OPTIONS)}", record=number)
        name = str(options.get("name") or f"record{number:03}")
        if not all(c.isalnum() or c in "._-" for c in name) or name.startswith("."):
            raise BundleError(f"record {number}: name `{name}`: use letters, digits, `_`, `-` and `.`", record=number)
        file = folder / "records" / f"{name}.npz"
        if file in files or file.exists():
            raise BundleError(f"record {number}: the name `{name}` is taken", record=number, path=file)
        for option, (types, meaning) in _KINDS.items():
            value = options.get(option)
            if value is not None and (isinstance(value, bool) or not isinstance(value, types)):
                raise BundleError(f"record {number}: {option} = {value!r}: give {meaning}", record=number)
        files.append(file)
    try:
        (folder / "records").mkdir(parents=True, exist_ok=True)
        for file, (signals, _) in zip(files, records):
            _write_arrays(file, signals)
    except OSError as problem:
        raise WriteError(f"{folder}: the bundle cannot be written: {problem}", path=folder) from None
    for file, (_, options) in zip(files, records):
        period = options.get("period")
        entry = {
            "file": f"records/{file.name}",
            "kind": "transient" if period is None else "periodic",
            "period": period,
            "use": options.get("use", "estimation"),
            "position": options.get("position"),
            "injection": options.get("injection"),
        }
        lines += ["", "[[records]]", *(f"{key} = {toml(value)}" for key, value in entry.items() if value is not None)]
    write_texts({description: "\n".join(lines) + "\n"})


def _write_arrays(file: Path, arrays: Mapping[str, NDArray[np.float64]]) -> None:
    """NPZ; not by savez, whose own arguments are names of columns too."""
    with zipfile.ZipFile(file, "w") as out:
        for name, samples in arrays.items():
            with out.open(f"{name}.npy", "w", force_zip64=True) as array:
                np.lib.format.write_array(array, samples, allow_pickle=False)


def write_texts(texts: Mapping[Path, str]) -> None:
    """Writes files in UTF-8 that take their places once all of them are written."""
    parts = {file: file.with_name(f".{file.name}.part") for file in texts}
    try:
        for file, text in texts.items():
            parts[file].write_bytes(text.encode())
        for file, part in parts.items():
            os.replace(part, file)
    except OSError as problem:
        for part in parts.values():
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
        raise WriteError(f"{file}: cannot be written: {problem}", path=file) from None
