//! Modes of a model, and in words: frequency in Hz, and damping ratio.

pub(super) fn pole_modes(fit: &pole_fit::PoleFit) -> Vec<[f64; 2]> {
    fit.modes().iter().map(|m| [m.frequency_hz, m.damping]).collect()
}

pub(super) fn modal_modes(fit: &modal_fit::ModalFit) -> Vec<[f64; 2]> {
    fit.modes.iter().map(|m| [m.frequency_hz, m.damping]).collect()
}

pub(super) fn mode_lines(modes: &[[f64; 2]]) -> String {
    if modes.is_empty() {
        return "  none: all poles are real".to_owned();
    }
    let lines: Vec<String> = modes
        .iter()
        .map(|[f, d]| format!("  {f:.5} Hz, damping {d:.4}"))
        .collect();
    lines.join("\n")
}
