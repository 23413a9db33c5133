"""What combines ways, and the tables of all ways. Faces call this and nothing below it."""
