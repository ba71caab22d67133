"""The exceptions of lpvident, with the facts as fields.

Every message says what is wrong, where, and what to do. A field that an error does not have is None.
"""

from __future__ import annotations

import json
from typing import Any


class LpvError(Exception):
    """Every refusal of lpvident.

    Fields:
        path: the file or folder.
        record: number of the record in its bundle, from 0.
        line, column: where in the file; the column of a table by its name.
        key: the key of the description, such as ``records[3].period``.
        place: position and records behind it, in words.
        name, value, allowed, nearest: of a setting, what was given, what is allowed, and the known name nearest to it.
        finding: what was found in the data, as a dictionary.
        exit_code: that of the program ``lpv`` for the same error: 2 where the input is at fault, 3 where the data contradict
            themselves, 1 for anything else.
    """

    path: str | None = None
    record: int | None = None
    line: int | None = None
    column: int | str | None = None
    key: str | None = None
    place: str | None = None
    name: str | None = None
    value: float | None = None
    allowed: str | None = None
    nearest: str | None = None
    finding: dict[str, Any] | None = None
    exit_code: int = 2

    def __init__(self, message: str, **facts: Any) -> None:
        super().__init__(message)
        for name, fact in facts.items():
            if name == "finding" and isinstance(fact, str):
                fact = json.loads(fact)
            setattr(self, name, fact if name != "path" or fact is None else str(fact))

    @property
    def message(self) -> str:
        """What is wrong, where, and what to do."""
        return str(self.args[0]) if self.args else ""

    def __reduce__(self) -> tuple[Any, ...]:
        return (_again, (type(self), self.message, dict(self.__dict__)))


def _again(kind: type[LpvError], message: str, facts: dict[str, Any]) -> LpvError:
    return kind(message, **facts)


class BundleError(LpvError, ValueError):
    """A bundle, a record or an array that cannot be used."""


class IdentifyError(LpvError):
    """No model comes of these data with these settings."""


class ContradictionError(IdentifyError):
    """No model comes of the data, since they contradict themselves; ``finding`` says how."""


class DiagnoseError(LpvError):
    """Effects cannot be looked for in this bundle, or not with this model."""


class ModelError(LpvError, ValueError):
    """A model that cannot be read, or that does not fit what it is asked."""


class MachineError(LpvError, ValueError):
    """A machine that cannot be simulated."""


class SettingError(LpvError, ValueError):
    """A setting that does not exist, of another type, or outside its range."""


class WriteError(LpvError):
    """A result that cannot be written, or that would replace a file of another kind."""


class InternalError(LpvError):
    """A fault of lpvident itself."""

    exit_code = 1
