use lfr_realize::*;
use lpv_core::{Continuous, DeltaBlock, Discrete, Frf};
use std::time::Instant;
use xytable_plant::{Machine, MachineParameters};
fn strict(c: &Candidate<Continuous>, truth: &[(Vec<f64>, Frf)], clock: Discrete, lines: &[f64]) -> (f64, f64) {
    let mut errors = Vec::new();
    for (p, g) in truth {
        let frozen = c.frozen(p).unwrap().zero_order_hold(clock).unwrap();
        errors.extend(frozen.frequency_response(lines).unwrap().relative_error(g).unwrap());
    }
    errors.sort_by(f64::total_cmp);
    let d = |e: f64| 20.0 * e.log10();
    (d(errors[errors.len() - 1]), d(errors[errors.len() / 2]))
}
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let machine = MachineParameters::default().check()?;
    let clock = Discrete::from_rate(20.0)?;
    let lines: Vec<f64> = (0..160).map(|k| (f64::from(k) + 0.5) / 16.0).collect();
    let data = FrozenData::relative(clock, &responses(&machine, clock, 21, &lines)?)?;
    let truth = responses(&machine, clock, 81, &lines)?;
    let centre = data.subset(|p| p[0] == 0.0)?;
    let poles = machine.sampled_flexible_poles(0.0, clock)?;
    let local = local_model(Continuous, &centre, &poles, &LocalSettings::new().check()?)?;
    for nd in [4, 5, 6] {
        for degree in [1, 2, 3, 4, 6] {
            let t = Instant::now();
            let deltas = [DeltaBlock { parameter: 0, repetitions: nd }];
            let (c, rms) = coherent_start(&local.flexible, local.gamma.as_ref(), &data, &deltas, &machine.scheduling_range()?, degree)?;
            let worst = rms.iter().copied().fold(0.0, f64::max);
            let s = strict(&c, &truth, clock, &lines);
            let t1 = t.elapsed().as_secs_f64();
            let r = refine(&c, &data, &RefineSettings::new().target(1e-5).check()?)?;
            let e = strict(&r.candidate, &truth, clock, &lines);
            println!("nd {nd} degree {degree}: local rms {worst:.1e}, start {s:.1?} ({t1:.2} s), refined {:.1e} {e:.1?} {} it {:?} {:.2} s", r.account.rms, r.account.iterations(), r.account.stop, t.elapsed().as_secs_f64());
        }
    }
    Ok(())
}
fn responses(machine: &Machine, clock: Discrete, count: usize, lines: &[f64]) -> Result<Vec<(Vec<f64>, Frf)>, Box<dyn std::error::Error>> {
    machine.positions(count).into_iter().map(|p| Ok((vec![p], machine.sampled(p, clock)?.frequency_response(lines)?))).collect()
}
