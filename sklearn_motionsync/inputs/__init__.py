"""The input contract: what a set of performances is, and how estimators take one."""
