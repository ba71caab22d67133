use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{Discrete, Purpose, Record, RecordKind, Signals, StateSpace};
use lti_ident::{Focus, InnovationSettings, Segment, identify};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
fn normal(r: usize, c: usize, seed: u64) -> DMatrix<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    DMatrix::from_fn(r, c, |_, _| StandardNormal.sample(&mut rng))
}
fn sig(m: &DMatrix<f64>, s: &str) -> Signals {
    Signals {
        names: (0..m.nrows()).map(|i| format!("{s}{i}")).collect(),
        units: vec![],
        columns: m.row_iter().map(|r| r.iter().copied().collect()).collect(),
    }
}
fn colour(e: &DMatrix<f64>, a: f64) -> DMatrix<f64> {
    let mut o = e.clone();
    for i in 0..e.nrows() {
        let mut s = 0.0;
        for k in 0..e.ncols() {
            s = a * s + (1.0f64 - a * a).sqrt() * e[(i, k)];
            o[(i, k)] = s;
        }
    }
    o
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let only = args.get(1).cloned().unwrap_or_default();
    let samples: usize = args.get(2).map_or(1500, |s| s.parse().unwrap());
    let c = Discrete::new(0.1).unwrap();
    let ss = |a, b, cc, d| StateSpace::new(a, b, cc, d, c).unwrap();
    let two = ss(
        dmatrix![0.9, 0.3; -0.3, 0.9],
        dmatrix![1.0; 0.0],
        dmatrix![0.0, 1.0],
        dmatrix![0.0],
    );
    let four = ss(
        dmatrix![0.9,0.3,0.,0.;-0.3,0.9,0.,0.;0.,0.,0.4,0.8;0.,0.,-0.8,0.4],
        dmatrix![1.0;0.5;0.5;1.0],
        dmatrix![0.4, 0.1, 1.0, 0.0],
        dmatrix![0.0],
    );
    let mode = |r: f64, w: f64| [r * w.cos(), r * w.sin()];
    let ([a, b], [e, d]) = (mode(0.97, 0.3), mode(0.93, 1.1));
    let mimo = ss(
        DMatrix::from_row_slice(4, 4, &[a, b, 0., 0., -b, a, 0., 0., 0., 0., e, d, 0., 0., -d, e]),
        DMatrix::from_row_slice(4, 2, &[1.0, 0.2, 0.0, 0.5, 0.3, -1.0, 0.6, 0.0]),
        DMatrix::from_row_slice(2, 4, &[0.5, 0.1, 1.0, 0.0, -0.3, 0.8, 0.2, 0.4]),
        DMatrix::from_row_slice(2, 2, &[0.3, 0.0, 0.0, -0.2]),
    );
    for (name, sys, size) in [("two", &two, 0.02), ("four", &four, 0.1), ("mimo", &mimo, 0.2)] {
        for (kind, pole) in [("white", 0.0), ("c0.8", 0.8), ("c-0.6", -0.6)] {
            for focus in [Focus::Simulation, Focus::Prediction] {
                let tag = format!("{name}-{kind}-{focus:?}");
                if !tag.contains(&only) {
                    continue;
                }
                let mut out = vec![];
                let start = std::time::Instant::now();
                for seed in 0..args.get(3).map_or(10u64, |s| s.parse().unwrap()) {
                    let u = normal(sys.inputs(), samples, 100 + seed);
                    let e = colour(&normal(sys.outputs(), samples, 900 + seed), pole) * size;
                    let y = sys.simulate(&DVector::zeros(sys.states()), &u).unwrap().outputs + e;
                    let none = Signals::default;
                    let record = Record {
                        name: "x".into(),
                        kind: RecordKind::Transient,
                        purpose: Purpose::Estimation,
                        position: None,
                        outputs: sig(&y, "y"),
                        inputs: sig(&u, "u"),
                        references: none(),
                        scheduling: none(),
                        auxiliary: none(),
                        injection: none(),
                    };
                    let set = InnovationSettings::new(1..=12).focus(focus).check().unwrap();
                    let fit = identify(&[Segment::new(&record, 0..samples * 7 / 10)], c, &set, &[]).unwrap();
                    for e in &fit.entries {
                        let worst = e
                            .model
                            .model()
                            .poles()
                            .unwrap()
                            .iter()
                            .map(|z| z.norm())
                            .fold(0.0, f64::max);
                        println!(
                            "D {tag} {seed} {} {} {} {} {} {} {worst}",
                            e.order,
                            e.cost,
                            e.expected_cost - e.cost,
                            e.parameters,
                            samples * 7 / 10,
                            sys.outputs()
                        );
                    }
                    // choice with price f * optimism
                    let n = (samples * 7 / 10 * sys.outputs()) as f64;
                    let pick = |f: f64| {
                        fit.entries
                            .iter()
                            .min_by(|a, b| {
                                let v = |e: &lti_ident::OrderEntry| e.cost + f * (e.expected_cost - e.cost);
                                v(a).total_cmp(&v(b))
                            })
                            .unwrap()
                            .order
                    };
                    let bic = fit
                        .entries
                        .iter()
                        .min_by(|a, b| {
                            let v = |e: &lti_ident::OrderEntry| {
                                e.cost + n.ln() * (e.parameters + e.order) as f64 / n * sys.outputs() as f64
                            };
                            v(a).total_cmp(&v(b))
                        })
                        .unwrap()
                        .order;
                    out.push((fit.chosen().order, pick(1.5), pick(1.75), pick(2.0), bic));
                    use std::io::Write;
                    std::io::stdout().flush().unwrap();
                }
                println!(
                    "{tag} {:?} chosen {:?}",
                    start.elapsed(),
                    out.iter().map(|o| o.0).collect::<Vec<_>>()
                );
                println!(
                    "    x1.5 {:?}  x1.75 {:?} x2 {:?} bic {:?}",
                    out.iter().map(|o| o.1).collect::<Vec<_>>(),
                    out.iter().map(|o| o.2).collect::<Vec<_>>(),
                    out.iter().map(|o| o.3).collect::<Vec<_>>(),
                    out.iter().map(|o| o.4).collect::<Vec<_>>()
                );
            }
        }
    }
}
