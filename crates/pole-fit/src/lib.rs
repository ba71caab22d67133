//! MIMO common-denominator fit of frequency response functions
