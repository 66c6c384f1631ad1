//! What a run tells while it works. Libraries report; only a user interface
//! draws.

pub use neat_images::event::{Decision, Stage, Warning, WarningKind, timed};

use neat_train::trainer::StepReport;

/// One message of a run.
pub type Event<'a> = neat_images::event::Event<'a, StepReport>;

/// Who listens to the events of a run.
pub type OnEvent<'a> = neat_images::event::OnEvent<'a, StepReport>;
