"""Many jobs, on this machine or on a cluster: a job is a function by name, plain data, and a log file."""
