//! Spoils good scenes in many ways and prints what the doctor says of them, and of
//! right scenes, as Markdown tables with their counts.
//!
//! `cargo run --release -p neat-doctor --example corruptions -- SCENE...`, where each
//! SCENE is a folder, or the name of a synthetic solid such as `l-prism`. What is not
//! named right is printed to the standard error in full.

#[path = "../tests/corruption/mod.rs"]
mod corruption;
#[path = "../tests/right/mod.rs"]
mod right;

use corruption::Corruption;
use corruption::draft::Base;
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_doctor::{Depth, Verdict};
use right::Right;
use std::error::Error;
use std::path::Path;

/// Of how many corruptions what was said.
#[derive(Default)]
struct Counts {
    all: usize,
    named: usize,
    refused: usize,
    to_refuse: usize,
    ready: usize,
}

#[expect(
    clippy::print_stdout,
    reason = "the tables are what this program is for"
)]
fn main() -> Result<(), Box<dyn Error>> {
    let scenes: Vec<String> = std::env::args().skip(1).collect();
    if scenes.is_empty() {
        return Err("give folders of scenes, or names of synthetic solids".into());
    }
    let bases: Vec<Base> = scenes
        .iter()
        .map(|scene| base(scene))
        .collect::<Result<_, _>>()?;
    println!("| spoilt by | has to be named | {} |", scenes.join(" | "));
    println!("|---|---|{}", "---|".repeat(scenes.len()));
    let mut counts = Counts::default();
    for corruption in Corruption::all() {
        let cells: Vec<_> = (bases.iter())
            .map(|base| counts.count(&corruption, base))
            .collect();
        let (name, expected) = (corruption.name, corruption.expected());
        println!("| {name} | {expected} | {} |", cells.join(" | "));
    }
    println!("\n| right scene | what the doctor says |\n|---|---|");
    let (rights, mut refused) = (Right::all(), 0);
    for right in &rights {
        let [examination] = right.examined([Depth::Full]);
        refused += usize::from(examination.verdict == Verdict::NotReady);
        let judged = match right.judged(&examination) {
            Ok(()) if right.shows_little => "accepted, cannot tell of its poses",
            Ok(()) => "accepted, its poses are good",
            Err(_) => "wrong",
        };
        println!("| {} | {judged} |", right.name);
    }
    let share = |part: usize, all: usize| 100.0 * part as f64 / all.max(1) as f64;
    println!(
        "\n{} spoilt scenes: {} named, {} passed as ready. {} of {} that have to be refused are: \
         recall {:.1} %. {refused} of {} right scenes are refused: precision {:.1} %.",
        counts.all,
        counts.named,
        counts.ready,
        counts.refused,
        counts.to_refuse,
        share(counts.refused, counts.to_refuse),
        rights.len(),
        share(counts.refused, counts.refused + refused),
    );
    Ok(())
}

impl Counts {
    /// What is said of the base, spoilt; in a word.
    #[expect(clippy::print_stderr, reason = "what went wrong is to be seen")]
    fn count(&mut self, corruption: &Corruption, base: &Base) -> &'static str {
        if !corruption.applies_to(base) {
            return "–";
        }
        let examination = corruption.examined(base);
        let judged = corruption.judged(&examination);
        let refused = examination.verdict == Verdict::NotReady;
        self.all += 1;
        self.named += usize::from(judged.is_ok());
        self.ready += usize::from(examination.verdict == Verdict::Ready);
        if !corruption.may_be_a_warning() {
            self.to_refuse += 1;
            self.refused += usize::from(refused);
        }
        match judged {
            Ok(()) if refused => "named",
            Ok(()) => "named, a warning",
            Err(wrong) => {
                eprintln!("{}: {wrong}", corruption.name);
                if refused { "refused" } else { "passed" }
            }
        }
    }
}

fn base(scene: &str) -> Result<Base, Box<dyn Error>> {
    let Some(solid) = Solid::ALL.into_iter().find(|solid| solid.name() == scene) else {
        return Ok(Base::read(Path::new(scene))?);
    };
    let config = SyntheticScene {
        solid,
        views: 30,
        image_size: 400,
        image_height: Some(320),
        camera_distance: 2.3,
        ..SyntheticScene::default()
    };
    Ok(Base::new(generate(&config)?.scene)?)
}
