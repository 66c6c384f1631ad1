//! Least squares: one damped driver, one robust loss, one linear solver under it,
//! one sparse factorisation.

mod block_cholesky;
mod cauchy;
mod jackknife;
mod levenberg_marquardt;
mod reweighted;

pub(crate) use block_cholesky::{BlockCholesky, Elimination, OffDiagonal};
pub(crate) use cauchy::Cauchy;
pub(crate) use jackknife::{NormalEquations, jackknife};
pub(crate) use levenberg_marquardt::{LeastSquares, Options, minimise};
pub use levenberg_marquardt::{Summary, Termination};
pub(crate) use reweighted::{Reweighted, reweighted};
