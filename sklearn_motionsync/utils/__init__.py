"""What all estimators share beside movement: jobs, pipelines, parameters, groups."""
