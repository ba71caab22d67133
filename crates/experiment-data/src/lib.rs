//! Experiment bundles on disk: one experiment.toml and its record files
