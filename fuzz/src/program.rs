//! Targets of what the program reads beside records: models, settings, machines.

use crate::targets::{Target, file};
use lpv::convert::{Target as Format, export, import};
use lpv::simulate::MachineFile;
use lpv::{IdentifyConfig, ModelFile};

/// All of them.
pub const TARGETS: &[Target] = &[
    Target {
        name: "model",
        run: |data| model("m.json", data),
    },
    Target {
        name: "model-mat",
        run: |data| model("m.mat", data),
    },
    Target {
        name: "model-csv",
        run: |data| model("m.csv", data),
    },
    Target {
        name: "settings",
        run: |data| drop(IdentifyConfig::read(&file("identify.toml", data))),
    },
    Target {
        name: "machine",
        run: |data| drop(MachineFile::read(&file("machine.toml", data))),
    },
];

/// A model that is read can be written and read again, and is the same.
fn model(name: &str, data: &[u8]) {
    let path = file(name, data);
    let Ok(model) = import(&path) else { return };
    for format in [Format::Json, Format::Csv, Format::Mat, Format::Python] {
        let Ok(bytes) = export(&model, format, 2) else {
            continue;
        };
        if let Format::Json = format {
            let again = ModelFile::read(&file("again.json", &bytes)).expect("a model that was written");
            assert_eq!(again.model, model.model);
        }
    }
}
