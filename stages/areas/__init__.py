"""From where the views of a map can be seen."""
