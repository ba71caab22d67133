//! Files that ask for more memory than they are worth end in a message, under a limit of 1 GiB.

use crate::broken::arrays::zeros;
use crate::common::Desk;
use std::process::{Command, Output};

/// Runs `lpv` with an address space of 1 GiB, where a shell can limit it: an allocation beyond that ends in an abort.
fn limited(desk: &Desk, line: &str) -> Output {
    let program = env!("CARGO_BIN_EXE_lpv");
    let mut command = if cfg!(target_os = "linux") {
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("ulimit -v 1048576; exec '{program}' {line}")]);
        shell
    } else {
        let mut command = Command::new(program);
        command.args(line.split_whitespace());
        command
    };
    // A thread takes address space of its own, which is no memory.
    command.env("RAYON_NUM_THREADS", "2");
    command.current_dir(desk.path("")).output().unwrap()
}

/// What a run says that refuses its input.
fn refused(desk: &Desk, line: &str) -> String {
    let output = limited(desk, line);
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{line}: {text}");
    text
}

#[test]
fn a_small_file_that_unpacks_to_the_whole_memory_is_refused() {
    let desk = Desk::new();
    let file = zeros(&["y", "u", "r"], 40_000_000);
    assert!(file.len() < 200_000, "{}", file.len());
    desk.write("b/r.npz", &file);
    desk.write(
        "b/experiment.toml",
        "format = 1\nname = 'n'\nsample_rate = 10.0\n[channels.output]\ncolumns = ['y']\n[channels.input]\ncolumns = ['u']\n\
         [[records]]\nfile = 'r.npz'\nkind = 'transient'\nuse = 'estimation'\n",
    );
    for line in ["inspect b", "identify b -o m.json"] {
        let text = refused(&desk, line);
        for part in [
            "r.npz (records[0])",
            "`y` claims 40000000 numbers",
            "320 MB",
            "without compression",
        ] {
            assert!(text.contains(part), "{line}: {part} in {text}");
        }
    }
}

#[test]
fn frozen_systems_are_counted_before_they_are_made() {
    let desk = Desk::new();
    // One state and nothing that depends on p, but 12 parameters: 11^12 points of the default grid.
    let model = |parameters: usize| {
        let range = vec!["[0.0, 1.0]"; parameters].join(", ");
        let matrix = |rows: usize, columns: usize| {
            let row = format!("[{}]", vec!["0.5"; columns].join(", "));
            format!(
                "{{\"shape\": [{rows}, {columns}], \"rows\": [{}]}}",
                vec![row; rows].join(", ")
            )
        };
        format!(
            "{{\"format\": \"lpv-model\", \"version\": 1, \"kind\": \"discrete-lfr\", \"model\": {{\"sample_time\": 0.1, \
             \"range\": [{range}], \"deltas\": [], \"a\": {}, \"b1\": {}, \"b2\": {}, \"c1\": {}, \"d11\": {}, \
             \"d12\": {}, \"c2\": {}, \"d21\": {}, \"d22\": {}}}}}",
            matrix(1, 1),
            matrix(1, 0),
            matrix(1, 1),
            matrix(0, 1),
            matrix(0, 0),
            matrix(0, 1),
            matrix(1, 1),
            matrix(1, 0),
            matrix(1, 1)
        )
    };
    desk.write("twelve.json", model(12));
    for to in ["csv", "mat", "python"] {
        let text = refused(&desk, &format!("convert twelve.json --to {to} -o out.{to}"));
        assert!(
            text.contains("each of the 12 scheduling parameters are 3e12 frozen systems"),
            "{text}"
        );
        assert!(text.contains("--points 2"), "{text}");
        assert!(!desk.path(&format!("out.{to}")).exists());
    }
    let done = limited(&desk, "convert twelve.json --to mat --points 2 -o out.mat");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    desk.write("many.json", model(30));
    let text = refused(&desk, "convert many.json --to csv --points 2 -o out.csv");
    assert!(text.contains("write the model as JSON"), "{text}");
}

#[test]
fn a_simulation_that_does_not_fit_is_refused_before_anything_is_written() {
    let desk = Desk::new();
    let head = "[positions]\ncount = 1\n[multisine]\nlines = { band = { first = 1, last = 3 } }\n";
    desk.write(
        "long.toml",
        format!("{head}period = 64\nperiods = 100000\n[moves]\nestimation = 0\nvalidation = 0\n"),
    );
    let text = refused(&desk, "simulate --machine long.toml -o out");
    assert!(
        text.contains("long.toml:6:1: [multisine] periods = 100000") && text.contains("4,194,304"),
        "{text}"
    );
    desk.write(
        "moves.toml",
        format!("{head}period = 64\nperiods = 2\n[moves]\nestimation = 1\nvalidation = 0\n[setpoints]\nsamples = 2097153\n"),
    );
    let text = refused(&desk, "simulate --machine moves.toml -o out");
    assert!(
        text.contains("moves.toml:11:1: [setpoints] samples = 2097153") && text.contains("2,097,152"),
        "{text}"
    );
    assert!(!desk.path("out").exists());
}

#[test]
fn a_model_file_claims_no_more_entries_than_it_has_lines() {
    let desk = Desk::new();
    desk.write(
        "m.csv",
        "matrix,p,row,column,value\nkind,,,,state-space\nsize A,,4000,4000,\nend,,,,\n",
    );
    let text = refused(&desk, "convert m.csv --to json -o m.json");
    assert!(text.contains("line 3") && text.contains("4000 x 4000"), "{text}");
}
