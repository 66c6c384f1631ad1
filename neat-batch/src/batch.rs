//! A list of jobs without two of one name.

use crate::error::BatchError;
use crate::job::{Job, JobNames};
use crate::manifest_file;
use crate::scene_folders;
use crate::shard::Shard;
use std::path::Path;

/// A list of jobs without two of one name, in the order of their source.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Batch {
    jobs: Vec<Job>,
}

impl Batch {
    /// A batch of these jobs.
    ///
    /// # Errors
    /// If a name occurs twice or cannot be a folder, or a job has an argument that
    /// the batch gives itself.
    pub fn new(jobs: Vec<Job>) -> Result<Self, BatchError> {
        let mut names = JobNames::default();
        jobs.iter().try_for_each(|job| names.add(job))?;
        Ok(Self { jobs })
    }

    /// The jobs of a manifest:
    ///
    /// ```toml
    /// [defaults]                     # for every job; all keys are optional
    /// preset = "fast"
    /// seed = 0
    /// set = ["data.max_image_size=1600"]
    /// args = ["--train", "--time-budget", "10m"]
    ///
    /// [[job]]
    /// scene = "scenes/house"         # relative to the folder of the manifest
    ///
    /// [[job]]
    /// scene = "scenes/house"
    /// name = "house-seed-1"          # the folder's name without it
    /// seed = 1                       # instead of the default
    /// set = ["train.steps=2000"]     # after the defaults; `args` likewise
    /// truth = "truth/house.json"     # SCENE/gt_wireframe.json without it
    /// ```
    ///
    /// `config = "FILE"` stands for a preset. Whether a scene exists is found out
    /// by its job, so that one missing folder does not keep the others from running.
    ///
    /// # Errors
    /// If the file cannot be read, or breaks the rules; the message has the line.
    pub fn from_manifest(path: &Path) -> Result<Self, BatchError> {
        manifest_file::read(path).map(|jobs| Self { jobs })
    }

    /// A job for every folder that is named or that a pattern such as `scenes/*`
    /// matches, sorted by path and named like the folder.
    ///
    /// # Errors
    /// If a pattern cannot be understood, there is no such folder, or two have one
    /// name.
    pub fn from_folders(patterns: &[String]) -> Result<Self, BatchError> {
        Self::new(scene_folders::find(patterns)?)
    }

    /// The same jobs with further arguments for each.
    ///
    /// # Errors
    /// If the batch gives one of them itself.
    pub fn with_arguments(mut self, arguments: &[String]) -> Result<Self, BatchError> {
        for job in &mut self.jobs {
            job.arguments.extend_from_slice(arguments);
        }
        Self::new(self.jobs)
    }

    /// The part of the jobs that `shard` does: every `shard.count()`-th one, so
    /// that neighbours of one size spread.
    pub fn shard(&self, shard: Shard) -> Self {
        let jobs = self.jobs.iter().enumerate();
        Self {
            jobs: jobs
                .filter(|(position, _)| shard.has(*position))
                .map(|(_, job)| job.clone())
                .collect(),
        }
    }

    /// The jobs.
    pub fn jobs(&self) -> &[Job] {
        &self.jobs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(name: &str) -> Job {
        Job {
            name: name.into(),
            scene: Path::new("/scenes").join(name),
            arguments: Vec::new(),
            truth: None,
        }
    }

    #[test]
    fn no_two_jobs_share_a_folder_even_where_case_is_ignored() {
        let error = Batch::new(vec![job("a"), job("House"), job("house")]).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("/scenes/House") && text.contains("/scenes/house"),
            "{text}"
        );
    }

    #[test]
    fn shards_share_the_jobs_without_overlap() {
        let names = ["a", "b", "c", "d", "e"];
        let batch = Batch::new(names.map(job).to_vec()).unwrap();
        let part = |text: &str| {
            let shard = batch.shard(text.parse().unwrap());
            shard
                .jobs()
                .iter()
                .map(|job| job.name.clone())
                .collect::<Vec<_>>()
        };
        assert_eq!(part("1/2"), ["a", "c", "e"]);
        assert_eq!(part("2/2"), ["b", "d"]);
        assert_eq!(part("1/1"), names);
        assert!(part("7/7").is_empty());
    }

    #[test]
    fn arguments_for_all_come_last_and_are_checked() {
        let batch = Batch::new(vec![job("a")]).unwrap();
        let more = |text: &str| batch.clone().with_arguments(&[text.to_owned()]);
        assert_eq!(
            more("--no-doctor").unwrap().jobs()[0].arguments,
            ["--no-doctor"]
        );
        assert!(more("--out=x").is_err());
    }
}
