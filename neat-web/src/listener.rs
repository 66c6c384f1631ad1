//! What a reconstruction tells: a line of JSON each, and what of it the report needs.

use crate::tell::tell;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use neat_core::View;
use neat_images::event::{Decision, Event, Stage};
use neat_report::{FactGroup, Photograph, PhotographConfig};
use serde_json::{Value, json};

/// An image on the page while the work goes on.
const THUMBNAIL: PhotographConfig = PhotographConfig {
    max_photographs: 1,
    max_size: 320,
    quality: 70,
};

/// Hears the events of a reconstruction.
#[derive(Debug, Default)]
pub struct Listener {
    /// Whole sentences.
    pub warnings: Vec<String>,
    decisions: Vec<Decision>,
    seconds: Vec<(Stage, f64)>,
}

impl Listener {
    /// Tells the page, and keeps what has to last.
    pub fn hear(&mut self, event: &Event<'_, ()>) {
        match event {
            Event::Warning(warning) => self.warnings.push(warning.message.clone()),
            Event::Decided(decision) => self.decisions.push(decision.clone()),
            Event::StageFinished { stage, seconds } => self.seconds.push((*stage, *seconds)),
            _ => {}
        }
        let mut told = event.to_json();
        if let Event::Detected(view) = event {
            told["picture"] = picture(view);
        }
        tell(&told);
    }

    /// The groups of facts of the report; `result` is the first.
    pub fn facts(&self, result: Vec<(&'static str, String)>) -> Vec<FactGroup> {
        let group = |heading: &str, facts: Vec<(String, String)>| FactGroup {
            heading: heading.to_owned(),
            facts,
        };
        let owned = |(label, value): (&str, String)| (label.to_owned(), value);
        let decided = (self.decisions.iter())
            .map(|decided| {
                let told = format!("{}, {}", decided.value, decided.reason);
                (decided.setting.clone(), told)
            })
            .collect();
        let seconds = (self.seconds.iter())
            .map(|(stage, seconds)| (stage.to_string(), format!("{seconds:.1}")))
            .collect();
        vec![
            group("Result", result.into_iter().map(owned).collect()),
            group("Decided by the scene", decided),
            group("Seconds", seconds),
        ]
    }
}

/// A view for the page: its size, its image as a small JPEG, and the ends of its 2D segments
/// in pixels, to half of one. Without the image where that cannot be made.
fn picture(view: &View) -> Value {
    let (width, height) = view.image.dimensions();
    let segments: Vec<[f64; 4]> = (view.wireframe.segments(f64::NEG_INFINITY).iter())
        .map(|scored| {
            let [a, b] = scored.segment.ends();
            [a.x, a.y, b.x, b.y]
        })
        .collect();
    let image = (view.image.read().ok())
        .and_then(|image| Photograph::of_image(&image, &THUMBNAIL).ok())
        .map(|photograph| BASE64_STANDARD.encode(photograph.jpeg));
    json!({ "width": width, "height": height, "segments": segments, "jpeg": image })
}
