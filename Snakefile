# A data set by Snakemake: a rule a shard, then the summary of all. Settings are given with --config:
#
#   snakemake --cores 8 --config data=/data/abo_500 out=/scratch/abo shards=4 options="--layout abo --split test"
#
# Shards that are done stay done. Where a scene fails, gprop ends with 6 and so does its rule; the summary is made all the same
# with --keep-going, and `options="... --retry-failed"` tries those scenes again.

import shlex

DATA = config["data"]
OUT = config["out"]
SHARDS = int(config.get("shards", 1))
GPROP = config.get("gprop", "gprop")
OPTIONS = shlex.split(config.get("options", ""))


def command(*more):
    return shlex.join([GPROP, "batch", DATA, "--out", OUT, *OPTIONS, *more])


rule summary:
    input:
        expand("{out}/batch/.done-{shard}-of-{shards}", out=OUT, shard=range(SHARDS), shards=SHARDS),
    output:
        f"{OUT}/batch/summary.json",
    params:
        command=command("--merge", "--quiet"),
    shell:
        "{params.command} > /dev/null"


rule shard:
    output:
        touch(f"{OUT}/batch/.done-{{shard}}-of-{SHARDS}"),
    params:
        command=lambda wildcards: command("--shard", f"{wildcards.shard}/{SHARDS}"),
    threads: max(1, workflow.cores // SHARDS) if workflow.cores else 1
    shell:
        "{params.command} --threads {threads} --quiet"
