//! The benches of `cargo bench`: the regression core first, then the kernels before and after it in the chain.
#![allow(missing_docs)] // The entry points that the harness generates have no documentation.
#![allow(clippy::unwrap_used)] // An input that cannot be made ends the bench.

mod frf;
mod poles;
mod regression;
mod responses;

criterion::criterion_group! {
    name = benches;
    config = lpv_benches::short();
    targets =
        regression::regression,
        frf::frf,
        poles::pole_fit,
        poles::basis_poles,
        responses::frequency_response,
        responses::simulation
}
criterion::criterion_main!(benches);
