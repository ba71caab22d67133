//! `lpv convert`: to other formats and back, bit by bit.

use crate::common::{Desk, mode, mode_bundle};
use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{
    Clock, Continuous, DeltaBlock, Discrete, InnovationModel, Lfr, LfrBlocks, Model, RigidBody,
    RigidBodyAxis, SchedulingRange, StateSpace,
};

/// An LFR with two states, three deltas of two parameters, and numbers without a short decimal form.
pub(crate) fn lfr<K: Clock>(clock: K, size: f64) -> Lfr<K> {
    let third = |m: DMatrix<f64>| m / 3.0;
    let blocks = LfrBlocks {
        a: dmatrix![0.3, 0.4; -0.4, 0.3] * size,
        b1: third(dmatrix![0.1, 0.2, 0.0; 0.3, -0.1, 0.2]),
        b2: third(dmatrix![1.0; 2.0]),
        c1: third(dmatrix![1.0, 0.0; 0.0, 1.0; 0.5, 0.5]),
        d11: third(dmatrix![0.1, 0.0, 0.2; 0.0, 0.3, 0.0; 0.1, 0.1, 0.0]),
        d12: third(dmatrix![0.0; 1.0; 1e-300]),
        c2: third(dmatrix![1.0, 1.0; -0.0, 7.0]),
        d21: third(dmatrix![0.0, 1.0, 0.5; 1.0, 0.0, 0.0]),
        d22: third(dmatrix![0.0; 0.0]),
    };
    let deltas = vec![
        DeltaBlock {
            parameter: 0,
            repetitions: 2,
        },
        DeltaBlock {
            parameter: 1,
            repetitions: 1,
        },
    ];
    let range = SchedulingRange::new(vec![[-0.3, 0.1], [1.0, 1.0 + 1.0 / 7.0]]).unwrap();
    Lfr::new(blocks, deltas, range, clock).unwrap()
}

pub(crate) fn clock() -> Discrete {
    Discrete::new(1.0 / 30.0).unwrap()
}

fn models() -> Vec<(&'static str, Model)> {
    let continuous = StateSpace::new(
        dmatrix![-1.0 / 3.0, 1.0; 0.0, -2.0],
        dmatrix![0.0; 1.0],
        dmatrix![1.0, 0.0],
        dmatrix![0.1],
        Continuous,
    );
    let innovation = InnovationModel::new(
        mode(),
        dmatrix![0.1; 1.0 / 3.0],
        dmatrix![2e-7],
        DVector::from_element(1, 0.7),
        DVector::from_element(1, -1.0 / 7.0),
    );
    let axis = |inertia| RigidBodyAxis {
        inertia,
        viscous: 1.0 / 3.0,
        offset: -0.25,
        inertia_deviation: 1e-3,
        viscous_deviation: 2e-3,
        offset_deviation: 3e-3,
        output: lpv_core::AxisOutput::Position,
    };
    let range = SchedulingRange::interval(0.0, 1.0).unwrap();
    vec![
        ("lfr", Model::DiscreteLfr(lfr(clock(), 1.0))),
        ("continuous-lfr", Model::ContinuousLfr(lfr(Continuous, -1.0))),
        (
            "without-deltas",
            Model::DiscreteLfr(Lfr::from_lti(&mode(), range).unwrap()),
        ),
        ("lti", Model::DiscreteStateSpace(mode())),
        (
            "gain",
            Model::DiscreteStateSpace(StateSpace::gain(dmatrix![1.0 / 3.0, 2.0], clock()).unwrap()),
        ),
        ("continuous", Model::ContinuousStateSpace(continuous.unwrap())),
        ("innovation", Model::InnovationStateSpace(innovation.unwrap())),
        (
            "rigid-body",
            Model::RigidBody(
                RigidBody::new(vec![
                    axis(0.1),
                    RigidBodyAxis {
                        output: lpv_core::AxisOutput::Speed,
                        ..axis(2.0 / 3.0)
                    },
                ])
                .unwrap(),
            ),
        ),
    ]
}

#[test]
fn there_and_back_changes_no_bit() {
    let desk = Desk::new();
    for (name, model) in models() {
        desk.write_model("model.json", &model);
        for format in ["mat", "csv"] {
            let there = desk.done(&format!("convert model.json --to {format} -o there.{format}"));
            assert!(there.contains(&format!("there.{format}")), "{there}");
            desk.done(&format!("convert there.{format} --to json -o back.json"));
            let back = desk.model("back.json");
            assert_eq!(
                back.to_json().unwrap(),
                model.to_json().unwrap(),
                "{name} by {format}"
            );
        }
        // From one foreign format to the other as well.
        desk.done("convert there.mat --to csv -o second.csv");
        desk.done("convert second.csv --to json -o back.json");
        assert_eq!(desk.model("back.json"), model, "{name}");
    }
}

#[test]
fn without_an_output_the_file_lies_beside_the_model() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    desk.done("identify bundle -o result/model.json");
    for (format, ending) in [("mat", "mat"), ("csv", "csv"), ("python", "py")] {
        desk.done(&format!("convert result/model.json --to {format}"));
        assert!(desk.path(&format!("result/model.{ending}")).is_file());
    }
    // Names of the channels and the account of the identification stay where the format has a place for them.
    assert!(desk.text("result/model.py").contains("inputs = [\"u\"]"));
    desk.done("convert result/model.json --to json -o copy.json");
    assert_eq!(desk.text("copy.json"), desk.text("result/model.json"));
    // A model from elsewhere is judged like one's own.
    let own = desk.json("validate result/model.json bundle --json");
    assert_eq!(own, desk.json("validate result/model.mat bundle --json"));
    assert_eq!(own, desk.json("validate result/model.csv bundle --json"));
}

#[test]
fn a_model_is_not_written_over_itself() {
    let desk = Desk::new();
    desk.write_model("model.json", &Model::DiscreteStateSpace(mode()));
    let before = desk.files();
    for line in [
        "model.json --to json",
        "model.json --to mat -o model.json",
        "model.json --to csv -o ./model.json",
    ] {
        let message = desk.refused(&format!("convert {line}"));
        assert!(
            message.contains("never replaced") && message.contains("--output"),
            "{message}"
        );
    }
    assert_eq!(desk.files(), before);
    desk.done("convert model.json --to python");
    let message = desk.refused("convert model.py --to json -o other.json");
    assert!(message.contains("cannot be read back"), "{message}");
}

#[test]
fn damaged_models_end_in_one_message() {
    let desk = Desk::new();
    for (name, model) in models() {
        desk.write_model("whole.json", &model);
        for format in ["json", "mat", "csv"] {
            if format != "json" {
                desk.done(&format!("convert whole.json --to {format} -o whole.{format}"));
            }
            let bytes = desk.bytes(&format!("whole.{format}"));
            for part in [0, 1, 2, 3, 4, 5, 6, 7] {
                let cut = &bytes[..bytes.len() * part / 8];
                desk.write(&format!("cut.{format}"), cut);
                let message = desk.refused(&format!("convert cut.{format} --to json -o out.json"));
                assert!(
                    message.contains(&format!("cut.{format}")),
                    "{name}, {part}/8: {message}"
                );
            }
        }
    }
    assert!(!desk.path("out.json").exists());
}

#[test]
fn a_csv_file_that_lost_its_end_is_no_model() {
    let desk = Desk::new();
    desk.write_model("model.json", &Model::DiscreteStateSpace(mode()));
    desk.done("convert model.json --to csv");
    let text = desk.text("model.csv");
    let lines: Vec<&str> = text.lines().collect();
    for kept in 0..lines.len() {
        desk.write("cut.csv", lines[..kept].join("\n"));
        desk.refused("convert cut.csv --to json -o out.json");
        assert!(!desk.path("out.json").exists(), "{kept} lines");
    }
    // An entry that is missing in between is no zero.
    let without: Vec<&str> = lines
        .iter()
        .copied()
        .filter(|l| !l.starts_with("A,,2,1,"))
        .collect();
    assert_eq!(without.len(), lines.len() - 1);
    desk.write("cut.csv", without.join("\n"));
    desk.refused("convert cut.csv --to json -o out.json");
}

#[test]
fn files_that_are_no_models_say_where() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    for (name, content, part) in [
        (
            "a.json",
            "{\"format\": \"lpv-model\", \"version\": 99}",
            "version",
        ),
        ("b.json", "[1, 2", "line 1"),
        ("c.json", "{}", "format"),
        ("d.csv", "a,b\n1,2\n", "header"),
        (
            "e.csv",
            "matrix,p,row,column,value\nkind,,,,state-space\nsize A,,4000000000,4000000000,\n",
            "no model",
        ),
        (
            "f.csv",
            "matrix,p,row,column,value\nkind,,,,state-space\nA,,1,1,5\n",
            "line 3",
        ),
        (
            "g.csv",
            "matrix,p,row,column,value\nkind,,,,state-space\nsize A,,1,1,\nA,,1,1,five\n",
            "`five`",
        ),
        ("h.mat", "MATLAB", "h.mat"),
        ("i.txt", "a model", "i.txt"),
    ] {
        desk.write(name, content);
        for line in [
            format!("convert {name} --to json -o out.json"),
            format!("validate {name} bundle"),
        ] {
            let message = desk.refused(&line);
            assert!(
                message.contains(name) && message.contains(part),
                "{line}: {message}"
            );
        }
    }
    assert!(
        desk.refused("convert nothing.json --to mat")
            .contains("nothing.json")
    );
    assert!(!desk.path("out.json").exists());
}
