//! What the page may do.

use crate::tell::tell;
use neat_report::Report;
use serde_json::json;
use std::error::Error;

/// Tells the content security policy of the page: its own files, and the one script and the
/// one style that are in every report, which it shows in a frame. Frames that a page fills itself
/// have its policy beside their own.
pub fn tell_policy() -> Result<(), Box<dyn Error>> {
    let [script, style] = Report::policy_sources();
    tell(&json!({
        "event": "policy",
        "policy": format!(
            "default-src 'none'; script-src 'self' 'wasm-unsafe-eval' '{script}'; \
             style-src 'self' '{style}'; img-src data: blob:; connect-src 'self'; \
             worker-src 'self' blob:; frame-src blob:; base-uri 'none'; form-action 'none'"
        ),
    }));
    Ok(())
}
