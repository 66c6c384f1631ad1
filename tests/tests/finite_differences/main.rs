//! Every hand-written gradient against central differences, in float64 on the
//! CPU.

mod background;
mod coordinate_mlp;
mod elementwise;
mod grid_encoding;
mod losses;
mod rendering;
