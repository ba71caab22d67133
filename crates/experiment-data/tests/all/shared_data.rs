//! The bundles that come with the project, where they are present.
use experiment_data::Bundle;
use lpv_core::{Record, RecordKind};
use std::path::PathBuf;

fn shared(name: &str) -> Option<Bundle> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data")
        .join(name);
    if !folder.exists() {
        println!("skipped: {} is not there", folder.display());
        return None;
    }
    Some(Bundle::open(&folder).unwrap())
}

#[test]
fn machines_load_whole_and_their_moves_follow_the_controller() {
    for name in ["machine-plain", "machine-friction", "machine-extra-mode"] {
        let Some(bundle) = shared(name) else { continue };
        assert_eq!(bundle.len(), 26);
        let mut positions = Vec::new();
        for record in bundle.records() {
            let record = record.unwrap();
            assert_eq!(record.outputs.units, ["m", "rad"]);
            match record.kind {
                RecordKind::Periodic { period } => {
                    assert_eq!((period, record.len()), (2048, 6 * 2048));
                    positions.push(record.position.unwrap());
                }
                RecordKind::Transient => {
                    assert_eq!((record.len(), &record.position), (4000, &None));
                    let error = controller_error(&bundle, &record);
                    assert!(error < 1e-9, "{name}, {}: {error}", record.name);
                }
            }
        }
        // Two experiments at each of nine positions, exactly equal within a pair.
        assert_eq!(positions.len(), 18);
        assert!(positions.chunks(2).all(|p| p[0] == p[1]));
        assert_eq!((positions[0][0], positions[17][0]), (-0.3, 0.3));
        let t = bundle
            .description()
            .geometry
            .as_ref()
            .unwrap()
            .force_from_input_at(0.1);
        assert_eq!(t.shape(), (2, 2));
    }
}

/// Difference of logged and recomputed inputs, rms over rms.
fn controller_error(bundle: &Bundle, record: &Record) -> f64 {
    let controller = bundle.description().controller.as_ref().unwrap();
    let mut state = controller.start().unwrap();
    let n = controller.loops();
    let at = |columns: &[Vec<f64>], k: usize| columns.iter().map(|c| c[k]).collect::<Vec<_>>();
    let (mut error, mut size) = (0.0f64, 0.0f64);
    for k in 0..record.len() {
        let mut u = vec![0.0; n];
        state.step(
            &at(&record.references.columns, k),
            &at(&record.outputs.columns, k),
            &mut u,
        );
        for i in 0..n {
            let pulse = record.injection.columns.get(i).map_or(0.0, |c| c[k]);
            error += (u[i] + pulse - record.inputs.columns[i][k]).powi(2);
            size += record.inputs.columns[i][k].powi(2);
        }
    }
    (error / size).sqrt()
}

#[test]
fn emps_loads_with_scales_and_pulses() {
    let Some(bundle) = shared("emps") else { return };
    let gtau = 35.15065188248547;
    let first = bundle.load(0).unwrap();
    let second = bundle.load(1).unwrap();
    assert_eq!((first.len(), second.len()), (24841, 24841));
    assert_eq!(first.name, "DATA_EMPS");
    // Extremes as an independent reader (scipy 1.17.1) gives them.
    let max = |x: &[f64]| x.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert_eq!(max(&first.outputs.columns[0]), 0.24637774999999998);
    assert_eq!(max(&first.inputs.columns[0]), 4.138482534881537 * gtau);
    assert_eq!(max(&second.injection.columns[0]), 5.0 * gtau);
    assert_eq!(
        second.injection.columns[0].iter().filter(|v| **v > 0.0).count(),
        12497
    );
    assert!(first.injection.columns.is_empty());
    for (record, expected) in [(&first, 0.0031463139750035492), (&second, 0.030998502458557318)] {
        let error = controller_error(&bundle, record);
        println!("{}: controller against log {error}", record.name);
        // numpy gives 0.31 % and 3.1 %; the data set's own statement is 0.24 % without the start of the first.
        assert!((error - expected).abs() < 1e-9, "{error}");
    }
}

fn centred(x: &[f64]) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    x.iter().map(|v| v - mean).collect()
}

#[test]
fn two_mass_bench_loads_past_its_matlab_object() {
    let Some(bundle) = shared("two-mass-bench") else {
        return;
    };
    for record in bundle.records() {
        let record = record.unwrap();
        assert_eq!(record.kind, RecordKind::Periodic { period: 2500 });
        assert_eq!(record.len(), 50_000);
        assert_eq!(record.position, None);
        // Both angles swing together once the load's sign is corrected.
        let (motor, load) = (
            centred(&record.outputs.columns[0]),
            centred(&record.outputs.columns[1]),
        );
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let correlation = dot(&motor, &load) / (dot(&motor, &motor) * dot(&load, &load)).sqrt();
        println!("{}: correlation of motor and load {correlation}", record.name);
        assert!(correlation > 0.4);
    }
}

#[test]
fn cd_player_arm_loads() {
    let Some(bundle) = shared("cd-player-arm") else {
        return;
    };
    let record = bundle.load(0).unwrap();
    assert_eq!(record.len(), 2048);
    assert_eq!(record.inputs.columns[0][0], 0.0531);
    assert_eq!(record.outputs.columns[1][1], 0.0342);
}
