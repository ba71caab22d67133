//! Places in the plane: what is for one scheduling signal says so, and takes no several places for one.

use crate::common::{Desk, csv, entry, head, mode, response};

/// A record of the machine at rest at a place, periodic or not.
fn record(desk: &Desk, name: &str, period: Option<usize>, place: Option<[f64; 2]>) {
    let u: Vec<f64> = (0..800)
        .map(|k| {
            let phase = (if period.is_some() { k % 200 } else { k }) as f64;
            (0.31 * phase).sin() + (0.013 * phase * phase).sin()
        })
        .collect();
    let y = response(&mode(), &u);
    let mut columns = vec![("u", u.as_slice()), ("y", y.as_slice())];
    let at = place.map(|p| p.map(|p| vec![p; 800]));
    if let Some([x, y]) = &at {
        columns.extend([("px", x.as_slice()), ("py", y.as_slice())]);
    }
    desk.write(&format!("bundle/{name}.csv"), csv(&columns));
}

/// Four records at the corners of a square; with columns or with positions alone.
fn bundle(desk: &Desk, period: Option<usize>, measured: bool, corners: [[f64; 2]; 4]) {
    let mut toml = head(100.0).replace("format = 1", "format = 2");
    if measured {
        toml += "[channels.scheduling]\ncolumns = [\"px\", \"py\"]\n";
    }
    for (i, place) in corners.into_iter().enumerate() {
        let name = format!("r{i}");
        record(desk, &name, period, measured.then_some(place));
        toml += &entry(&format!("{name}.csv"), period, "estimation");
        if !measured {
            toml += &format!("position = [{}, {}]\n", place[0], place[1]);
        }
    }
    desk.write("bundle/experiment.toml", toml);
}

const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [0.1, 0.0], [0.0, 0.1], [0.1, 0.1]];

#[test]
fn several_places_in_the_plane_are_refused_by_name_whatever_is_asked() {
    for (period, measured) in [(Some(200), true), (Some(200), false), (None, true), (None, false)] {
        let desk = Desk::new();
        bundle(&desk, period, measured, SQUARE);
        let remedy = match measured {
            true => "[channels.auxiliary]",
            false => "write in `position` the one number that changes",
        };
        for command in [
            "identify bundle -o model.json",
            "identify bundle --structure rigid-body -o model.json",
            "identify bundle --structure lti -o model.json",
            "diagnose bundle -o found",
        ] {
            let message = desk.refused(command);
            let named = message.contains("records r0 and r1 rest at (0, 0) and (0.1, 0)");
            assert!(
                named && message.contains(remedy),
                "{period:?} {measured} {command}: {message}"
            );
        }
    }
}

#[test]
fn one_place_in_the_plane_is_a_machine_that_does_not_change() {
    for period in [Some(200), None] {
        let desk = Desk::new();
        bundle(&desk, period, true, [[0.3, -2.0]; 4]);
        desk.done("identify bundle -o model.json");
        // A model of one place against several.
        let other = Desk::new();
        bundle(&other, period, true, SQUARE);
        other.write("model.json", desk.bytes("model.json"));
        let message = other.refused("validate model.json bundle");
        assert!(message.contains("records r0 and r1 rest at"), "{message}");
    }
}

/// Positions alone tell places apart, and a model over them is run at the position of a record.
#[test]
fn declared_positions_make_a_model_over_p() {
    for period in [Some(200), None] {
        let desk = Desk::new();
        let mut toml = head(100.0);
        for i in 0..4 {
            let name = format!("r{i}");
            record(&desk, &name, period, None);
            toml += &entry(&format!("{name}.csv"), period, "estimation");
            toml += &format!("position = {:?}\n", 0.1 * f64::from(i));
        }
        desk.write("bundle/experiment.toml", toml);
        let text = desk.judged("identify bundle -o model.json");
        assert!(!text.contains("not judged"), "{text}");
        assert!(desk.text("model.json").contains("\"range\""), "{text}");
        let text = desk.judged("validate model.json bundle");
        assert!(!text.contains("number of parameters"), "{text}");
    }
}

#[test]
fn a_position_that_is_no_number_is_answered_in_plain_words() {
    let desk = Desk::new();
    bundle(&desk, Some(200), false, SQUARE);
    let good = desk.text("bundle/experiment.toml");
    for (bad, said) in [
        ("\"0.1\"", "expected a number or a list of numbers"),
        ("[]", "expected a number or a list of numbers"),
        ("[[0.1, 0.2]]", "expected a number"),
        ("[0.1]", "1 numbers where p has 2"),
    ] {
        desk.write("bundle/experiment.toml", good.replacen("[0.1, 0]", bad, 1));
        let message = desk.refused("inspect bundle");
        assert!(
            message.contains(said) && message.contains("experiment.toml:"),
            "{bad}: {message}"
        );
    }
}
