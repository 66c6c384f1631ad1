//! How far the assembler is, and whether anybody still wants it.

use std::ops::ControlFlow;

/// Receives the share that is done, from 0 to 1, ascending, and says whether to go on.
pub type OnProgress<'a> = &'a mut dyn FnMut(f64) -> ControlFlow<()>;

/// What `progress` is told of a part of the work that lies between two shares of the whole.
pub(super) fn part(
    progress: OnProgress<'_>,
    [from, to]: [f64; 2],
) -> impl FnMut(f64) -> ControlFlow<()> {
    move |share| progress(from + share * (to - from))
}
