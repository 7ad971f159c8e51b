"""Tracking: the body behind observations with gaps and noise, by the model of an action."""
