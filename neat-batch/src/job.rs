//! One job: a scene and how to reconstruct it.

use crate::error::BatchError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Names in OUT that are no job's.
const TAKEN: [&str; 3] = ["summary.json", "summary.md", "summary.csv"];

/// Arguments that the batch gives itself, and why nobody else may.
const RESERVED: [(&str, &str); 3] = [
    ("--out", "the batch has a folder for every job"),
    ("--resume", "every attempt continues anyway"),
    (
        "--overwrite",
        "it would begin every attempt anew: use the batch's own --restart-changed",
    ),
];

/// The truth that a scene may bring along.
const GROUND_TRUTH: &str = "gt_wireframe.json";

/// A scene and how to reconstruct it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Job {
    /// Its folder below OUT, unique in a batch.
    pub name: String,
    /// Folder of the scene, absolute.
    pub scene: PathBuf,
    /// Further arguments of `neat reconstruct`.
    pub arguments: Vec<String>,
    /// File of the true wireframe, where the scene's own is not the one to use.
    pub truth: Option<PathBuf>,
}

impl Job {
    /// The true wireframe to measure the result with: the one that was named, or
    /// `gt_wireframe.json` of the scene where there is one.
    pub fn truth_file(&self) -> Option<PathBuf> {
        let own = || Some(self.scene.join(GROUND_TRUTH)).filter(|path| path.is_file());
        self.truth.clone().or_else(own)
    }

    /// The arguments of the program, the same whoever runs the job on however many
    /// threads: `reconstruct SCENE --out RUN --resume …`.
    pub fn command_line(&self, run: &Path) -> Vec<String> {
        let text = |path: &Path| path.to_string_lossy().into_owned();
        let mut all = vec!["reconstruct".to_owned(), text(&self.scene)];
        all.extend(["--out".to_owned(), text(run), "--resume".to_owned()]);
        all.extend(self.arguments.iter().cloned());
        all
    }

    /// Whether the job says itself on how many threads it runs.
    pub(crate) fn chooses_threads(&self) -> bool {
        self.has_argument("--threads").is_some()
    }

    /// The argument of this name, as `--name` or `--name=…`.
    fn has_argument(&self, name: &str) -> Option<&String> {
        let is_it = |argument: &&String| {
            let rest = argument.strip_prefix(name);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('='))
        };
        self.arguments.iter().find(is_it)
    }

    fn check(&self) -> Result<(), BatchError> {
        if let Some(reason) = name_flaw(&self.name) {
            return Err(BatchError::Name {
                name: self.name.clone(),
                reason,
            });
        }
        for (name, reason) in RESERVED {
            if let Some(argument) = self.has_argument(name) {
                return Err(BatchError::ReservedArgument {
                    job: self.name.clone(),
                    argument: argument.clone(),
                    reason,
                });
            }
        }
        Ok(())
    }
}

/// The names of jobs so far, in lower case, with their scenes.
#[derive(Default)]
pub(crate) struct JobNames(BTreeMap<String, PathBuf>);

impl JobNames {
    /// Takes in one more job.
    ///
    /// # Errors
    /// If another one has its name, the name cannot be a folder, or the job has an
    /// argument that the batch gives itself.
    pub fn add(&mut self, job: &Job) -> Result<(), BatchError> {
        job.check()?;
        match self.0.insert(job.name.to_lowercase(), job.scene.clone()) {
            None => Ok(()),
            Some(first) => Err(BatchError::SameName {
                name: job.name.clone(),
                first,
                second: job.scene.clone(),
            }),
        }
    }
}

/// The last part of a path, as text.
pub(crate) fn folder_name(path: &Path) -> Option<String> {
    Some(path.file_name()?.to_string_lossy().into_owned())
}

/// Why a name cannot be that of a folder in OUT on every system.
fn name_flaw(name: &str) -> Option<&'static str> {
    if name.is_empty() {
        Some("it is empty")
    } else if name.starts_with('.') {
        Some("names with a leading dot are hidden")
    } else if name.starts_with('-') {
        Some("names with a leading dash look like options")
    } else if name.contains(['/', '\\']) {
        Some("it leads to another folder")
    } else if name.contains(|c: char| c.is_control() || "<>:\"|?*".contains(c)) {
        Some("not every system has file names with such characters")
    } else if name.ends_with(['.', ' ']) || name.starts_with(' ') {
        Some("not every system has file names with a dot at the end or a space at either end")
    } else if TAKEN.contains(&name.to_lowercase().as_str()) {
        Some("a file of the batch has that name")
    } else if name.len() > 200 {
        Some("it is longer than 200 bytes")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(name: &str, arguments: &[&str]) -> Job {
        Job {
            name: name.into(),
            scene: "/scenes/house".into(),
            arguments: arguments.iter().map(|&text| text.into()).collect(),
            truth: None,
        }
    }

    #[test]
    fn names_are_folders_of_their_own_in_out() {
        for good in ["house", "Häuser 2", "a.b_c-d"] {
            job(good, &[]).check().unwrap();
        }
        for bad in [
            "",
            ".",
            "..",
            "a/b",
            "..\\b",
            "-x",
            "Summary.json",
            "a\nb",
            "a ",
            "con:",
        ] {
            let error = job(bad, &[]).check().unwrap_err();
            assert!(matches!(error, BatchError::Name { .. }), "{bad}: {error}");
        }
    }

    #[test]
    fn arguments_of_the_batch_itself_are_refused() {
        for bad in ["--out", "--out=x", "--resume", "--overwrite"] {
            let error = job("house", &["--seed", "1", bad]).check().unwrap_err();
            assert!(error.to_string().contains(bad), "{error}");
        }
        // An argument that only begins like one.
        job("house", &["--outline"]).check().unwrap();
    }

    #[test]
    fn the_command_continues_whatever_there_is() {
        let job = job("house", &["--seed", "1"]);
        assert_eq!(
            job.command_line(Path::new("out/house/run")),
            [
                "reconstruct",
                "/scenes/house",
                "--out",
                "out/house/run",
                "--resume",
                "--seed",
                "1"
            ]
        );
        assert!(!job.chooses_threads());
    }

    #[test]
    fn the_truth_of_the_scene_serves_where_none_is_named() {
        let scene = tempfile::tempdir().unwrap();
        let mut job = Job {
            scene: scene.path().into(),
            ..job("house", &["--threads=2"])
        };
        assert!(job.chooses_threads());
        assert_eq!(job.truth_file(), None);
        let own = scene.path().join(GROUND_TRUTH);
        std::fs::write(&own, "{}").unwrap();
        assert_eq!(job.truth_file(), Some(own));
        job.truth = Some("other.json".into());
        assert_eq!(job.truth_file(), Some("other.json".into()));
    }
}
