//! Spoils a good scene in many ways and prints what the doctor says, as a
//! Markdown table.
//!
//! `cargo run --release -p neat-doctor --example corruptions -- SCENE`, where
//! SCENE is a folder, or the name of a synthetic solid such as `l-prism`.

#[path = "../tests/corruption/mod.rs"]
mod corruption;

use corruption::{Base, Corruption, judged, load_options};
use neat_core::layout::abc;
use neat_core::load_scene;
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_doctor::{ExamineOptions, examine_folder};
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

#[expect(clippy::print_stdout, reason = "the table is what this program is for")]
fn main() -> Result<(), Box<dyn Error>> {
    let Some(scene) = std::env::args().nth(1) else {
        return Err("give the folder of a scene, or the name of a synthetic solid".into());
    };
    let only = std::env::args().nth(2);
    let temporary = tempfile::tempdir()?;
    let solid = Solid::ALL.into_iter().find(|solid| solid.name() == scene);
    let dir = match solid {
        Some(solid) => {
            let config = SyntheticScene {
                solid,
                views: 40,
                ..SyntheticScene::default()
            };
            abc::write_scene(&generate(&config)?.scene, temporary.path())?;
            temporary.path().to_owned()
        }
        None => PathBuf::from(&scene),
    };
    let base = Base::new(load_scene(&dir, &load_options())?.scene, &dir);
    let start = Instant::now();
    let examination = examine_folder(&dir, &load_options(), &ExamineOptions::default());
    println!("{examination}\n({:.1} s)\n", start.elapsed().as_secs_f64());
    println!("| corruption | what the doctor says | repaired by | cause |");
    println!("|---|---|---|---|");
    for corruption in Corruption::ALL {
        if only
            .as_ref()
            .is_some_and(|only| !corruption.name().contains(only.as_str()))
        {
            continue;
        }
        let dir = corruption.write(&base);
        let examination = examine_folder(dir.path(), &load_options(), &ExamineOptions::default());
        let problem = examination.problems().next();
        let path = dir.path().display().to_string();
        let cell = |text: &str| text.replace(&path, "SCENE").replace(['|', '\n'], " ");
        println!(
            "| {} | {} | {} | {} |",
            corruption.name(),
            problem.map_or("nothing".into(), |problem| cell(&problem.message)),
            problem
                .and_then(|problem| problem.remedy.as_deref())
                .map_or("what the message says".into(), cell),
            judged(corruption, &examination).map_or_else(|wrong| cell(&wrong), |()| "right".into()),
        );
    }
    Ok(())
}
