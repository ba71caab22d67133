//! Prints the catalogue: name, family, what it is, and its parameters. `cargo run -p lpv-diagnose --example catalogue`

use lpv_diagnose::catalogue::KINDS;

fn main() {
    for effect in KINDS.iter().filter_map(|kind| kind.first()) {
        let parameters: Vec<&str> = effect.parameters.iter().map(|p| p.name).collect();
        println!(
            "{:24} {:15} {} ({})",
            effect.name,
            effect.family.name(),
            effect.meaning,
            parameters.join(", ")
        );
    }
}
