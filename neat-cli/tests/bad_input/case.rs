//! What one kind of bad input is, and what every kind must meet.

use crate::support::{TestScene, contents, neat, stderr};
use std::fs;
use std::path::Path;
use std::sync::Mutex;

/// One kind of bad input.
pub struct Case {
    /// What is wrong, as the table says it.
    pub kind: &'static str,
    /// Makes it so.
    pub spoil: fn(&TestScene),
    /// The arguments of neat, which runs in the folder of the test: the scene is
    /// `scene` there.
    pub command: &'static str,
    /// What the message must contain: the file, the view, the remedy.
    pub names: &'static [&'static str],
}

/// The shortest training; what is wrong must be noticed before it begins.
pub const TRAIN: &str = "train scene --out run --backend flex --steps 1";

/// Runs all cases and compares what neat says with their table in
/// `docs/reliability.md`, under the marker `table: NAME`; with `NEAT_UPDATE_DOCS=1`
/// writes the table.
pub fn check(name: &str, cases: &[Case]) {
    let rows: String = cases.iter().map(row).collect();
    let table = format!("| what is wrong | what neat says |\n| --- | --- |\n{rows}");
    compare_with_docs(name, &table);
}

/// Runs one case: exit code 2, one error that names what it must, and every file as
/// it was. Returns its row of the table.
fn row(case: &Case) -> String {
    let kind = case.kind;
    let scene = TestScene::without_edges();
    (case.spoil)(&scene);
    let before = contents(&scene.file(""));
    let assert = neat(&[])
        .current_dir(scene.file(""))
        .args(case.command.split(' '))
        .arg("--quiet")
        .assert();
    let message = stderr(&assert).replace(&scene.path(""), "");
    assert_eq!(
        assert.get_output().status.code(),
        Some(2),
        "{kind}: {message}"
    );
    let errors = message.matches("error: ").count();
    assert_eq!(errors, 1, "{kind}: {message}");
    for name in case.names {
        assert!(message.contains(name), "{kind}: no `{name}` in: {message}");
    }
    let after = contents(&scene.file(""));
    assert!(
        before.keys().eq(after.keys()),
        "{kind}: files were made or removed: {:?} became {:?}",
        before.keys(),
        after.keys()
    );
    assert!(before == after, "{kind}: files were changed");
    format!("| {kind} | {} |\n", cell(&message))
}

/// A message as a cell of a table: its error, without the usage that clap adds.
fn cell(message: &str) -> String {
    const LONGEST: usize = 240;
    let error = message
        .split_once("error: ")
        .map_or(message, |(_, rest)| rest);
    let error = error.split("\n\n").next().unwrap_or_default();
    let words: Vec<&str> = error.split_whitespace().collect();
    let mut text = words.join(" ").replace('|', "\\|").replace('<', "\\<");
    if let Some((end, _)) = text.char_indices().nth(LONGEST) {
        text.truncate(end);
        text.push('…');
    }
    text
}

fn compare_with_docs(name: &str, table: &str) {
    // Tests of one program run at the same time.
    static DOCS: Mutex<()> = Mutex::new(());
    let _one_at_a_time = DOCS.lock();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reliability.md");
    let text = fs::read_to_string(&path).unwrap();
    let begin = format!("<!-- table: {name} -->\n\n");
    let (before, rest) = text.split_once(&begin).expect("a marker in reliability.md");
    let (written, after) = rest
        .split_once("\n<!-- end -->")
        .expect("the end of the table");
    if std::env::var_os("NEAT_UPDATE_DOCS").is_some() {
        let text = format!("{before}{begin}{table}\n<!-- end -->{after}");
        fs::write(&path, text).unwrap();
    } else {
        assert_eq!(
            written, table,
            "docs/reliability.md: run this test once with NEAT_UPDATE_DOCS=1"
        );
    }
}
