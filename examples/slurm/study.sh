#!/bin/bash
# One shard of a study in each task of a Slurm array: sbatch --array=1-64 study.sh cor --seed 1
# The tasks share the folder; a task that is started again continues where it stopped. When all have ended:
#   calib merge shards/*/*.parquet --out cor.parquet
#   calib study cor --seed 1 --from cor.parquet --out results
#SBATCH --job-name=calib-study
#SBATCH --cpus-per-task=1
#SBATCH --requeue
set -euo pipefail
calib study "$@" --threads "${SLURM_CPUS_PER_TASK:-1}" \
  --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" --out shards
