//! A module for Python that builds python-control systems.

use super::exchange::Exchange;
use crate::encode::{python_string, visible};
use lpv_core::nalgebra::DMatrix;
use std::fmt::Write as _;

pub(super) fn write(e: &Exchange) -> String {
    let description = visible(&e.description).replace(['\\', '"'], "'");
    let mut out = format!(
        "\"\"\"{description}.\n\nWritten by `lpv convert`. Needs numpy and python-control.\n\"\"\"\n\nimport control\nimport numpy as np\n\n"
    );
    let _ = writeln!(
        out,
        "dt = {}  # sample time, 0 for continuous time",
        number(e.sample_time)
    );
    let names = |names: &[String]| {
        let quoted: Vec<String> = names.iter().map(|n| python_string(n)).collect();
        if quoted.is_empty() {
            "None".to_owned()
        } else {
            format!("[{}]", quoted.join(", "))
        }
    };
    let _ = writeln!(
        out,
        "inputs = {}\noutputs = {}\n",
        names(&e.inputs),
        names(&e.outputs)
    );
    for (name, m) in &e.blocks {
        let _ = writeln!(out, "{name} = {}", array(m));
    }
    out.push('\n');
    if !e.note.is_empty() {
        let lines: Vec<String> = e
            .note
            .split(".  ")
            .map(|l| format!("# {}\n", visible(l)))
            .collect();
        out += &lines.concat();
    }
    out += match e.kind.as_str() {
        "lfr" => LFR,
        "grid" => GRID,
        "rigid-body" => RIGID_BODY,
        "innovation" => INNOVATION,
        _ => STATE_SPACE,
    };
    if matches!(e.kind.as_str(), "lfr" | "grid") && e.sample_time == 0.0 {
        out += SAMPLED;
    }
    if !e.grid.is_empty() {
        out += &grid(e);
    }
    out += SYSTEM;
    out
}

fn array(m: &DMatrix<f64>) -> String {
    if m.is_empty() {
        return format!("np.zeros(({}, {}))", m.nrows(), m.ncols());
    }
    let rows: Vec<String> = m
        .row_iter()
        .map(|r| {
            let cells: Vec<String> = r.iter().map(|v| number(*v)).collect();
            format!("[{}]", cells.join(", "))
        })
        .collect();
    format!("np.array([{}])", rows.join(",\n    "))
}

/// A number as Python reads it.
fn number(value: f64) -> String {
    match value.is_finite() {
        true => format!("{value:?}"),
        false => format!("float(\"{value}\")"),
    }
}

fn grid(e: &Exchange) -> String {
    let points: Vec<String> = e
        .grid
        .iter()
        .map(|(p, _)| {
            let values: Vec<String> = p.iter().map(|v| number(*v)).collect();
            format!("[{}]", values.join(", "))
        })
        .collect();
    let mut out = format!(
        "\n\ngrid = np.array([{}])  # scheduling values, one row a point\n",
        points.join(", ")
    );
    if e.kind == "grid" {
        for (k, name) in ["A", "B", "C", "D"].iter().enumerate() {
            let stack: Vec<String> = e.grid.iter().map(|(_, s)| array(&s[k])).collect();
            let _ = writeln!(out, "grid_{name} = np.array([{}])", stack.join(",\n  "));
        }
    }
    out += "models = [frozen(p) for p in grid]  # the frozen systems\n";
    out
}

const SYSTEM: &str = r#"

if __name__ == "__main__":
    print(models[0] if "models" in globals() else model)
"#;

const STATE_SPACE: &str = r#"model = control.StateSpace(A, B, C, D, dt, remove_useless_states=False)
if inputs and outputs:
    model.input_labels, model.output_labels = inputs, outputs
"#;

const INNOVATION: &str = r#"# x+ = A x + B (u - input_offset) + K e,  y = output_offset + C x + D (u - input_offset) + e
model = control.StateSpace(A, B, C, D, dt, remove_useless_states=False)
if inputs and outputs:
    model.input_labels, model.output_labels = inputs, outputs
"#;

const RIGID_BODY: &str = r#"# One row an axis: inertia, viscous friction, offset, and the standard deviations of the three.
# Input i is the force of axis i minus its offset; states are position and velocity of each axis.
model = control.StateSpace(A, B, C, D, dt, remove_useless_states=False)
if inputs and outputs:
    model.input_labels, model.output_labels = inputs, outputs
"#;

const LFR: &str = r#"def delta(p):
    """Delta(p): each parameter normalised to [-1, 1] over its range, repeated as `deltas` says."""
    p = np.atleast_1d(np.asarray(p, dtype=float))
    low, high = range[:, 0], range[:, 1]
    if np.any(p < low - 1e-3 * (high - low)) or np.any(p > high + 1e-3 * (high - low)):
        raise ValueError(f"p = {p} is outside the range {range.tolist()} of the model")
    normalised = (2 * p - low - high) / (high - low)
    entries = [np.full(int(count), normalised[int(parameter) - 1]) for parameter, count in deltas]
    return np.diag(np.concatenate(entries)) if entries else np.zeros((0, 0))


def frozen(p):
    """The model at constant p, a control.StateSpace."""
    d = delta(p)
    loop = d @ np.linalg.solve(np.eye(len(d)) - D11 @ d, np.hstack([C1, D12]))
    state, direct = loop[:, : A.shape[0]], loop[:, A.shape[0] :]
    system = control.StateSpace(
        A + B1 @ state, B2 + B1 @ direct, C2 + D21 @ state, D22 + D21 @ direct, dt, remove_useless_states=False
    )
    if inputs and outputs:
        system.input_labels, system.output_labels = inputs, outputs
    return system
"#;

const SAMPLED: &str = r#"

def sampled(p, Ts=None):
    """The model at constant p with the input held between samples Ts apart, by default those of its records."""
    if Ts is None:
        if "record_sample_time" not in globals():
            raise ValueError("the sample time of the records is not known: give Ts")
        Ts = record_sample_time[0, 0]
    system = frozen(p).sample(Ts, method="zoh")
    if inputs and outputs:
        system.input_labels, system.output_labels = inputs, outputs
    return system
"#;

const GRID: &str = r#"def frozen(p):
    """The model at constant p, its matrices interpolated linearly between the points of `grid` (one parameter)."""
    p = float(np.atleast_1d(p)[0])
    at = grid[:, 0]
    if p < at[0] or p > at[-1]:
        raise ValueError(f"p = {p} is outside the range of the model")
    k = min(max(int(np.searchsorted(at, p)) - 1, 0), len(at) - 2)
    t = (p - at[k]) / (at[k + 1] - at[k])
    matrices = [(1 - t) * m[k] + t * m[k + 1] for m in (grid_A, grid_B, grid_C, grid_D)]
    system = control.StateSpace(*matrices, dt, remove_useless_states=False)
    if inputs and outputs:
        system.input_labels, system.output_labels = inputs, outputs
    return system
"#;
