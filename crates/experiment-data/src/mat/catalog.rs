//! Everything in a MATLAB file by name, class and shape, and the columns of a record in it: vectors, the columns or rows of
//! matrices, and the fields of struct arrays, as Simulink and ControlDesk write them.

use super::Array;
use crate::RecordError;
use crate::contents::{Column, Contents, PassedOver};

/// A matrix with more signals than this is no table of signals.
const MOST_SIGNALS: u64 = 64;

/// What an entry of a file is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Kind {
    /// Real numbers or truth values.
    Numbers,
    /// A short text; long ones have no words.
    Text(String),
    /// Anything else, in words.
    Other(String),
}

/// An entry of a file; the elements of struct arrays have their number: `exp1.Y(2).Data`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Item {
    pub(super) name: String,
    /// Rows first.
    pub(super) shape: Vec<u64>,
    pub(super) kind: Kind,
}

/// One column or row of a matrix, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Column(u64),
    Row(u64),
}

/// `data(:,3)` apart: the matrix and its part.
pub(super) fn part_of(name: &str) -> (&str, Option<Part>) {
    let whole = (name, None);
    let Some((base, inside)) = name.strip_suffix(')').and_then(|n| n.rsplit_once('(')) else {
        return whole;
    };
    let Some((row, column)) = inside.split_once(',') else {
        return whole;
    };
    match (row.trim(), column.trim()) {
        (":", k) => k.parse().map_or(whole, |k| (base, Some(Part::Column(k)))),
        (k, ":") => k.parse().map_or(whole, |k| (base, Some(Part::Row(k)))),
        _ => whole,
    }
}

/// A column or row of a matrix.
pub(super) fn cut(name: &str, array: &Array, part: Part) -> Result<Vec<f64>, RecordError> {
    let no_matrix = || RecordError::NotAVector {
        column: name.to_owned(),
        shape: array.shape.clone(),
    };
    let &[rows, columns] = array.shape.as_slice() else {
        return Err(no_matrix());
    };
    let (rows, columns) = (rows as usize, columns as usize);
    match part {
        Part::Column(k) if k >= 1 && k as usize <= columns => {
            Ok(array.data[(k as usize - 1) * rows..k as usize * rows].to_vec())
        }
        Part::Row(k) if k >= 1 && k as usize <= rows => Ok(array
            .data
            .iter()
            .skip(k as usize - 1)
            .step_by(rows.max(1))
            .copied()
            .collect()),
        _ => Err(no_matrix()),
    }
}

/// The name with a number for each selector: `exp1.Y[Name=force].Data` is `exp1.Y(2).Data` where the second element has that
/// name. None if no element has.
pub(super) fn resolve(name: &str, items: &[Item]) -> Option<String> {
    let mut done = String::new();
    let mut rest = name;
    while let Some(open) = rest.find('[') {
        done += &rest[..open];
        // Units in the value may have brackets of their own.
        let inside = &rest[open + 1..];
        let close = inside
            .match_indices(']')
            .map(|(at, _)| at)
            .find(|at| inside[at + 1..].is_empty() || inside[at + 1..].starts_with(['.', '(']))?;
        let (key, value) = inside[..close].split_once('=')?;
        let element = items.iter().find_map(|item| {
            let number = item.name.strip_prefix(done.as_str())?.strip_prefix('(')?;
            let (number, field) = number.split_once(").")?;
            (field == key.trim() && item.kind == Kind::Text(value.to_owned())).then_some(number)
        })?;
        done += &format!("({element})");
        rest = &inside[close + 1..];
    }
    Some(done + rest)
}

/// The columns of a record, and what is none.
pub(super) fn contents(items: &[Item]) -> Contents {
    let mut found = Contents::default();
    let mut inside_objects = false;
    for item in items {
        match &item.kind {
            // Where MATLAB keeps the contents of objects.
            _ if item.name.is_empty() => inside_objects = true,
            Kind::Numbers => numbers(item, items, &mut found),
            // The names and units of signals.
            Kind::Text(_) if item.name.contains(['.', '(']) => {}
            Kind::Text(_) => found.passed_over.push(PassedOver {
                name: item.name.clone(),
                what: "text".to_owned(),
                remedy: String::new(),
            }),
            Kind::Other(what) => found.passed_over.push(PassedOver {
                name: item.name.clone(),
                what: format!("{what}{}", size(&item.shape)),
                remedy: remedy(&item.name, what),
            }),
        }
    }
    if inside_objects && !found.passed_over.iter().any(|p| p.what.contains("object")) {
        found.passed_over.push(PassedOver {
            name: "(no name)".to_owned(),
            what: "MATLAB objects".to_owned(),
            remedy: remedy("out", "an object of class Simulink.SimulationOutput"),
        });
    }
    unique_names(&mut found.columns);
    found
}

/// A vector, or a matrix of few signals.
fn numbers(item: &Item, items: &[Item], found: &mut Contents) {
    let (name, unit) = known_as(item, items);
    let (short, long) = match item.shape.as_slice() {
        &[rows, columns] => (rows.min(columns), rows.max(columns)),
        shape => (
            if shape.iter().filter(|n| **n != 1).count() > 1 {
                u64::MAX
            } else {
                1
            },
            shape.iter().copied().max().unwrap_or(0),
        ),
    };
    let column = |part: String| Column {
        name: format!("{name}{part}"),
        rows: long,
        unit: unit.clone(),
        source: (name != item.name).then(|| format!("{}{part}", address(item, items))),
        is_stamp: false,
    };
    match short {
        0 => {}
        1 => found.columns.push(column(String::new())),
        2..=MOST_SIGNALS => {
            let upright = item.shape[0] == long;
            let part = |k| {
                if upright {
                    format!("(:,{k})")
                } else {
                    format!("({k},:)")
                }
            };
            found.columns.extend((1..=short).map(|k| column(part(k))));
        }
        _ => found.passed_over.push(PassedOver {
            name: item.name.clone(),
            what: format!("numbers{}", size(&item.shape)),
            remedy: "write the signals in it as columns of their own".to_owned(),
        }),
    }
}

const LABELS: [&str; 5] = ["Name", "name", "label", "Label", "signalName"];

/// The words of a neighbour in the same element of a struct array.
fn neighbour<'a>(element: &str, keys: &[&str], items: &'a [Item]) -> Option<&'a str> {
    keys.iter().find_map(|key| {
        let own = |i: &&Item| i.name.strip_prefix(element).and_then(|r| r.strip_prefix('.')) == Some(key);
        match items.iter().find(own).map(|i| &i.kind) {
            Some(Kind::Text(text)) if !text.trim().is_empty() => Some(text.as_str()),
            _ => None,
        }
    })
}

/// The element of a struct array that an entry is a field of: `exp1.Y(2)` of `exp1.Y(2).Data`.
fn element_of(name: &str) -> Option<&str> {
    let (element, _) = name.rsplit_once('.')?;
    element.ends_with(')').then_some(element)
}

/// The name and the unit that the file has for a signal elsewhere: the label beside it in a struct array, or the time of such.
fn known_as(item: &Item, items: &[Item]) -> (String, String) {
    let own = item.name.as_str();
    if let Some(element) = element_of(own) {
        let unit = neighbour(element, &["Unit", "unit", "units"], items).unwrap_or("");
        let name = neighbour(element, &LABELS, items).map(|label| {
            // Of the path of a block, its last part.
            let last = label.rsplit('/').next().unwrap_or(label);
            last.trim().to_owned()
        });
        // Settings beside the samples keep their place for a name.
        let is_samples = item.shape.iter().any(|n| *n > 1);
        return match name {
            Some(name) if is_samples && !name.is_empty() => (name, unit.to_owned()),
            _ => (own.to_owned(), unit.to_owned()),
        };
    }
    let beside = |field: &str, array: &str| {
        own.strip_suffix(field).is_some_and(|base| {
            items
                .iter()
                .any(|i| i.name.starts_with(&format!("{base}{array}(")))
        })
    };
    if beside(".X.Data", ".Y") {
        return ("time".to_owned(), "s".to_owned());
    }
    let simulink = own == "tout" || beside(".time", ".signals") || own.ends_with(".tout");
    let unit = if simulink { "s" } else { "" };
    (own.to_owned(), unit.to_owned())
}

/// Where the file has a signal that is known by a label, by the label where there is one.
fn address(item: &Item, items: &[Item]) -> String {
    let by_label = || {
        let element = element_of(&item.name)?;
        let (array, _) = element.rsplit_once('(')?;
        let field = item.name.strip_prefix(element)?;
        LABELS.iter().find_map(|key| {
            let label = neighbour(element, &[key], items)?;
            let address = format!("{array}[{key}={label}]{field}");
            (resolve(&address, items).as_deref() == Some(item.name.as_str())).then_some(address)
        })
    };
    by_label().unwrap_or_else(|| item.name.clone())
}

/// Signals of one label keep their place for a name.
fn unique_names(columns: &mut [Column]) {
    let names: Vec<String> = columns.iter().map(|c| c.name.clone()).collect();
    for column in columns {
        if let Some(source) = &column.source
            && names.iter().filter(|n| **n == column.name).count() > 1
        {
            column.name.clone_from(source);
            column.source = None;
        }
    }
}

fn size(shape: &[u64]) -> String {
    if shape.is_empty() {
        return String::new();
    }
    let shape: Vec<String> = shape.iter().map(ToString::to_string).collect();
    format!(", {}", shape.join(" x "))
}

/// What to type in MATLAB.
fn remedy(name: &str, what: &str) -> String {
    let name = if name.is_empty() { "x" } else { name };
    let has = |class: &str| what.contains(class);
    let lines = if has("timetable") {
        format!("t = seconds({name}.Time - {name}.Time(1)); u = {name}.u; y = {name}.y;")
    } else if has("timeseries") {
        format!("t = {name}.Time; y = {name}.Data;")
    } else if has("iddata") {
        format!("u = {name}.u; y = {name}.y; Ts = {name}.Ts;")
    } else if has("table") {
        format!("u = {name}.u; y = {name}.y;")
    } else if has("SimulationOutput") || has("Dataset") {
        format!("t = {name}.tout; u = {name}.u; y = {name}.y;")
    } else if has("frd") || has("idfrd") {
        return format!(
            "in MATLAB: G = chgFreqUnit({name}, 'Hz'); frequency = G.Frequency; response = permute(G.ResponseData, [3 1 2]); save('x.mat', \
             'frequency', 'response'), for a record with kind = \"response\""
        );
    } else if has("several fields") {
        return format!(
            "in Python with h5py: table = file['{}'][()]; then new['t'] = table['t'] for each field, into a new file",
            name.replace('.', "/")
        );
    } else if has("cell array") {
        format!("t = {name}{{1}}.t; u = {name}{{1}}.u; y = {name}{{1}}.y;")
    } else if has("object") {
        format!("u = {name}.u; y = {name}.y;")
    } else {
        return String::new();
    };
    format!("in MATLAB: {lines} then save('x.mat', ...) with these variables as plain arrays")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(name: &str, shape: &[u64], kind: Kind) -> Item {
        Item {
            name: name.to_owned(),
            shape: shape.to_vec(),
            kind,
        }
    }

    fn text(name: &str, words: &str) -> Item {
        item(name, &[1, words.len() as u64], Kind::Text(words.to_owned()))
    }

    fn names(found: &Contents) -> Vec<(&str, Option<&str>)> {
        found
            .columns
            .iter()
            .map(|c| (c.name.as_str(), c.source.as_deref()))
            .collect()
    }

    #[test]
    fn parts_by_hand() {
        assert_eq!(part_of("data(:,3)"), ("data", Some(Part::Column(3))));
        assert_eq!(part_of("a.b( 2 ,:)"), ("a.b", Some(Part::Row(2))));
        for whole in ["u", "force (N)", "y(2)", "exp1.Y(2).Data", "f(x,y)"] {
            assert_eq!(part_of(whole), (whole, None));
        }
        let array = Array {
            shape: vec![3, 2],
            data: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        };
        assert_eq!(cut("x", &array, Part::Column(2)).unwrap(), [4.0, 5.0, 6.0]);
        assert_eq!(cut("x", &array, Part::Row(2)).unwrap(), [2.0, 5.0]);
        for outside in [Part::Column(0), Part::Column(3), Part::Row(4)] {
            assert!(cut("x", &array, outside).is_err());
        }
    }

    #[test]
    fn logs_of_a_rapid_prototyping_system() {
        let items = [
            item("exp1.X.Data", &[1, 60], Kind::Numbers),
            text("exp1.Y(1).Name", "Root/enc [mm]"),
            item("exp1.Y(1).Data", &[1, 60], Kind::Numbers),
            item("exp1.Y(1).Type", &[1, 1], Kind::Numbers),
            text("exp1.Y(2).Name", "in (V)"),
            item("exp1.Y(2).Data", &[1, 60], Kind::Numbers),
        ];
        let found = contents(&items);
        assert_eq!(
            names(&found),
            [
                ("time", Some("exp1.X.Data")),
                ("enc [mm]", Some("exp1.Y[Name=Root/enc [mm]].Data")),
                ("exp1.Y(1).Type", None),
                ("in (V)", Some("exp1.Y[Name=in (V)].Data")),
            ]
        );
        assert_eq!(found.columns[0].unit, "s");
        assert_eq!(
            resolve("exp1.Y[Name=in (V)].Data", &items).as_deref(),
            Some("exp1.Y(2).Data")
        );
        assert_eq!(resolve("exp1.Y[Name=out].Data", &items), None);
    }

    #[test]
    fn matrices_and_what_is_passed_over() {
        let items = [
            item("data", &[100, 3], Kind::Numbers),
            item("rec.pos", &[2, 100], Kind::Numbers),
            item("image", &[200, 100], Kind::Numbers),
            item("tt", &[], Kind::Other("an object of class timetable".to_owned())),
            item("", &[1, 88], Kind::Numbers),
        ];
        let found = contents(&items);
        let names: Vec<&str> = found.columns.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "data(:,1)",
                "data(:,2)",
                "data(:,3)",
                "rec.pos(1,:)",
                "rec.pos(2,:)"
            ]
        );
        let passed: Vec<&str> = found.passed_over.iter().map(|p| p.what.as_str()).collect();
        assert_eq!(passed, ["numbers, 200 x 100", "an object of class timetable"]);
        assert!(found.passed_over[1].remedy.contains("seconds(tt.Time"));
    }
}
