//! Every hand-written gradient against central differences, in float64 on the
//! CPU.

mod coordinate_mlp;
mod elementwise;
mod losses;
mod rendering;
