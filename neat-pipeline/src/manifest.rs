//! `manifest.json`: what ran, on which inputs, where, and how long it took.

use crate::event::{Decision, Event, Stage, Warning};
use neat_core::{SceneError, SceneSphere};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// It has not ended, or was killed.
    Running,
    /// It was stopped by a person after a step.
    Interrupted,
    /// It ended with an error.
    Failed,
    /// All results are on disk.
    Finished,
}

/// The content of `manifest.json`: enough to repeat the run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of neat.
    pub neat: String,
    /// The compiler that built it.
    pub compiler: String,
    /// The platform it was built for.
    pub target: String,
    /// The arguments of the program, its name first.
    pub command_line: Vec<String>,
    /// The preset that the configuration started from.
    pub preset: String,
    /// The backend that computed, never "auto".
    pub backend: String,
    /// Its device.
    pub device: String,
    /// CPU threads.
    pub threads: usize,
    /// The seed of all randomness.
    pub seed: u64,
    /// The folder of the scene.
    pub scene: PathBuf,
    /// The part of space that is modelled, in the frame and unit of the scene's
    /// files.
    #[serde(default)]
    pub sphere: Option<SceneSphere>,
    /// SHA-256 of every input file, in hexadecimal, by its path in that folder.
    pub inputs: BTreeMap<String, String>,
    /// What the scene and the machine decided when the run began.
    #[serde(default)]
    pub decisions: Vec<Decision>,
    /// What was noticed on the way.
    pub warnings: Vec<Warning>,
    /// How the run ended.
    pub status: Status,
    /// Optimisation steps that are done.
    pub steps: u64,
    /// When the run began: UTC, RFC 3339.
    pub started: String,
    /// When this file was last written.
    pub updated: String,
    /// Seconds that each stage took, over all sessions of the run.
    pub seconds: BTreeMap<Stage, f64>,
}

impl Manifest {
    /// Keeps what an event tells that has to last: warnings, decisions, and the time of
    /// a stage.
    pub fn record(&mut self, event: &Event<'_>) {
        match event {
            Event::Warning(warning) => self.warnings.push(warning.clone()),
            Event::Decided(decision) => self.decisions.push(decision.clone()),
            Event::StageFinished { stage, seconds } => {
                *self.seconds.entry(*stage).or_default() += seconds;
            }
            _ => {}
        }
    }

    /// Takes over what earlier sessions of the run have left.
    pub(crate) fn continue_from(&mut self, before: Self) {
        self.steps = before.steps;
        self.started = before.started;
        if !before.decisions.is_empty() {
            // What computes is decided anew in every session.
            let computes = |decision: &Decision| decision.setting == "backend";
            let now = self.decisions.iter().find(|d| computes(d)).cloned();
            let told = before.decisions.into_iter();
            self.decisions = told
                .filter_map(|d| if computes(&d) { now.clone() } else { Some(d) })
                .collect();
        }
        for (stage, seconds) in before.seconds {
            *self.seconds.entry(stage).or_default() += seconds;
        }
        for warning in before.warnings {
            // Manifests of earlier versions have no kinds.
            if !self.warnings.iter().any(|w| w.message == warning.message) {
                self.warnings.push(warning);
            }
        }
    }
}

/// Now, as RFC 3339 in UTC with whole seconds.
pub fn utc_now() -> String {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH);
    rfc3339(since_epoch.map_or(0, |elapsed| elapsed.as_secs()))
}

/// Seconds since 1970 as a date in the Gregorian calendar, by Howard Hinnant's
/// "civil from days": years begin in March, so that the leap day comes last.
fn rfc3339(seconds: u64) -> String {
    let days = seconds / 86_400 + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * march_month + 2) / 5 + 1;
    let month = (march_month + 2) % 12 + 1;
    let year = era * 400 + year_of_era + u64::from(month <= 2);
    let (hour, minute, second) = (seconds / 3_600 % 24, seconds / 60 % 60, seconds % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

/// SHA-256 of the files that a scene was read from, by their paths in its folder.
///
/// # Errors
/// If one of them cannot be read.
pub fn hash_inputs(
    scene: &Path,
    files: &[PathBuf],
) -> Result<BTreeMap<String, String>, SceneError> {
    files
        .par_iter()
        .map(|path| {
            let hash = sha256(path).map_err(|source| SceneError::Read {
                path: path.clone(),
                source,
            })?;
            let name = path.strip_prefix(scene).unwrap_or(path);
            Ok((name.to_string_lossy().replace('\\', "/"), hash))
        })
        .collect()
}

/// The SHA-256 of a file, in hexadecimal.
fn sha256(path: &Path) -> io::Result<String> {
    let mut file = File::open(path)?;
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer)? {
            0 => break,
            n => hasher.update(&buffer[..n]),
        }
    }
    let digest = hasher.finalize();
    Ok(digest.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn dates_follow_the_calendar() {
        assert_eq!(rfc3339(0), "1970-01-01T00:00:00Z");
        assert_eq!(rfc3339(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(rfc3339(1_709_251_199), "2024-02-29T23:59:59Z");
        assert_eq!(rfc3339(4_102_444_800), "2100-01-01T00:00:00Z");
    }

    #[test]
    fn inputs_are_hashed_by_their_paths() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("images")).unwrap();
        fs::write(dir.path().join("cameras.npz"), "abc").unwrap();
        fs::write(dir.path().join("images/b.png"), "").unwrap();
        let files = ["cameras.npz", "images/b.png"].map(|name| dir.path().join(name));
        let inputs = hash_inputs(dir.path(), &files).unwrap();
        let expected = [
            // The test vectors of FIPS 180-4.
            (
                "cameras.npz",
                "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad",
            ),
            (
                "images/b.png",
                "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855",
            ),
        ];
        let expected = expected.map(|(name, hash)| (name.to_owned(), hash.to_owned()));
        assert_eq!(inputs, BTreeMap::from(expected));
    }
}
