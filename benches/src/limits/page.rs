//! docs/limits.md.

use crate::Account;
use std::fmt::Write as _;

/// The page, made with this command.
pub(crate) fn page(account: &Account, command: &str) -> String {
    let mut out = format!(
        "# Limits and growth\n\nMade by `{command}`, on one thread; medians of 7. This machine multiplies matrices at \
         {:.1} Gflop/s and copies at {:.1} GB/s (read and written).\n\n",
        1e-9 * account.gemm,
        1e-9 * account.copy
    );
    out += &limits(account);
    if !account.growth.is_empty() {
        out += &growth(account);
    }
    out
}

fn verdict(bar: Option<f64>, met: bool) -> String {
    match bar {
        Some(bar) => format!("{bar}: {}", lpv_benches::verdict(met)),
        None => "-".to_owned(),
    }
}

fn limits(account: &Account) -> String {
    let mut out = "## How near the limit\n\nThe time that the operations (at the speed of that product) or the bytes (at the speed of that copy) \
         need, whichever is longer, over the time taken; both speeds are measured again beside each run.\n\n\
         | kernel | time | Mflop | MB | limited by | fraction | bar |\n|---|---|---|---|---|---|---|\n"
        .to_owned();
    for k in &account.kernels {
        let _ = writeln!(
            out,
            "| {} | {:.3} ms | {:.1} | {:.2} | {} | {:.0} % | {} |",
            k.kernel,
            1e3 * k.seconds,
            1e-6 * k.operations,
            1e-6 * k.bytes,
            k.limit,
            100.0 * k.fraction,
            verdict(k.bar, k.bar.is_none_or(|b| k.fraction >= b))
        );
    }
    out += "\nFRF, a quarter of four periods: two signals share a transform in registers of eight numbers, of which the sums take 64 lines at a time, \
            so that no spectrum is written. Its operations are counted as those of a transform by factors of two; what bounds it is \
            not them but what moves: the signals, the points of their transforms (512 KiB a pair, which leave the second cache when \
            four are in turn), and what is kept, 192 bytes a line, read and written for every two periods. Without registers of eight \
            numbers, or for other periods, a library transforms one signal after the other; its transforms alone have a row. Regression: the sums of products are matrix products for all \
            positions, 64 lines at a time, and take two fifths of the time, at the speed of a large product; a seventh waits for responses \
            and covariances (192 bytes a line and position, from three places each); what is left makes a weight of \
            each and a right side, the products of the functions and the response of the basis. A correction by what the equations leave is computed only \
            where more than six digits would be lost without. Moving p: the terms of a series follow from each \
            other, one number at a time; only machines side by side would fill the registers. LFR: two \
            fifths are reflections, column by column in blocks that fit the cache (normal equations would lose half of the digits), a \
            fifth the curvature, the rest the responses and their products; none of it is large enough for the speed of a large product.\n";
    out
}

fn growth(account: &Account) -> String {
    let mut out = "\n## Growth\n\nA transform of N samples takes N log N operations: from 2^10 to 2^18 that alone is an exponent of 1.11; what is kept of an \
            experiment (192 bytes a line) no longer fits a second cache of 1 MiB from 2^14 on, nor do the points of a period (64 bytes a sample \
            of four channels). The bar is on all sizes; their upper half is where what a size needs leaves one cache after the other, of a regression as of \
            a transform.\n\n| time | sizes | milliseconds | exponent | bar | upper half |\n|---|---|---|---|---|---|\n"
        .to_owned();
    for g in &account.growth {
        let list = |v: Vec<String>| v.join(", ");
        let _ = writeln!(
            out,
            "| {} | {} | {} | {:.2} | {} | {:.2} |",
            g.what,
            list(g.sizes.iter().map(usize::to_string).collect()),
            list(g.seconds.iter().map(|s| format!("{:.3}", 1e3 * s)).collect()),
            g.exponent,
            verdict(g.bar, g.bar.is_none_or(|b| g.exponent <= b)),
            g.upper_exponent
        );
    }
    out += "\n| peak memory beyond the inputs | sizes | MiB | exponent, upper half | bar, MiB |\n|---|---|---|---|---|\n";
    for g in &account.growth {
        let list = |v: Vec<String>| v.join(", ");
        let mib = g.mib.as_ref().map_or("not told".to_owned(), |m| {
            list(m.iter().map(|m| format!("{m:.1}")).collect())
        });
        let sizes = list(g.sizes.iter().map(usize::to_string).collect());
        let exponent = g.mib_exponent.map_or("-".to_owned(), |e| format!("{e:.2}"));
        let is_met = |most: f64| g.mib.as_ref().is_some_and(|m| m.iter().all(|m| *m <= most));
        let bar = verdict(g.most_mib, g.most_mib.is_none_or(is_met));
        let _ = writeln!(out, "| {} | {sizes} | {mib} | {exponent} | {bar} |", g.what);
    }
    out += "\nEach in a process of its own, which gives back at once what it frees. Counts of work (transforms, factorisations, bytes \
            read) are held by `tests/tests/work.rs`, instructions by `cargo xtask bench --growth`, both in CI.\n";
    out
}
