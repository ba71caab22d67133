//! MATLAB files as programs of the field write them: structs, matrices, objects, settings beside signals.

use super::{Draw, Judged, Lab, TaskError, draft};
use crate::trust::mat5::{Content, write};
use crate::trust::rig::Rig;

/// Rate and some rows of two signals and a reference.
fn recorded(draw: &mut Draw, rows: usize) -> (f64, [Vec<f64>; 4]) {
    let mut rig = Rig::closed(draw);
    let rate = draw.pick([100.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 10_000.0]);
    rig.rate = rate;
    let signals = rig.periodic(draw, 2);
    let cut = |v: &[f64]| v[..rows].to_vec();
    let time = (0..rows).map(|k| k as f64 / rate).collect();
    (
        rate,
        [time, cut(&signals.u[0]), cut(&signals.y[0]), cut(&signals.r[0])],
    )
}

fn judged(
    lab: &Lab,
    file: &str,
    rate: Option<f64>,
    signals: &[&[f64]],
    wanted: &str,
) -> Result<Judged, TaskError> {
    let said = lab.run(&["new", file])?;
    let found = draft(lab, ".");
    let has_rate = rate.is_none_or(|r| found.as_ref().is_some_and(|d| (d.rate / r - 1.0).abs() < 1e-6));
    let right = said.code == Some(0) && has_rate && found.is_some_and(|d| d.holds(lab, signals));
    Ok(Judged::new(right, &said, &format!("lpv new {file}"), wanted))
}

/// As dSPACE ControlDesk writes: a struct, named after the file, with X (the time) and an array Y of structs with Name and Data.
pub(super) fn dspace_mat(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rows = draw.integer(60, 400);
    let (rate, [t, u, y, r]) = recorded(draw, rows);
    let text = |s: &str| Content::Text(s.to_owned());
    let signal = |name: &str, v: &[f64]| vec![text(name), Content::row(v)];
    let capture = |settings: &[f64]| {
        let mut fields = vec![
            (
                "X",
                Content::structs(&["Name", "Data"], vec![vec![text("time"), Content::row(&t)]]),
            ),
            (
                "Y",
                Content::structs(
                    &["Name", "Data"],
                    vec![
                        signal("position (mm)", &y),
                        signal("input (V)", &u),
                        signal("setpoint (mm)", &r),
                    ],
                ),
            ),
        ];
        let names = [
            "RevisionMajor",
            "RevisionMinor",
            "Downsampling",
            "TriggerMode",
            "Platform",
        ];
        fields.extend(names.iter().zip(settings).map(|(n, v)| (*n, Content::scalar(*v))));
        let (names, values): (Vec<&str>, Vec<Content>) = fields.into_iter().unzip();
        Content::structs(&names, vec![values])
    };
    let settings: Vec<f64> = (0..5).map(|_| draw.integer(0, 9) as f64).collect();
    let two = draw.chance(0.5);
    write(&lab.path("exp1.mat"), vec![("exp1", capture(&settings))])?;
    let mut arguments = vec!["new", "exp1.mat"];
    if two {
        write(&lab.path("exp2.mat"), vec![("exp2", capture(&settings))])?;
        arguments.push("exp2.mat");
    }
    let said = lab.run(&arguments)?;
    let found = draft(lab, ".");
    let has_rate = found.as_ref().is_some_and(|d| (d.rate / rate - 1.0).abs() < 1e-6);
    let right = said.code == Some(0) && has_rate && found.is_some_and(|d| d.holds(lab, &[&u, &y, &r]));
    Ok(Judged::new(
        right,
        &said,
        &format!("lpv {}", arguments.join(" ")),
        &format!("{rows} rows of three signals at {rate} Hz"),
    ))
}

/// Structures with time, matrices, timetables, iddata.
pub(super) fn matlab_containers(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rows = draw.integer(60, 400);
    let (rate, [t, u, y, r]) = recorded(draw, rows);
    match draw.pick(["structure", "matrix", "timetable", "iddata", "timeseries"]) {
        "structure" => {
            let signal = |label: &str, v: &[f64]| {
                vec![
                    Content::column(v),
                    Content::Text(label.to_owned()),
                    Content::scalar(1.0),
                ]
            };
            let signals = Content::structs(
                &["values", "label", "dimensions"],
                vec![
                    signal("force", &u),
                    signal("position", &y),
                    signal("setpoint", &r),
                ],
            );
            let out = Content::structs(&["time", "signals"], vec![vec![Content::column(&t), signals]]);
            write(&lab.path("a.mat"), vec![("out", out)])?;
            judged(
                lab,
                "a.mat",
                Some(rate),
                &[&u, &y, &r],
                "signals(k).values at the rate of `time`",
            )
        }
        "matrix" => {
            let matrix = Content::matrix(&[&u, &y, &r]);
            write(
                &lab.path("a.mat"),
                vec![("tout", Content::column(&t)), ("yout", matrix)],
            )?;
            judged(
                lab,
                "a.mat",
                Some(rate),
                &[&u, &y, &r],
                "the columns of `yout` at the rate of `tout`",
            )
        }
        class => {
            write(
                &lab.path("a.mat"),
                vec![("log", Content::Opaque(class.to_owned()))],
            )?;
            let said = lab.run(&["new", "a.mat"])?;
            let right = said.code == Some(2) && said.first().contains(class);
            Ok(Judged::new(
                right,
                &said,
                "lpv new a.mat",
                &format!("the variable `log` is an object of class {class}: say so"),
            ))
        }
    }
}

/// Signals in the columns (or rows) of a matrix, beside settings.
pub(super) fn matrix_mat(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rows = draw.integer(60, 400);
    let (_, [t, u, y, r]) = recorded(draw, rows);
    let scalars = draw.integer(3, 12);
    let mut all: Vec<(String, Content)> = (0..scalars)
        .map(|i| (format!("K{i}"), Content::scalar(draw.normal())))
        .collect();
    let vector: Vec<f64> = draw.noise(1.0, 6);
    all.push((
        "para".to_owned(),
        Content::structs(
            &["u", "f_coul"],
            vec![vec![Content::column(&vector), Content::column(&vector)]],
        ),
    ));
    let nested = draw.chance(0.4);
    if nested {
        let matrix = Content::rows(&[&u, &y, &r]);
        all.push(("rec".to_owned(), Content::structs(&["pos"], vec![vec![matrix]])));
    } else {
        all.push(("data".to_owned(), Content::matrix(&[&t, &u, &y, &r])));
    }
    let named = all.iter().map(|(n, c)| (n.as_str(), c.clone())).collect();
    write(&lab.path("a.mat"), named)?;
    let size = if nested {
        format!("3 x {rows}")
    } else {
        format!("{rows} x 4")
    };
    let mut found = judged(
        lab,
        "a.mat",
        None,
        &[&u, &y, &r],
        &format!("the columns of the matrix {size}, or a word of it"),
    )?;
    let said = lab.run(&["new", "a.mat", "--force"])?;
    let none_of_few = draft(lab, ".").is_none_or(|d| {
        let few = |n: &String| n.starts_with('K') || n.starts_with("para");
        !d.inputs.iter().chain(&d.outputs).any(few)
    });
    found.is_right |=
        none_of_few && (said.all().contains(&size) || said.all().contains(&size.replace(" x ", "x")));
    Ok(found)
}

/// More settings than signals, and the record itself as a matrix.
pub(super) fn scalars_outnumber_signals(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rows = draw.integer(60, 400);
    let (rate, [t, u, y, r]) = recorded(draw, rows);
    let names = [
        "Tvz", "Tgm", "J", "B", "Mn", "Mmax", "N", "KFI", "Cu", "Tn", "Tsim",
    ];
    let mut all: Vec<(&str, Content)> = names[..draw.integer(5, 11)]
        .iter()
        .map(|n| (*n, Content::scalar(draw.decades(1e-3, 1e3))))
        .collect();
    let has_time = draw.chance(0.5);
    if has_time {
        all.push(("t", Content::column(&t)));
    }
    all.push(("u", Content::column(&u)));
    all.push(("y", Content::column(&y)));
    all.push(("r", Content::column(&r)));
    all.push(("data", Content::matrix(&[&t, &u, &y, &r])));
    write(&lab.path("step.mat"), all)?;
    judged(
        lab,
        "step.mat",
        has_time.then_some(rate),
        &[&u, &y, &r],
        &format!("the signals of {rows} rows, no setting among them"),
    )
}

/// Nothing but objects.
pub(super) fn mat_of_objects(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let class = draw.pick(["frd", "zpk", "tf", "timeseries", "Simulink.SimulationOutput"]);
    let mut all = vec![("out", Content::Opaque(class.to_owned()))];
    // MATLAB's own place for what objects hold: a variable without a name.
    all.push(("", Content::Bytes(vec![0; 8 * draw.integer(3, 40)])));
    write(&lab.path("object.mat"), all)?;
    let said = lab.run(&["new", "object.mat"])?;
    let line = said.first().to_lowercase();
    let right =
        said.code == Some(2) && line.contains("object") && (line.contains("plain") || line.contains("array"));
    Ok(Judged::new(
        right,
        &said,
        "lpv new object.mat",
        &format!("holds only MATLAB objects ({class}); save plain arrays"),
    ))
}
