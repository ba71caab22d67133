#![allow(missing_docs)]
use lfr_realize::*;
use lpv_core::{Continuous, DeltaBlock, Discrete, Frf, FrfEstimate};
use lpv_ident::{Interpolation, RegressionSettings, Weighting, regress};
use obf_basis::{FkcmSettings, OrthonormalBasis, PoleSet, fkcm};
use std::time::Instant;
use xytable_plant::{Machine, MachineParameters};
fn strict(
    c: &Candidate<Continuous>,
    truth: &[(Vec<f64>, Frf)],
    clock: Discrete,
    lines: &[f64],
) -> (f64, f64) {
    let mut errors = Vec::new();
    for (p, g) in truth {
        let frozen = c.frozen(p).unwrap().zero_order_hold(clock).unwrap();
        errors.extend(
            frozen
                .frequency_response(lines)
                .unwrap()
                .relative_error(g)
                .unwrap(),
        );
    }
    errors.sort_by(f64::total_cmp);
    let d = |e: f64| 20.0 * e.log10();
    (d(errors[errors.len() - 1]), d(errors[errors.len() / 2]))
}
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let machine = MachineParameters::default().check()?;
    let clock = Discrete::from_rate(20.0)?;
    let lines: Vec<f64> = (0..160).map(|k| (f64::from(k) + 0.5) / 16.0).collect();
    let data = FrozenData::relative(clock, &responses(&machine, clock, machine.positions(21), &lines)?)?;
    let truth = responses(&machine, clock, machine.positions(81), &lines)?;
    // OBF
    let mut poles = Vec::new();
    for p in machine.positions(41) {
        poles.extend(
            machine
                .sampled_flexible_poles(p, clock)?
                .into_iter()
                .filter(|z| z.im > 0.0),
        );
    }
    let found = fkcm(
        &PoleSet::from_upper_half(&poles)?,
        &FkcmSettings::new(16).check()?,
    )?;
    let basis = OrthonormalBasis::takenaka_malmquist(&found.poles, clock)?;
    let half = 0.5 * (truth[80].0[0] - truth[0].0[0]);
    let lobatto: Vec<f64> = (0..21)
        .map(|k| -half * (std::f64::consts::PI * f64::from(k) / 20.0).cos())
        .collect();
    let est: Vec<FrfEstimate> = responses(&machine, clock, lobatto, &lines)?
        .into_iter()
        .map(|(p, g)| FrfEstimate::with_unit_covariance(g, Some(p[0])).unwrap())
        .collect();
    let fits = regress(
        &est,
        basis.state_space(),
        &RegressionSettings::new()
            .diagonal_rigid_body(2)
            .weighting(Weighting::Relative)
            .check()?,
    )?;
    let model = fits.interpolate(Interpolation::Polynomial { order: 17 })?;
    let made = realize(&model.series()?)?;
    println!(
        "cost {:.1} dB, OBF LFR {} {}",
        found.cost_db,
        made.lfr.states(),
        made.lfr.delta_count()
    );
    let mut errors = Vec::new();
    for (p, g) in &truth {
        errors.extend(
            made.lfr
                .frozen(p)?
                .frequency_response(&lines)?
                .relative_error(g)?,
        );
    }
    errors.sort_by(f64::total_cmp);
    println!(
        "OBF strict {:.1} median {:.1}",
        20.0 * errors[errors.len() - 1].log10(),
        20.0 * errors[errors.len() / 2].log10()
    );
    let deltas = [DeltaBlock {
        parameter: 0,
        repetitions: 5,
    }];
    let red = reduce(&made.lfr, clock, 8, &deltas, &ReduceSettings::new().check()?)?;
    println!(
        "discrete winner {} {:.1} {:.1} {:?}",
        red.winner,
        20.0 * red.largest.log10(),
        20.0 * red.median.log10(),
        red.starts
    );
    let red = reduce_to_continuous(&made.lfr, 8, &deltas, &ReduceSettings::new().check()?)?;
    let centre = red.refined.candidate.frozen(&[0.0])?;
    let (n, m) = (centre.states(), red.gamma.as_ref().unwrap());
    let part = lpv_core::StateSpace::new(
        centre.a().view((4, 4), (n - 4, n - 4)).into_owned(),
        centre.b().rows(4, n - 4).into_owned(),
        centre.c().columns(4, n - 4).into_owned(),
        centre.d().clone(),
        Continuous,
    )?;
    for target in [3e-5, 1e-9] {
        let t = Instant::now();
        let c = coherent(
            &part,
            Some(m),
            &data,
            &deltas,
            &machine.scheduling_range()?,
            &CoherentSettings::new()
                .target(target)
                .gain(GainFit::Free)
                .refine(RefineSettings::new().target(target))
                .check()?,
        )?;
        println!(
            "reduced centre, then coherent on the data: {:.1?} {:.2} s {:?}",
            strict(&c.refined.candidate, &truth, clock, &lines),
            t.elapsed().as_secs_f64(),
            c.starts
        );
    }
    let t = Instant::now();
    let c = refine(
        &red.refined.candidate.clone().with_free_gain()?,
        &data,
        &RefineSettings::new().target(3e-5).check()?,
    )?;
    println!(
        "plain {:?} {}",
        strict(&c.candidate, &truth, clock, &lines),
        t.elapsed().as_secs_f64()
    );
    let t = Instant::now();
    let b = bound_between(&c.candidate, &data, &BoundSettings::new().check()?)?;
    println!(
        "between {:.2} s, bound {:.1e}, warnings {:?}",
        t.elapsed().as_secs_f64(),
        b.intervals.iter().map(|i| i.bound).fold(0.0, f64::max),
        b.warnings.iter().take(3).collect::<Vec<_>>()
    );
    println!(
        "{:?}",
        b.intervals
            .iter()
            .map(|i| (i.bound * 1e6).round() / 1e6)
            .collect::<Vec<_>>()
    );
    println!(
        "{:?}",
        b.intervals
            .iter()
            .map(|i| (i.shift * 1e2).round() / 1e2)
            .collect::<Vec<_>>()
    );
    println!("{:?}", b.left_out_rms);
    Ok(())
}
fn responses(
    machine: &Machine,
    clock: Discrete,
    at: Vec<f64>,
    lines: &[f64],
) -> Result<Vec<(Vec<f64>, Frf)>, Box<dyn std::error::Error>> {
    at.into_iter()
        .map(|p| Ok((vec![p], machine.sampled(p, clock)?.frequency_response(lines)?)))
        .collect()
}
