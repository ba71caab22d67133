//! Universal files (SDRC, "Universal file formats for modal analysis testing"): data set 58, functions at nodal degrees of freedom, in
//! text (`58`) and in bytes (`58b`). Other data sets are passed over by name.
//!
//! A time history of real numbers is a column, called after its quantity, node and direction: `force 1+Z`. The interval of even
//! samples is the scalar `abscissa increment`; uneven ones have their times as a column, `time of force 1+Z`.

mod header;
mod responses;
mod sets;
mod source;
mod values;

use self::header::{Function, Spacing};
pub(crate) use self::responses::read as responses;
use self::sets::{Set, Sets, sets};
use self::source::Source;
use crate::RecordError;
use crate::contents::{Column, Contents, PassedOver, Scalar, missing};
use crate::memory::Allowance;
use std::collections::HashMap;
use std::path::Path;

/// The named columns, in the order of the names.
pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let mut source = Source::open(path)?;
    let sets = sets(&mut source)?;
    let offered = offered(&sets);
    let mut allowance = Allowance::new(source.bytes());
    names
        .iter()
        .map(|name| {
            let Some((_, part, set)) = offered.iter().find(|(n, ..)| n == name) else {
                let present: Vec<String> = offered.iter().map(|(n, ..)| n.clone()).collect();
                return Err(missing(name, &present));
            };
            set.check_claim(name)?;
            allowance.take(name, set.numbers())?;
            let all = set.values(name, &mut source)?;
            Ok(match (part, set.header.spacing) {
                (Part::Time, _) => all.into_iter().step_by(2).collect(),
                (Part::Values, Spacing::Uneven) => all.into_iter().skip(1).step_by(2).collect(),
                (Part::Values, Spacing::Even) => all,
            })
        })
        .collect()
}

/// Every time history, and what else the file holds.
pub(crate) fn contents(path: &Path) -> Result<Contents, RecordError> {
    let mut source = Source::open(path)?;
    let sets = sets(&mut source)?;
    let mut contents = Contents::default();
    for (name, part, set) in offered(&sets) {
        set.check_claim(&name)?;
        contents.columns.push(Column {
            unit: match part {
                Part::Values => set.header.ordinate.unit.clone(),
                Part::Time => set.header.abscissa.unit.clone(),
            },
            name,
            rows: set.header.points,
            source: None,
            is_stamp: false,
        });
    }
    let even = |s: &&Set| s.is_time_history() && s.header.spacing == Spacing::Even;
    for set in sets.functions.iter().filter(even) {
        let scalar = Scalar {
            name: "abscissa increment".to_owned(),
            value: set.header.step,
        };
        if set.header.step.is_finite() && !contents.scalars.contains(&scalar) {
            contents.scalars.push(scalar);
        }
    }
    let passed = |number: usize, what: String, remedy: &str| PassedOver {
        name: format!("data set {number}"),
        what,
        remedy: remedy.to_owned(),
    };
    for set in sets.functions.iter().filter(|s| s.is_response()) {
        contents.responses.push(set.told(&mut source)?);
    }
    let functions = sets.functions.iter().filter(|s| !s.is_time_history());
    let remedy = |s: &Set| match s.header.function {
        Function::FrequencyResponse => "a record with kind = \"response\" takes it",
        _ => "",
    };
    contents.passed_over = functions.map(|s| passed(s.number, s.what(), remedy(s))).collect();
    let others = sets.others.iter();
    contents.passed_over.extend(
        others.map(|(number, kind)| passed(*number, format!("kind {kind} of the format, no function"), "")),
    );
    Ok(contents)
}

/// What of a set a column is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Values,
    Time,
}

/// The columns by name, in the order of the file; of equal names, the second has `#2` behind it.
fn offered(sets: &Sets) -> Vec<(String, Part, &Set)> {
    let mut times: HashMap<String, usize> = HashMap::new();
    let mut offered = Vec::new();
    for set in sets.functions.iter().filter(|s| s.is_time_history()) {
        let mut name = set.header.name();
        let seen = times.entry(name.clone()).or_default();
        *seen += 1;
        if *seen > 1 {
            name += &format!(" #{seen}");
        }
        if set.header.spacing == Spacing::Uneven {
            offered.push((format!("time of {name}"), Part::Time, set));
        }
        offered.push((name, Part::Values, set));
    }
    offered
}

impl Set {
    fn is_time_history(&self) -> bool {
        !self.header.is_complex
            && matches!(self.header.function, Function::Other | Function::TimeHistory)
            && matches!(self.header.abscissa.kind, 0 | 17)
    }
}

fn malformed(variable: &str, problem: &str) -> RecordError {
    RecordError::Malformed {
        format: "universal (UFF)",
        variable: variable.to_owned(),
        problem: problem.to_owned(),
    }
}
