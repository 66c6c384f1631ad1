//! The HTML file: template, style, script and data joined.

use crate::escaping::{html_text, json_for_script};
use crate::payload::Payload;
use crate::{Report, ReportError};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use sha2::{Digest, Sha256};

const TEMPLATE: &str = include_str!("page/index.html");
const STYLE: &str = include_str!("page/style.css");

/// The parts of the script. They share one scope; the last one starts the page.
const SCRIPTS: &[&str] = &[
    include_str!("page/linear_algebra.js"),
    include_str!("page/elements.js"),
    include_str!("page/data.js"),
    include_str!("page/color.js"),
    include_str!("page/orbit.js"),
    include_str!("page/camera_control.js"),
    include_str!("page/webgl_renderer.js"),
    include_str!("page/faces.js"),
    include_str!("page/canvas_renderer.js"),
    include_str!("page/drawing.js"),
    include_str!("page/photograph.js"),
    include_str!("page/picking.js"),
    include_str!("page/viewer.js"),
    include_str!("page/inspector.js"),
    include_str!("page/legend.js"),
    include_str!("page/charts.js"),
    include_str!("page/evolution.js"),
    include_str!("page/panels.js"),
    include_str!("page/main.js"),
];

/// The page of a report that was checked.
pub(crate) fn render(report: &Report) -> Result<String, ReportError> {
    let script = script();
    let policy = policy(&script);
    let title = html_text(&report.title);
    let data = json_for_script(&Payload::new(report))?;
    let mut page = String::with_capacity(TEMPLATE.len() + STYLE.len() + script.len() + data.len());
    // One pass from left to right: what is inserted is never searched again, so that
    // no data can pose as a placeholder.
    let mut rest = TEMPLATE;
    for (placeholder, content) in [
        ("{{policy}}", policy.as_str()),
        ("{{title}}", title.as_str()),
        ("{{style}}", STYLE),
        ("{{data}}", data.as_str()),
        ("{{script}}", script.as_str()),
    ] {
        let (before, after) = rest
            .split_once(placeholder)
            .expect("page::render: the template lacks a placeholder");
        page.push_str(before);
        page.push_str(content);
        rest = after;
    }
    page.push_str(rest);
    Ok(page)
}

fn script() -> String {
    format!(
        "(() => {{\n\"use strict\";\n{}\n}})();\n",
        SCRIPTS.join("\n")
    )
}

/// Only this script and this style run, photographs come from the page itself, and
/// nothing is fetched from anywhere.
fn policy(script: &str) -> String {
    format!(
        "default-src 'none'; script-src '{}'; style-src '{}'; img-src data:; \
         base-uri 'none'; form-action 'none'",
        source(script),
        source(STYLE)
    )
}

/// The script and the style of every page, as sources of a content security policy.
pub(crate) fn sources() -> [String; 2] {
    [source(&script()), source(STYLE)]
}

fn source(text: &str) -> String {
    let hash = BASE64_STANDARD.encode(Sha256::digest(text.as_bytes()));
    format!("sha256-{hash}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_the_page_ends_its_own_elements() {
        let script = script();
        for (text, end) in [(script.as_str(), "</script"), (STYLE, "</style")] {
            let lower = text.to_ascii_lowercase();
            assert!(!lower.contains(end) && !lower.contains("<!--"));
            // A browser would turn it into \n, and the hash would not fit.
            assert!(!text.contains('\r'));
        }
        for shunned in [
            "innerHTML",
            "outerHTML",
            "insertAdjacentHTML",
            "document.write",
            "eval(",
        ] {
            assert!(!script.contains(shunned), "{shunned} shows data as markup");
        }
    }
}
