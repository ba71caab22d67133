//! Prints the catalogue: name, family, what it is, and its parameters. `cargo run -p residual-trace --example catalogue`

use residual_trace::catalogue::CATALOGUE;

fn main() {
    // The others are the same at a second place.
    for effect in CATALOGUE.into_iter().filter(|e| e.channel == 0) {
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
