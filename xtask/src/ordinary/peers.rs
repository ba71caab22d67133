//! The same responses given to other tools, by a script of `benches/peers`.

use super::one::{Kind, Measurement};
use super::{C64, RATE};
use crate::{TaskError, root};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::process::Command;

/// What came of another tool.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Peer {
    channels: (usize, usize),
    name: String,
    residual_db: f64,
    over_bound: f64,
    seconds: f64,
    mib: f64,
}

/// Their names, and the words of the script.
const METHODS: [(&str, &str); 2] = [
    ("scikit-rf, vector fitting", "vector-fitting"),
    ("numpy, subspace", "subspace"),
];

/// All of them on one machine. `python`: an interpreter with numpy and scikit-rf; `folder`: for the files that they exchange.
pub(super) fn compare(kind: &Kind, seed: u64, python: &Path, folder: &Path) -> Result<Vec<Peer>, TaskError> {
    let measurement = Measurement::new(kind, seed)?;
    let frf = measurement.estimate.frf();
    let (n_y, n_u) = kind.size;
    let bytes =
        |values: &mut dyn Iterator<Item = f64>| values.flat_map(f64::to_le_bytes).collect::<Vec<u8>>();
    let lines = frf.frequencies_hz();
    std::fs::write(folder.join("frequencies.f64"), bytes(&mut lines.iter().copied()))?;
    // Row after row, as numpy has them.
    let by_row = (0..lines.len()).flat_map(|k| {
        let line = frf.line_slice(k);
        (0..n_y * n_u).flat_map(move |at| {
            let value = line[at / n_u + n_y * (at % n_u)];
            [value.re, value.im]
        })
    });
    std::fs::write(folder.join("frf.c16"), bytes(&mut by_row.into_iter()))?;
    let run = |(name, method): (&str, &str)| -> Result<Peer, TaskError> {
        let out = Command::new(python)
            .arg(root().join("benches/peers/stage.py"))
            .arg(folder)
            .arg(method)
            .args([n_y, n_u, kind.modes].map(|n| n.to_string()))
            .arg(RATE.to_string())
            .output()?;
        if !out.status.success() {
            return Err(format!("{name}: {}", String::from_utf8_lossy(&out.stderr)).into());
        }
        let text = String::from_utf8_lossy(&out.stdout);
        let numbers: Vec<f64> = text
            .split_whitespace()
            .map(str::parse)
            .collect::<Result<_, _>>()?;
        let &[seconds, mib] = numbers.as_slice() else {
            return Err(format!("{name}: `{text}` for seconds and MiB").into());
        };
        let numbers: Vec<f64> = std::fs::read(folder.join("response.c16"))?
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().unwrap_or_default()))
            .collect();
        let all: Vec<C64> = numbers.chunks_exact(2).map(|z| C64::new(z[0], z[1])).collect();
        if all.len() != lines.len() * n_y * n_u {
            return Err(format!("{name}: {} numbers in its response", all.len()).into());
        }
        let by_column: Vec<C64> = (0..all.len())
            .map(|at| {
                let (k, i) = (at / (n_y * n_u), at % (n_y * n_u));
                all[k * n_y * n_u + (i % n_y) * n_u + i / n_y]
            })
            .collect();
        let [residual_db, over_bound] = measurement.score(|k| &by_column[k * n_y * n_u..(k + 1) * n_y * n_u]);
        Ok(Peer {
            channels: kind.size,
            name: name.to_owned(),
            residual_db,
            over_bound,
            seconds,
            mib,
        })
    };
    METHODS.into_iter().map(run).collect()
}

impl Peer {
    pub(super) fn line(&self) -> String {
        format!(
            "| {} x {} | {} | {:+.2} | {:.2} | {:.1} | {:.0} |",
            self.channels.0,
            self.channels.1,
            self.name,
            self.residual_db,
            self.over_bound,
            self.seconds,
            self.mib
        )
    }
}
