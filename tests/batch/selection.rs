//! The scenes that a batch runs, and the shard of each.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use super::ball::Balls;
use super::{batch, lines, names, outcomes, stderr};
use crate::run::gprop;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/datasets").join(name)
}

/// The scenes that a dry run lists.
#[track_caller]
fn listed(command: &mut Command) -> Vec<String> {
    let output = command.args(["--dry-run", "--json"]).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let listed: Value = serde_json::from_slice(&output.stdout).unwrap();
    listed["scenes"].as_array().unwrap().iter().map(|scene| scene["name"].as_str().unwrap().to_owned()).collect()
}

fn of_fixture(name: &str, arguments: &[&str]) -> Command {
    let mut command = gprop();
    command.env_remove("SLURM_ARRAY_TASK_ID").env_remove("JOB_COMPLETION_INDEX");
    command.arg("batch").arg(fixture(name)).args(arguments);
    command
}

#[test]
fn a_split_is_the_data_sets_or_a_file() {
    assert_eq!(listed(&mut of_fixture("abo", &["--split", "test"])), ["B0000EXAM2_A1F83G8C2ARO7P"]);
    let home = tempfile::tempdir().unwrap();
    let list = home.path().join("mine.txt");
    fs::write(&list, "# what I want\n7/1b000c\n\n7/absent\n").unwrap();
    let mut mine = of_fixture("mvimgnet", &["--layout", "mvimgnet", "--split", list.to_str().unwrap()]);
    assert_eq!(listed(&mut mine), ["7/1b000c"]);
    let output = mine.output().unwrap();
    assert!(stderr(&output).contains("7/absent"), "{}", stderr(&output));
    for (name, split, words) in [("abo", "tset", "test, train"), ("mvimgnet", "test", "no splits")] {
        let output = of_fixture(name, &["--split", split, "--dry-run"]).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
    }
}

#[test]
fn scenes_are_filtered_and_cut() {
    let balls = Balls::new(5);
    let chosen = |arguments: &[&str]| listed(&mut batch(&balls, arguments));
    assert_eq!(chosen(&["--filter", "l-3"]), ["ball-3"]);
    assert_eq!(chosen(&["--filter", "ball-[12]"]), ["ball-1", "ball-2"]);
    assert_eq!(chosen(&["--start", "1", "--end", "3"]), ["ball-1", "ball-2"]);
    assert_eq!(chosen(&["--start", "4", "--end", "30"]), ["ball-4"]);
    assert_eq!(chosen(&["--filter", "ball-[!0]", "--start", "3"]), ["ball-4"]);
    let nothing = batch(&balls, &["--start", "5", "--dry-run"]).output().unwrap();
    assert_eq!(nothing.status.code(), Some(2));
    assert!(stderr(&nothing).contains("none of the 5 scenes"), "{}", stderr(&nothing));
}

#[test]
fn a_narrower_choice_forgets_no_other_scene() {
    let balls = Balls::new(2);
    assert_eq!(outcomes(&mut batch(&balls, &[]), 0).len(), 2);
    assert!(outcomes(&mut batch(&balls, &["--filter", "ball-1"]), 0).is_empty());
    let home = balls.folder().join("gprop/batch");
    assert_eq!(names(&lines(&home.join("shard-0-of-1.jsonl"))), ["ball-0", "ball-1"]);
    let summary: Value = serde_json::from_slice(&fs::read(home.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["scenes"], 1, "a summary is of the chosen scenes");
    assert!(outcomes(&mut batch(&balls, &[]), 0).is_empty(), "both are still done");
}

/// The folder of results was moved, or is called by another path.
#[test]
fn results_are_found_where_they_are_now() {
    let balls = Balls::new(2);
    fs::write(balls.scene(1).join("point_cloud.ply"), "ply\nno splat").unwrap();
    let (first, second) = (balls.folder().with_file_name("first"), balls.folder().with_file_name("second"));
    assert_eq!(outcomes(&mut batch(&balls, &["--out", first.to_str().unwrap()]), 6).len(), 2);
    fs::rename(&first, &second).unwrap();
    let moved = outcomes(&mut batch(&balls, &["--out", second.to_str().unwrap()]), 6);
    assert!(moved.is_empty(), "nothing changed, so neither the done nor the failed scene is run: {moved:?}");
    let mut relative = batch(&balls, &["--out", "second"]);
    let relative = outcomes(relative.current_dir(second.parent().unwrap()), 6);
    assert!(relative.is_empty(), "{relative:?}");

    let third = balls.folder().with_file_name("third");
    fs::rename(&second, &third).unwrap();
    let merged = batch(&balls, &["--out", third.to_str().unwrap(), "--merge", "--json"]).output().unwrap();
    assert_eq!(merged.status.code(), Some(6), "{}", stderr(&merged));
    let merged: Value = serde_json::from_slice(&merged.stdout).unwrap();
    assert_eq!(merged["outcomes"][0]["work"].as_str(), third.join("ball-0").to_str());
    let page = fs::read_to_string(third.join("batch/index.html")).unwrap();
    assert_eq!(page.matches("data:image/jpeg").count(), 1, "the picture of the scene that is done");
    // With this folder, the batch's own files are where they are without --out, but the work folders are not.
    assert_eq!(outcomes(&mut batch(&balls, &[]), 6).len(), 2);
    let inside = balls.folder().join("gprop");
    assert_eq!(outcomes(&mut batch(&balls, &["--out", inside.to_str().unwrap()]), 6).len(), 2);
}

#[test]
fn a_scene_does_not_share_its_work_folder_with_the_batch() {
    let balls = Balls::new(2);
    fs::rename(balls.scene(1), balls.folder().join("batch")).unwrap();
    assert_eq!(listed(&mut batch(&balls, &[])), ["ball-0", "batch"]);
    let out = balls.folder().with_file_name("out");
    let with_out = ["--out", out.to_str().unwrap(), "--dry-run"];
    let refused = batch(&balls, &with_out).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    assert!(stderr(&refused).contains("rename the scene's folder"), "{}", stderr(&refused));
    assert_eq!(listed(&mut batch(&balls, &["--out", out.to_str().unwrap(), "--filter", "ball"])), ["ball-0"]);
    // Many file systems take this for the same folder.
    fs::rename(balls.folder().join("batch"), balls.folder().join("Batch")).unwrap();
    let refused = batch(&balls, &with_out).output().unwrap();
    assert_eq!(refused.status.code(), Some(2), "{}", stderr(&refused));
    assert!(stderr(&refused).contains("no scene may be called `Batch`"), "{}", stderr(&refused));
}

#[test]
fn of_a_scene_in_two_shards_the_outcome_for_the_options_is_merged() {
    let balls = Balls::new(2);
    outcomes(&mut batch(&balls, &["--shard", "0/2"]), 0);
    let second = outcomes(&mut batch(&balls, &["--shard", "1/2"]), 0);
    let name = names(&second)[0];
    // Alone, it is in the first shard.
    let alone = ["--filter", name, "--shard", "0/2", "--views", "2"];
    assert_eq!(names(&outcomes(&mut batch(&balls, &alone), 0)), [name]);
    let views = |more: &[&str]| {
        let output = batch(&balls, more).args(["--merge", "--json"]).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        let merged: Value = serde_json::from_slice(&output.stdout).unwrap();
        let outcome = merged["outcomes"].as_array().unwrap().iter().find(|outcome| outcome["scene"] == name);
        outcome.unwrap()["views"].as_u64()
    };
    assert_eq!((views(&[]), views(&["--views", "2"])), (Some(3), Some(2)));
}

#[test]
fn shards_share_the_scenes_and_are_merged() {
    let balls = Balls::new(5);
    let slurm = |task: &str| {
        let mut command = batch(&balls, &[]);
        command.envs([("SLURM_ARRAY_TASK_ID", task), ("SLURM_ARRAY_TASK_COUNT", "2"), ("SLURM_ARRAY_TASK_MIN", "1")]);
        command
    };
    let first = outcomes(&mut slurm("1"), 0);
    let merge = |code| {
        let output = batch(&balls, &["--merge", "--json"]).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{}", stderr(&output));
        (serde_json::from_slice::<Value>(&output.stdout).unwrap(), stderr(&output))
    };
    let (half, message) = merge(6);
    assert_eq!(half["done"].as_u64(), Some(first.len() as u64));
    assert!(message.contains("its shard has not finished"), "{message}");

    let second = outcomes(&mut batch(&balls, &["--shard", "1/2"]), 0);
    let all: BTreeSet<&str> = names(&first).into_iter().chain(names(&second)).collect();
    assert_eq!((all.len(), first.len() + second.len()), (5, 5), "disjoint and complete");
    assert!((2..=3).contains(&first.len()), "balls are of nearly one size: {first:?}");
    let home = balls.folder().join("gprop/batch");
    assert_eq!(lines(&home.join("shard-0-of-2.jsonl")).len(), first.len());
    let (whole, _) = merge(0);
    assert_eq!((whole["done"].as_u64(), whole["outcomes"].as_array().map(Vec::len)), (Some(5), Some(5)));
    assert!(home.join("summary.json").is_file());
    assert_eq!(listed(&mut slurm("1")).len(), first.len(), "what was dealt does not change by running");

    // Scenes that two shards have done count as done for the whole batch, but shards of two divisions have no common
    // summary.
    assert!(outcomes(&mut batch(&balls, &[]), 0).is_empty());
    let mixed = batch(&balls, &["--merge"]).output().unwrap();
    assert_eq!(mixed.status.code(), Some(2));
    assert!(stderr(&mixed).contains("shard-*-of-2.jsonl"), "{}", stderr(&mixed));
}

#[test]
fn a_job_without_its_count_is_refused() {
    let balls = Balls::new(1);
    let output = batch(&balls, &["--dry-run"]).env("JOB_COMPLETION_INDEX", "0").output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("JOB_COMPLETIONS"), "{}", stderr(&output));
}

#[test]
fn the_pods_of_the_kubernetes_job_share_the_scenes() {
    let text =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/batch/k8s-indexed-job.yaml")).unwrap();
    let job: Value = serde_yaml_ng::from_str(&text).unwrap();
    let (spec, pod) = (&job["spec"], &job["spec"]["template"]["spec"]);
    let container = &pod["containers"][0];
    assert_eq!((&job["kind"], &spec["completionMode"]), (&"Job".into(), &"Indexed".into()));
    let completions = spec["completions"].as_u64().unwrap();
    assert!(spec["parallelism"].as_u64().is_some_and(|pods| (1..=completions).contains(&pods)));
    let set = |name: &str| container["env"].as_array().unwrap().iter().find(|set| set["name"] == name).cloned();
    let count = set("JOB_COMPLETIONS").unwrap()["value"].as_str().unwrap().to_owned();
    assert_eq!(count.parse(), Ok(completions), "what gprop is told is what there are");
    // Kubernetes sets the index itself, but only in this completion mode.
    assert!(set("JOB_COMPLETION_INDEX").is_none());
    let mounted: Vec<&str> =
        container["volumeMounts"].as_array().unwrap().iter().map(|at| at["mountPath"].as_str().unwrap()).collect();

    // The pod's command, on balls instead of the volume claim.
    let (balls, results) = (Balls::new(7), tempfile::tempdir().unwrap());
    let words: Vec<&str> = container["command"].as_array().unwrap().iter().map(|word| word.as_str().unwrap()).collect();
    assert!(
        words[0] == "gprop"
            && words
                .iter()
                .filter(|word| word.starts_with('/'))
                .all(|word| mounted.iter().any(|at| word.starts_with(at)))
    );
    let place = |word: &&str| match *word {
        word if word.starts_with("/results") => results.path().to_owned(),
        word if word.starts_with('/') => balls.folder(),
        "abo" => "scenes".into(),
        word => word.into(),
    };
    let of_pod = |index: u64| {
        let mut command = gprop();
        command.env_remove("SLURM_ARRAY_TASK_ID").args(words[1..].iter().map(place));
        listed(command.envs([("JOB_COMPLETION_INDEX", index.to_string()), ("JOB_COMPLETIONS", count.clone())]))
    };
    let mut dealt: Vec<String> = (0..completions).flat_map(of_pod).collect();
    dealt.sort();
    assert_eq!(dealt, (0..7).map(|ball| format!("ball-{ball}")).collect::<Vec<_>>(), "each scene falls to one pod");
}
