//! Seeds of the targets of the program.

use crate::seeds::put;
use lpv::convert::{Target as Format, export};
use lpv::simulate::MachineFile;
use lpv::{IdentifyConfig, ModelFile};
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Continuous, DeltaBlock, Discrete, Lfr, LfrBlocks, Model, SchedulingRange, StateSpace};
use std::path::Path;

/// Writes them.
pub fn write(folder: &Path) {
    let put = |target: &str, name: &str, bytes: &[u8]| put(folder, target, name, bytes);
    put("machine", "small", MACHINE.as_bytes());
    put("settings", "defaults", IdentifyConfig::template().as_bytes());
    put("machine", "defaults", MachineFile::template().as_bytes());

    for (name, model) in models() {
        let file = ModelFile {
            model,
            identification: None,
            explanation: None,
        };
        for (target, format) in [
            ("model", Format::Json),
            ("model-csv", Format::Csv),
            ("model-mat", Format::Mat),
        ] {
            put(target, name, &export(&file, format, 2).expect("a model"));
        }
    }
}

const MACHINE: &str = "[multisine]\nperiod = 8\nperiods = 2\nlines = { band = { first = 1, last = 3 } }\n\
[positions]\ncount = 1\n[moves]\nestimation = 0\nvalidation = 0\n";

fn models() -> Vec<(&'static str, Model)> {
    let m = |rows, columns, values: &[f64]| DMatrix::from_row_slice(rows, columns, values);
    let clock = Discrete::new(0.1).expect("a clock");
    let plain = StateSpace::new(
        m(1, 1, &[0.5]),
        m(1, 1, &[1.0]),
        m(1, 1, &[2.0]),
        m(1, 1, &[0.0]),
        clock,
    );
    let blocks = LfrBlocks {
        a: m(1, 1, &[-1.0]),
        b1: m(1, 1, &[0.1]),
        b2: m(1, 1, &[1.0]),
        c1: m(1, 1, &[0.1]),
        d11: m(1, 1, &[0.2]),
        d12: m(1, 1, &[0.0]),
        c2: m(1, 1, &[1.0]),
        d21: m(1, 1, &[0.0]),
        d22: m(1, 1, &[0.0]),
    };
    let deltas = vec![DeltaBlock {
        parameter: 0,
        repetitions: 1,
    }];
    let range = SchedulingRange::new(vec![[-1.0, 1.0]]).expect("a range");
    let lfr = Lfr::new(blocks, deltas, range, Continuous).expect("an LFR");
    vec![
        ("state-space", Model::DiscreteStateSpace(plain.expect("a system"))),
        ("lfr", Model::ContinuousLfr(lfr)),
    ]
}
