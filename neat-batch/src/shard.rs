//! The part of a batch that one task of a cluster does.

use std::fmt;
use std::str::FromStr;

/// Variables of a Slurm job array.
const SLURM: [&str; 4] = [
    "SLURM_ARRAY_TASK_ID",
    "SLURM_ARRAY_TASK_MIN",
    "SLURM_ARRAY_TASK_MAX",
    "SLURM_ARRAY_TASK_COUNT",
];
const SLURM_STEP: &str = "SLURM_ARRAY_TASK_STEP";
/// Variable of an Indexed Job of Kubernetes, which does not say how many there are.
const KUBERNETES: &str = "JOB_COMPLETION_INDEX";
/// Our variable for that.
const COUNT: &str = "NEAT_SHARDS";

/// The part `index` of `count` of a batch, written `index/count` and counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u32,
    count: u32,
}

/// Who says which shard it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShardSource {
    /// Nobody: it is all of the batch.
    Nobody,
    /// A person.
    Person,
    /// The variables of a Slurm job array.
    Slurm,
    /// The variables of an Indexed Job of Kubernetes.
    Kubernetes,
}

impl fmt::Display for ShardSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nobody => "all of the batch",
            Self::Person => "--shard",
            Self::Slurm => SLURM[0],
            Self::Kubernetes => KUBERNETES,
        })
    }
}

/// Why there is no such shard.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShardError {
    /// A text that is no shard.
    #[error("`{0}` is no shard: write I/N with I from 1 to N, such as 2/8")]
    Malformed(String),
    /// A variable without a usable number.
    #[error("{variable}={value} is no number that fits: unset the variable or give --shard I/N")]
    BadVariable {
        /// The variable.
        variable: &'static str,
        /// Its value.
        value: String,
    },
    /// Variables of which some are there and some are not.
    #[error("{present} is set but {missing} is not: give --shard I/N, or {remedy}")]
    MissingVariable {
        /// The one that is there.
        present: &'static str,
        /// The one that is not.
        missing: &'static str,
        /// What else would do.
        remedy: &'static str,
    },
    /// Numbers of which one must be wrong.
    #[error("{first} and {second} contradict each other: give --shard I/N")]
    Contradiction {
        /// One of them, with its source.
        first: String,
        /// The other.
        second: String,
    },
}

impl Shard {
    /// Part `index`, from 1, of `count`.
    ///
    /// # Errors
    /// If there is no such part.
    pub fn new(index: u32, count: u32) -> Result<Self, ShardError> {
        if index == 0 || index > count {
            return Err(ShardError::Malformed(format!("{index}/{count}")));
        }
        Ok(Self { index, count })
    }

    /// Which part it is, from 1.
    pub fn index(&self) -> u32 {
        self.index
    }

    /// How many parts there are.
    pub fn count(&self) -> u32 {
        self.count
    }

    /// Whether the job at this position of the batch, from 0, belongs to it.
    pub fn has(&self, position: usize) -> bool {
        position % self.count as usize == self.index as usize - 1
    }

    /// The shard that was given, or else the one that a cluster tells in its
    /// variables, or else all. `variable` is `|name| std::env::var(name).ok()`, but
    /// for tests. `count` is the number of shards, where only the index is told.
    ///
    /// - Slurm: SLURM_ARRAY_TASK_ID within SLURM_ARRAY_TASK_MIN, _MAX, _STEP and
    ///   _COUNT.
    /// - Kubernetes: JOB_COMPLETION_INDEX, and `count` or NEAT_SHARDS.
    ///
    /// # Errors
    /// If variables are no numbers, contradict each other, or are out of range.
    pub fn choose(
        given: Option<Self>,
        count: Option<u32>,
        variable: impl Fn(&str) -> Option<String>,
    ) -> Result<(Self, ShardSource), ShardError> {
        if let Some(shard) = given {
            return match count {
                Some(count) if count != shard.count => Err(ShardError::Contradiction {
                    first: format!("--shard {shard}"),
                    second: format!("--shards {count}"),
                }),
                _ => Ok((shard, ShardSource::Person)),
            };
        }
        let slurm = of_slurm(&variable)?;
        let kubernetes = number(KUBERNETES, &variable)?;
        let count = match count {
            Some(count) => Some(("--shards", count)),
            None => number(COUNT, &variable)?.map(|count| (COUNT, count)),
        };
        if let (Some(shard), Some((name, count))) = (slurm, count)
            && shard.count != count
        {
            return Err(ShardError::Contradiction {
                first: format!("{}={}", SLURM[3], shard.count),
                second: format!("{name}={count}"),
            });
        }
        let indexed = match (
            kubernetes,
            count.or(slurm.map(|shard| (SLURM[3], shard.count))),
        ) {
            (None, _) => None,
            (Some(_), None) => {
                return Err(ShardError::MissingVariable {
                    present: KUBERNETES,
                    missing: COUNT,
                    remedy: "set it to the completions of the Job, or give --shards N",
                });
            }
            (Some(index), Some((name, count))) => {
                let shard = Self::new(index.saturating_add(1), count);
                Some(shard.map_err(|_| ShardError::Contradiction {
                    first: format!("{KUBERNETES}={index} (from 0)"),
                    second: format!("{name}={count}"),
                })?)
            }
        };
        match (slurm, indexed) {
            (Some(slurm), Some(indexed)) if slurm != indexed => Err(ShardError::Contradiction {
                first: format!("shard {slurm} of {}", ShardSource::Slurm),
                second: format!("shard {indexed} of {}", ShardSource::Kubernetes),
            }),
            (Some(shard), _) => Ok((shard, ShardSource::Slurm)),
            (None, Some(shard)) => Ok((shard, ShardSource::Kubernetes)),
            // A number of shards that somebody asked for is never ignored.
            (None, None) if count.is_some_and(|(name, _)| name != COUNT) => {
                Err(ShardError::MissingVariable {
                    present: "--shards",
                    missing: KUBERNETES,
                    remedy: "run it in an Indexed Job",
                })
            }
            (None, None) => Ok((Self { index: 1, count: 1 }, ShardSource::Nobody)),
        }
    }
}

/// The shard of a task of a Slurm job array; `None` outside of one.
fn of_slurm(variable: &impl Fn(&str) -> Option<String>) -> Result<Option<Shard>, ShardError> {
    let Some(id) = number(SLURM[0], variable)? else {
        return Ok(None);
    };
    let needed = |name| {
        number(name, variable)?.ok_or(ShardError::MissingVariable {
            present: SLURM[0],
            missing: name,
            remedy: "run it in a job array (sbatch --array=1-N)",
        })
    };
    let (first, last, count) = (needed(SLURM[1])?, needed(SLURM[2])?, needed(SLURM[3])?);
    let step = number(SLURM_STEP, variable)?.unwrap_or(1).max(1);
    // `--array=1,2,5` leaves holes, which no arithmetic can fill.
    let even = last >= first && (last - first) % step == 0 && (last - first) / step + 1 == count;
    let inside = id >= first && id <= last && (id - first) % step == 0;
    if !even || !inside {
        return Err(ShardError::Contradiction {
            first: format!("{}={id}", SLURM[0]),
            second: format!("an array of {count} tasks from {first} to {last} by {step}"),
        });
    }
    Shard::new((id - first) / step + 1, count).map(Some)
}

/// The number in a variable; `None` if it is not set or empty.
fn number(
    name: &'static str,
    variable: &impl Fn(&str) -> Option<String>,
) -> Result<Option<u32>, ShardError> {
    let text = variable(name).filter(|text| !text.is_empty());
    text.map(|value| {
        let number = value.trim().parse();
        number.map_err(|_| ShardError::BadVariable {
            variable: name,
            value,
        })
    })
    .transpose()
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let malformed = || ShardError::Malformed(text.to_owned());
        let (index, count) = text.split_once('/').ok_or_else(malformed)?;
        let number = |text: &str| text.trim().parse::<u32>().map_err(|_| malformed());
        Self::new(number(index)?, number(count)?).map_err(|_| malformed())
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is chosen with nothing but these variables, such as `A=1 B=2`.
    fn chosen(variables: &str) -> Result<(String, ShardSource), ShardError> {
        with_count(None, variables)
    }

    fn with_count(
        count: Option<u32>,
        variables: &str,
    ) -> Result<(String, ShardSource), ShardError> {
        let value = |name: &str| {
            let pairs = variables.split(' ').filter_map(|pair| pair.split_once('='));
            let mut values = pairs
                .filter(|pair| pair.0 == name)
                .map(|pair| pair.1.to_owned());
            values.next()
        };
        Shard::choose(None, count, value).map(|(shard, source)| (shard.to_string(), source))
    }

    fn slurm(id: &str, first: u32, last: u32, step: u32, count: u32) -> String {
        format!(
            "SLURM_ARRAY_TASK_ID={id} SLURM_ARRAY_TASK_MIN={first} SLURM_ARRAY_TASK_MAX={last} SLURM_ARRAY_TASK_STEP={step} SLURM_ARRAY_TASK_COUNT={count}"
        )
    }

    #[test]
    fn shards_are_written_from_one() {
        let shard: Shard = "2/8".parse().unwrap();
        assert_eq!(
            (shard.index(), shard.count(), shard.to_string()),
            (2, 8, "2/8".into())
        );
        for bad in [
            "", "2", "0/2", "3/2", "1/0", "-1/2", "a/b", "1/2/3", "1.0/2",
        ] {
            let error = bad.parse::<Shard>().unwrap_err();
            assert_eq!(error, ShardError::Malformed(bad.into()));
        }
    }

    #[test]
    fn a_person_is_right_whatever_the_cluster_says() {
        let given = Some("1/3".parse().unwrap());
        let clash = |_: &str| Some("nonsense".to_owned());
        let (shard, source) = Shard::choose(given, None, clash).unwrap();
        assert_eq!(
            (shard.to_string(), source),
            ("1/3".into(), ShardSource::Person)
        );
        assert!(Shard::choose(given, Some(4), clash).is_err());
        let all = ("1/1".to_owned(), ShardSource::Nobody);
        assert_eq!(chosen(""), Ok(all.clone()));
        assert_eq!(
            chosen("SLURM_ARRAY_TASK_ID= JOB_COMPLETION_INDEX="),
            Ok(all)
        );
    }

    #[test]
    fn slurm_counts_from_wherever_its_array_begins() {
        for (variables, expected) in [
            (slurm("1", 1, 8, 1, 8), "1/8"),
            (slurm("8", 1, 8, 1, 8), "8/8"),
            (slurm("0", 0, 3, 1, 4), "1/4"),
            (slurm("20", 10, 30, 10, 3), "2/3"),
            (slurm("5", 5, 5, 1, 1), "1/1"),
        ] {
            let expected = (expected.to_owned(), ShardSource::Slurm);
            assert_eq!(chosen(&variables), Ok(expected), "{variables}");
        }
        for bad in [
            slurm("9", 1, 8, 1, 8),
            slurm("0", 1, 8, 1, 8),
            slurm("3", 1, 5, 2, 5),
            slurm("5", 1, 5, 1, 3),
            slurm("15", 10, 30, 10, 3),
            slurm("1", 8, 1, 1, 8),
        ] {
            let error = chosen(&bad).unwrap_err();
            assert!(
                matches!(error, ShardError::Contradiction { .. }),
                "{bad}: {error}"
            );
        }
        let error = chosen("SLURM_ARRAY_TASK_ID=1").unwrap_err().to_string();
        assert!(error.contains("SLURM_ARRAY_TASK_MIN"), "{error}");
        let error = chosen("SLURM_ARRAY_TASK_ID=one").unwrap_err().to_string();
        assert!(error.contains("SLURM_ARRAY_TASK_ID=one"), "{error}");
    }

    #[test]
    fn kubernetes_counts_from_zero_and_needs_a_count() {
        let third = Ok(("3/4".to_owned(), ShardSource::Kubernetes));
        assert_eq!(chosen("JOB_COMPLETION_INDEX=2 NEAT_SHARDS=4"), third);
        assert_eq!(
            with_count(Some(4), "JOB_COMPLETION_INDEX=2 NEAT_SHARDS=9"),
            third
        );
        let error = chosen("JOB_COMPLETION_INDEX=2").unwrap_err().to_string();
        assert!(
            error.contains("NEAT_SHARDS") && error.contains("--shards"),
            "{error}"
        );
        let error = chosen("JOB_COMPLETION_INDEX=4 NEAT_SHARDS=4").unwrap_err();
        assert!(
            error.to_string().contains("JOB_COMPLETION_INDEX=4"),
            "{error}"
        );
        assert!(with_count(Some(4), "").is_err());
        // In the environment of something that is no shard it has no meaning.
        assert_eq!(
            chosen("NEAT_SHARDS=4"),
            Ok(("1/1".into(), ShardSource::Nobody))
        );
    }

    #[test]
    fn two_clusters_must_agree() {
        let array = slurm("3", 1, 4, 1, 4);
        let both = |index: u32, count: u32| {
            chosen(&format!(
                "{array} JOB_COMPLETION_INDEX={index} NEAT_SHARDS={count}"
            ))
        };
        assert_eq!(both(2, 4).unwrap().0, "3/4");
        assert!(matches!(both(1, 4), Err(ShardError::Contradiction { .. })));
        assert!(matches!(both(2, 5), Err(ShardError::Contradiction { .. })));
    }
}
