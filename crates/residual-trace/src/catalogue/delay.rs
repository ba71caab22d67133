//! Commands that come late.

use crate::effect::{Block, Effect, EffectParameter, Family, Needs, Path, Scale};
use num_complex::Complex64 as C64;

pub(super) static EFFECT: Effect = Effect {
    name: "delay",
    family: Family::Timing,
    channel: 0,
    needs: Needs::Nothing,
    meaning: "pure delay of the commands, of any part of a sample",
    parameters: &[EffectParameter {
        name: "time",
        unit: "s",
        scale: Scale::NotNegative,
    }],
    extends: None,
    starts: |screen| vec![vec![1e-4 * screen.step()], vec![0.3 * screen.step()]],
    block: |v, _| Box::new(Late(v[0])),
};

#[derive(Debug)]
struct Late(f64);

impl Block for Late {
    fn delay(&self) -> f64 {
        self.0
    }

    fn respond(&self, s: C64, path: &mut Path) {
        path.command *= (-s * self.0).exp();
    }
}
