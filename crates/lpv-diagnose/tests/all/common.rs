//! What the tests share.

use lpv_diagnose::lpv_core::{Purpose, Record, RecordKind, Signals};

/// A record of outputs y0, y1, ... and inputs u0, u1, ...
pub(crate) fn record(name: &str, outputs: Vec<Vec<f64>>, inputs: Vec<Vec<f64>>) -> Record {
    let names = |letter: &str, n: usize| (0..n).map(|i| format!("{letter}{i}")).collect::<Vec<_>>();
    let signals = |letter: &str, columns: Vec<Vec<f64>>| {
        let names = names(letter, columns.len());
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        Signals::new(&names, columns)
    };
    let none = || Signals::new(&[], vec![]);
    Record {
        name: name.to_owned(),
        kind: RecordKind::Transient,
        purpose: Purpose::Estimation,
        position: None,
        outputs: signals("y", outputs),
        inputs: signals("u", inputs),
        references: none(),
        scheduling: none(),
        auxiliary: none(),
        injection: none(),
    }
}

/// One step of `dx/dt = v`, `dv/dt = rate(x, v)` by the rule of the middle, in place.
pub(crate) fn middle_step(x: &mut f64, v: &mut f64, h: f64, rate: impl Fn(f64, f64) -> f64) {
    let middle = *v + 0.5 * h * rate(*x, *v);
    *v += h * rate(*x + 0.5 * h * *v, middle);
    *x += h * middle;
}
