"""Whether groups differ in shape or in timing, and whether a subject differs from a norm."""
