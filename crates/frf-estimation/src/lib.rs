//! MIMO frequency response functions with covariance from records
