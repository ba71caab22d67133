//! The identification pipeline as a library, and the program lpv
