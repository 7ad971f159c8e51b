"""The input contract: what a set of trials is, and how estimators take one."""
