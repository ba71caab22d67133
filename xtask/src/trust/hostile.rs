//! What must never happen: a file of the user's destroyed, a name run as code, a run aborted, the memory of the machine taken.

mod files;
mod memory;
mod texts;

use super::bundle::Description;
use super::draw::Draw;
use super::judge::Judged;
use super::loops::{moves, rms};
use super::program::{Lab, Said};
use super::rig::Rig;
use super::{Case, TaskError};

/// No run may hold more, in KiB.
const MOST_KIB: u64 = 1 << 20;

type Make = fn(&mut Draw, &Lab) -> Result<Judged, TaskError>;

const KINDS: [(&str, Make); 22] = [
    ("contradicting-records", files::contradicting_records),
    (
        "convert-destroys-measurement",
        files::convert_destroys_measurement,
    ),
    ("diagnose-destroys-its-model", files::diagnose_destroys_its_model),
    ("exit101-closed-stderr", files::closed_stderr),
    ("h5-chunk-4GB", memory::damaged_mat_73),
    ("lfr-many-parameters", memory::lfr_many_parameters),
    ("lines-csv-not-quoted", texts::lines_csv),
    ("long-output-name", files::long_output_name),
    ("machine-file-errors", texts::machine_file_errors),
    ("output-destroys-bundle", files::output_destroys_bundle),
    ("outputs-in-nanometres", files::outputs_in_nanometres),
    ("panic-non-utf8-path", texts::non_utf8_path),
    ("permissions-widened", files::permissions_widened),
    ("position-offset-merges", files::position_offset_merges),
    ("python-injection", texts::python_injection),
    ("quadratic-names", memory::quadratic_names),
    ("report-of-a-file", files::report_of_a_file),
    ("simulate-full-disk", memory::simulate_full_disk),
    ("simulate-memory", memory::simulate_memory),
    ("slow-sampling-no-small-lfr", files::slow_sampling),
    ("terminal-escape", texts::terminal_escape),
    ("zip-bomb", memory::zip_bomb),
];

/// So many of each kind.
pub(crate) fn cases(first: u64, seeds: u64) -> Vec<Case> {
    let kinds = KINDS.iter();
    kinds
        .flat_map(|(name, make)| (first..first + seeds).map(|i| Case::new("hostile", name, i, *make)))
        .collect()
}

/// What several runs of one case did together.
struct Watch {
    command: String,
    wanted: String,
    wrong: Option<(Said, String)>,
    last: Said,
}

impl Watch {
    fn new(wanted: &str) -> Self {
        Self {
            command: String::new(),
            wanted: wanted.to_owned(),
            wrong: None,
            last: Said::default(),
        }
    }
    /// Looks at the end of a run and its memory, whatever it did.
    fn saw(&mut self, said: Said, command: &str) -> &Said {
        self.command = command.to_owned();
        self.last = said.clone();
        if !said.is_orderly() {
            self.fail(&format!("ended with {:?}", said.code));
        }
        if said.peak_kib > MOST_KIB {
            self.fail(&format!("took {} MiB", said.peak_kib >> 10));
        }
        &self.last
    }
    /// Runs and looks.
    fn run(&mut self, lab: &Lab, arguments: &[&str]) -> Result<&Said, TaskError> {
        let said = lab.run(arguments)?;
        Ok(self.saw(said, &format!("lpv {}", arguments.join(" "))))
    }
    /// Something is wrong; the first of all counts.
    fn fail(&mut self, what: &str) {
        if self.wrong.is_none() {
            self.wrong = Some((self.last.clone(), what.to_owned()));
        }
    }
    fn check(&mut self, holds: bool, otherwise: &str) {
        if !holds {
            self.fail(otherwise);
        }
    }
    fn judged(self) -> Judged {
        let (said, what) = self.wrong.clone().unwrap_or((self.last, String::new()));
        let mut judged = Judged::new(self.wrong.is_none(), &said, &self.command, &self.wanted);
        if !what.is_empty() {
            judged.said = format!("{what}: {}", judged.said);
        }
        judged
    }
}

/// A small periodic bundle in the folder `b` with one record `a.csv`.
fn small(draw: &mut Draw, lab: &Lab) -> Result<Rig, TaskError> {
    let mut rig = Rig::closed(draw);
    rig.period = 400;
    rig.lines = (1..160).collect();
    let signals = rig.periodic(draw, 6);
    std::fs::create_dir_all(lab.path("b"))?;
    Rig::table(&signals).write(&lab.path("b/a.csv"))?;
    let mut description = Description::single(rig.rate).referred(&["r"]);
    if let Some(c) = &rig.controller {
        description = description.controlled(c);
    }
    // A short move, so that a diagnosis has something to look at.
    let slow = (2.0 * rig.rate / rig.axis.modes[0][0]) as usize;
    for (file, by) in [("m1.csv", 30.0), ("m2.csv", -20.0)] {
        let moved = rig.follow(draw, &moves(&[by * rms(&signals.y[0]), 0.0], 10 * slow, 3 * slow));
        Rig::table(&moved).write(&lab.path("b").join(file))?;
    }
    description
        .periodic("a.csv", rig.period, false)
        .transient("m1.csv", false)
        .transient("m2.csv", true)
        .write(&lab.path("b"))?;
    Ok(rig)
}
