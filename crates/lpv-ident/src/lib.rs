//! LPV-OBF regression on frequency responses and interpolation over the scheduling variable
