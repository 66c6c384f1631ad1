//! Manifests: batches as TOML, see [`Batch::from_manifest`](crate::Batch::from_manifest).

use crate::error::BatchError;
use crate::job::{Job, JobNames, folder_name};
use crate::json_file::absolute;
use neat_core::file;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use toml::Spanned;

const REMEDY: &str = "give a manifest with [[job]] tables, or folders of scenes";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    #[serde(default)]
    defaults: Defaults,
    #[serde(default)]
    job: Vec<Spanned<JobTable>>,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Defaults {
    preset: Option<String>,
    config: Option<PathBuf>,
    seed: Option<u64>,
    set: Vec<String>,
    args: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JobTable {
    scene: PathBuf,
    name: Option<String>,
    truth: Option<PathBuf>,
    preset: Option<String>,
    config: Option<PathBuf>,
    seed: Option<u64>,
    #[serde(default)]
    set: Vec<String>,
    #[serde(default)]
    args: Vec<String>,
}

/// The jobs of a manifest, of which no two have one name.
pub fn read(path: &Path) -> Result<Vec<Job>, BatchError> {
    let bytes = file::read(path, REMEDY)?;
    let text = String::from_utf8(bytes).map_err(|error| BatchError::Manifest {
        path: path.into(),
        line: line_of(error.as_bytes(), error.utf8_error().valid_up_to()),
        reason: "the text is not UTF-8: save it as such".to_owned(),
    })?;
    let absolute = absolute(path)?;
    parse(&text, path, absolute.parent().unwrap_or(Path::new("/")))
}

/// The jobs of a manifest's text; paths in it are relative to `folder`.
fn parse(text: &str, path: &Path, folder: &Path) -> Result<Vec<Job>, BatchError> {
    let at = |offset: usize, reason: String| BatchError::Manifest {
        path: path.into(),
        line: line_of(text.as_bytes(), offset),
        reason,
    };
    let manifest: Manifest = toml::from_str(text).map_err(|error| {
        let offset = error.span().map_or(0, |span| span.start);
        at(offset, error.message().trim_end().replace('\n', ", "))
    })?;
    if manifest.defaults.preset.is_some() && manifest.defaults.config.is_some() {
        return Err(at(0, TWO_BASES.to_owned()));
    }
    let mut jobs = Vec::with_capacity(manifest.job.len());
    let mut names = JobNames::default();
    for table in manifest.job {
        let offset = table.span().start;
        let job = job(table.into_inner(), &manifest.defaults, folder)
            .map_err(|reason| at(offset, reason.to_owned()))?;
        // Here, while the line is known.
        let named = names.add(&job);
        named.map_err(|error| at(offset, error.to_string()))?;
        jobs.push(job);
    }
    if jobs.is_empty() {
        return Err(BatchError::NoJob {
            source_name: path.display().to_string(),
            remedy: "add a table [[job]] with `scene = \"FOLDER\"` for each",
        });
    }
    Ok(jobs)
}

const TWO_BASES: &str = "`preset` and `config` exclude each other: keep one of them";

fn job(table: JobTable, defaults: &Defaults, folder: &Path) -> Result<Job, &'static str> {
    if table.preset.is_some() && table.config.is_some() {
        return Err(TWO_BASES);
    }
    let scene = folder.join(&table.scene);
    let name = match table.name {
        Some(name) => name,
        None => folder_name(&scene).ok_or("the scene has no folder name: give the job a `name`")?,
    };
    // Either one replaces either default.
    let (preset, config) = if table.preset.is_some() || table.config.is_some() {
        (&table.preset, &table.config)
    } else {
        (&defaults.preset, &defaults.config)
    };
    let mut arguments = Vec::new();
    let mut option = |name: &str, value: String| arguments.extend([name.to_owned(), value]);
    if let Some(preset) = preset {
        option("--preset", preset.clone());
    }
    if let Some(config) = config {
        let config = folder.join(config);
        option("--config", config.to_string_lossy().into_owned());
    }
    if let Some(seed) = table.seed.or(defaults.seed) {
        option("--seed", seed.to_string());
    }
    for set in defaults.set.iter().chain(&table.set) {
        option("--set", set.clone());
    }
    arguments.extend(defaults.args.iter().chain(&table.args).cloned());
    Ok(Job {
        name,
        scene,
        arguments,
        truth: table.truth.map(|truth| folder.join(truth)),
    })
}

/// The line of a byte, from 1.
fn line_of(text: &[u8], offset: usize) -> usize {
    let before = &text[..offset.min(text.len())];
    1 + before.iter().filter(|&&byte| byte == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Vec<Job>, BatchError> {
        parse(text, Path::new("jobs.toml"), Path::new("/data"))
    }

    #[test]
    fn jobs_go_on_from_the_defaults() {
        let jobs = parsed(
            r#"
            [defaults]
            preset = "fast"
            seed = 3
            set = ["train.rays=512"]
            args = ["--no-doctor"]

            [[job]]
            scene = "scenes/house"

            [[job]]
            scene = "/elsewhere/house/"
            name = "other"
            config = "other.toml"
            seed = 4
            set = ["train.steps=9"]
            args = ["--backend", "flex"]
            truth = "truth.json"
            "#,
        )
        .unwrap();
        let [first, second] = &jobs[..] else { panic!() };
        assert_eq!((first.name.as_str(), first.truth.as_ref()), ("house", None));
        assert_eq!(first.scene, Path::new("/data/scenes/house"));
        let text = "--preset fast --seed 3 --set train.rays=512 --no-doctor";
        assert_eq!(first.arguments.join(" "), text);
        assert_eq!(second.scene, Path::new("/elsewhere/house"));
        assert_eq!(second.truth.as_deref(), Some(Path::new("/data/truth.json")));
        let text = "--config /data/other.toml --seed 4 --set train.rays=512 --set train.steps=9 --no-doctor --backend flex";
        assert_eq!(second.arguments.join(" "), text);
    }

    #[test]
    fn mistakes_are_found_with_their_line() {
        for (text, line, part) in [
            ("[[job]]\nscene = \"a\"\nsede = 1\n", 3, "sede"),
            ("[defaults]\nout = \"x\"\n", 2, "out"),
            ("\n[[job]]\nname = \"a\"\n", 2, "scene"),
            ("[[job]]\nscene = \n", 2, ""),
            ("[[job]]\nscene = \"a\"\nseed = -1\n", 3, ""),
            ("[[job]]\nscene = \"/\"\n", 1, "`name`"),
            ("[[job]]\nscene=\"a\"\n[[job]]\nscene=\"b/A\"\n", 3, "both"),
            ("[[job]]\nscene=\"a\"\nargs=[\"--out=x\"]\n", 1, "--out=x"),
            (
                "[[job]]\nscene=\"a\"\npreset=\"fast\"\nconfig=\"c\"\n",
                1,
                "exclude",
            ),
            ("[defaults]\npreset=\"fast\"\nconfig=\"c\"\n", 1, "exclude"),
        ] {
            let error = parsed(text).unwrap_err();
            let message = error.to_string();
            let found = match error {
                BatchError::Manifest { line, .. } => line,
                error => panic!("{error}"),
            };
            assert_eq!(found, line, "{message}");
            assert!(
                message.contains(part) && message.starts_with("jobs.toml"),
                "{message}"
            );
        }
        assert!(matches!(parsed(""), Err(BatchError::NoJob { .. })));
    }

    #[test]
    fn files_that_are_no_manifest_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("jobs.toml");
        let message = read(&path).unwrap_err().to_string();
        assert!(message.contains("jobs.toml does not exist"), "{message}");
        std::fs::write(&path, b"[[job]]\nscene = \"\xff\"\n").unwrap();
        let message = read(&path).unwrap_err().to_string();
        assert!(
            message.contains("line 2") && message.contains("UTF-8"),
            "{message}"
        );
    }
}
