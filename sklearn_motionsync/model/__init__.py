"""What an action looks like, how people vary in it, and what is not the action (section 4)."""
