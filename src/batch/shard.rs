//! Divides a data set among machines.

use std::fmt;
use std::str::FromStr;

use super::BatchError;

/// Most shards of a data set: cluster schedulers start no arrays of more jobs, and no data set has more scenes.
const MOST_SHARDS: usize = 1_000_000;

/// Shard `index` of `of`, counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shard {
    pub index: usize,
    pub of: usize,
}

impl Shard {
    /// The whole data set.
    pub const WHOLE: Self = Self { index: 0, of: 1 };

    /// The shard of a cluster job, from the variables that Slurm and Kubernetes set; the whole data set outside such a
    /// job. A Slurm array may start at any index and use any step.
    pub fn from_environment(get: &dyn Fn(&str) -> Option<String>) -> Result<Self, BatchError> {
        let (index, count) = match (get("SLURM_ARRAY_TASK_ID"), get("JOB_COMPLETION_INDEX")) {
            (Some(_), _) => ("SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT"),
            (None, Some(_)) => ("JOB_COMPLETION_INDEX", "JOB_COMPLETIONS"),
            (None, None) => return Ok(Self::WHOLE),
        };
        let optional = |name: &str| get(name).and_then(|value| value.parse::<usize>().ok());
        let needed = |name: &str| {
            optional(name).ok_or_else(|| BatchError::Shard {
                given: format!("{index} is set"),
                problem: format!("{name} must also be set to a number; or give --shard I/N"),
            })
        };
        let (id, of) = (needed(index)?, needed(count)?);
        let (first, step) = match index {
            "SLURM_ARRAY_TASK_ID" => (optional("SLURM_ARRAY_TASK_MIN"), optional("SLURM_ARRAY_TASK_STEP")),
            _ => (None, None),
        };
        let (first, step) = (first.unwrap_or(0), step.unwrap_or(1).max(1));
        let shard = id.checked_sub(first).and_then(|distance| Self::new(distance / step, of));
        shard.ok_or_else(|| BatchError::Shard {
            given: format!("{index}={id}"),
            problem: format!("is not one of the {of} tasks ({count}) that start at {first}; give --shard I/N"),
        })
    }

    fn new(index: usize, of: usize) -> Option<Self> {
        (index < of && of <= MOST_SHARDS).then_some(Self { index, of })
    }

    /// Name of the shard's file of outcomes.
    pub(super) fn file_name(self) -> String {
        format!("shard-{}-of-{}.jsonl", self.index, self.of)
    }

    /// The shard to which a file of outcomes belongs.
    pub(super) fn of_file_name(name: &str) -> Option<Self> {
        let (index, of) = name.strip_prefix("shard-")?.strip_suffix(".jsonl")?.split_once("-of-")?;
        Self::new(index.parse().ok()?, of.parse().ok()?)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers = text.split_once('/').and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        let shard = numbers.and_then(|(index, of)| Self::new(index, of));
        shard.ok_or_else(|| format!("give I/N with I from 0 to N - 1 and N up to {MOST_SHARDS}"))
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

/// Distributes items of the given sizes to `count` shards, the largest first and each to the shard with the smallest
/// total so far, so that the shards' totals are about equal. Returns the shard of each item. Items of equal size are
/// taken in their order.
pub(super) fn deal(sizes: &[u64], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by_key(|&index| (std::cmp::Reverse(sizes[index]), index));
    // If there are more shards than items, the last shards stay empty.
    let count = count.min(sizes.len());
    let mut loads = vec![(0_u64, 0_usize); count];
    let mut shards = vec![0; sizes.len()];
    for index in order {
        let least = (0..count).min_by_key(|&shard| loads[shard]).expect("there is at least one shard");
        loads[least].0 += sizes[index];
        loads[least].1 += 1;
        shards[index] = least;
    }
    shards
}

#[cfg(test)]
mod tests {
    use super::*;

    fn within(variables: &[(&str, &str)]) -> Result<Shard, BatchError> {
        let get = |name: &str| variables.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned());
        Shard::from_environment(&get)
    }

    #[test]
    fn a_shard_is_typed_from_0() {
        assert_eq!("3/10".parse(), Ok(Shard { index: 3, of: 10 }));
        for wrong in ["10/10", "1", "a/b", "-1/2", "0/0", "", "0/4294967296", "0/1000001"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn clusters_say_which_shard_it_is() {
        assert_eq!(within(&[]).unwrap(), Shard::WHOLE);
        let slurm = [("SLURM_ARRAY_TASK_ID", "7"), ("SLURM_ARRAY_TASK_COUNT", "4"), ("SLURM_ARRAY_TASK_MIN", "1")];
        let stepped = [slurm.as_slice(), &[("SLURM_ARRAY_TASK_STEP", "2")]].concat();
        assert_eq!(within(&stepped).unwrap(), Shard { index: 3, of: 4 });
        assert!(within(&slurm).is_err(), "1, 2, 3, 4 has no 7");
        let kubernetes = [("JOB_COMPLETION_INDEX", "2"), ("JOB_COMPLETIONS", "5")];
        assert_eq!(within(&kubernetes).unwrap(), Shard { index: 2, of: 5 });
        let error = within(&kubernetes[..1]).unwrap_err().to_string();
        assert!(error.contains("JOB_COMPLETIONS") && error.contains("--shard"), "{error}");
    }

    #[test]
    fn files_are_named_after_their_shard() {
        let shard = Shard { index: 3, of: 12 };
        assert_eq!(Shard::of_file_name(&shard.file_name()), Some(shard));
        for other in ["shard-3-of-3.jsonl", "shard-1.jsonl", "summary.json", "shard-a-of-b.jsonl"] {
            assert_eq!(Shard::of_file_name(other), None, "{other}");
        }
    }

    #[test]
    fn shards_are_balanced_by_size_and_no_scene_is_lost() {
        let sizes: Vec<u64> = (0..101).map(|n| 1 + (n * 7919) % 997).collect();
        let shards = deal(&sizes, 4);
        let load = |shard| -> u64 { (0..sizes.len()).filter(|&n| shards[n] == shard).map(|n| sizes[n]).sum() };
        let loads: Vec<u64> = (0..4).map(load).collect();
        assert_eq!(loads.iter().sum::<u64>(), sizes.iter().sum::<u64>());
        let (least, most) = (loads.iter().min().unwrap(), loads.iter().max().unwrap());
        // Longest-first distribution: two loads differ by no more than the last item of the larger one, a small one.
        assert!(most - least <= *sizes.iter().max().unwrap() / 10, "{loads:?}");
        assert_eq!(deal(&sizes, 4), shards);
        assert_eq!(deal(&[3, 5], 1_000_000_000_000), [1, 0], "no memory for shards that stay empty");
        assert_eq!(deal(&[0, 0, 0, 0], 2), [0, 1, 0, 1], "scenes without files are dealt evenly too");
    }
}
