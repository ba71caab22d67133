//! LFR realisation of LPV-OBF models
