//! Basis poles for a machine whose resonances move: the fuzzy search on 21 positions, then the direct minimax
//! descent on a dense set, judged on the dense set.

#[path = "../tests/all/machine/mod.rs"]
mod machine;

use lpv_core::Discrete;
use obf_basis::{
    FkcmSettings, MinimaxSettings, OrthonormalBasis, PoleSet, Refinement, fkcm, kolmogorov_cost_db,
    polish_minimax,
};
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let observed = PoleSet::new(&machine::sampled_poles(21))?;
    let dense = machine::sampled_poles(2001);
    println!("n-width cost in dB                alternation   FKcM          minimax on the dense set");
    println!("functions                         grid / dense  grid / dense  dense");
    for functions in [4, 8, 12, 16] {
        let published = FkcmSettings {
            refinement: Refinement::None,
            ..FkcmSettings::new(functions)
        };
        let alternation = fkcm(&observed, &published)?;
        let clock = Instant::now();
        let found = fkcm(&observed, &FkcmSettings::new(functions))?;
        let fkcm_time = clock.elapsed();
        let clock = Instant::now();
        let polished = polish_minimax(&found.poles, &dense, &MinimaxSettings::default())?;
        let polish_time = clock.elapsed();
        println!(
            "{functions:>3}  (FKcM {:>5.1} ms, minimax {:>5.1} ms) {:6.2}/{:6.2} {:6.2}/{:6.2} {:9.3}",
            1e3 * fkcm_time.as_secs_f64(),
            1e3 * polish_time.as_secs_f64(),
            alternation.cost_db,
            kolmogorov_cost_db(&alternation.poles, &dense)?,
            found.cost_db,
            kolmogorov_cost_db(&found.poles, &dense)?,
            polished.cost_db,
        );
        let basis = OrthonormalBasis::takenaka_malmquist(&polished.poles, Discrete::from_rate(20.0)?)?;
        let (a, b) = (basis.state_space().a(), basis.state_space().b());
        let defect = a * a.transpose() + b * b.transpose();
        let identity = lpv_core::nalgebra::DMatrix::identity(functions, functions);
        println!(
            "     starts at the best: {}/{}, orthonormality defect {:.1e}",
            found.reached_best,
            found.starts.len(),
            (defect - identity).amax()
        );
    }
    Ok(())
}
