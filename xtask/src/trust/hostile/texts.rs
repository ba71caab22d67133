//! Names are text, whatever they hold: not code, not commands to a terminal, not columns of a table.

use super::{Draw, Judged, Lab, TaskError, Watch, small};
use serde_json::Value;
use std::ffi::OsString;
use std::fs;
use std::os::unix::ffi::OsStringExt;
use std::process::Command;

/// The bundle `b` with another name for its output.
fn renamed(lab: &Lab, name: &str) -> Result<(), TaskError> {
    let quoted = format!("\"{}\"", name.replace('"', "\"\""));
    for file in ["b/a.csv", "b/m1.csv", "b/m2.csv"] {
        let csv = fs::read_to_string(lab.path(file))?;
        fs::write(lab.path(file), csv.replacen("y,", &format!("{quoted},"), 1))?;
    }
    let toml = fs::read_to_string(lab.path("b/experiment.toml"))?;
    let basic: String = name
        .chars()
        .map(|c| match c {
            '"' => "\\\"".to_owned(),
            '\\' => "\\\\".to_owned(),
            c if c.is_control() => format!("\\u{:04x}", c as u32),
            c => c.to_string(),
        })
        .collect();
    let changed = toml.replace("columns = [\"y\"]", &format!("columns = [\"{basic}\"]"));
    fs::write(
        lab.path("b/experiment.toml"),
        changed.replace("name = \"case\"", &format!("name = \"{basic}\"")),
    )?;
    Ok(())
}

/// Rows of a table with quotation marks.
fn cells(line: &str) -> Vec<String> {
    let (mut out, mut cell, mut quoted) = (Vec::new(), String::new(), false);
    for c in line.chars() {
        match c {
            '"' => quoted = !quoted,
            ',' if !quoted => out.push(std::mem::take(&mut cell)),
            c => cell.push(c),
        }
    }
    out.push(cell);
    out
}

/// `inspect --lines` with names that are formulas or hold commas.
pub(super) fn lines_csv(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    small(draw, lab)?;
    let name = draw.pick([
        "=y, left",
        "+cmd|' /C calc'!A0",
        "@SUM(1,2)",
        "-2+3,4",
        "a \"b\", c",
    ]);
    renamed(lab, name)?;
    let mut watch = Watch::new("as many cells in each row as in the header, no cell a formula");
    let said = watch.run(lab, &["inspect", "b", "--lines"])?;
    let (code, out) = (said.code, said.out.clone());
    let header = out.lines().next().map_or(0, |l| cells(l).len());
    let even = out.lines().all(|l| cells(l).len() == header);
    let formula = out.lines().flat_map(cells).find(|c| {
        let c = c.trim_start_matches('"');
        c.starts_with(['=', '+', '@']) || (c.starts_with('-') && c.parse::<f64>().is_err())
    });
    watch.check(code == Some(0) && header > 1, "no table");
    watch.check(even, "rows of other lengths");
    watch.check(formula.is_none(), &format!("{formula:?}"));
    Ok(watch.judged())
}

/// A value of machine.toml that is out of range.
pub(super) fn machine_file_errors(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let (table, key, value) = draw.pick([
        ("machine", "carriage-mass-kg", "0.0"),
        ("machine", "beam-mass-kg", "-3.0"),
        ("servo", "bandwidth-hz", "0.0"),
        ("controller", "bandwidth-hz", "-1.0"),
    ]);
    let before = draw.integer(0, 4);
    let text = format!(
        "{}[{table}]\n{key} = {value}\n",
        "# a line of mine\n".repeat(before)
    );
    fs::write(lab.path("m.toml"), text)?;
    let mut watch = Watch::new(&format!("file, line and the key `{key}` of [{table}]"));
    let said = watch.run(lab, &["simulate", "--machine", "m.toml", "-o", "o"])?;
    let (code, line) = (said.code, said.first());
    watch.check(code == Some(2), &format!("{code:?}"));
    watch.check(line.contains("m.toml"), "no file");
    watch.check(
        line.contains(key) && line.contains(table),
        "not the key of the file",
    );
    watch.check(line.contains(&(before + 2).to_string()), "no line");
    watch.check(!lab.path("o").exists(), "a folder is left");
    Ok(watch.judged())
}

/// Folders and files whose names are not UTF-8.
pub(super) fn non_utf8_path(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    small(draw, lab)?;
    let mut bad = format!("bad{}", draw.integer(0, 99)).into_bytes();
    bad.push(0xff);
    let bad = OsString::from_vec(bad);
    fs::rename(lab.path("b"), lab.folder.join(&bad))?;
    let mut seen = Watch::new("works, or is refused before any work; no panic");
    let runs: [(&str, &[&str]); 4] = [
        (
            "new",
            &["--sample-rate", "50", "--force", "--input", "u", "--output", "y"],
        ),
        ("inspect", &[]),
        ("identify", &["-o", "m.json"]),
        ("diagnose", &["-o", "d"]),
    ];
    for (name, rest) in runs {
        let place = match name {
            "new" => lab.folder.join(&bad).join("a.csv"),
            _ => lab.folder.join(&bad),
        };
        let mut command = lab.command(&[name]);
        command.arg(place).args(rest);
        let said = crate::trust::program::watch(&mut command)?;
        let known = matches!(said.code, Some(0 | 2 | 3)) || name == "diagnose";
        seen.saw(said, &format!("lpv {name} bad\\xff ..."));
        seen.check(known, "neither done nor refused");
    }
    let machine = "[multisine]\nperiod = 64\nperiods = 2\nlines = { band = { first = 1, last = 19 } }\n[positions]\ncount = 2\n[moves]\nestimation = 0\nvalidation = 0\n";
    fs::write(lab.path("m.toml"), machine)?;
    let mut command = lab.command(&["simulate", "--machine", "m.toml", "-o"]);
    let mut place = bad.clone().into_vec();
    place.push(b's');
    command.arg(OsString::from_vec(place));
    seen.saw(
        crate::trust::program::watch(&mut command)?,
        "lpv simulate -o bad\\xffs",
    );
    Ok(seen.judged())
}

/// Code in the names of a bundle, and in the texts of a model file.
pub(super) fn python_injection(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    small(draw, lab)?;
    let token = format!("token{}", draw.integer(1000, 9999));
    let code = format!("open('pwned','w').write('{token}')");
    let evil = draw.pick([
        "\n{}\n#",
        "\"\"\"\n{}\n\"\"\"",
        "\r{}\n",
        "\\\n{}\n",
        "\u{2028}{}",
        "'\n{}\n'",
        "a\u{308}\n{}\n",
    ]);
    let evil = evil.replace("{}", &code);
    renamed(lab, &format!("y {evil}"))?;
    let mut watch = Watch::new("a module that Python reads, and that runs nothing of these");
    let refused = watch.run(lab, &["identify", "b", "-o", "m.json"])?.code == Some(2);
    if !refused {
        watch.run(lab, &["convert", "m.json", "--to", "python", "-o", "m.py"])?;
        read_by_python(&mut watch, lab, "m.py")?;
        // The same from a model file alone: every text that is not of the format becomes code.
        let mut json = lab.json("m.json");
        if let Some(part) = json.get_mut("identification") {
            poison(part, &evil);
        }
        fs::write(lab.path("evil.json"), json.to_string())?;
        watch.run(lab, &["convert", "evil.json", "--to", "python", "-o", "evil.py"])?;
        read_by_python(&mut watch, lab, "evil.py")?;
    }
    Ok(watch.judged())
}

/// Every text with a letter after it in the places where texts are free.
fn poison(value: &mut Value, evil: &str) {
    match value {
        Value::Object(map) => {
            for (key, inside) in map.iter_mut() {
                if ["bundle", "outputs", "inputs", "reasons"].contains(&key.as_str()) {
                    match inside {
                        Value::String(text) => text.push_str(evil),
                        Value::Array(all) => all.iter_mut().for_each(|v| {
                            if let Value::String(text) = v {
                                text.push_str(evil);
                            }
                        }),
                        _ => {}
                    }
                } else {
                    poison(inside, evil);
                }
            }
        }
        Value::Array(all) => all.iter_mut().for_each(|v| poison(v, evil)),
        _ => {}
    }
}

fn read_by_python(watch: &mut Watch, lab: &Lab, module: &str) -> Result<(), TaskError> {
    if !lab.path(module).exists() {
        return Ok(());
    }
    let python = "import ast, sys; ast.parse(open(sys.argv[1], encoding='utf-8').read())";
    let parsed = Command::new("python3")
        .args(["-c", python, module])
        .current_dir(&lab.folder)
        .output();
    if let Ok(parsed) = parsed {
        watch.check(parsed.status.success(), &format!("{module} does not parse"));
        // Without its libraries the import ends early; what runs before that would have left its mark.
        Command::new("python3")
            .arg(module)
            .current_dir(&lab.folder)
            .output()?;
    }
    let text = fs::read_to_string(lab.path(module))?;
    let as_code = text.lines().any(|l| l.trim_start().starts_with("open('pwned'"));
    watch.check(
        !as_code && !lab.path("pwned").exists(),
        &format!("{module} runs the name"),
    );
    Ok(())
}

/// Colours and bells in names.
pub(super) fn terminal_escape(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = small(draw, lab)?;
    let evil = draw.pick([
        "y\u{1b}[31m",
        "y\u{1b}]0;title\u{7}",
        "y\u{9b}2J",
        "y\u{8}\u{8}",
        "y\u{202e}x",
    ]);
    renamed(lab, evil)?;
    let mut watch = Watch::new("no control character on the terminal");
    let is_control = |text: &str| {
        text.chars()
            .any(|c| (c.is_control() && !['\n', '\t'].contains(&c)) || ('\u{202a}'..='\u{202e}').contains(&c))
    };
    for arguments in [
        &["inspect", "b"][..],
        &["identify", "b", "-o", "m.json"],
        &["diagnose", "b", "-o", "d"],
    ] {
        let said = watch.run(lab, arguments)?;
        let bare = is_control(&said.out) || is_control(&said.err);
        watch.check(!bare, "a control character");
    }
    let toml = fs::read_to_string(lab.path("b/experiment.toml"))?;
    let period = format!("period = {}", rig.period);
    fs::write(
        lab.path("b/experiment.toml"),
        toml.replace(&period, "period = 63"),
    )?;
    let said = watch.run(lab, &["inspect", "b"])?;
    let bare = is_control(&said.out) || is_control(&said.err);
    watch.check(!bare, "a control character in an error");
    Ok(watch.judged())
}
