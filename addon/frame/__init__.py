"""From a Snapshot to a Frame: plan which techniques run, run them sample by sample, keep what has not changed."""
