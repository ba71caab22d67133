"""LPV models of position-dependent machines from measured records.

    import lpvident

    bundle = lpvident.Bundle("measurements")     # a folder with experiment.toml; or from_arrays, from_frames
    model = bundle.identify()                    # every choice from the data, with its reason in model.reasons
    print(model.verdict)
    G = model.frozen(0.1)                        # a control.StateSpace at p = 0.1
    y = model.simulate(u, p)                     # along a moving p
    model.validate(bundle).to_frame()            # errors on held-out records
    bundle.diagnose().to_frame()                 # the effects that the model lacks

Arrays are samples x channels, responses frequencies x outputs x inputs, frequencies in Hz, times in s, all else in the units of the
bundle. Results are those of the program `lpv`, to the last bit. Long calls leave the interpreter to other threads, tell what they do
through ``progress=`` and end on Ctrl-C. What goes wrong is an `LpvError`, with the facts as fields.

`lpvident.distributed` does so for many bundles, places and seeds, by Dask.

What it does not do: it has no estimator of its own and decides nothing about models or data. numpy is the only package that it needs;
pandas, xarray, python-control, matplotlib and tqdm serve where they are installed, and none of them is imported before it is asked for.
"""

from __future__ import annotations

from ._lpvident import __version__, machine_template
from ._lpvident import template as settings_template
from .accounts import Diagnosis, Inspection, Run, Validation
from .bundle import Bundle, Record
from .commands import diagnose, fit_frf, identify, inspect, simulate_machine, validate
from .effects import Effect, Parameter, State, read_effects
from .errors import (
    BundleError,
    ContradictionError,
    DiagnoseError,
    IdentifyError,
    InternalError,
    LpvError,
    MachineError,
    ModelError,
    SettingError,
    WriteError,
)
from .model import Model
from .responses import Frf, Responses
from .systems import FrozenDeviation, StateSpace

load = Model.load

__all__ = [
    "Bundle",
    "BundleError",
    "ContradictionError",
    "DiagnoseError",
    "Diagnosis",
    "Effect",
    "Frf",
    "FrozenDeviation",
    "IdentifyError",
    "Inspection",
    "InternalError",
    "LpvError",
    "MachineError",
    "Model",
    "ModelError",
    "Parameter",
    "Record",
    "Responses",
    "Run",
    "SettingError",
    "State",
    "StateSpace",
    "Validation",
    "WriteError",
    "__version__",
    "diagnose",
    "fit_frf",
    "identify",
    "inspect",
    "load",
    "machine_template",
    "read_effects",
    "settings_template",
    "simulate_machine",
    "validate",
]
