//! A GPU that fails: its memory is full, or it is gone.
//!
//! burn reports both by a panic in the operation that meets it. The state is on disk,
//! so the training goes on from there with less memory, or on the CPU.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The batch is taken in at most so many passes before the device is given up.
const MAX_PASSES: usize = 8;

/// What a failed device is replaced by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Replacement {
    /// The same device, with so many rays per pass.
    SmallerChunks(usize),
    /// The CPU.
    Cpu,
    /// Nothing is left to try.
    None,
}

impl Replacement {
    /// What comes after a failure with `chunk` of `rays` rays per pass: half of them,
    /// down to an eighth of the batch, then the CPU if that is allowed.
    pub fn after(chunk: usize, rays: usize, cpu_allowed: bool) -> Self {
        let smaller = chunk.min(rays) / 2;
        if smaller > 0 && smaller * MAX_PASSES >= rays {
            return Self::SmallerChunks(smaller);
        }
        match cpu_allowed {
            true => Self::Cpu,
            false => Self::None,
        }
    }
}

/// Does `work`; `Err` with the message if it panics.
///
/// What `work` changed may be half done after a panic: begin again from what is on
/// disk.
pub fn catch<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| message(&*panic))
}

fn message(panic: &(dyn Any + Send)) -> String {
    let text = (panic.downcast_ref::<String>().map(String::as_str))
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("it did not say why");
    // The first line says what; others are traces.
    text.lines().next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_are_halved_before_the_cpu_takes_over() {
        let mut chunk = 1024;
        let mut tried = Vec::new();
        while let Replacement::SmallerChunks(smaller) = Replacement::after(chunk, 1024, true) {
            tried.push(smaller);
            chunk = smaller;
        }
        assert_eq!(tried, [512, 256, 128]);
        assert_eq!(Replacement::after(chunk, 1024, true), Replacement::Cpu);
        assert_eq!(Replacement::after(chunk, 1024, false), Replacement::None);
        // A chunk that is larger than the batch is the batch.
        let first = Replacement::after(usize::MAX, 256, false);
        assert_eq!(first, Replacement::SmallerChunks(128));
        assert_eq!(Replacement::after(1, 1, true), Replacement::Cpu);
    }

    #[test]
    fn a_panic_becomes_its_first_line() {
        assert_eq!(catch(|| 7), Ok(7));
        let lost = catch(|| -> i32 { panic!("device lost\nbacktrace: {}", 3) });
        assert_eq!(lost, Err("device lost".to_owned()));
        let full = catch(|| -> i32 { std::panic::panic_any("out of memory") });
        assert_eq!(full, Err("out of memory".to_owned()));
        let other = catch(|| -> i32 { std::panic::panic_any(5) });
        assert_eq!(other, Err("it did not say why".to_owned()));
    }
}
