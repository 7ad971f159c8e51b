"""What all estimators share beside movement: jobs, atomic fits, pipelines."""
