//! Text tables as instruments write them.

use super::{Draw, Judged, Lab, TaskError, draft};
use crate::trust::bundle::{Table, number};
use crate::trust::program::Said;
use crate::trust::rig::Rig;
use std::fmt::Write as _;

/// A rig in loop with a rate whose period is a decimal number, as instruments write them, and a table of two signals and a reference.
fn recorded(draw: &mut Draw, names: [&str; 4]) -> (f64, Table) {
    let mut rig = Rig::closed(draw);
    let rate = draw.pick([100.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 10_000.0, 20_000.0]);
    rig.rate = rate;
    let signals = rig.periodic(draw, 2);
    let rows = 800.min(signals.y[0].len());
    let round = |v: &[f64]| -> Vec<f64> {
        v[..rows]
            .iter()
            .map(|v| format!("{v:.6e}").parse().unwrap_or(*v))
            .collect()
    };
    let table = Table::default()
        .with(names[0], &(0..rows).map(|k| k as f64 / rate).collect::<Vec<_>>())
        .with(names[1], &round(&signals.u[0]))
        .with(names[2], &round(&signals.y[0]))
        .with(names[3], &round(&signals.r[0]));
    (rate, table)
}

/// Whether the draft has this rate and these columns with these values.
fn drafted(lab: &Lab, said: &Said, rate: f64, table: &Table) -> bool {
    let signals: Vec<&[f64]> = table.0[1..3].iter().map(|(_, v)| v.as_slice()).collect();
    let found = draft(lab, ".");
    let has_rate = found.as_ref().is_some_and(|d| (d.rate / rate - 1.0).abs() < 1e-6);
    said.code == Some(0) && has_rate && found.is_some_and(|d| d.holds(lab, &signals))
}

/// Lines before the header, a row of units, separators, times in samples or milliseconds.
pub(super) fn csv_preambles(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let what = draw.pick([
        "oscilloscope",
        "units",
        "labview",
        "twincat",
        "milliseconds",
        "samples",
    ]);
    let (rate, mut table) = recorded(draw, ["t", "u", "y", "r"]);
    let mut text = String::new();
    match what {
        "oscilloscope" => {
            for (column, name) in table.0.iter_mut().zip(["TIME", "CH1", "CH2", "CH3"]) {
                name.clone_into(&mut column.0);
            }
            let offset = table.0[0].1[100];
            table.0[0].1.iter_mut().for_each(|t| *t -= offset);
            let _ = write!(
                text,
                "Model,MDO{}\nFirmware Version,1.{}\n\nWaveform Type,ANALOG,,\nHorizontal Units,s,,\nSample Interval,{},\nVertical Units,V,V\n,,\nLabel,FORCE,POS,REF\n",
                draw.integer(1000, 9999),
                draw.integer(0, 99),
                number(1.0 / rate)
            );
            text.push_str(&table.text(',', '.'));
        }
        "units" => {
            let unit = draw.pick(["m", "mm", "rad", "um"]);
            let _ = write!(text, "t,u,y,r\ns,N,{unit},{unit}\n{}", table.body(',', '.'));
        }
        "labview" => {
            let rows = table.rows();
            let _ = write!(
                text,
                "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tNo\n***End_of_Header***\t\n\nChannels\t3\nSamples\t{rows}\t{rows}\t{rows}\n***End_of_Header***\t\nX_Value\tForce\tPosition\tReference\n{}",
                table.body('\t', '.')
            );
        }
        "twincat" => {
            table.0[0].1.iter_mut().for_each(|t| *t *= 1000.0);
            let _ = write!(
                text,
                "Name;Scope Project\nFile;C:\\meas{}.svdx\nStarttime of export;{}\n\nName;Axis1.Force;Axis1.Pos;Axis1.Set\nt;u;y;r\n{}",
                draw.integer(0, 99),
                draw.integer(100_000, 999_999),
                table.body(';', ',')
            );
        }
        other => {
            "time".clone_into(&mut table.0[0].0);
            let by = if other == "milliseconds" { 1000.0 } else { rate };
            table.0[0]
                .1
                .iter_mut()
                .for_each(|t| *t = (*t * by * 1e9).round() / 1e9);
            text = table.text(',', '.');
        }
    }
    std::fs::write(lab.path("a.csv"), text)?;
    let said = lab.run(&["new", "a.csv"])?;
    let mut right = drafted(lab, &said, rate, &table);
    let words = said.all();
    if what == "samples" {
        // Nothing in the file tells the rate: it is asked for.
        let rate = draft(lab, ".").map_or(1.0, |d| d.rate);
        right = said.code == Some(0)
            && (rate == 0.0
                || words.contains("sample number")
                || words.contains("samples,")
                || words.contains("counts"));
    } else if what == "milliseconds" || what == "twincat" {
        let values: Vec<&[f64]> = table.0[1..3].iter().map(|(_, v)| v.as_slice()).collect();
        right |= said.code == Some(0)
            && (words.contains("millisecond") || words.contains(" ms"))
            && draft(lab, ".").is_some_and(|d| d.holds(lab, &values));
    }
    Ok(Judged::new(
        right,
        &said,
        "lpv new a.csv",
        &format!("{what}: {rate} Hz and the signals of the table"),
    ))
}

/// Semicolons, decimal commas, times in milliseconds, German names.
pub(super) fn german_csv(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let (rate, mut table) = recorded(
        draw,
        ["Zeit [ms]", "Moment [Nm]", "Drehzahl [rad/s]", "Soll [rad/s]"],
    );
    table.0[0]
        .1
        .iter_mut()
        .for_each(|t| *t = (*t * 1e9).round() / 1e6);
    let mark = draw.pick(["", "\u{feff}"]);
    let end = draw.pick(["\n", "\r\n"]);
    let text = format!("{mark}{}", table.text(';', ',')).replace('\n', end);
    std::fs::write(lab.path("a.csv"), text)?;
    let said = lab.run(&["new", "a.csv"])?;
    let right = drafted(lab, &said, rate, &table);
    Ok(Judged::new(
        right,
        &said,
        "lpv new a.csv",
        &format!("read as it is: {rate} Hz and three signals"),
    ))
}

/// A column that holds one number and is empty below, and a comma at the end of the header.
pub(super) fn empty_cells_in_an_unused_column(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let (rate, table) = recorded(draw, ["t", "uEst", "yEst", "uVal"]);
    let mut text = "uEst,yEst,uVal,Ts,\n".to_owned();
    for row in 0..table.rows() {
        let cell = |i: usize| number(table.0[i].1[row]);
        let step = if row == 0 {
            number(1.0 / rate)
        } else {
            String::new()
        };
        let _ = writeln!(text, "{},{},{},{step},", cell(1), cell(2), cell(3));
    }
    std::fs::write(lab.path("tanks.csv"), text)?;
    let given = draw.chance(0.5);
    let text = format!("{rate:?}");
    let mut arguments = vec!["new", "tanks.csv", "--input", "uEst", "--output", "yEst"];
    if given {
        arguments.extend(["--sample-rate", &text]);
    }
    let said = lab.run(&arguments)?;
    let found = draft(lab, ".");
    let roles = found
        .as_ref()
        .is_some_and(|d| d.inputs == ["uEst"] && d.outputs == ["yEst"]);
    let values: Vec<&[f64]> = table.0[1..3].iter().map(|(_, v)| v.as_slice()).collect();
    let has_rate = !given || found.as_ref().is_some_and(|d| (d.rate / rate - 1.0).abs() < 1e-9);
    let right = said.code == Some(0) && roles && has_rate && found.is_some_and(|d| d.holds(lab, &values));
    Ok(Judged::new(
        right,
        &said,
        &format!("lpv {}", arguments.join(" ")),
        "the column of one number is left out, the rest is read",
    ))
}
