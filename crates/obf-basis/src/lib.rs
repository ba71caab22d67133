//! Orthonormal basis functions and their choice by Fuzzy-Kolmogorov c-Max
